//! Every parser of what comes from outside, and files with something wrong for them: made from sound ones
//! with a seed, by damage that knows nothing of the format and by damage that knows its words.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use fmi_import::Fmu;
use fmi_ssp as ssp;
use fmi_system::{Between, InputTable, SystemFile};
use identification::data::Recording;
use identification::diagnosis::case::Nominal;
use identification::diagnosis::rigs::{Description, ExtendedRig};
use identification::identify::{model_file::ModelFile, specimen_file};
use laboratory::error::clipped;
use laboratory::run::{manifest::Manifest, signals::read_csv, summary::Summary};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use zip::{ZipWriter, write::SimpleFileOptions};

/// Reads a file; an error is what the user would be told.
pub type Read = fn(&Path) -> Result<(), String>;

/// A parser.
#[derive(Clone, Copy)]
pub struct Parser {
    /// Its name, and that of its folder in the corpus.
    pub name: &'static str,
    /// How the files that it reads end.
    pub extension: &'static str,
    /// Whether what it reads are entries of an archive.
    pub is_archive: bool,
    /// Reads a file.
    pub read: Read,
}

fn told<T, E: std::fmt::Display>(outcome: Result<T, E>) -> Result<(), String> {
    outcome.map(|_| ()).map_err(|error| error.to_string())
}

/// All of them.
pub const PARSERS: [Parser; 16] = [
    Parser {
        name: "fmu",
        extension: "fmu",
        is_archive: true,
        read: |path| told(Fmu::open(path)),
    },
    Parser {
        name: "validate",
        extension: "fmu",
        is_archive: true,
        read: |path| told(fmi_check::validate(path, pack::program::guest().as_deref())),
    },
    Parser {
        name: "ssp",
        extension: "ssp",
        is_archive: true,
        read: |path| told(ssp::read(&path.display().to_string())),
    },
    Parser {
        name: "ssd",
        extension: "ssd",
        is_archive: false,
        read: |path| told(ssp::read(&path.display().to_string())),
    },
    Parser {
        name: "system",
        extension: "toml",
        is_archive: false,
        read: |path| told(SystemFile::read(path)),
    },
    Parser {
        name: "at2",
        extension: "AT2",
        is_archive: false,
        read: |path| told(motion::load(path, &motion::Options::default())),
    },
    Parser {
        name: "record",
        extension: "csv",
        is_archive: false,
        read: |path| told(motion::load(path, &motion::Options::default())),
    },
    Parser {
        name: "reference",
        extension: "csv",
        is_archive: false,
        read: |path| told(motion::load_reference(path, &motion::Options::default())),
    },
    Parser {
        name: "recording",
        extension: "csv",
        is_archive: false,
        read: |path| told(Recording::read(path, "recording")),
    },
    Parser {
        name: "table",
        extension: "csv",
        is_archive: false,
        read: |path| told(InputTable::read("table", path, Between::default())),
    },
    Parser {
        name: "results",
        extension: "csv",
        is_archive: false,
        read: |path| told(read_csv(path)),
    },
    Parser {
        name: "manifest",
        extension: "json",
        is_archive: false,
        read: |path| told(Manifest::read(path)).and(told(Summary::read(path))),
    },
    Parser {
        name: "model",
        extension: "toml",
        is_archive: false,
        read: |path| told(ModelFile::read(path)),
    },
    Parser {
        name: "specimen",
        extension: "toml",
        is_archive: false,
        read: |path| told(specimen_file::read(path)),
    },
    Parser {
        name: "nominal",
        extension: "toml",
        is_archive: false,
        read: |path| {
            let bytes = fs::read(path).map_err(|error| error.to_string())?;
            told(Nominal::parse(&String::from_utf8_lossy(&bytes)))
        },
    },
    Parser {
        name: "rig",
        extension: "toml",
        is_archive: false,
        read: |path| {
            let rig = told(Description::read(path));
            let extended = told(ExtendedRig::read(path));
            rig.or(extended)
        },
    },
];

/// A file for a parser: bytes, or the entries of an archive.
#[derive(Debug, Clone)]
pub enum Sound {
    /// As it is.
    File(Vec<u8>),
    /// Entries by name.
    Archive(BTreeMap<String, Vec<u8>>),
}

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The corpus of the project: `sound` files to begin with, and what was `found`.
pub fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus")
}

/// The files of a folder whose names end so, in alphabetical order.
fn files(folder: &Path, extension: &str) -> Vec<Vec<u8>> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ends| ends == extension));
    paths.sort();
    paths
        .into_iter()
        .filter_map(|path| fs::read(path).ok())
        .collect()
}

fn archive(entries: &[(&str, PathBuf)]) -> Sound {
    let read = |(name, path): &(&str, PathBuf)| {
        let content = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        (name.to_string(), content)
    };
    Sound::Archive(entries.iter().map(read).collect())
}

/// Reads the file with a parser: none where all is well, else what is wrong with how it was read.
///
/// A message, as the program prints it, names the file, or the parser was given none, and is no book.
pub fn fault(parser: &Parser, path: &Path) -> Option<String> {
    let begin = Instant::now();
    let outcome = catch_unwind(AssertUnwindSafe(|| (parser.read)(path)));
    let took = begin.elapsed();
    if took > LIMIT {
        return Some(format!("takes {took:?}"));
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    match outcome {
        Err(_) => Some("panics".to_string()),
        Ok(Err(message)) if !message.contains(&*name) && parser.name != "nominal" => {
            Some(format!("no file in `{message}`"))
        }
        Ok(Err(message)) if clipped(&message).len() > 20_000 => {
            Some(format!("a message of {} bytes", clipped(&message).len()))
        }
        Ok(_) => None,
    }
}

/// Nothing that small may take longer.
pub const LIMIT: Duration = Duration::from_secs(20);

/// Sound files of a parser, to be damaged.
pub fn sound(parser: &Parser) -> Vec<Sound> {
    let (project, sound) = (project(), corpus().join("sound"));
    let systems = project.join("orchestrator/laboratory/systems");
    let hybrid = project.join("hybrid/systems");
    let texts = |texts: Vec<Vec<u8>>| texts.into_iter().map(Sound::File).collect();
    match parser.name {
        "fmu" | "validate" => {
            let description = |version: &str, name: &str| {
                let path = project.join(format!("modelDescription/{version}/{name}.xml"));
                archive(&[("modelDescription.xml", path)])
            };
            let more = sound.join("fmu");
            vec![
                description("fmi2", "Interlock"),
                description("fmi3", "Specimen"),
                archive(&[
                    ("modelDescription.xml", more.join("arrays.xml")),
                    (
                        "terminalsAndIcons/terminalsAndIcons.xml",
                        more.join("terminalsAndIcons.xml"),
                    ),
                    (
                        "sources/buildDescription.xml",
                        more.join("buildDescription.xml"),
                    ),
                ]),
            ]
        }
        "ssp" => {
            let folder = sound.join("ssp");
            let names = ["SystemStructure.ssd", "resources/a.ssv", "resources/a.ssm"];
            vec![archive(&names.map(|name| (name, folder.join(name))))]
        }
        "ssd" => texts(files(&sound.join("ssp"), "ssd")),
        "system" => texts(
            [&systems, &systems.join("plant"), &hybrid]
                .into_iter()
                .flat_map(|folder| files(folder, "toml"))
                .collect(),
        ),
        "model" | "specimen" => {
            let model = systems.join("plant/servohydraulic-model.toml");
            let mut all = vec![fs::read(model).unwrap_or_default()];
            all.push(SPECIMEN.as_bytes().to_vec());
            texts(all)
        }
        "nominal" => {
            let template = identification::diagnosis::case::template();
            texts(vec![template.into_bytes()])
        }
        "rig" => texts(files(&project.join("identification/rigs"), "toml")),
        "at2" => texts(vec![accelerogram().into_bytes()]),
        "manifest" => texts(files(&sound.join("json"), "json")),
        _ => texts(tables()),
    }
}

const SPECIMEN: &str =
    "units = \"inch-pound\"\n[specimen]\nmass = 12.5\ndamping = 0.1\nstiffness = 2e3\n";

fn accelerogram() -> String {
    let mut text = String::from(
        "RECORD\nEVENT, STATION, 90\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS=  500, DT=   .0100 SEC\n",
    );
    for k in 0..500 {
        let value = (0.1 * f64::from(k)).sin();
        text += &format!("{value:15.7E}{}", if k % 5 == 4 { "\n" } else { "" });
    }
    text
}

/// Tables as spreadsheets and recorders write them.
fn tables() -> Vec<Vec<u8>> {
    let mut plain = String::from("t_s,a_g\n");
    let mut comma = String::from("Recorder 7;;\n\nTime (ms);Force [kN];Weg [mm]\n");
    let mut all = String::from(
        "# made by hand\ntime [s],reference_displacement [in],command_voltage [V],displacement [in],\
         acceleration [g],force [lbf]\n",
    );
    for k in 0..400 {
        let (t, value) = (0.01 * f64::from(k), (0.3 * f64::from(k)).sin());
        plain += &format!("{t},{value}\n");
        comma += &format!("{:.1};{value:.4};{value:.4}\n", 1e3 * t).replace('.', ",");
        all += &format!("{t:.3},{value},{value:e},{value},{value},{value}\n");
    }
    [plain, comma, all].map(String::into_bytes).to_vec()
}

/// A damaged file for a parser, made from one of its sound ones.
pub fn hostile(random: &mut ChaCha8Rng, sound: &[Sound]) -> Vec<u8> {
    match &sound[random.random_range(0..sound.len())] {
        Sound::File(bytes) => damaged(random, bytes),
        Sound::Archive(entries) => {
            if random.random_range(0..5) == 0 {
                return damaged(random, &zipped(entries));
            }
            let mut entries = entries.clone();
            let place = random.random_range(0..entries.len());
            if let Some(content) = entries.values_mut().nth(place) {
                *content = damaged(random, content);
            }
            zipped(&entries)
        }
    }
}

/// An archive of these entries.
pub fn zipped(entries: &BTreeMap<String, Vec<u8>>) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in entries {
        archive
            .start_file(name, SimpleFileOptions::default())
            .and_then(|()| Ok(archive.write_all(content)?))
            .unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    let done = archive.finish();
    done.unwrap_or_else(|error| panic!("{error}")).into_inner()
}

/// What is put where it does not belong.
const WORDS: [&[u8]; 36] = [
    b"NaN",
    b"inf",
    b"-inf",
    b"1e999",
    b"-1e308",
    b"-1",
    b"0",
    b"-0.0",
    b"1e-320",
    b"99999999999999999999",
    b"-9223372036854775808",
    b"4294967296",
    b"18446744073709551616",
    b"0x7fffffff",
    b"\0",
    b"<a>",
    b"</",
    b"/>",
    b"<!--",
    b"&#0;",
    b"&amp;",
    b"]]>",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\"",
    b"'",
    b",,,,",
    b";",
    b"\t",
    b"\n\n",
    b"\r",
    b"[[",
    b"]",
    b" = ",
    b"{}",
    "\u{2212}\u{1f4a9}\u{0301}".as_bytes(),
];

/// The same bytes with something wrong.
pub fn damaged(random: &mut ChaCha8Rng, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.random_range(1..4) {
        damage(random, &mut bytes);
    }
    bytes
}

fn damage(random: &mut ChaCha8Rng, bytes: &mut Vec<u8>) {
    let length = bytes.len().max(1);
    let at = random.random_range(0..length).min(bytes.len());
    match random.random_range(0..9) {
        0 => bytes.truncate(at),
        1 => {
            for _ in 0..random.random_range(1..20) {
                let at = random.random_range(0..length);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = random.random();
                }
            }
        }
        2 => {
            let end = (at + random.random_range(1..200)).min(bytes.len());
            bytes.drain(at..end);
        }
        3 => {
            // A piece once more, perhaps often.
            let end = (at + random.random_range(1..200)).min(bytes.len());
            let again = bytes[at..end].repeat(match random.random_range(0..8) {
                0 => random.random_range(2..2000),
                _ => 1,
            });
            if again.len() < 1 << 18 {
                bytes.splice(at..at, again);
            }
        }
        4 => {
            let word = WORDS[random.random_range(0..WORDS.len())];
            bytes.splice(at..at, word.iter().copied());
        }
        5 => replace_number(random, bytes, at),
        6 => replace_quoted(random, bytes, at),
        7 => swap_lines(random, bytes),
        _ => {
            // One bit.
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << random.random_range(0..8);
            }
        }
    }
}

/// Puts a word in place of the number that follows `at`.
fn replace_number(random: &mut ChaCha8Rng, bytes: &mut Vec<u8>, at: usize) {
    let is_part = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit) else {
        return;
    };
    let start = at + start;
    let length = bytes[start..].iter().position(|byte| !is_part(byte));
    let end = length.map_or(bytes.len(), |length| start + length);
    let word = WORDS[random.random_range(0..WORDS.len())];
    bytes.splice(start..end, word.iter().copied());
}

/// Puts another text of the file, or a word, in place of the one in quotes that follows `at`.
fn replace_quoted(random: &mut ChaCha8Rng, bytes: &mut Vec<u8>, at: usize) {
    let texts: Vec<(usize, usize)> = quoted(bytes);
    let Some(&(start, end)) = texts.iter().find(|(start, _)| *start >= at) else {
        return;
    };
    let other = match random.random_range(0..3) {
        0 => WORDS[random.random_range(0..WORDS.len())].to_vec(),
        _ => {
            let (from, to) = texts[random.random_range(0..texts.len())];
            bytes[from..to].to_vec()
        }
    };
    bytes.splice(start..end, other);
}

fn quoted(bytes: &[u8]) -> Vec<(usize, usize)> {
    let marks: Vec<usize> = (0..bytes.len()).filter(|&at| bytes[at] == b'"').collect();
    let pairs = marks.chunks_exact(2);
    pairs.map(|pair| (pair[0] + 1, pair[1])).collect()
}

fn swap_lines(random: &mut ChaCha8Rng, bytes: &mut Vec<u8>) {
    let mut lines: Vec<Vec<u8>> = bytes
        .split(|&byte| byte == b'\n')
        .map(<[u8]>::to_vec)
        .collect();
    let count = lines.len();
    lines.swap(random.random_range(0..count), random.random_range(0..count));
    *bytes = lines.join(&b'\n');
}

//! Damaged and hostile files, made from sound ones with a seed: each is read, or refused with an error
//! that names the file; nothing crashes, waits or fills the memory.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use fmi_import::{FmiVersion, Fmu};
use fmi_ssp as ssp;
use fmi_system::SystemFile;
use laboratory::export::{Experiment, write};
use laboratory::run::experiment::{Request, prepare};
use pack::all_fmus;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

const SEED: u64 = 20_261;
/// Nothing that small may take longer.
const LIMIT: Duration = Duration::from_secs(20);

type Reader<'a> = &'a dyn Fn(&Path) -> Result<(), String>;

/// How many files were refused and how many read.
#[derive(Debug, Default)]
struct Count {
    refused: usize,
    read: usize,
}

/// Writes `bytes` to a file and reads it; an error must name the file.
fn attempt(count: &mut Count, place: &Path, bytes: &[u8], read: Reader, what: &str) {
    fs::write(place, bytes).unwrap();
    let begin = Instant::now();
    let outcome = read(place);
    let took = begin.elapsed();
    assert!(took < LIMIT, "{what}: {took:?}");
    match outcome {
        Ok(()) => count.read += 1,
        Err(message) => {
            let name = place.file_name().unwrap().to_string_lossy();
            assert!(message.contains(&*name), "{what}: no file in `{message}`");
            assert!(
                message.len() < 20_000,
                "{what}: a message of {} bytes",
                message.len()
            );
            count.refused += 1;
        }
    }
}

/// The same bytes with something wrong.
fn damaged(random: &mut ChaCha8Rng, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let length = bytes.len().max(1);
    match random.random_range(0..5) {
        0 => bytes.truncate(random.random_range(0..length)),
        1 => {
            for _ in 0..random.random_range(1..20) {
                let at = random.random_range(0..length);
                bytes[at] = random.random();
            }
        }
        2 => {
            let at = random.random_range(0..length);
            let end = (at + random.random_range(1..200)).min(length);
            bytes.drain(at..end);
        }
        3 => {
            let at = random.random_range(0..length);
            let end = (at + random.random_range(1..200)).min(length);
            let again = bytes[at..end].to_vec();
            bytes.splice(at..at, again);
        }
        _ => {
            let at = random.random_range(0..length);
            let words: [&[u8]; 8] = [
                b"NaN",
                b"1e999",
                b"-1",
                b"99999999999999999999",
                b"\0",
                b"<a>",
                b"\xff\xfe",
                b"\"",
            ];
            let word = words[random.random_range(0..words.len())];
            bytes.splice(at..at, word.iter().copied());
        }
    }
    bytes
}

fn entries(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut archive = ZipArchive::new(File::open(path).unwrap()).unwrap();
    (0..archive.len())
        .map(|index| {
            let mut entry = archive.by_index(index).unwrap();
            let mut content = Vec::new();
            entry.read_to_end(&mut content).unwrap();
            (entry.name().unwrap().into_owned(), content)
        })
        .collect()
}

fn zipped(entries: &BTreeMap<String, Vec<u8>>) -> Vec<u8> {
    let mut archive = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, content) in entries {
        archive
            .start_file(name, SimpleFileOptions::default())
            .unwrap();
        archive.write_all(content).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// The archive with one file damaged.
fn spoiled(random: &mut ChaCha8Rng, sound: &BTreeMap<String, Vec<u8>>, name: &str) -> Vec<u8> {
    let mut spoiled = sound.clone();
    let content = damaged(random, &sound[name]);
    spoiled.insert(name.to_string(), content);
    zipped(&spoiled)
}

/// The same bytes with another name for an entry, of the same length.
fn renamed(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut bytes = bytes.to_vec();
    let mut found = 0;
    for at in 0..bytes.len().saturating_sub(from.len()) {
        if bytes[at..].starts_with(from.as_bytes()) {
            bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
            found += 1;
        }
    }
    assert!(found >= 2, "in the entry's head and in the directory");
    bytes
}

/// The same bytes with something else in the heads of all entries and in the directory: `local` and
/// `central` are offsets from their signatures.
fn patched(bytes: &[u8], (local, central): (usize, usize), value: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for at in 0..bytes.len() - 46 {
        let offset = match &bytes[at..at + 4] {
            b"PK\x03\x04" => local,
            b"PK\x01\x02" => central,
            _ => continue,
        };
        bytes[at + offset..at + offset + value.len()].copy_from_slice(value);
    }
    bytes
}

/// Archives that are no mishap.
fn hostile_archives(sound: &BTreeMap<String, Vec<u8>>) -> Vec<(&'static str, Vec<u8>)> {
    let with = |name: &str| {
        let mut more = sound.clone();
        more.insert(name.to_string(), b"x".to_vec());
        zipped(&more)
    };
    let place = "extra/placeholder/21";
    let whole = zipped(sound);
    let mut archives = vec![
        (
            "two descriptions",
            renamed(&with(place), place, "modelDescription.xml"),
        ),
        (
            "a zero in a name",
            renamed(&with(place), place, "extra/place\0older/21"),
        ),
        ("dots", renamed(&with(place), place, "extra/../../../../21")),
        (
            "backslashes",
            renamed(&with(place), place, "extra\\..\\..\\..\\..\\12"),
        ),
        (
            "a drive",
            renamed(&with(place), place, "C:/extra/placeholder"),
        ),
        (
            "two slashes",
            renamed(&with(place), place, "//server/place/hold1"),
        ),
        (
            "escapes",
            renamed(&with(place), place, "extra/\u{1b}[2Jcehold11/1"),
        ),
        ("encrypted", patched(&whole, (6, 8), &1_u16.to_le_bytes())),
        (
            "an unknown method",
            patched(&whole, (8, 10), &99_u16.to_le_bytes()),
        ),
        (
            "another checksum",
            patched(&whole, (14, 16), &7_u32.to_le_bytes()),
        ),
        ("nothing inside", zipped(&BTreeMap::new())),
        (
            "a name of 5,000 letters",
            with(&format!("extra/{}", "n".repeat(5000))),
        ),
        (
            "200 folders deep",
            with(&format!("extra/{}end", "d/".repeat(200))),
        ),
        ("a folder under a file", with("modelDescription.xml/below")),
    ];
    // 4 GB are said to be inside.
    let size = (4_000_000_000_u32).to_le_bytes();
    archives.push(("sizes that are not true", patched(&whole, (22, 24), &size)));
    let mut linked = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default();
    for (name, content) in sound {
        linked.start_file(name, options).unwrap();
        linked.write_all(content).unwrap();
    }
    for (name, target) in [
        ("resources/link", "/etc/passwd"),
        ("binaries/up", "../../.."),
    ] {
        linked.add_symlink(name, target, options).unwrap();
    }
    let linked = linked.finish().unwrap().into_inner();
    archives.push(("links to outside", linked));
    archives
}

#[test]
fn damaged_and_hostile_files_are_read_or_refused_by_name() {
    println!("seed {SEED}");
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let folder = tempfile::tempdir().unwrap();
    let mut counts: BTreeMap<&str, Count> = BTreeMap::new();

    let open = |path: &Path| {
        Fmu::open(path)
            .map(|_| ())
            .map_err(|error| error.to_string())
    };
    for version in FmiVersion::ALL {
        let all = all_fmus().unwrap().into_iter();
        let mut all = all.filter(|fmu| fmu.version == version && fmu.name == "ReferenceMotion");
        let sound = entries(&all.next().unwrap().path);
        let whole = zipped(&sound);
        let place = folder.path().join("damaged.fmu");
        let count = counts.entry("fmu").or_default();
        for number in 0..60 {
            let bytes = match number % 2 {
                0 => damaged(&mut random, &whole),
                _ => spoiled(&mut random, &sound, "modelDescription.xml"),
            };
            attempt(count, &place, &bytes, &open, &format!("{version} {number}"));
        }
        for name in [
            "../../outside",
            "/outside",
            "a/../../outside",
            "c:\\outside",
        ] {
            let mut hostile = sound.clone();
            hostile.insert(name.to_string(), b"x".to_vec());
            attempt(count, &place, &zipped(&hostile), &open, name);
        }
        for (what, bytes) in hostile_archives(&sound) {
            attempt(count, &place, &bytes, &open, what);
        }
        // A thousandfold bomb of a description is refused, not unpacked into memory for ever.
        let mut bomb = sound.clone();
        bomb.insert("modelDescription.xml".into(), vec![b' '; 64 << 20]);
        attempt(count, &place, &zipped(&bomb), &open, "bomb");
    }

    let prepared = prepare(&Request {
        duration_s: Some(0.1),
        fmi: FmiVersion::V2,
        ..Request::built_in("displacement-pid")
    })
    .unwrap();
    let archive = folder.path().join("sound.ssp");
    let experiment = Experiment {
        motion: Some(&prepared.motion),
        step: 0.002,
        duration: 0.1,
        algorithm: "jacobi".to_string(),
        fmi: FmiVersion::V2,
        installation: pack::Installation::default(),
    };
    write(&prepared.system, &experiment, &archive).unwrap();
    let mut sound = entries(&archive);
    // Small ones are quick.
    sound.retain(|name, _| name.ends_with(".ssd"));
    let read = |path: &Path| {
        let read = ssp::read(&path.display().to_string());
        read.map(|_| ()).map_err(|error| error.to_string())
    };
    let place = folder.path().join("damaged.ssp");
    let whole = zipped(&sound);
    let count = counts.entry("ssp").or_default();
    for number in 0..200 {
        let bytes = match number % 4 {
            0 => damaged(&mut random, &whole),
            _ => spoiled(&mut random, &sound, ssp::STRUCTURE),
        };
        attempt(count, &place, &bytes, &read, &format!("ssp {number}"));
    }

    let system = include_bytes!("../../../orchestrator/laboratory/systems/mpc.toml");
    let read = |path: &Path| {
        let read = SystemFile::read(path);
        read.map(|_| ()).map_err(|error| error.to_string())
    };
    let place = folder.path().join("damaged.toml");
    let count = counts.entry("system").or_default();
    for number in 0..200 {
        let bytes = damaged(&mut random, system);
        attempt(count, &place, &bytes, &read, &format!("system {number}"));
    }

    let mut record = String::from(
        "RECORD\nEVENT\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 400, DT= .01 SEC\n",
    );
    let mut table = String::from("t_s,a_g\n");
    for k in 0..400 {
        let value = (0.1 * f64::from(k)).sin();
        record += &format!("{value:15.7E}{}", if k % 5 == 4 { "\n" } else { "" });
        table += &format!("{},{value}\n", 0.01 * f64::from(k));
    }
    let read = |path: &Path| {
        let options = motion::Options::default();
        let read = motion::load(path, &options);
        read.map(|_| ()).map_err(|error| error.to_string())
    };
    for (name, sound) in [("damaged.AT2", &record), ("damaged.csv", &table)] {
        let place = folder.path().join(name);
        let count = counts.entry("motion").or_default();
        for number in 0..100 {
            let bytes = damaged(&mut random, sound.as_bytes());
            let named = |path: &Path| {
                read(path).map_err(|message| match message.contains("damaged") {
                    true => format!("{name}: {message}"),
                    false => message,
                })
            };
            attempt(count, &place, &bytes, &named, &format!("{name} {number}"));
        }
    }
    println!("{counts:?}");
    let refused: usize = counts.values().map(|count| count.refused).sum();
    assert!(refused >= 100, "{counts:?}");
    assert!(!folder.path().join("outside").exists());
    assert!(!folder.path().parent().unwrap().join("outside").exists());
}

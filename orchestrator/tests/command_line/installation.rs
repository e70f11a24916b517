//! The program away from its sources: moved to any folder, with an empty environment.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Instant;

use pack::{self, FmiVersion};
use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

use super::{stderr, stdout};

/// The program with its FMUs beside it, and a folder to work in.
struct Installation {
    folder: tempfile::TempDir,
}

impl Installation {
    fn new(versions: &[FmiVersion]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let here = folder.path();
        fs::copy(env!("CARGO_BIN_EXE_shakebench"), here.join("shakebench")).unwrap();
        fs::create_dir(here.join("work")).unwrap();
        for fmu in pack::all_fmus().unwrap() {
            if versions.contains(&fmu.version) {
                let below = here.join("fmus").join(fmu.version.folder());
                fs::create_dir_all(&below).unwrap();
                fs::copy(&fmu.path, below.join(fmu.path.file_name().unwrap())).unwrap();
            }
        }
        Self { folder }
    }

    fn place(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn call(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(self.place("shakebench"));
        // Not even the system's own folders of programs.
        command.args(arguments).env_clear().env("PATH", "");
        command.current_dir(self.place("work")).output().unwrap()
    }

    /// Fails with status 2 and all the words.
    #[track_caller]
    fn refuses(&self, arguments: &[&str], words: &[&str]) {
        let output = self.call(arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        for word in words {
            assert!(said.contains(word), "`{word}` is not in: {said}");
        }
    }
}

fn table() -> &'static str {
    "fmus/fmi3/ShakeTable.fmu"
}

/// Writes an archive again with another content of one file; without it where that is `None`.
fn rewrite(path: &Path, name: &str, change: impl Fn(&[u8]) -> Option<Vec<u8>>) {
    let mut archive = ZipArchive::new(File::open(path).unwrap()).unwrap();
    let mut files = Vec::new();
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).unwrap();
        let mut content = Vec::new();
        file.read_to_end(&mut content).unwrap();
        files.push((file.name().unwrap().into_owned(), content));
    }
    let mut written = ZipWriter::new(File::create(path).unwrap());
    for (own, content) in files {
        let content = match own == name {
            true => change(&content),
            false => Some(content),
        };
        if let Some(content) = content.filter(|_| !own.ends_with('/')) {
            written
                .start_file(own, SimpleFileOptions::default())
                .unwrap();
            written.write_all(&content).unwrap();
        }
    }
    written.finish().unwrap();
}

#[test]
fn moved_program_runs_like_the_one_in_the_checkout() {
    let installed = Installation::new(&FmiVersion::ALL);
    let begin = Instant::now();
    let output = installed.call(&["run", "mpc", "--out", "out", "--json"]);
    let wall = begin.elapsed();
    assert!(output.status.success(), "{}", stderr(&output));
    let here = installed.place("here");
    let arguments = ["run", "mpc", "--out", here.to_str().unwrap()];
    let own = super::shakebench(Path::new(env!("CARGO_MANIFEST_DIR")), &arguments);
    assert!(own.status.success(), "{}", stderr(&own));
    let results = |folder: PathBuf| fs::read(folder.join("results.csv")).unwrap();
    assert!(
        results(installed.place("work/out")) == results(here),
        "another results.csv than in the checkout"
    );
    println!("first result after {:.2} s", wall.as_secs_f64());

    for arguments in [
        &["info", "ShakeTable"][..],
        &["info", "mpc"],
        &["design", "--out", "design"],
        &["run", "--fmi", "2", "--isolate", "all", "--duration", "2 s"],
        &["report", "out"],
    ] {
        let output = installed.call(arguments);
        assert!(
            output.status.success(),
            "{arguments:?}: {}",
            stderr(&output)
        );
    }
    installed.refuses(&["info", "ShakeTabel"], &["expected", "ShakeTable"]);
    installed.refuses(&["build", "--out", "new"], &["no workspace", "release"]);
    assert!(!installed.place("work/new").exists());
}

/// The benchmarks are another program, beside this one.
#[cfg(unix)]
#[test]
fn a_benchmark_is_started_beside_the_program_with_what_was_said() {
    use std::os::unix::fs::PermissionsExt;
    let installed = Installation::new(&[]);
    installed.refuses(
        &["benchmark", "vrths"],
        &["shakebench-hybrid", "is missing", "install"],
    );
    let beside = installed.place("shakebench-hybrid");
    fs::write(&beside, "#!/bin/sh\necho \"$@\"\nexit 2\n").unwrap();
    fs::set_permissions(&beside, fs::Permissions::from_mode(0o755)).unwrap();
    let said = [
        "--force",
        "--units",
        "si",
        "benchmark",
        "vrths",
        "--help",
        "--json",
    ];
    let output = installed.call(&said);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(stdout(&output), "--units si --force vrths --help --json\n");
}

#[test]
fn doctor_says_what_is_here_and_what_is_not() {
    let installed = Installation::new(&FmiVersion::ALL);
    let output = installed.call(&["doctor", "--json"]);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["ready"], true, "{found:#}");
    assert_eq!(found["origin"], "beside-program");
    let parts = found["findings"].as_array().unwrap();
    let state = |part: &str| {
        let own = parts.iter().find(|finding| finding["part"] == part);
        own.unwrap_or_else(|| panic!("no `{part}` in {found:#}"))["state"].clone()
    };
    // There is no cargo, and nothing needs it.
    assert_eq!(state("cargo"), "absent");
    assert_eq!(state("processes for FMUs"), "good");

    fs::write(installed.place(table()), "PK, but no archive").unwrap();
    let output = installed.call(&["doctor"]);
    assert_eq!(output.status.code(), Some(1), "{}", stdout(&output));
    for word in ["BAD", "ShakeTable.fmu", "damaged", "install again"] {
        assert!(stdout(&output).contains(word), "{}", stdout(&output));
    }
}

#[test]
fn folder_of_fmus_is_named_by_option_or_environment() {
    let installed = Installation::new(&[FmiVersion::V3]);
    let elsewhere = installed.place("elsewhere");
    fs::rename(installed.place("fmus"), &elsewhere).unwrap();
    let run = ["run", "--duration", "1 s"];
    installed.refuses(
        &run,
        &[
            "no FMUs",
            "next to the program",
            "--fmus",
            "SHAKEBENCH_FMUS",
        ],
    );
    let by_option = [&run[..], &["--fmus", elsewhere.to_str().unwrap()]].concat();
    assert!(installed.call(&by_option).status.success());
    let mut by_environment = Command::new(installed.place("shakebench"));
    by_environment.args(run).env_clear();
    by_environment.env("SHAKEBENCH_FMUS", &elsewhere);
    by_environment.current_dir(installed.place("work"));
    assert!(by_environment.output().unwrap().status.success());
    // One version alone is enough for that version.
    let other = [&by_option[..], &["--fmi", "2"]].concat();
    installed.refuses(
        &other,
        &["`ThreeVariableControl`", "nor a component in", "fmi2"],
    );
    let nowhere = [&run[..], &["--fmus", "nowhere"]].concat();
    installed.refuses(&nowhere, &["nowhere: no FMUs", "named by --fmus", "fmi3"]);
}

#[test]
fn fmus_that_do_not_fit_the_program_are_refused_with_the_cure() {
    let installed = Installation::new(&[FmiVersion::V3]);
    let path = installed.place(table());
    let whole = fs::read(&path).unwrap();
    let run = ["run", "--duration", "1 s"];
    let library = pack::Platform::here()
        .unwrap()
        .library_in_fmu(FmiVersion::V3, "ShakeTable");
    let replace = |from: &'static str, to: &'static str| {
        move |text: &[u8]| Some(String::from_utf8_lossy(text).replace(from, to).into_bytes())
    };

    let version = concat!("version=\"", env!("CARGO_PKG_VERSION"), "\"");
    rewrite(
        &path,
        "modelDescription.xml",
        replace(version, "version=\"0.0.7\""),
    );
    let words = ["ShakeTable.fmu", "version 0.0.7", env!("CARGO_PKG_VERSION")];
    installed.refuses(&run, &words);
    installed.refuses(&run, &["install again", "--fmus"]);

    fs::write(&path, &whole).unwrap();
    rewrite(
        &path,
        "modelDescription.xml",
        replace("fmu-kit", "Other tool"),
    );
    installed.refuses(&run, &["not a component of this program", "Other tool"]);

    fs::write(&path, &whole).unwrap();
    rewrite(&path, &library, |_| None);
    installed.refuses(&run, &["ShakeTable.fmu", "no binary", "install again"]);

    fs::write(&path, &whole).unwrap();
    rewrite(&path, &library, |_| {
        Some(b"MZ of another system".repeat(10))
    });
    installed.refuses(
        &run,
        &["a Windows library", "ShakeTable.fmu", "install again"],
    );

    // Mapped, such a file would end the process.
    fs::write(&path, &whole).unwrap();
    rewrite(&path, &library, |bytes| Some(bytes[..20_000].to_vec()));
    if cfg!(target_os = "linux") {
        installed.refuses(&run, &["cut short", "ShakeTable.fmu", "install again"]);
    }

    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    installed.refuses(&run, &["ShakeTable.fmu", "damaged", "install again"]);

    fs::remove_file(&path).unwrap();
    installed.refuses(
        &run,
        &[
            "`ShakeTable` is neither a path",
            "nor a component in",
            "fmi3",
        ],
    );
}

#[test]
fn archives_of_several_machines_are_merged() {
    let installed = Installation::new(&[FmiVersion::V3]);
    let path = installed.place("mac/fmi3/ShakeTable.fmu");
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::copy(installed.place(table()), &path).unwrap();
    let platform: pack::Platform = "aarch64-darwin".parse().unwrap();
    let mac = platform.library_in_fmu(FmiVersion::V3, "ShakeTable");
    let library = pack::Platform::here()
        .unwrap()
        .library_in_fmu(FmiVersion::V3, "ShakeTable");
    // An archive as a Mac would pack it: the same, with another library in another place.
    let renamed = |to: &str| {
        let mut archive = ZipArchive::new(File::open(&path).unwrap()).unwrap();
        let mut files = Vec::new();
        for index in 0..archive.len() {
            let mut file = archive.by_index(index).unwrap();
            let mut content = Vec::new();
            file.read_to_end(&mut content).unwrap();
            let name = file.name().unwrap().into_owned();
            files.push((
                if name == library {
                    to.to_string()
                } else {
                    name
                },
                content,
            ));
        }
        let mut written = ZipWriter::new(File::create(&path).unwrap());
        for (name, content) in files {
            if let Some(folder) = name.strip_suffix('/') {
                written
                    .add_directory(folder, SimpleFileOptions::default())
                    .unwrap();
            } else {
                written
                    .start_file(name, SimpleFileOptions::default())
                    .unwrap();
                written.write_all(&content).unwrap();
            }
        }
        written.finish().unwrap();
    };
    renamed(&mac);
    let merge = ["build", "--merge", "../fmus", "../mac", "--out", "all"];
    let output = installed.call(&merge);
    assert!(output.status.success(), "{}", stderr(&output));
    let both = File::open(installed.place("work/all/fmi3/ShakeTable.fmu")).unwrap();
    let archive = ZipArchive::new(both).unwrap();
    let names: Vec<String> = archive
        .file_names()
        .map(|n| n.unwrap().to_string())
        .collect();
    assert!(
        names.contains(&mac) && names.contains(&library),
        "{names:?}"
    );
    let run = installed.call(&["run", "--duration", "1 s", "--fmus", "all"]);
    assert!(run.status.success(), "{}", stderr(&run));

    rewrite(&path, "modelDescription.xml", |_| {
        Some(b"<other/>".to_vec())
    });
    fs::remove_dir_all(installed.place("work/all")).unwrap();
    installed.refuses(
        &merge,
        &["cannot be merged", "`modelDescription.xml` differs"],
    );
    assert!(!installed.place("work/all").exists());
    installed.refuses(
        &["build", "--merge", "../nothing", "--out", "all"],
        &["no FMUs"],
    );
}

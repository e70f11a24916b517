//! FMUs in C that crash, print, never return or break the standard: each ends as an error that names
//! FMU, call and time, with what was computed until then saved.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;
use std::process::Command;

use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

use crate::{shakebench, stderr, stdout};

/// Compiles `tests/importers/hostile/hostile.c` with a behaviour and packs it as `hostile.fmu`.
pub(crate) fn pack(folder: &Path, behaviour: &str, attributes: &str) {
    pack_as(folder, "hostile.fmu", behaviour, attributes, "");
}

/// As [`pack`], under another name, with attributes for the output's `Unknown`.
fn pack_as(folder: &Path, name: &str, behaviour: &str, attributes: &str, unknown: &str) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = source.join("../tests/importers/hostile/hostile.c");
    let library = folder.join("hostile.so");
    let done = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-pthread", "-o"])
        .arg(&library)
        .arg(format!("-DBEHAVIOUR={behaviour}"))
        .arg(source)
        .arg("-lm")
        .output()
        .expect("a C compiler");
    assert!(done.status.success(), "{}", stderr(&done));
    let description = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="hostile" guid="{{1}}" generationTool="by hand">
<CoSimulation modelIdentifier="hostile" canHandleVariableCommunicationStepSize="true" {attributes}/>
<ModelVariables>
<ScalarVariable name="y" valueReference="0" causality="output" variability="continuous" initial="calculated"><Real/></ScalarVariable>
<ScalarVariable name="u" valueReference="1" causality="input" variability="continuous"><Real start="0.25"/></ScalarVariable>
<ScalarVariable name="at" valueReference="2" causality="parameter" variability="fixed"><Real start="1"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="1" {unknown}/></Outputs><InitialUnknowns><Unknown index="1"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>"#
    );
    let mut archive = ZipWriter::new(File::create(folder.join(name)).unwrap());
    for (name, content) in [
        ("modelDescription.xml", description.into_bytes()),
        ("binaries/linux64/hostile.so", fs::read(library).unwrap()),
    ] {
        let options = SimpleFileOptions::default();
        archive.start_file(name, options).unwrap();
        archive.write_all(&content).unwrap();
    }
    archive.finish().unwrap();
}

pub(crate) const ALONE: &str = r#"
    connections = ["reference.displacement -> it.u"]
    [components.it]
    fmu = "hostile.fmu"
    [experiment]
    duration = "2 s"
"#;

struct Run {
    status: Option<i32>,
    said: String,
    summary: serde_json::Value,
    /// Rows of the results.
    rows: Vec<Vec<f64>>,
}

fn run(folder: &Path, system: &str, more: &[&str]) -> Run {
    fs::write(folder.join("rig.toml"), system).unwrap();
    let mut arguments = vec!["run", "rig.toml", "--out", "out", "--json", "--force"];
    arguments.extend(more);
    let output = shakebench(folder, &arguments);
    let said = stderr(&output);
    let results = fs::read_to_string(folder.join("out/results.csv")).unwrap_or_default();
    Run {
        status: output.status.code(),
        summary: serde_json::from_str(&stdout(&output))
            .unwrap_or_else(|error| panic!("{error}: {}\n{said}", stdout(&output))),
        rows: results
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
            .collect(),
        said,
    }
}

/// It ends early with status 1, the rows until then saved, and a message with these words.
#[track_caller]
fn ends(behaviour: &str, more: &[&str], rows: usize, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), behaviour, "");
    let run = run(folder.path(), ALONE, more);
    assert_eq!(run.status, Some(1), "{behaviour}: {}", run.said);
    assert_eq!(run.summary["ended"], "failed", "{behaviour}");
    assert_eq!(run.rows.len(), rows, "{behaviour}: {}", run.said);
    for word in ["`it`", "hostile.fmu", "fmi2DoStep", "at 1 s"]
        .iter()
        .chain(words)
    {
        assert!(
            run.said.contains(word),
            "{behaviour}: `{word}` is not in {}",
            run.said
        );
    }
}

/// It ends regularly; gives what was said.
#[track_caller]
fn survives(behaviour: &str, more: &[&str]) -> Run {
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), behaviour, "");
    let run = run(folder.path(), ALONE, more);
    assert_eq!(run.status, Some(0), "{behaviour}: {}", run.said);
    assert_eq!(run.rows.len(), 1000, "{behaviour}: {}", run.said);
    run
}

#[test]
fn an_fmu_that_ends_its_process_ends_the_run_only() {
    // A row at 1 s, then the step from there.
    ends("SEGFAULT", &[], 501, &["segmentation fault"]);
    ends("ABORT", &[], 501, &["abort"]);
    ends("EXIT", &[], 501, &["exit(0)"]);
    ends(
        "LOOP",
        &["--call-limit", "0.5 s"],
        501,
        &["did not return within 0.5 s"],
    );
}

#[test]
fn processes_that_an_fmu_leaves_behind_hold_nobody_up_and_end_with_it() {
    // They wait without end, with the guest's pipes open.
    survives("FORKS", &[]);
    survives("RETURNS_TWICE", &[]);
    ends("DAEMON", &[], 501, &["abort"]);
    let marked = fs::read_dir("/proc").unwrap().flatten().filter(|process| {
        let read = |name| fs::read(process.path().join(name)).unwrap_or_default();
        String::from_utf8_lossy(&read("environ")).contains("SHAKEBENCH_GUEST=")
            && String::from_utf8_lossy(&read("maps")).contains("hostile.so")
            // Other tests have guests now, but none that have been given up by their parent.
            && String::from_utf8_lossy(&read("status")).contains("PPid:\t1\n")
    });
    assert_eq!(marked.count(), 0);
}

/// 147 libraries: every way to misbehave in a step, and nine of them in seven other functions.
#[test]
#[ignore = "slow: a minute, most of which it waits"]
fn no_fmu_hangs_or_ends_the_program_whatever_it_does_and_wherever() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR"));
    let script = script.join("../tests/importers/hostile/breadth.py");
    let output = Command::new("python3")
        .arg(script)
        .arg(env!("CARGO_BIN_EXE_shakebench"))
        .output()
        .expect("Python");
    assert!(
        output.status.success(),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
    assert!(stdout(&output).contains("147 libraries, 0 faults"));
}

#[test]
fn an_fmu_cannot_take_the_program_along_by_the_memory_they_share() {
    survives("TRUNCATES", &[]);
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), "FORGES", "");
    let forged = run(folder.path(), ALONE, &["--call-limit", "2 s"]);
    // Whatever comes of it.
    assert!(matches!(forged.status, Some(0 | 1)), "{}", forged.said);
    assert!(forged.rows.len() >= 500, "{}", forged.said);
}

#[test]
fn a_logger_called_with_a_strange_environment_logs_for_the_fmu_that_is_called() {
    for isolate in ["none", "foreign"] {
        let run = survives("STRANGE_ENVIRONMENT", &["--isolate", isolate]);
        for word in ["from 1.5 s", "and 1.5 s"] {
            assert!(run.said.contains(word), "{isolate}: {word}: {}", run.said);
        }
    }
}

#[test]
fn an_fmu_that_changes_the_rounding_changes_its_own_only() {
    let folder = tempfile::tempdir().unwrap();
    pack_as(folder.path(), "thirds.fmu", "THIRDS", "", "");
    let system = r#"
        connections = ["reference.displacement -> it.u", "reference.displacement -> other.u"]
        [components.it]
        fmu = "hostile.fmu"
        [components.other]
        fmu = "thirds.fmu"
        [experiment]
        duration = "2 s"
    "#;
    for isolate in ["none", "foreign"] {
        let thirds = ["HONEST", "ROUNDS"].map(|behaviour| {
            pack(folder.path(), behaviour, "");
            let run = run(folder.path(), system, &["--isolate", isolate]);
            assert_eq!(run.status, Some(0), "{}", run.said);
            run.rows.iter().map(|row| row[5]).collect::<Vec<f64>>()
        });
        assert_eq!(thirds[0], thirds[1], "{isolate}");
    }
}

#[test]
fn an_fmu_that_ends_the_program_does_not_end_it_with_success() {
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), "EXIT", "");
    fs::write(folder.path().join("rig.toml"), ALONE).unwrap();
    let arguments = ["run", "rig.toml", "--out", "out", "--isolate", "none"];
    let output = shakebench(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("ended the program by exit()"));
}

#[test]
fn a_limit_of_the_size_of_files_leaves_what_there_was_room_for() {
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), "HONEST", "");
    fs::write(folder.path().join("rig.toml"), ALONE).unwrap();
    let program = env!("CARGO_BIN_EXE_shakebench");
    // Blocks of 512 bytes; the memory that is shared with another process counts, too.
    for (isolate, blocks, duration) in [("none", 100, "2 s"), ("foreign", 4300, "200 s")] {
        let output = Command::new("sh")
            .arg("-c")
            .arg(format!("ulimit -f {blocks}; exec \"$@\""))
            .args(["sh", program, "run", "rig.toml", "--force", "--out", "out"])
            .args(["--isolate", isolate, "--duration", duration])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{isolate}: {said}");
        assert!(said.contains("results.csv.part"), "{isolate}: {said}");
        let rows = fs::read_to_string(folder.path().join("out/results.csv.part")).unwrap();
        assert!(
            rows.lines().count() > 100 && rows.ends_with('\n'),
            "{isolate}"
        );
    }
}

#[test]
fn an_fmu_that_ends_its_process_ends_its_diagnosis_with_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, "SEGFAULT", "");
    fs::write(
        folder.join("map.toml"),
        "inputs = { u = 'u' }\noutputs = { y = 'y' }\n",
    )
    .unwrap();
    let rows: String = (0..300)
        .map(|k| format!("{},{},{}\n", 0.01 * f64::from(k), k % 7, k % 5))
        .collect();
    fs::write(folder.join("data.csv"), format!("time [s],u,y\n{rows}")).unwrap();
    let arguments = [
        "diagnose",
        "--fmu",
        "hostile.fmu",
        "--map",
        "map.toml",
        "data.csv",
        "--out",
        "out",
    ];
    let output = shakebench(folder, &arguments);
    assert_eq!(output.status.code(), Some(2));
    let said = stderr(&output);
    for word in ["hostile.fmu", "data", "segmentation fault", "at 1 s"] {
        assert!(said.contains(word), "`{word}` is not in {said}");
    }
    assert!(!folder.join("out").exists());
}

/// The archive with another library in it.
fn replace_library(folder: &Path, library: &[u8]) {
    let path = folder.join("hostile.fmu");
    let mut sound = ZipArchive::new(File::open(&path).unwrap()).unwrap();
    let mut description = Vec::new();
    let mut entry = sound.by_name("modelDescription.xml").unwrap();
    entry.read_to_end(&mut description).unwrap();
    let mut archive = ZipWriter::new(File::create(&path).unwrap());
    for (name, content) in [
        ("modelDescription.xml", &description[..]),
        ("binaries/linux64/hostile.so", library),
    ] {
        let options = SimpleFileOptions::default();
        archive.start_file(name, options).unwrap();
        archive.write_all(content).unwrap();
    }
    archive.finish().unwrap();
}

#[test]
fn damaged_libraries_end_as_errors_that_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, "HONEST", "");
    let sound = fs::read(folder.join("hostile.so")).unwrap();
    let mut cases: Vec<(String, Vec<u8>, &[&str])> = vec![
        ("empty".into(), Vec::new(), &["hostile.fmu"]),
        (
            "a text".into(),
            b"no library\n".repeat(100),
            &["hostile.fmu"],
        ),
    ];
    // ELF: machine, class, kind of file; a system that is not this one.
    for (what, at, value) in [
        ("for ARM", 18, 183),
        ("of 32 bits", 4, 1),
        ("an object file", 16, 1),
        ("of the other byte order", 5, 2),
    ] {
        let mut other = sound.clone();
        other[at] = value;
        cases.push((what.into(), other, &["hostile.fmu"]));
    }
    for tenth in 1..10 {
        let length = sound.len() * tenth / 10;
        let short = sound[..length].to_vec();
        cases.push((format!("{length} of {} bytes", sound.len()), short, &[]));
    }
    // A function that has another name.
    for name in ["fmi2DoStep", "fmi2Instantiate", "fmi2FreeInstance"] {
        let mut other = sound.clone();
        let places = (0..sound.len() - name.len())
            .filter(|&at| sound[at..].starts_with(name.as_bytes()) && sound[at + name.len()] == 0);
        places.for_each(|at| other[at] = b'x');
        cases.push((format!("without {name}"), other, &["hostile.fmu"]));
    }
    for (what, library, words) in &cases {
        replace_library(folder, library);
        fs::write(folder.join("rig.toml"), ALONE).unwrap();
        let output = shakebench(folder, &["run", "rig.toml", "--out", "out", "--force"]);
        let said = stderr(&output);
        // The program ends by itself, also where the loader dies of the library.
        let status = output.status.code();
        assert!(status.is_some(), "{what}: the program died: {said}");
        if status != Some(0) {
            assert!(
                said.contains("error: ") && (said.contains("`it`") || said.contains("hostile.fmu")),
                "{what}: {said}"
            );
        }
        if !words.is_empty() {
            assert_eq!(status, Some(2), "{what}: {said}");
        }
        for word in *words {
            assert!(said.contains(word), "{what}: `{word}` is not in {said}");
        }
    }
}

#[test]
fn an_unknown_status_is_an_error_that_names_the_number() {
    for isolate in ["none", "foreign"] {
        ends(
            "UNKNOWN_STATUS",
            &["--isolate", isolate],
            501,
            &["returned 17"],
        );
        ends(
            "DISCARDS",
            &["--isolate", isolate],
            501,
            &["discard", "it came to 1 s"],
        );
    }
}

#[test]
fn callbacks_are_there_for_as_long_as_the_instance_lives() {
    for isolate in ["none", "foreign"] {
        let run = survives("KEEPS_CALLBACKS", &["--isolate", isolate]);
        for word in ["stepped from 1.5 s", "terminated at 2 s", "freed at 2 s"] {
            assert!(run.said.contains(word), "{isolate}: {word}: {}", run.said);
        }
        let run = survives("NULL_MESSAGE", &["--isolate", isolate]);
        assert!(run.said.contains("without a text"), "{}", run.said);
    }
}

#[test]
fn what_an_fmu_says_cannot_break_the_output() {
    for isolate in ["none", "foreign"] {
        let run = survives("PRINTS", &["--isolate", isolate]);
        assert!(
            run.said.contains("printed at 1.5 s"),
            "{isolate}: {}",
            run.said
        );
        let run = survives("ESCAPES", &["--isolate", isolate]);
        assert!(!run.said.contains('\u{1b}'), "{}", run.said);
        assert!(run.said.contains("\\u{1b}[2J"), "{}", run.said);
        let run = survives("REPEATS", &["--isolate", isolate]);
        assert!(
            run.said.contains("again and again (500 times)"),
            "{}",
            run.said
        );
    }
}

#[test]
fn an_fmu_that_asks_to_end_the_run_ends_it_regularly() {
    for isolate in ["none", "foreign"] {
        let folder = tempfile::tempdir().unwrap();
        pack(folder.path(), "ENDS", "");
        let run = run(folder.path(), ALONE, &["--isolate", isolate]);
        assert_eq!(run.status, Some(0), "{}", run.said);
        assert_eq!(run.summary["ended"], "terminated");
        assert!(
            run.said.contains("requested the end of the run at 1 s"),
            "{}",
            run.said
        );
    }
}

#[test]
fn an_fmu_that_dies_before_or_after_the_run() {
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), "DIES_WHEN_LOADED", "");
    fs::write(folder.path().join("rig.toml"), ALONE).unwrap();
    let output = shakebench(folder.path(), &["run", "rig.toml", "--out", "out"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("hostile.fmu") && said.contains("abort"),
        "{said}"
    );
    assert!(!folder.path().join("out").exists());
    survives("DIES_WHEN_FREED", &[]);
}

#[test]
fn one_instance_a_process_is_heeded() {
    let folder = tempfile::tempdir().unwrap();
    pack(
        folder.path(),
        "ONCE",
        "canBeInstantiatedOnlyOncePerProcess=\"true\"",
    );
    let system = r#"
        connections = ["reference.displacement -> a.u", "a.y -> b.u", "b.y -> c.u"]
        [components.a]
        fmu = "hostile.fmu"
        [components.b]
        fmu = "hostile.fmu"
        [components.c]
        fmu = "hostile.fmu"
        [experiment]
        duration = "1 s"
    "#;
    for isolate in ["none", "foreign", "all"] {
        let run = run(folder.path(), system, &["--isolate", isolate]);
        assert_eq!(run.status, Some(0), "{isolate}: {}", run.said);
    }
}

#[test]
fn a_program_under_another_name_runs_fmus_in_processes_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), "HONEST", "");
    fs::write(folder.path().join("rig.toml"), ALONE).unwrap();
    let renamed = folder.path().join("shakebench-0.1");
    fs::copy(env!("CARGO_BIN_EXE_shakebench"), &renamed).unwrap();
    let output = Command::new(renamed)
        .args(["run", "rig.toml", "--out", "out"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn a_process_of_its_own_changes_no_bit() {
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), "HONEST", "");
    let here = run(folder.path(), ALONE, &["--isolate", "none"]);
    let apart = run(folder.path(), ALONE, &[]);
    assert_eq!(here.rows, apart.rows);
    assert!(here.rows.iter().any(|row| row[4] != 0.0));
    let traced = run(folder.path(), ALONE, &["--trace", "calls.txt"]);
    assert_eq!(here.rows, traced.rows);
    let calls = fs::read_to_string(folder.path().join("calls.txt")).unwrap();
    for call in [
        "fmi2Instantiate() -> 0",
        "stop 2,",
        "fmi2DoStep(1.998, 0.002) -> 0",
        "fmi2Terminate() -> 0",
    ] {
        assert!(calls.contains(call), "{call}");
    }
}

/// The steps of several FMUs in another process travel there together; what one of them does there is its
/// own, and the others do what they would do here.
#[test]
fn an_fmu_among_others_in_a_process_is_named_and_changes_nothing_of_theirs() {
    let system = r#"
        connections = ["reference.displacement -> a.u", "a.y -> b.u", "b.y -> c.u"]
        [components.a]
        fmu = "honest.fmu"
        [components.b]
        fmu = "hostile.fmu"
        [components.c]
        fmu = "honest.fmu"
        [experiment]
        duration = "2 s"
    "#;
    for behaviour in ["HONEST", "ENDS", "UNKNOWN_STATUS", "DISCARDS", "SEGFAULT"] {
        let folder = tempfile::tempdir().unwrap();
        pack_as(folder.path(), "honest.fmu", "HONEST", "", "");
        pack(folder.path(), behaviour, "");
        for algorithm in ["jacobi", "gauss-seidel"] {
            let more = ["--algorithm", algorithm, "--isolate"];
            let apart = run(folder.path(), system, &[&more[..], &["foreign"]].concat());
            if !["HONEST", "ENDS"].contains(&behaviour) {
                for word in ["`b`", "hostile.fmu", "fmi2DoStep", "at 1 s"] {
                    assert!(apart.said.contains(word), "{behaviour}: {}", apart.said);
                }
            }
            let rows = apart.rows.len();
            assert!([501, 1000, 1001].contains(&rows), "{behaviour}: {rows}");
            if behaviour == "SEGFAULT" {
                continue;
            }
            let here = run(folder.path(), system, &[&more[..], &["none"]].concat());
            assert_eq!(here.status, apart.status, "{behaviour}: {}", apart.said);
            assert_eq!(here.rows, apart.rows, "{behaviour}, {algorithm}");
        }
    }
}

#[test]
fn an_fmu_that_refuses_get_after_set_runs_and_says_so_once() {
    for isolate in ["none", "foreign"] {
        let folder = tempfile::tempdir().unwrap();
        pack(folder.path(), "STRICT", "");
        let run = run(folder.path(), ALONE, &["--isolate", isolate]);
        assert_eq!(run.status, Some(0), "{isolate}: {}", run.said);
        assert_eq!(
            run.said.matches("refuses to give outputs").count(),
            1,
            "{}",
            run.said
        );
        // y = 2 u of the step before.
        let [reference, y] =
            [1, 4].map(|at| -> Vec<f64> { run.rows.iter().map(|row| row[at]).collect() });
        assert!(
            y[2..]
                .iter()
                .zip(&reference[1..])
                .all(|(y, u)| *y == 2.0 * u)
        );
    }
}

#[test]
fn an_fmu_that_computes_in_its_step_only_is_reported_and_called_without_delay_on_demand() {
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), "LATE", "");
    let run_late = run(folder.path(), ALONE, &[]);
    assert_eq!(run_late.status, Some(0), "{}", run_late.said);
    assert!(
        run_late.said.contains("computes it only in its steps"),
        "{}",
        run_late.said
    );
    let sampled = ALONE.replace("fmu = ", "period = \"2 ms\"\n    fmu = ");
    let run_sampled = run(folder.path(), &sampled, &[]);
    assert!(
        !run_sampled.said.contains("only in its steps"),
        "{}",
        run_sampled.said
    );
    assert!(run_sampled.rows.iter().all(|row| row[4] == 2.0 * row[1]));
    // What gives its outputs at once, or says that they do not depend directly, is not reported.
    pack(folder.path(), "DIRECT", "");
    let direct = run(folder.path(), ALONE, &[]);
    assert!(
        !direct.said.contains("only in its steps"),
        "{}",
        direct.said
    );
    assert!(direct.rows.iter().all(|row| row[4] == 2.0 * row[1]));
    pack_as(
        folder.path(),
        "hostile.fmu",
        "LATE",
        "",
        "dependencies=\"\"",
    );
    let declared = run(folder.path(), ALONE, &[]);
    assert!(
        !declared.said.contains("only in its steps"),
        "{}",
        declared.said
    );
}

#[test]
fn an_open_input_keeps_its_start_value_and_a_line_says_so() {
    let folder = tempfile::tempdir().unwrap();
    pack(folder.path(), "DIRECT", "");
    let system = ALONE.replace("connections = [\"reference.displacement -> it.u\"]", "");
    let run = run(folder.path(), &system, &[]);
    assert_eq!(run.status, Some(0), "{}", run.said);
    assert!(
        run.said
            .contains("`it`: the open input `u` (0.25) keeps its start value"),
        "{}",
        run.said
    );
    // Time and the output: nothing reads the motion.
    assert!(run.rows.iter().all(|row| row[1] == 0.5));
}

//! Components that fail while they run, and systems that ask to end a run: the status is 1, what
//! was computed is saved, and the message says what happened.

use std::fs;
use std::path::Path;

use crate::{shakebench, stderr, stdout};

/// A table under displacement control beside a component that fails on demand.
fn system(folder: &Path, version: pack::FmiVersion, faulty: &str, experiment: &str) {
    let packed =
        pack::build_component("tests/importers/faulty", &folder.join("fmus"), &[version]).unwrap();
    let text = format!(
        r#"
        connections = [
            "reference.displacement -> control.reference_displacement",
            "table.displacement -> control.measured_displacement",
            "control.valve_command -> table.valve_command",
            "control.valve_command -> watch.level",
        ]
        [components.control]
        fmu = "DisplacementPid"
        [components.table]
        fmu = "ShakeTable"
        inputs = {{ specimen_force = 0 }}
        [components.watch]
        fmu = "{}"
        inputs = {{ enabled = true, offset = 2, label = "watch", "tap[1]" = 1, "tap[2]" = 2, "tap[3]" = 3 }}
        parameters = {{ gain = "500 mV/V", {faulty} }}
        [experiment]
        duration = "2 s"
        {experiment}
        "#,
        packed[0].path.display()
    );
    fs::write(folder.join("rig.toml"), text).unwrap();
}

/// Runs the system; returns what it said and the rows of its results.
#[track_caller]
fn run(folder: &Path, status: i32, ended: &str) -> (String, usize) {
    let output = shakebench(folder, &["run", "rig.toml", "--out", "out", "--json"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(status), "{said}");
    let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(summary["ended"], ended);
    let results = fs::read_to_string(folder.join("out/results.csv")).unwrap();
    assert!(folder.join("out/report.html").is_file());
    (said, results.lines().count() - 1)
}

#[test]
fn a_failing_component_ends_the_run_and_what_was_computed_is_saved() {
    for version in pack::FmiVersion::ALL {
        let prefix = version.folder();
        // 500 steps of 2 ms work.
        for (fault, rows, words) in [
            ("panic_in_step", 501, ["DoStep", "at 1 s", "on demand"]),
            (
                "error_in_step",
                501,
                ["DoStep", "at 1 s", "refused on demand"],
            ),
            ("nan", 500, ["`value`", "at 0.998 s", "NaN"]),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let faulty = format!("fault = \"{fault}\", fault_after = 500");
            system(folder.path(), version, &faulty, "");
            let (said, saved) = run(folder.path(), 1, "failed");
            for word in [
                "the run ended early",
                "`watch`",
                "Faulty.fmu",
                prefix,
                "saved",
            ] {
                assert!(said.contains(word), "{fault}: `{word}` is not in: {said}");
            }
            for word in words {
                assert!(said.contains(word), "{fault}: `{word}` is not in: {said}");
            }
            assert_eq!(saved, rows, "{fault}");
        }
    }
}

#[test]
fn without_a_fault_it_runs_to_its_end_with_values_of_every_type() {
    let folder = tempfile::tempdir().unwrap();
    system(folder.path(), pack::FmiVersion::V2, "fault = \"none\"", "");
    let (_, rows) = run(folder.path(), 0, "complete");
    assert_eq!(rows, 1000);
    let results = fs::read_to_string(folder.path().join("out/results.csv")).unwrap();
    let (header, last) = (
        results.lines().next().unwrap(),
        results.lines().last().unwrap(),
    );
    let value = |name: &str| {
        let place = header.split(',').position(|column| column == name).unwrap();
        last.split(',').nth(place).unwrap().parse::<f64>().unwrap()
    };
    assert_eq!(value("watch.active"), 1.0);
    assert_eq!(value("watch.count"), 999.0);
    assert_eq!(value("watch.sum"), 6.0);
    assert_eq!(value("watch.value"), 0.5 * value("control.valve_command"));
}

#[test]
fn an_output_that_ends_the_run_is_named_with_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let end = "end_when = \"watch.active\"\n end_after = \"0.1 s\"";
    system(folder.path(), pack::FmiVersion::V3, "fault = \"none\"", end);
    let (said, rows) = run(folder.path(), 1, "interlock");
    assert!(
        said.contains("`watch.active` became true at 0.000 s"),
        "{said}"
    );
    assert_eq!(rows, 51);
}

#[test]
fn a_component_that_cannot_be_initialized_is_input_at_fault() {
    let folder = tempfile::tempdir().unwrap();
    system(
        folder.path(),
        pack::FmiVersion::V3,
        "fault = \"refuse\"",
        "",
    );
    crate::refused(
        folder.path(),
        &["run", "rig.toml"],
        &["`watch`", "`fault` is 5 (refuse)"],
    );
}

//! Iterative control: the drive is corrected from run to run.

use std::fs;

use serde_json::Value;

use crate::{shakebench, stderr, stdout};

/// Three-variable control on the physical rig, seed 1.
const RIG: [&str; 6] = [
    "iterate",
    "three-variable",
    "--plant",
    "servohydraulic",
    "--specimen",
    "yielding",
];

#[test]
fn three_corrections_make_the_error_smaller_and_the_drive_is_written_and_read() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        &RIG[..],
        &["--dummy-mass", "25 lbm", "--out", "out", "--json"],
    ]
    .concat();
    let output = shakebench(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let runs = found["runs"].as_array().unwrap();
    let error = |run: &Value| run["time_domain_percent"].as_f64().unwrap();
    let errors: Vec<f64> = runs.iter().map(error).collect();
    println!("{errors:.2?} %, {}", found["stop"]);
    let best = errors[found["best"].as_u64().unwrap() as usize];
    assert!(best < 0.8 * errors[0], "{errors:?}");
    assert!(found["converges"].as_bool().unwrap());
    // Exposure counts every run on the specimen.
    let exposure = runs.last().unwrap()["exposure"].as_f64().unwrap();
    assert!((exposure / runs.len() as f64 - 1.0).abs() < 0.2);

    // The drive, read again, gives the best run again.
    let again = ["--drive", "out/drive.csv", "--iterations", "0", "--json"];
    let output = shakebench(folder.path(), &[&RIG[..], &again].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let replayed: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert!((error(&replayed["runs"][0]) - best).abs() < 1e-9);
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("Iterative control: three-variable on synthetic-1"));
}

#[test]
fn what_cannot_be_iterated_is_said_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, expected) in [
        (&["--gain", "1.5"][..], "--gain"),
        (&["--band", "9", "3"], "--band"),
        (&["--exposure", "0.5"], "--exposure"),
        (&["--drive", "none.csv"], "none.csv"),
    ] {
        let output = shakebench(folder.path(), &[&["iterate"][..], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let said = stderr(&output);
        assert!(said.contains(expected), "{said}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

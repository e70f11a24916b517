//! `report`: the page again from the other files of a folder.

use std::fs;
use std::path::Path;

use crate::{shakebench, stderr, stdout};

fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = shakebench(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    stdout(&output)
}

/// The page that was written and the one that `report` makes without it.
fn twice(folder: &Path) -> [String; 2] {
    let page = folder.join("out/report.html");
    let first = fs::read_to_string(&page).unwrap();
    fs::remove_file(&page).unwrap();
    let said = done(folder, &["report", "out"]);
    assert!(said.contains("report.html"), "{said}");
    [first, fs::read_to_string(&page).unwrap()]
}

#[test]
fn the_report_of_a_run_is_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    done(folder, &["run", "displacement-pid", "--out", "out"]);
    let [first, again] = twice(folder);
    assert!(first == again, "the pages differ");
    // It is read, not repeated: another figure shows.
    let summary = folder.join("out/summary.json");
    let mut json: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&summary).unwrap()).unwrap();
    json["tracking"]["time_domain_percent"] = 87.65.into();
    fs::write(&summary, json.to_string()).unwrap();
    assert!(twice(folder)[1].contains("acceleration error of 87.65 %"));
}

#[test]
fn a_run_that_played_the_beginning_keeps_the_figures_of_the_whole_motion() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = ["run", "three-variable", "--duration", "3 s", "--out", "out"];
    done(folder, &run);
    let [first, again] = twice(folder);
    // Up to the plots, which show what was played.
    let figures = |page: &str| page.split("Time histories").next().unwrap().to_string();
    assert!(figures(&first).contains("of the reference"));
    assert_eq!(figures(&first), figures(&again));
}

#[test]
fn the_report_of_a_comparison_is_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut reference =
        "time [s],displacement [m],velocity [m/s],acceleration [m/s^2]\n".to_string();
    for n in 0..1500 {
        let (t, w, a) = (f64::from(n) * 0.002, 6.0_f64, 0.004);
        let (sine, cosine) = (w * t).sin_cos();
        let (v, c) = (a * w * sine, a * w * w * cosine);
        reference += &format!("{t},{},{v},{c}\n", a * (1.0 - cosine));
    }
    fs::write(folder.join("sine.csv"), reference).unwrap();
    let controllers = "three-variable,displacement-pid";
    let arguments = [
        "compare",
        "--controllers",
        controllers,
        "--reference",
        "sine.csv",
    ];
    done(folder, &[&arguments[..], &["--out", "out"]].concat());
    let [first, again] = twice(folder);
    assert!(first.contains("error on sine"), "there are no plots");
    assert!(first == again, "the pages differ");
}

#[test]
fn finished_runs_and_systems_are_compared_on_one_motion() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let json = |arguments: &[&str]| -> serde_json::Value {
        let said = done(folder, &[arguments, &["--json", "-q"]].concat());
        serde_json::from_str(&said).unwrap()
    };
    let run = ["run", "three-variable", "--seed", "3", "--duration", "1 s"];
    json(&[&run[..], &["--set", "control.valve_limit=5 V", "-o", "a"]].concat());
    let found = json(&["compare", "a", "displacement-pid", "-o", "both"]);
    let runs = found["runs"].as_array().unwrap();
    let of = |n: usize, key: &str| runs[n][key].as_str().unwrap();
    assert_eq!(of(0, "label"), "a");
    assert_eq!(of(1, "system"), "displacement-pid");
    assert_eq!(of(1, "motion"), "synthetic-3");
    // The controllers are different models: no row for each of their parameters.
    let rows = found["differences"].as_array().unwrap();
    let what: Vec<&str> = rows
        .iter()
        .map(|row| row["what"].as_str().unwrap())
        .collect();
    assert!(what.contains(&"control"), "{what:?}");
    assert!(
        what.iter().all(|row| !row.starts_with("control.")),
        "{what:?}"
    );

    // The same run by the former word, and of systems alone with a parameter of one of them.
    let again = json(&["compare-runs", "a", "both/displacement-pid", "-o", "again"]);
    assert_eq!(again["runs"][1]["tracking"], runs[1]["tracking"]);
    let systems = [
        "compare",
        "displacement-pid",
        "three-variable",
        "--seed",
        "3",
    ];
    let more = [
        "--duration",
        "1 s",
        "--set",
        "control.valve_limit=5 V",
        "-o",
        "c",
    ];
    let rows = json(&[&systems[..], &more].concat());
    let error = |row: &serde_json::Value| row["time_domain_percent"].as_f64().unwrap();
    assert_eq!(
        error(&rows["rows"][1]),
        error(&runs[0]["tracking"]),
        "the limit was not set"
    );

    let refused = |arguments: &[&str], word: &str| {
        let output = shakebench(folder, arguments);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(word), "{}", stderr(&output));
    };
    refused(&["compare", "a", "both", "--seed", "4"], "--seed");
    refused(&["compare", "a"], "one run");
    refused(&["compare", "a", "nothing"], "nothing");
    refused(&["compare", "mpc", "--set", "other.x=1"], "other.x=1");
}

#[test]
fn folders_and_files_at_fault_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let complaint = |words: &[&str]| {
        let output = shakebench(folder, &["report", "out"]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        for word in words {
            assert!(said.contains(word), "`{word}` is not in: {said}");
        }
        assert!(!folder.join("out/report.html").exists());
    };
    complaint(&["error: out: is not a folder"]);
    fs::create_dir(folder.join("out")).unwrap();
    complaint(&[
        "out: contains no results",
        "results.csv",
        "comparison.json",
        "diagnosis.json",
    ]);
    for name in ["comparison.json", "diagnosis.json"] {
        fs::write(folder.join("out").join(name), "{}").unwrap();
        complaint(&[name, "missing field"]);
        fs::remove_file(folder.join("out").join(name)).unwrap();
    }
    fs::write(folder.join("out/results.csv"), "").unwrap();
    complaint(&["manifest.json"]);
    fs::remove_file(folder.join("out/results.csv")).unwrap();

    let run = [
        "run",
        "displacement-pid",
        "--duration",
        "1 s",
        "--out",
        "out",
    ];
    done(folder, &run);
    fs::remove_file(folder.join("out/report.html")).unwrap();
    let results = folder.join("out/results.csv");
    let text = fs::read_to_string(&results).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    fs::write(&results, [lines[0], lines[1], "0.002,x"].join("\n")).unwrap();
    complaint(&["results.csv", "line: 3"]);
    let broken = lines[2].replacen("0.002", "soon", 1);
    fs::write(&results, [lines[0], lines[1], &broken].join("\n")).unwrap();
    complaint(&["results.csv: line 3: `soon` is not a number"]);
    fs::write(&results, text.replacen("reference.velocity", "other", 1)).unwrap();
    complaint(&["results.csv", "no column `reference.velocity`"]);
    fs::remove_file(folder.join("out/summary.json")).unwrap();
    complaint(&["summary.json"]);
}

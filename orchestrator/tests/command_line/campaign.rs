//! Studies: one row per run, whoever carried it out and however often it was stopped.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::{refused, shakebench, stderr, stdout};

const STUDY: &str = r#"
[study]
design = "sobol"
runs = 24
seed = 3
[fixed]
specimen = "yielding"
plant = "servohydraulic"
duration = "4 s"
[factors]
controller = ["three-variable", "displacement-pid"]
seed = [1, 2]
pga = { uniform = ["0.05 g", "0.15 g"] }
"table.bulk_modulus" = { normal = [1.0, "5 %"], relative = true }
"specimen.yield_force" = { uniform = ["4 lbf", "8 lbf"] }
[limits]
"specimen.drift" = "0.2 in"
"#;

fn write(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).unwrap();
}

/// Carries `study` out into `out`, and gives what it prints.
#[track_caller]
fn carried(folder: &Path, study: &str, out: &str, more: &[&str]) -> serde_json::Value {
    let mut arguments = vec!["campaign", study, "--out", out, "--json"];
    arguments.extend(more);
    let output = shakebench(folder, &arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

/// The results of the study in `out`: the table in both forms.
fn results(folder: &Path, out: &str) -> [Vec<u8>; 2] {
    ["runs.csv", "runs.parquet"].map(|name| fs::read(folder.join(out).join(name)).unwrap())
}

fn cells(folder: &Path, out: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let mut reader = csv::Reader::from_path(folder.join(out).join("runs.csv")).unwrap();
    let words = |record: &csv::StringRecord| record.iter().map(String::from).collect::<Vec<_>>();
    let head = words(reader.headers().unwrap());
    let rows = reader.records().map(|row| words(&row.unwrap())).collect();
    (head, rows)
}

/// A row is what `shakebench run` gives for the same rig, to the last digit.
#[test]
fn a_row_is_the_run_that_it_names() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "study.toml", STUDY);
    let said = carried(folder.path(), "study.toml", "out", &[]);
    assert_eq!(said["runs"], 24);
    assert_eq!(said["failed"], 0, "{said}");
    let (head, rows) = cells(folder.path(), "out");
    let place = |name: &str| head.iter().position(|own| own.starts_with(name)).unwrap();
    assert_eq!(
        head[place("specimen.yield_force")],
        "specimen.yield_force [N]"
    );
    for row in [&rows[0], &rows[17]] {
        let of = |name: &str| row[place(name)].as_str();
        let set = [
            format!("table.bulk_modulus={} Pa", of("table.bulk_modulus")),
            format!("specimen.yield_force={} N", of("specimen.yield_force")),
        ];
        let pga = format!("{} g", of("pga "));
        let arguments = [
            "run",
            of("controller"),
            "--plant",
            "servohydraulic",
            "--specimen",
            "yielding",
            "--duration",
            "4 s",
            "--seed",
            of("seed"),
            "--pga",
            &pga,
            "--set",
            &set[0],
            "--set",
            &set[1],
            "--out",
            of("run"),
            "--json",
        ];
        let output = shakebench(folder.path(), &arguments);
        let run: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
        for figure in ["time_domain_percent", "peak_displacement_m", "delay_s"] {
            assert_eq!(run["tracking"][figure].to_string(), of(figure), "{figure}");
        }
        assert_eq!(run["ended"], of("ended"));
        let traces = folder.path().join(of("run")).join("results.csv");
        let mut traces = csv::Reader::from_path(traces).unwrap();
        let drift = traces
            .headers()
            .unwrap()
            .iter()
            .position(|name| name == "specimen.drift");
        let drift = drift.unwrap();
        let peak = traces.records().fold(0.0, |most: f64, row| {
            most.max(row.unwrap()[drift].parse::<f64>().unwrap().abs())
        });
        assert_eq!(of("peak.specimen.drift").parse::<f64>().unwrap(), peak);
    }
}

#[test]
fn shards_rows_and_a_study_in_one_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(folder, "study.toml", STUDY);
    carried(folder, "study.toml", "whole", &["--jobs", "1"]);
    for shard in ["1/3", "2/3", "3/3"] {
        let said = carried(folder, "study.toml", "parts", &["--shard", shard]);
        assert_eq!(said["runs"], 8);
    }
    let said = carried(folder, "study.toml", "parts", &[]);
    assert_eq!(said["from_before"], 24);
    assert_eq!(results(folder, "whole"), results(folder, "parts"));
    fs::create_dir_all(folder.join("printed/journal")).unwrap();
    for rows in ["0-9", "9-24"] {
        let output = shakebench(folder, &["campaign", "study.toml", "--rows", rows]);
        assert!(output.status.success(), "{}", stderr(&output));
        fs::write(
            folder.join(format!("printed/journal/{rows}.jsonl")),
            output.stdout,
        )
        .unwrap();
    }
    assert_eq!(
        carried(folder, "study.toml", "printed", &[])["from_before"],
        24
    );
    assert_eq!(results(folder, "whole"), results(folder, "printed"));
}

#[test]
fn a_study_that_is_killed_ten_times_ends_as_one_that_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(
        folder,
        "study.toml",
        &STUDY.replace("runs = 24", "runs = 60"),
    );
    carried(folder, "study.toml", "whole", &[]);
    let journal = folder.join("out/journal/all.jsonl");
    let length = || fs::metadata(&journal).map_or(0, |file| file.len());
    for kill in 0..10 {
        let before = length();
        let program = env!("CARGO_BIN_EXE_shakebench");
        let mut child = Command::new(program)
            .args(["campaign", "study.toml", "--out", "out"])
            .current_dir(folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let deadline = Instant::now() + Duration::from_secs(60);
        // After a few rows, at a moment that depends on the kill.
        while length() < before + 100 && child.try_wait().unwrap().is_none() {
            assert!(Instant::now() < deadline, "no row came");
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_millis(7 * kill));
        child.kill().unwrap();
        child.wait().unwrap();
        // A line that was cut off in the middle.
        let mut bytes = fs::read(&journal).unwrap();
        if kill % 3 == 1 {
            bytes.truncate(bytes.len() - 5);
        } else if kill % 3 == 2 {
            bytes.extend(b"{\"run\":\"0123");
        }
        fs::write(&journal, bytes).unwrap();
    }
    carried(folder, "study.toml", "out", &[]);
    assert_eq!(results(folder, "whole"), results(folder, "out"));
}

#[test]
fn a_study_is_extended_without_repeating() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(folder, "study.toml", STUDY);
    carried(folder, "study.toml", "out", &[]);
    let more = STUDY.replace("runs = 24", "runs = 32");
    write(folder, "study.toml", &more);
    let said = carried(folder, "study.toml", "out", &[]);
    assert_eq!(
        (&said["runs"], &said["from_before"]),
        (&32.into(), &24.into())
    );
    carried(folder, "study.toml", "anew", &[]);
    assert_eq!(results(folder, "out"), results(folder, "anew"));
    // The same runs on another order of the file's lines are the same runs.
    let mut lines: Vec<&str> = more.lines().collect();
    let at = lines
        .iter()
        .position(|line| line.starts_with("pga"))
        .unwrap();
    lines.swap(at, at - 1);
    write(folder, "study.toml", &lines.join("\n"));
    assert_eq!(carried(folder, "study.toml", "out", &[])["from_before"], 32);
}

#[test]
fn a_run_that_cannot_begin_is_a_row_that_no_figure_counts() {
    let folder = tempfile::tempdir().unwrap();
    let study = r#"
        [study]
        design = "full"
        [fixed]
        plant = "identified"
        duration = "2 s"
        pga = "0.22 g"
        [factors]
        seed = [1, 3]
    "#;
    write(folder.path(), "study.toml", study);
    let output = shakebench(folder.path(), &["campaign", "study.toml", "--out", "out"]);
    // The second motion does not fit into the stroke, which is known before the first run.
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("seed = 3"), "{}", stderr(&output));
    // That one of all combinations does not is found when it is run.
    let study = r#"
        [study]
        design = "full"
        [fixed]
        plant = "identified"
        duration = "2 s"
        [factors]
        seed = [1, 3]
        pga = ["0.15 g", "0.22 g"]
    "#;
    write(folder.path(), "study.toml", study);
    let said = carried(folder.path(), "study.toml", "out", &[]);
    assert_eq!(
        (&said["runs"], &said["failed"], &said["invalid"]),
        (&4.into(), &0.into(), &1.into()),
        "{said}"
    );
    let (head, rows) = cells(folder.path(), "out");
    let place = |name: &str| head.iter().position(|own| own == name).unwrap();
    let invalid: Vec<_> = rows
        .iter()
        .filter(|row| row[place("ended")] == "invalid")
        .collect();
    assert_eq!(invalid.len(), 1);
    assert_eq!(
        (
            invalid[0][place("pga [g]")].as_str(),
            invalid[0][place("seed")].as_str()
        ),
        ("0.22", "3")
    );
    assert!(invalid[0][place("reason")].contains("exceeds the stroke"));
    assert_eq!(invalid[0][place("time_domain_percent")], "");
    let found = fs::read_to_string(folder.path().join("out/findings.json")).unwrap();
    let found: serde_json::Value = serde_json::from_str(&found).unwrap();
    assert_eq!(found["groups"][0]["endings"]["runs"], 3);
    assert_eq!(found["invalid"][0]["runs"], 1);
    let worst = found["worst"].as_array().unwrap();
    assert!(
        worst.iter().all(|run| run["ended"] == "complete"),
        "{found}"
    );
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("1 more could not begin and are not counted"));
}

#[test]
fn rows_of_another_version_are_not_mixed_in() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(
        folder,
        "study.toml",
        &STUDY.replace("runs = 24", "runs = 2"),
    );
    carried(folder, "study.toml", "out", &[]);
    let journal = folder.join("out/journal/all.jsonl");
    let text = fs::read_to_string(&journal).unwrap();
    let version = format!("\"shakebench\":\"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(text.contains(&version));
    fs::write(&journal, text.replace(&version, "\"shakebench\":\"0.0.1\"")).unwrap();
    let output = shakebench(folder, &["campaign", "study.toml", "--out", "out"]);
    assert_eq!(output.status.code(), Some(2));
    let said = stderr(&output);
    for word in ["all.jsonl", "0.0.1", "--force"] {
        assert!(said.contains(word), "{said}");
    }
    let said = carried(folder, "study.toml", "out", &["--force"]);
    assert_eq!(
        (&said["runs"], &said["from_before"]),
        (&2.into(), &0.into())
    );
}

#[test]
fn what_is_wrong_with_a_study_is_said_before_its_first_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let refuse = |from: &str, to: &str, words: &[&str]| {
        assert!(STUDY.contains(from), "{from}");
        write(folder, "study.toml", &STUDY.replace(from, to));
        let words: Vec<&str> = words.iter().copied().chain(["study.toml"]).collect();
        refused(folder, &["campaign", "study.toml"], &words);
    };
    refuse(
        "table.bulk_modulus",
        "table.bulk_modulos",
        &["table.bulk_modulos", "bulk_modulus"],
    );
    refuse(
        "specimen.yield_force",
        "spcimen.yield_force",
        &["spcimen", "specimen"],
    );
    refuse("[1, 2]", "[]", &["[factors] seed", "empty list"]);
    refuse(
        "[\"0.05 g\", \"0.15 g\"]",
        "[\"0.15 g\", \"0.05 g\"]",
        &["pga", "range", "empty"],
    );
    refuse(
        "[\"0.05 g\", \"0.15 g\"]",
        "[\"0.05 g\", \"2 in\"]",
        &["pga", "in"],
    );
    refuse(
        "\"displacement-pid\"",
        "\"displacment-pid\"",
        &["controller", "displacement-pid"],
    );
    refuse("controller =", "controler =", &["controler", "controller"]);
    refuse("\"sobol\"", "\"sobel\"", &["[study] design", "sobol"]);
    refuse("runs = 24", "runs = 0", &["runs = 0"]);
    refuse(
        "\"specimen.drift\" = \"0.2 in\"",
        "\"specimen.drift\" = \"0.2 lbf\"",
        &["specimen.drift", "lbf"],
    );
    refuse(
        "\"specimen.drift\" = \"0.2 in\"",
        "\"specimen.drift\" = 0.2",
        &["specimen.drift", "unit"],
    );
    refuse(
        "specimen.drift",
        "specimen.drft",
        &["specimen.drft", "specimen.drift"],
    );
    refuse(
        "duration = \"4 s\"",
        "duration = \"4 s\"\nseed = 1",
        &["seed", "fixed and varies"],
    );
    refuse(
        "duration = \"4 s\"",
        "record = \"no.AT2\"",
        &["record", "seed"],
    );
    refuse(
        "seed = [1, 2]",
        "record = [\"no.AT2\"]",
        &["record", "no.AT2"],
    );
    refuse("seed = 3", "seed = 3\ncross = [\"pga\"]", &["cross", "pga"]);
    refuse(
        "seed = 3",
        "seed = 3\nintensity = \"pga_m\"",
        &["intensity", "pga_g"],
    );
    refuse("[study]", "[study", &["expected"]);
    refused(folder, &["campaign", "none.toml"], &["none.toml"]);
}

#[test]
fn crossed_factors_share_their_points() {
    let folder = tempfile::tempdir().unwrap();
    let study = STUDY.replace("runs = 24", "runs = 5\ncross = [\"controller\"]");
    write(folder.path(), "study.toml", &study);
    let output = shakebench(
        folder.path(),
        &["campaign", "study.toml", "--plan", "--json"],
    );
    let plan: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(plan["runs"], 10);
    carried(folder.path(), "study.toml", "out", &[]);
    let (head, rows) = cells(folder.path(), "out");
    let place = |name: &str| head.iter().position(|own| own.starts_with(name)).unwrap();
    for pair in rows.chunks(2) {
        assert_eq!(pair[0][place("controller")], "three-variable");
        assert_eq!(pair[1][place("controller")], "displacement-pid");
        for name in ["pga ", "seed", "table.bulk_modulus", "specimen.yield_force"] {
            assert_eq!(pair[0][place(name)], pair[1][place(name)]);
        }
    }
}

/// A study of a system that others wrote, without a motion: what its file refers to is part of its runs.
#[test]
fn a_system_file_counts_with_all_that_it_refers_to() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let system = r#"
        connections = ["drive.a -> specimen.table_acceleration"]
        [components.specimen]
        fmu = "Specimen"
        [tables.drive]
        file = "drive.csv"
    "#;
    let study = r#"
        [study]
        design = "full"
        [fixed]
        system = "own.toml"
        duration = "2 s"
        [factors]
        "specimen.mass" = { range = ["20 kg", "40 kg"], steps = 3 }
        [limits]
        "specimen.force" = "1 N"
    "#;
    write(folder, "own.toml", system);
    write(folder, "study.toml", study);
    let drive = |size: f64| {
        write(
            folder,
            "drive.csv",
            &format!("time [s],a [m/s2]\n0,0\n1,{size}\n2,0\n"),
        )
    };
    drive(1.0);
    let said = carried(folder, "study.toml", "out", &[]);
    assert_eq!(
        (&said["runs"], &said["complete"]),
        (&3.into(), &3.into()),
        "{said}"
    );
    let force = |row: &[String], head: &[String]| {
        let place = head
            .iter()
            .position(|name| name == "peak.specimen.force")
            .unwrap();
        row[place].parse::<f64>().unwrap()
    };
    let (head, rows) = cells(folder, "out");
    let small = force(&rows[0], &head);
    assert!(small > 0.0);
    assert_eq!(carried(folder, "study.toml", "out", &[])["from_before"], 3);
    drive(2.0);
    assert_eq!(carried(folder, "study.toml", "out", &[])["from_before"], 0);
    let (head, rows) = cells(folder, "out");
    let large = force(&rows[0], &head);
    assert!((large / small - 2.0).abs() < 1e-6, "{small}, {large}");
}

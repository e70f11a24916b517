//! Benchmarks as scripts use them.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::path::Path;
use std::process::{Command, Output};

/// Runs the program that `shakebench benchmark` starts.
fn benchmark(folder: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_shakebench-hybrid");
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output();
    output.unwrap_or_else(|error| panic!("{program}: {error}"))
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The run is refused with status 2 and a message that has all the `words`; nothing is written.
#[track_caller]
fn refused(folder: &Path, arguments: &[&str], words: &[&str]) {
    let output = benchmark(folder, &[arguments, &["--out", "out"]].concat());
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    assert_eq!(stdout(&output), "", "{arguments:?}");
    for word in words {
        assert!(said.contains(word), "`{word}` is not in: {said}");
    }
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), 0, "{said}");
}

#[test]
fn scores_are_one_json_object_and_repeat() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "vrths",
        "--case",
        "1",
        "--motion",
        "built-in",
        "--controller",
        "inverse,adaptive-inverse",
        "--perturbed",
        "1",
        "--seed",
        "5",
        "--json",
        "--out",
        "scores",
    ];
    let scores = || {
        let output = benchmark(folder.path(), &arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        serde_json::from_str::<serde_json::Value>(&stdout(&output)).unwrap()
    };
    let first = scores();
    let controllers = first["controllers"].as_object().unwrap();
    assert_eq!(controllers.len(), 2);
    for score in controllers.values() {
        assert_eq!(score["runs"], 2);
        assert_eq!(score["unstable"], 0);
        for figures in ["mean", "max"] {
            assert_eq!(score[figures].as_array().unwrap().len(), 9);
            assert!(score["true_tracking_percent"][figures].is_number());
        }
    }
    assert!(first["wall_s"].is_number());
    assert_eq!(scores()["controllers"], first["controllers"]);
    for file in ["report.html", "scores.json", "runs.csv"] {
        assert!(folder.path().join("scores").join(file).exists(), "{file}");
    }
}

#[test]
fn what_cannot_be_benchmarked_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (options, words) in [
        (["--case", "5"], ["--case", "1, 2, 3 or 4"]),
        (
            ["--controller", "adaptive-invers"],
            ["--controller", "did you mean `adaptive-inverse`"],
        ),
        (["--motion", "el-centr"], ["--motion", "el-centro"]),
        (["--motion", "none.csv"], ["none.csv", "no such file"]),
        (["--data", "nowhere"], ["nowhere", "folder not found"]),
        (["--intensity", "-1"], ["--intensity", "positive"]),
        (["--corners", "0"], ["--corners", "standard deviations"]),
        (
            ["--hidden", "dealy=1 ms"],
            ["--hidden", "did you mean `delay`"],
        ),
        (["--hidden", "delay"], ["EFFECT=VALUE", "valve_play"]),
        (["--hidden", "delay=1 mm"], ["--hidden", "delay=1 mm"]),
        (["--hidden", "valve_play=-1 mm"], ["--hidden", "valve_play"]),
    ] {
        let [option, value] = options;
        let argument = format!("{option}={value}");
        refused(folder.path(), &["vrths", &argument], &words);
    }
}

/// A diagnosis takes minutes, so what would be lost is told before.
#[test]
fn a_record_that_would_be_overwritten_is_told_before_it_is_diagnosed() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("record.csv"), "mine\n").unwrap();
    let begun = std::time::Instant::now();
    let arguments = [
        "vrths",
        "--hidden=valve_play=0.2 mm",
        "--case=1",
        "--motion=built-in",
        "--out=out",
    ];
    let output = benchmark(folder.path(), &arguments);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("record.csv") && said.contains("--force"),
        "{said}"
    );
    println!("refused after {:.1} s", begun.elapsed().as_secs_f64());
    let kept = std::fs::read_dir(&out).unwrap().count();
    assert_eq!(kept, 1);
    assert_eq!(
        std::fs::read_to_string(out.join("record.csv")).unwrap(),
        "mine\n"
    );
}

#[test]
fn two_actuators_are_scored_by_class_and_repeat() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "marths",
        "--motion",
        "built-in",
        "--controller",
        "rodeac,adaptive-predictive-estimate",
        "--perturbed",
        "1",
        "--json",
        "--out",
        "scores",
    ];
    let scores = || {
        let output = benchmark(folder.path(), &arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        serde_json::from_str::<serde_json::Value>(&stdout(&output)).unwrap()
    };
    let first = scores();
    let classes = [
        ("rodeac", "raw"),
        ("adaptive-predictive-estimate", "estimate"),
    ];
    for (name, class) in classes {
        let score = &first["controllers"][name];
        assert_eq!(score["class"], class);
        assert_eq!((&score["runs"], &score["unstable"]), (&2.into(), &0.into()));
        for column in ["J2_1", "J3_2", "true_J2_1", "H8"] {
            assert!(score["mean"][column].as_f64() <= score["max"][column].as_f64());
        }
        assert!(first["nominal"][name]["built-in"]["J10_th3"].is_number());
    }
    assert_eq!(scores()["controllers"], first["controllers"]);
    for file in ["report.html", "scores.json", "runs.csv"] {
        assert!(folder.path().join("scores").join(file).exists(), "{file}");
    }
    let folder = tempfile::tempdir().unwrap();
    for (argument, words) in [
        ("--controller=rodeak", ["--controller", "rodeac"]),
        ("--motion=kobi", ["--motion", "kobe"]),
    ] {
        refused(folder.path(), &["marths", argument], &words);
    }
}

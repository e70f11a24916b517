//! Benchmarks as scripts use them.

use crate::{refused, shakebench, stderr, stdout};

#[test]
fn scores_are_one_json_object_and_repeat() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "benchmark",
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
        let output = shakebench(folder.path(), &arguments);
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
        (["--data", "nowhere"], ["nowhere", "no such folder"]),
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
        refused(folder.path(), &["benchmark", "vrths", &argument], &words);
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
        "benchmark",
        "vrths",
        "--hidden=valve_play=0.2 mm",
        "--case=1",
        "--motion=built-in",
        "--out=out",
    ];
    let output = shakebench(folder.path(), &arguments);
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

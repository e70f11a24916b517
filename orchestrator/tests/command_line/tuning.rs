//! Controllers tuned over a study.

use std::fs;

use crate::{refused, shakebench, stderr, stdout};

const STUDY: &str = r#"
[study]
design = "full"
[fixed]
controller = "three-variable"
plant = "identified"
specimen = "none"
duration = "8 s"
[factors]
seed = [1, 2, 3]
pga = ["0.05 g", "0.1 g"]
[tune]
evaluations = 14
gain_margin = "8 dB"
phase_margin = "40 deg"
[tune.parameters]
"control.proportional_gain" = ["2 V/in", "20 V/in"]
"control.acceleration_feedforward_gain" = ["-0.005 V s2/in", "0.005 V s2/in"]
"#;

fn tuned(study: &str) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("study.toml"), study).unwrap();
    let arguments = ["tune", "study.toml", "--out", "out", "--json"];
    let output = shakebench(folder.path(), &arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    for file in ["tuned.toml", "tuned.json", "report.html"] {
        assert!(folder.path().join("out").join(file).is_file(), "{file}");
    }
    serde_json::from_str(&stdout(&output)).unwrap()
}

/// The margins of the running components are those that the loop's equations have.
#[test]
fn margins_of_running_components_are_those_of_the_equations() {
    let found = tuned(STUDY);
    let held = &found["before"]["held"];
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "design",
        "--loop",
        "three-variable",
        "--json",
        "--out",
        "out",
    ];
    let output = shakebench(folder.path(), &arguments);
    let design: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let sampled = &design["loops"][0]["sampled"];
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let close = |measured: &str, computed: &str, within: f64| {
        let (a, b) = (number(&held[measured]), number(&sampled[computed]));
        assert!(
            (a - b).abs() < within * b.abs(),
            "{measured}: {a} is not {b}"
        );
    };
    close("gain_margin_db", "gain_margin_db", 0.01);
    close("phase_margin_deg", "phase_margin_deg", 0.02);
    close("crossover", "crossover_rad_s", 0.01);
}

#[test]
fn what_is_found_is_better_where_it_was_not_looked_for_and_keeps_its_margins() {
    let found = tuned(STUDY);
    let number = |path: &str| {
        found
            .pointer(path)
            .and_then(serde_json::Value::as_f64)
            .unwrap()
    };
    assert_eq!(found["held_out"][1], serde_json::json!(["3"]));
    assert_eq!(number("/before/held_out/runs"), 2.0);
    assert!(number("/after/training/quantile") < 0.9 * number("/before/training/quantile"));
    assert!(number("/after/held_out/quantile") < 0.9 * number("/before/held_out/quantile"));
    assert!(number("/after/held/gain_margin_db") >= 8.0);
    assert!(number("/after/held/phase_margin_deg") >= 40.0);
    let trials = found["trials"].as_array().unwrap();
    assert!(trials.len() <= 15, "{}", trials.len());
    for parameter in found["parameters"].as_array().unwrap() {
        let of = |name: &str| parameter[name].as_f64().unwrap();
        assert!((of("low")..=of("high")).contains(&of("after")));
    }
}

#[test]
fn what_is_wrong_with_a_search_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let refuse = |from: &str, to: &str, words: &[&str]| {
        assert!(STUDY.contains(from), "{from}");
        fs::write(folder.path().join("study.toml"), STUDY.replace(from, to)).unwrap();
        refused(folder.path(), &["tune", "study.toml"], words);
    };
    refuse(
        "control.proportional_gain",
        "control.proportional_gian",
        &["[tune]", "proportional_gain"],
    );
    refuse("\"2 V/in\"", "2", &["proportional_gain", "unit"]);
    refuse("\"2 V/in\"", "\"40 V/in\"", &["proportional_gain", "empty"]);
    refuse(
        "evaluations = 14",
        "evaluations = 2",
        &["evaluations", "at least 4"],
    );
    refuse(
        "evaluations = 14",
        "objective = \"error\"",
        &["objective", "error"],
    );
    refuse("\"8 dB\"", "\"8 m\"", &["gain_margin", "dB"]);
    refuse(
        "\"8 dB\"",
        "\"60 dB\"",
        &["no set of parameters", "margins"],
    );
    refuse("[tune]\n", "[tune]\nshare = 1\n", &["share"]);
    let without = &STUDY[..STUDY.find("[tune]").unwrap()];
    refuse(&STUDY[without.len()..], "", &["[tune]", "parameters"]);
}

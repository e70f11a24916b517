//! `diagnose`: its JSON, and that names, order and units of the columns change no verdict.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::{refused, shakebench, stderr, stdout};

/// A practice case beside the repository.
fn practice(name: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let shared = std::env::var_os("SHAKEBENCH_SHARED").map_or_else(beside, PathBuf::from);
    let case = shared.join("hidden-effects/cases").join(name);
    if case.is_dir() {
        return Some(case);
    }
    println!(
        "SKIPPED: {} is missing (set SHAKEBENCH_SHARED)",
        case.display()
    );
    None
}

fn diagnosed(folder: &Path, case: &Path) -> Value {
    let case = case.to_str().unwrap();
    let output = shakebench(folder, &["diagnose", case, "--out", "out", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

/// Copies a case, each CSV through `change`.
fn copied(from: &Path, to: &Path, change: impl Fn(&str) -> String) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().flatten() {
        let mut text = fs::read_to_string(entry.path()).unwrap();
        if entry.path().extension().is_some_and(|e| e == "csv") {
            text = change(&text);
        }
        fs::write(to.join(entry.file_name()), text).unwrap();
    }
}

/// SI units, the columns backwards, and one more of an unknown name.
fn rewritten(text: &str) -> String {
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let si = [
        ("in/s^2", "m/s^2", 0.0254),
        ("in", "m", 0.0254),
        ("lbf", "N", 4.448_221_615_260_5),
    ];
    let mut factors = Vec::new();
    let mut names = Vec::new();
    for cell in header {
        let (name, unit) = cell.trim_end_matches(']').split_once(" [").unwrap();
        let found = si.iter().find(|(own, ..)| *own == unit);
        let (unit, factor) = found.map_or((unit, 1.0), |(_, unit, factor)| (*unit, *factor));
        names.push(format!("{name} [{unit}]"));
        factors.push(factor);
    }
    names.reverse();
    let mut out = format!("oil temperature [K],{}\n", names.join(","));
    for line in lines {
        let values = line
            .split(',')
            .zip(&factors)
            .map(|(cell, factor)| match *factor {
                1.0 => cell.to_string(),
                _ => format!("{:e}", cell.parse::<f64>().unwrap() * factor),
            });
        let mut values: Vec<String> = values.collect();
        values.reverse();
        out += &format!("313,{}\n", values.join(","));
    }
    out
}

#[test]
fn a_diagnosis_has_the_fields_of_the_contract_and_its_files() {
    let Some(case) = practice("dev-03") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let found = diagnosed(folder.path(), &case);
    assert_eq!(found["verdict"], "named");
    let effect = &found["effects"][0];
    assert!(effect["effect"].is_string());
    assert!(effect["confidence"].as_f64().unwrap() > 0.5);
    for parameter in effect["parameters"].as_object().unwrap().values() {
        assert!(parameter["value"].is_f64() && parameter["standard_error"].is_f64());
        assert!(parameter["unit"].is_string());
    }
    assert!(found["alternatives"].is_array());
    let fields = found.as_object().unwrap();
    assert!(fields.contains_key("separating_experiment"));
    let gain = &found["gain"];
    let number = |name: &str| gain[name].as_f64().unwrap();
    assert!(number("before_nrmse") > number("after_nrmse"));
    assert!(number("after_nrmse") > 0.9 * number("noise_floor_nrmse"));
    assert!(gain["interval_95"][0].as_f64() < gain["interval_95"][1].as_f64());
    assert_eq!(gain["record"], "validation");
    assert!(found["wall_s"].as_f64().unwrap() > 0.0);
    let model = folder
        .path()
        .join(found["extended_model"].as_str().unwrap());
    let model: toml::Table = fs::read_to_string(model).unwrap().parse().unwrap();
    assert!(model.contains_key("actuator") && model.contains_key("table"));
    let value = &effect["parameters"]["half_width"]["value"];
    assert_eq!(
        model["effects"]["valve_dead_band"]["half_width"].as_float(),
        value.as_f64()
    );
    // The FMU with the effect, and all four of table and specimen.
    let fmu = found["extended_fmu"].as_str().unwrap();
    assert!(fmu.ends_with("out/fmi3/ShakeTable.fmu") && folder.path().join(fmu).is_file());
    for version in ["fmi2", "fmi3"] {
        for name in ["ShakeTable.fmu", "Specimen.fmu"] {
            assert!(folder.path().join("out").join(version).join(name).is_file());
        }
    }
    assert_eq!(found["extended_fmus"].as_array().unwrap().len(), 4);
    // Whole records in closed loop: far off without the effect, near the noise with it.
    let closed = &found["co_simulation"];
    let ratio = |name: &str| closed[name].as_f64().unwrap();
    assert!(ratio("before_ratio") > 10.0, "{closed}");
    assert!(
        ratio("after_ratio") > 0.9 && ratio("after_ratio") < 2.0,
        "{closed}"
    );
    assert!(closed["interval_95"][0].as_f64().unwrap() > 0.5, "{closed}");
    let written = fs::read_to_string(folder.path().join("out/diagnosis.json")).unwrap();
    let written: Value = serde_json::from_str(&written).unwrap();
    assert_eq!(written, found);
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("Errors against the state"));
    // The page again: refused over the one with pictures, and without them from the JSON.
    let output = shakebench(folder.path(), &["report", "out"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("pictures"), "{}", stderr(&output));
    let page = folder.path().join("out/report.html");
    fs::remove_file(&page).unwrap();
    let output = shakebench(folder.path(), &["report", "out"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let page = fs::read_to_string(page).unwrap();
    for words in [
        found["sentence"].as_str().unwrap(),
        "half_width",
        "The same in closed loop",
    ] {
        assert!(page.contains(words), "`{words}` is not in the page");
    }
}

#[test]
fn names_order_and_units_of_columns_change_no_verdict() {
    let Some(case) = practice("dev-03") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let changed = folder.path().join("changed");
    copied(&case, &changed, rewritten);
    let (plain, other) = (
        diagnosed(folder.path(), &case),
        diagnosed(folder.path(), &changed),
    );
    assert_eq!(plain["verdict"], other["verdict"]);
    let effects = |found: &Value| found["effects"].as_array().unwrap().clone();
    assert_eq!(effects(&plain).len(), effects(&other).len());
    for (one, two) in effects(&plain).iter().zip(&effects(&other)) {
        assert_eq!(one["effect"], two["effect"]);
        for (name, parameter) in one["parameters"].as_object().unwrap() {
            let value = |p: &Value| p["value"].as_f64().unwrap();
            let error = parameter["standard_error"].as_f64().unwrap();
            let apart = (value(parameter) - value(&two["parameters"][name])).abs();
            assert!(
                apart < 0.1 * error,
                "{name}: {apart} apart, standard error {error}"
            );
        }
    }
}

#[test]
fn a_case_that_cannot_be_read_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    refused(folder.path(), &["diagnose", "nowhere"], &["nowhere"]);
    let Some(case) = practice("dev-03") else {
        return;
    };
    let broken = folder.path().join("broken");
    copied(&case, &broken, |text| {
        text.replacen("displacement [in]", "displacement", 1)
    });
    refused(
        folder.path(),
        &["diagnose", "broken"],
        &["broken", ".csv", "displacement", "unit"],
    );
    copied(&case, &broken, str::to_string);
    fs::remove_file(broken.join("validation.csv")).unwrap();
    refused(folder.path(), &["diagnose", "broken"], &["validation.csv"]);
}

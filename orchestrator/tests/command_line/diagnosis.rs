//! `diagnose`: its JSON, and that names, order and units of the columns change no verdict.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::{refused, shakebench, stderr, stdout};

/// A practice case beside the repository.
fn practice(name: &str) -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let shared = std::env::var_os("SHAKEBENCH_SHARED").map_or_else(beside, PathBuf::from);
    shared.join("hidden-effects/cases").join(name)
}

fn diagnosed(folder: &Path, case: &Path) -> Value {
    let case = case.to_str().unwrap();
    let output = shakebench(
        folder,
        &["diagnose", case, "--out", "out", "--json", "--verbose"],
    );
    let told = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert!(told.contains("nominal; score"), "{told}");
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

#[needs::shared("hidden-effects/cases")]
#[test]
fn a_diagnosis_has_the_fields_of_the_contract_and_its_files() {
    let case = practice("dev-03");
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
    let mut written: Value = serde_json::from_str(&written).unwrap();
    written["folder"] = "out".into();
    assert_eq!(written, found);
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("Errors against the state"));
    // The page again: refused over the one with pictures, and without them from the JSON.
    let output = shakebench(folder.path(), &["report", "out"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("plots"), "{}", stderr(&output));
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
    what_the_extended_model_makes_of_a_record(folder.path(), &case);
}

/// Nothing is fitted: a record is scored, and predicted from its reference alone.
fn what_the_extended_model_makes_of_a_record(folder: &Path, case: &Path) {
    let record = case.join("validation.csv");
    let with_model = |more: &[&str]| {
        let model = ["diagnose", "--model", "out/extended_model.toml", "--json"];
        let output = shakebench(folder, &[&model[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        serde_json::from_str::<Value>(&stdout(&output)).unwrap()
    };
    let scored = with_model(&["--validate", record.to_str().unwrap()]);
    let table = &scored["tables"][0];
    let number = |name: &str| table[name].as_f64().unwrap();
    assert!(number("described_in_noise") > 1.5, "{scored}");
    assert!(
        (0.9..1.1).contains(&number("extended_in_noise")),
        "{scored}"
    );
    let records = scored["records"].as_array().unwrap();
    assert_eq!(records.len(), 4);
    assert!(records.iter().all(|own| own["extended_percent"].is_f64()));

    let text = fs::read_to_string(&record).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = |name: &str| head.iter().position(|cell| cell.starts_with(name)).unwrap();
    let (time, reference) = (place("time"), place("reference"));
    let displacement = place("displacement");
    let mut wanted = format!("{},{},displacement [in]\n", head[time], head[reference]);
    let mut measured = Vec::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        wanted += &format!("{},{},\n", cells[time], cells[reference]);
        measured.push(0.0254 * cells[displacement].parse::<f64>().unwrap());
    }
    fs::write(folder.join("wanted.csv"), wanted).unwrap();
    let told = with_model(&["--predict", "wanted.csv", "--out", "prediction.csv"]);
    assert_eq!((&told["given"], &told["unit"]), (&0.into(), &"in".into()));
    let predicted = fs::read_to_string(folder.join("prediction.csv")).unwrap();
    let mut rows = predicted.lines();
    assert!(
        rows.next()
            .unwrap()
            .starts_with("prediction,time [s],displacement [m],")
    );
    let predicted: Vec<f64> = rows
        .map(|row| 0.0254 * row.split(',').next().unwrap().parse::<f64>().unwrap())
        .collect();
    assert_eq!(predicted.len(), measured.len());
    let sum = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let missed = sum(&mut predicted.iter().zip(&measured).map(|(a, b)| a - b));
    // The whole record in closed loop, without a look at it: noise and unseen voltage are all that is missed.
    let share = missed / sum(&mut measured.iter().copied());
    assert!(share < 0.05, "{share}");
}

#[test]
fn an_extended_model_of_a_table_says_what_it_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let told = |words: &[&str], text: &str| {
        fs::write(folder.path().join("model.toml"), text).unwrap();
        fs::write(
            folder.path().join("wanted.csv"),
            "time [s],reference [in]\n0,0\n0.002,0\n",
        )
        .unwrap();
        let output = shakebench(
            folder.path(),
            &[
                "diagnose",
                "--model",
                "model.toml",
                "--predict",
                "wanted.csv",
            ],
        );
        assert_eq!(output.status.code(), Some(2));
        for word in words {
            assert!(stderr(&output).contains(word), "{}", stderr(&output));
        }
    };
    let template = shakebench(folder.path(), &["diagnose", "--template", "table"]);
    let nominal = stdout(&template).replace("nan", "0.1");
    told(&["model.toml", "[described]"], &nominal);
    told(
        &["model.toml", "sample_rate"],
        &nominal.replace("sample_rate", "# sample_rate"),
    );
}

#[needs::shared("hidden-effects/cases")]
#[test]
fn names_order_and_units_of_columns_change_no_verdict() {
    let case = practice("dev-03");
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

#[needs::shared("hidden-effects/cases")]
#[test]
fn a_search_that_runs_out_of_time_names_nothing_and_says_so() {
    let case = practice("dev-03");
    let folder = tempfile::tempdir().unwrap();
    let diagnose = |limit: &str| {
        let case = case.to_str().unwrap();
        let arguments = ["diagnose", case, "--out", "out", "--json"];
        shakebench(
            folder.path(),
            &[&arguments[..], &["--time-limit", limit]].concat(),
        )
    };
    for (limit, words) in [("0 s", "more than 0 s"), ("3 mm", "does not fit \"s\"")] {
        let output = diagnose(limit);
        assert_eq!(output.status.code(), Some(2));
        let said = stderr(&output);
        assert!(
            said.contains("--time-limit") && said.contains(words),
            "{said}"
        );
    }
    let found: Value = serde_json::from_str(&stdout(&diagnose("1 ms"))).unwrap();
    assert_eq!(found["time_limit_reached"], true);
    assert_eq!(found["effects"], Value::Array(Vec::new()), "{found}");
    assert_ne!(found["verdict"], "named");
    let notes = found["notes"].as_array().unwrap();
    let is_said = |note: &Value| note.as_str().unwrap().contains("--time-limit");
    assert!(notes.iter().any(is_said), "{found}");
}

#[test]
fn a_case_that_is_not_there_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    refused(folder.path(), &["diagnose", "nowhere"], &["nowhere"]);
}

#[needs::shared("hidden-effects/cases")]
#[test]
fn a_case_that_cannot_be_read_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let case = practice("dev-03");
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

/// A description of a press whose output comes `delay` samples later than its nominal model says, and
/// its data, in `folder`.
fn press(folder: &Path, delay: usize, left_out: &str) {
    let (step, gain) = (1e-3, 50.0);
    let command = |k: usize| {
        let t = step * k as f64;
        // A sweep from 1 to 7 Hz.
        2e-3 * (std::f64::consts::TAU * (1.0 + t) * t).sin()
    };
    let mut text = String::from("t,command,displacement\n");
    let (mut x, mut seed) = (0.0, 1_u32);
    for k in 0..3000 {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = 2e-6 * (f64::from(seed) / f64::from(u32::MAX) - 0.5);
        text += &format!("{},{},{}\n", step * k as f64, command(k), x + noise);
        let late = if k < delay { 0.0 } else { command(k - delay) };
        x += step * gain * (late - x);
    }
    fs::write(folder.join("data.csv"), text).unwrap();
    let description = format!(
        r#"
name = "Press"
kind = "closed_loop_actuator"
data = ["data.csv"]
[columns]
time = {{ column = "t", unit = "s" }}
command = {{ column = "command", unit = "m" }}
displacement = {{ column = "displacement", unit = "m" }}
[nominal]
loop_gain = {{ value = 48.0, plus_minus = 5.0, unit = "1/s" }}
command_lag = {{ value = 0.0, unit = "s" }}
scale = {{ value = 1.0, unit = "1" }}
offset = {{ value = 0.0, plus_minus = 1e-5, unit = "m" }}
[left_out]
{left_out}
"#
    );
    fs::write(folder.join("press.toml"), description).unwrap();
}

const BLOCKS: &str = r#"every_second_block = { value = 0.25, unit = "s" }"#;

#[test]
fn a_rig_is_reported_as_a_case_is() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    press(folder, 6, BLOCKS);
    let output = shakebench(
        folder,
        &[
            "diagnose",
            "press.toml",
            "--json",
            "--verbose",
            "--out",
            "out",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let told = stderr(&output);
    assert!(
        told.contains("fitting left out") && told.contains("delay ["),
        "{told}"
    );
    let found: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(found["verdict"], "named", "{found:#}");
    let effect = &found["effects"][0];
    assert_eq!(effect["effect"], "delay");
    let delay = &effect["parameters"]["delay"];
    assert!(
        (delay["value"].as_f64().unwrap() - 6e-3).abs() < 1e-3,
        "{delay}"
    );
    assert_eq!(delay["unit"], "s");
    assert!(delay["standard_error"].is_number());
    assert!(effect["confidence"].is_number());
    for name in [
        "alternatives",
        "separating_experiment",
        "extended_fmu",
        "wall_s",
    ] {
        assert!(found.get(name).is_some(), "{name}");
    }
    let gain = &found["gain"];
    assert!(gain["before_nrmse"].as_f64() > gain["after_nrmse"].as_f64());
    assert!(gain["noise_floor_nrmse"].is_null());
    assert_eq!(gain["interval_95"].as_array().unwrap().len(), 2);
    assert_eq!(gain["record"], "left out");
    // Every file, and the JSON that was printed.
    let out = folder.join("out");
    for name in ["report.html", "curves.csv", "error.svg", "close.svg"] {
        assert!(out.join(name).is_file(), "{name}");
    }
    let written = fs::read_to_string(out.join("diagnosis.json")).unwrap();
    let mut written: Value = serde_json::from_str(&written).unwrap();
    written["folder"] = "out".into();
    assert_eq!(written, found);
    let model = fs::read_to_string(out.join("extended_model.toml")).unwrap();
    let model: toml::Table = model.parse().unwrap();
    let estimate = &model["effects"]["delay"]["delay"];
    assert_eq!(estimate["value"].as_float(), delay["value"].as_f64());
    assert_eq!(model["nominal"]["loop_gain"]["unit"].as_str(), Some("1/s"));
    // The page again, with its pictures as long as the curves are there.
    let page = || fs::read_to_string(out.join("report.html")).unwrap();
    let first = page();
    assert!(first.contains("where the nominal model is worst"));
    let again = || shakebench(folder, &["report", "out"]);
    assert_eq!(again().status.code(), Some(0), "{}", stderr(&again()));
    assert_eq!(first.replace("press.toml", "diagnosis.json in out"), page());
    fs::remove_file(out.join("curves.csv")).unwrap();
    let refusal = again();
    assert_eq!(refusal.status.code(), Some(2));
    assert!(stderr(&refusal).contains("plots"), "{}", stderr(&refusal));
    fs::remove_file(out.join("report.html")).unwrap();
    assert_eq!(again().status.code(), Some(0));
    assert!(page().contains("loop_gain") && !page().contains("nominal model is worst"));
}

#[test]
fn the_data_of_a_rig_may_be_spelt_as_a_spreadsheet_does() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    press(folder, 6, BLOCKS);
    let diagnosed = |description: &str| -> Value {
        let arguments = ["diagnose", description, "--json", "--force", "--out", "out"];
        let output = shakebench(folder, &arguments);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        serde_json::from_str(&stdout(&output)).unwrap()
    };
    let plain = diagnosed("press.toml");
    // Byte-order mark, a line above the header, semicolons, decimal commas, ms, Windows line ends.
    let text = fs::read_to_string(folder.join("data.csv")).unwrap();
    let mut lines = text.lines();
    let mut german = format!(
        "\u{feff}Messung 3\r\n{}\r\n",
        lines.next().unwrap().replace(',', ";")
    );
    for (k, line) in lines.enumerate() {
        let (_, rest) = line.split_once(',').unwrap();
        let rest = rest.replace(',', ";").replace('.', ",");
        german += &format!("{k};{rest}\r\n");
    }
    fs::write(folder.join("data.csv"), german).unwrap();
    let description = fs::read_to_string(folder.join("press.toml")).unwrap();
    let description = description.replace(
        r#"column = "t", unit = "s""#,
        r#"column = "t", unit = "ms""#,
    );
    fs::write(folder.join("german.toml"), description).unwrap();
    let other = diagnosed("german.toml");
    assert_eq!(plain["verdict"], other["verdict"]);
    for (one, two) in [(&plain, &other)].map(|(a, b)| (&a["effects"][0], &b["effects"][0])) {
        assert_eq!(one["effect"], two["effect"]);
        let delay = |e: &Value| e["parameters"]["delay"]["value"].as_f64().unwrap();
        let apart = (delay(one) / delay(two) - 1.0).abs();
        assert!(apart < 1e-9, "{apart:e}");
    }
}

#[test]
fn a_rig_that_cannot_be_diagnosed_is_refused_by_place() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    press(folder, 6, "second_half = false");
    refused(
        folder,
        &["diagnose", "press.toml"],
        &["press.toml", "second_half", "holds out no data"],
    );
    press(folder, 6, "third_half = true");
    refused(
        folder,
        &["diagnose", "press.toml"],
        &["press.toml", "line 15", "third_half"],
    );
    press(folder, 6, BLOCKS);
    let path = folder.join("press.toml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replace("kind =", "units = \"SI\"\nkind =")).unwrap();
    refused(
        folder,
        &["diagnose", "press.toml"],
        &["press.toml", "line 3", "units"],
    );
    fs::write(&path, text).unwrap();
    let data = fs::read_to_string(folder.join("data.csv")).unwrap();
    fs::write(
        folder.join("data.csv"),
        data.replacen("\n0.001,", "\nsoon,", 1),
    )
    .unwrap();
    refused(
        folder,
        &["diagnose", "press.toml"],
        &["data.csv", "line 3", "soon"],
    );
}

#[test]
fn data_of_a_case_and_unknown_keys_of_its_model_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::create_dir(folder.join("case")).unwrap();
    let arguments = ["diagnose", "case", "--data", "other.csv"];
    refused(folder, &arguments, &["--data", "identification.csv"]);
    fs::write(folder.join("case/nominal.toml"), "units = \"metric\"\n").unwrap();
    refused(
        folder,
        &["diagnose", "case"],
        &["nominal.toml", "line 1", "units"],
    );
}

//! `diagnose` on rigs: from a CSV and ten lines to a named effect, and the model on later records.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{refused, shakebench, stderr, stdout};

const RATE: f64 = 200.0;
/// kg, N s/m, N/m, N/m3: 5 Hz, 4 % damping; at 10 mm the cubic spring adds a third.
const MASS: f64 = 10.0;
const DAMPING: f64 = 25.0;
const STIFFNESS: f64 = 10_000.0;
const CUBIC: f64 = 3.0e7;

/// Noise without a generator: the fraction of a large multiple of a sine.
fn noise(k: usize) -> f64 {
    let x = (k as f64 * 12.9898).sin() * 43_758.545;
    2.0 * (x - x.floor()) - 1.0
}

/// Force of `tones` between 1 and 10 Hz.
fn force(t: f64, size: f64, shift: f64) -> f64 {
    let tones = [1.3, 2.1, 3.7, 4.4, 5.2, 6.9, 8.3, 9.6];
    let each = tones.iter().enumerate();
    each.map(|(i, f)| size * (std::f64::consts::TAU * f * t + shift * (i * i) as f64).sin())
        .sum()
}

/// A record from rest by Verlet's method at fifty steps a sample, in mm and kN; the transducer's zero
/// lies off by `zero` (mm), and its noise is 5 µm. With `given` below the number of samples the
/// displacements behind are left out.
fn record(samples: usize, size: f64, shift: f64, zero: f64, given: usize) -> (String, Vec<f64>) {
    const STEPS: usize = 50;
    let h = 1.0 / RATE / STEPS as f64;
    let (mut x, mut v) = (0.0, 0.0);
    let mut text = String::from("Time (s);Load (kN);Stroke (mm);Temperature (C)\n");
    let mut measured = Vec::new();
    for k in 0..samples {
        let t = k as f64 / RATE;
        let shown = 1e3 * x + zero + 0.005 * noise(k);
        measured.push(shown);
        let cell = if k < given {
            format!("{shown:.5}")
        } else {
            String::new()
        };
        writeln!(
            text,
            "{t:.4};{:.6};{cell};21.5",
            1e-3 * force(t, size, shift)
        )
        .unwrap();
        for i in 0..STEPS {
            let t = t + (i as f64 + 0.5) * h;
            let half = x + 0.5 * h * v;
            let spring = STIFFNESS * half + CUBIC * half.powi(3);
            let pull = force(t, size, shift) - spring;
            v = (v * (1.0 - 0.5 * h * DAMPING / MASS) + h * pull / MASS)
                / (1.0 + 0.5 * h * DAMPING / MASS);
            x = half + 0.5 * h * v;
        }
    }
    (text, measured)
}

const DESCRIPTION: &str = r#"name = "Isolator"
kind = "oscillator"
data = ["record.csv"]
columns.time = { column = "Time (s)", unit = "s" }
columns.force = { column = "Load (kN)", unit = "kN" }
columns.displacement = { column = "Stroke (mm)", unit = "mm" }
nominal.mass = { value = 10.0, plus_minus = 0.5, unit = "kg" }
nominal.damping = { value = 20.0, plus_minus = 10.0, unit = "N s/m" }
nominal.stiffness = { value = 12.0, plus_minus = 2.0, unit = "kN/m" }
left_out = { second_half = true }
"#;

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = shakebench(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

#[test]
fn a_rig_in_ten_lines_and_its_model_on_later_records() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::write(here.join("rig.toml"), DESCRIPTION).unwrap();
    let write = |name: &str, text: &str| fs::write(here.join(name), text).unwrap();
    write("record.csv", &record(4000, 8.0, 1.0, 0.0, 4000).0);
    let found = json(here, &["diagnose", "rig.toml", "--out", "out", "--json"]);
    assert_eq!(found["verdict"], "named", "{found}");
    let effects = found["effects"].as_array().unwrap();
    assert_eq!(effects.len(), 1, "{effects:?}");
    assert_eq!(effects[0]["effect"], "cubic_stiffness");
    let size = &effects[0]["parameters"]["stiffness"];
    let (value, error) = (size["value"].as_f64(), size["standard_error"].as_f64());
    let (value, error) = (value.unwrap(), error.unwrap());
    assert!(
        (value / CUBIC - 1.0).abs() < 0.02 && error < 0.02 * CUBIC,
        "{size}"
    );
    assert!(here.join("out/report.html").is_file());

    // A later record, larger, whose transducer was set up anew; in other columns.
    let (later, _) = record(3000, 10.0, 2.3, 0.7, 3000);
    write("later.csv", &later.replace("Stroke (mm)", "Weg (mm)"));
    write("map.toml", "displacement = \"Weg (mm)\"\n");
    let model = "out/extended_model.toml";
    let arguments = [
        "diagnose",
        "--model",
        model,
        "--columns",
        "map.toml",
        "--json",
    ];
    let found = json(
        here,
        &[&arguments[..], &["--validate", "later.csv"]].concat(),
    );
    let one = &found["records"][0];
    let percent = |name: &str| one[name].as_f64().unwrap();
    assert_eq!(one["channel"], "displacement");
    assert!(percent("extended_percent") < 0.2, "{one}");
    assert!(percent("nominal_percent") > 10.0, "{one}");
    let zero = one["session"]["zero"].as_f64().unwrap();
    assert!((zero - 0.7e-3).abs() < 2e-5, "{zero}");

    // A record of which only the begin was measured.
    let (begun, whole) = record(2000, 9.0, 0.4, 0.0, 50);
    write("begun.csv", &begun);
    let arguments = ["diagnose", "--model", model, "--predict", "begun.csv"];
    let told = json(
        here,
        &[&arguments[..], &["--out", "prediction.csv", "--json"]].concat(),
    );
    assert_eq!(told["rows"], 2000);
    assert_eq!(told["given"], 50);
    let text = fs::read_to_string(here.join("prediction.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("prediction"));
    let predicted: Vec<f64> = lines.map(|line| line.parse().unwrap()).collect();
    assert_eq!(predicted.len(), 2000);
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
    let errors = square(&mut predicted.iter().zip(&whole).map(|(p, m)| p - m));
    let share = (errors / square(&mut whole.iter().copied())).sqrt();
    assert!(share < 0.01, "{share}");
}

#[test]
fn templates_and_what_is_wrong_with_a_model_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (kind, holds) in [
        ("oscillator", "cubic_stiffness"),
        ("hysteretic device", "free_play"),
        ("actuator", "loop_gain"),
        ("table", "voltage_to_force"),
    ] {
        let output = shakebench(here, &["diagnose", "--template", kind]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(stdout(&output).contains(holds), "{kind}");
    }
    let diagnose = |arguments: &[&str], words: &[&str]| {
        refused(here, &[&["diagnose"], arguments].concat(), words);
    };
    diagnose(&["--template", "oscilator"], &["did you mean `oscillator`"]);
    diagnose(&[], &["CASE"]);
    diagnose(&["--model", "rig.toml"], &["--validate", "--predict"]);
    fs::write(here.join("rig.toml"), DESCRIPTION).unwrap();
    diagnose(&["rig.toml"], &["record.csv"]);
    let words = ["a.csv", "no such file"];
    diagnose(&["--model", "rig.toml", "--validate", "a.csv"], &words);
    fs::write(here.join("record.csv"), record(200, 8.0, 1.0, 0.0, 200).0).unwrap();
    for (from, to, holds) in [
        ("columns.force", "columns.load", "`columns.load` is unknown"),
        ("unit = \"kN\"", "unit = \"mm\"", "columns.force"),
        ("nominal.mass", "nominal.mas", "did you mean `mass`"),
        ("value = 10.0", "value = nan", "nominal.mass"),
        ("kind =", "units = \"metre\"\nkind =", "units"),
        ("second_half = true", "second_half = false", "second_half"),
        ("\"Load (kN)\"", "\"Last (kN)\"", "Load (kN)"),
    ] {
        fs::write(here.join("rig.toml"), DESCRIPTION.replacen(from, to, 1)).unwrap();
        diagnose(&["rig.toml"], &[holds]);
    }
}

//! The diagnosis of rigs on data whose cause is known, made here by closed forms.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fmt::Write;
use std::path::Path;

use diagnosis::{Observer, Verdict};
use rigs::kinds::{Description, RigDiagnosis, diagnose};

/// `x' = K (r - x)` for a sweep, in mm, in steps that are exact for a constant command; `late` by so many samples.
fn record(gain: f64, period: f64, late: f64) -> String {
    const STEPS: usize = 200;
    let command = |t: f64| {
        // A slow sweep, 1 to 6 Hz at 250 samples a second: with few samples a cycle nobody knows the course between.
        let t = t.max(0.0);
        4.0 * (std::f64::consts::TAU * (1.0 + 0.001 / period * t) * t).sin()
    };
    let mut text = String::from("t_s,r_mm,x_mm\n");
    let step = period / STEPS as f64;
    let (mut x, keep) = (0.0, (-gain * step).exp());
    for k in 0..(10.0 / period) as usize {
        let now = k as f64 * period;
        let noise = 0.004 * (k as f64 * 91.7).sin() * (k as f64 * 13.31).cos();
        writeln!(text, "{now:.4},{:.5},{:.5}", command(now), x + noise).unwrap();
        for part in 0..STEPS {
            let asked = command(now + (part as f64 + 0.5) * step - late * period);
            x = asked + (x - asked) * keep;
        }
    }
    text
}

fn diagnosed(folder: &Path, record: &str) -> RigDiagnosis {
    std::fs::write(folder.join("record.csv"), record).unwrap();
    let text = r#"name = "Press"
kind = "closed_loop_actuator"
data = ["record.csv"]
columns.time = { column = "t_s", unit = "s" }
columns.command = { column = "r_mm", unit = "mm" }
columns.displacement = { column = "x_mm", unit = "mm" }
nominal.loop_gain = { value = 50.0, plus_minus = 3.0, unit = "1/s" }
nominal.command_lag = { value = 1.0, plus_minus = 0.5, unit = "ms" }
nominal.scale = { value = 1.0, plus_minus = 0.001, unit = "1" }
left_out.every_second_block = { value = 1.0, unit = "s" }
"#;
    let path = folder.join("rig.toml");
    std::fs::write(&path, text).unwrap();
    let description = Description::read(&path).unwrap();
    let measurement = description.measurement(&[]).unwrap();
    diagnose(&description, &measurement, Observer::none()).unwrap()
}

#[test]
fn a_gain_far_from_what_was_stated_is_a_finding_and_no_effect() {
    let folder = tempfile::tempdir().unwrap();
    // At 250 Hz, and at 50 Hz, where the gain times a sample is 1.8.
    for period in [0.004, 0.02] {
        let found = diagnosed(folder.path(), &record(90.0, period, 0.0));
        let part = &found.as_described;
        assert!(part.nominal_error > 0.05, "{}", part.nominal_error);
        assert!(part.refitted_error < 0.002, "{}", part.refitted_error);
        assert_eq!(found.verdict, Verdict::Adequate, "{:?}", found.named);
        let value = |name: &str| {
            let mut all = found.confirmed.parameters.iter();
            all.find(|p| p.name == name).unwrap().value
        };
        // At 50 Hz a gain and a lag of less than a millisecond make up for each other.
        let (gain, lag) = (value("loop_gain"), value("command_lag"));
        assert!(
            (90.0 * (1.0 / gain + lag) - 1.0).abs() < 0.02,
            "{gain} {lag}"
        );
        assert!(period > 0.01 || (gain - 90.0).abs() < 1.0, "{gain}");
        assert!(
            found.findings.iter().any(|f| f.contains("loop_gain")),
            "{:?}",
            found.findings
        );
    }
}

#[test]
fn a_delay_is_found_at_its_size() {
    let folder = tempfile::tempdir().unwrap();
    let found = diagnosed(folder.path(), &record(60.0, 0.004, 5.0));
    assert_eq!(found.verdict, Verdict::Named, "{:?}", found.set_aside);
    assert!(
        found.named.iter().any(|name| name.contains("delay")),
        "{:?}",
        found.named
    );
    let delay = &found.confirmed.effects[0];
    assert_eq!(delay.0, "delay");
    assert!((delay.1[0].value - 0.020).abs() < 1e-3, "{delay:?}");
    assert!(found.confirmed.error < 0.005, "{}", found.confirmed.error);
}

#[test]
fn windows_are_refused_where_something_brings_the_rig_back_or_nothing_is_left_to_compare() {
    let folder = tempfile::tempdir().unwrap();
    let mut data = String::from("t,u,q\n");
    for k in 0..400 {
        writeln!(data, "{:.3},{},{}", 0.001 * f64::from(k), k % 7, k).unwrap();
    }
    std::fs::write(folder.path().join("record.csv"), data).unwrap();
    let refused = |kind: &str, windows: &str| {
        let oscillator = kind == "oscillator";
        let (input, output) = if oscillator {
            ("force = { column = \"u\", unit = \"N\" }", "displacement")
        } else {
            (
                "motor_voltage = { column = \"u\", unit = \"V\" }",
                "position",
            )
        };
        let nominal = if oscillator {
            "mass = { value = 1.0, unit = \"kg\" }
            damping = { value = 1.0, unit = \"N s/m\" }
            stiffness = { value = 1.0, unit = \"N/m\" }"
        } else {
            "mass = { value = 1.0, unit = \"kg\" }
            viscous_friction = { value = 1.0, unit = \"N s/m\" }
            coulomb_friction = { value = 1.0, unit = \"N\" }
            force_gain = { value = 1.0, unit = \"N/V\" }"
        };
        let text = format!(
            "name = \"Axis\"\nkind = \"{kind}\"\ndata = [\"record.csv\"]\n[columns]\n\
             time = {{ column = \"t\", unit = \"s\" }}\n{input}\n\
             {output} = {{ column = \"q\", unit = \"mm\" }}\n[nominal]\n{nominal}\n\
             [left_out]\nsecond_half = true\n[windows]\n{windows}\n"
        );
        let path = folder.path().join("rig.toml");
        std::fs::write(&path, text).unwrap();
        let read = Description::read(&path).and_then(|d| d.measurement(&[]));
        read.map(|_| ()).map_err(|error| error.to_string())
    };
    let good = "length = { value = 0.1, unit = \"s\" }\nknown = { value = 10, unit = \"ms\" }";
    refused("linear_axis", good).unwrap();
    let error = refused("oscillator", good).unwrap_err();
    assert!(
        error.contains("rig.toml") && error.contains("linear_axis"),
        "{error}"
    );
    for (windows, place) in [
        (
            good.replace("0.1", "0.015").as_str(),
            "expected at least 2 known ones",
        ),
        (good.replace("\"s\"", "\"mm\"").as_str(), "windows.length"),
        (good.replace("known", "knwon").as_str(), "knwon"),
        (
            good.replace("10,", "-10,").as_str(),
            "expected at least 2 known ones",
        ),
    ] {
        let error = refused("linear_axis", windows).unwrap_err();
        assert!(error.contains(place), "{error}");
    }
}

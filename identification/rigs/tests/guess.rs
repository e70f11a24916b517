//! Files without a description: what is guessed, what is asked, and what a diagnosis then says.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fmt::Write;
use std::path::{Path, PathBuf};

use diagnosis::{Observer, Verdict};
use rigs::kinds::guess::guess;
use rigs::kinds::{ExtendedRig, diagnose};

/// A German file of `x' = K (1.05 r(t - 12 ms) - x)`, at most `rail` (mm/s), in millimetres with decimal commas and a
/// title. Every small step is exact for a constant command.
fn german(file: &Path, seconds: f64, seed: f64, size: f64, rail: f64) {
    let (gain, period, delay) = (30.0, 0.004, 0.012);
    let command = |t: f64| {
        let tone = |f: f64, a: f64| size * a * (std::f64::consts::TAU * f * t + seed * f).sin();
        tone(0.31, 3.0)
            + tone(0.83, 2.0)
            + tone(1.9, 1.0)
            + tone(3.7, 0.5)
            + tone(6.1, 0.5)
            + tone(9.3, 0.3)
    };
    let comma = |value: f64| format!("{value:.5}").replace('.', ",");
    let mut text = String::from("Rütteltisch, Versuch 1\nZeit [s];Sollwert [mm];Weg [mm]\n");
    const STEPS: usize = 100;
    let step = period / STEPS as f64;
    let (mut x, keep) = (1.05 * command(0.0), (-gain * step).exp());
    for k in 0..(seconds / period) as usize {
        let noise = 0.002 * (k as f64 * 91.7 + seed).sin();
        let now = k as f64 * period;
        let (t, r) = (comma(now), comma(command(now)));
        writeln!(text, "{t};{r};{}", comma(x + noise)).unwrap();
        for part in 0..STEPS {
            let r = 1.05 * command((now + (part as f64 + 0.5) * step - delay).max(0.0));
            let most = rail * step;
            x += ((r - x) * (1.0 - keep)).clamp(-most, most);
        }
    }
    std::fs::write(file, text).unwrap();
}

#[test]
fn two_files_alone_are_answered_with_delay_and_scale_in_the_first_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["eins.csv", "zwei.csv"].map(|name| folder.path().join(name));
    german(&files[0], 20.0, 1.0, 1.0, f64::INFINITY);
    german(&files[1], 12.0, 2.0, 1.0, f64::INFINITY);
    let guessed = guess(&files, None).unwrap();
    assert_eq!(guessed.description.kind, "closed_loop_actuator");
    let found = diagnose(&guessed.description, &guessed.measurement, Observer::none()).unwrap();
    assert_eq!(found.verdict, Verdict::Named, "{}", found.sentence());
    let value = |name: &str| {
        let own = found.causes.iter().find(|own| own.found.name == name);
        own.map_or(f64::NAN, |own| own.found.value)
    };
    assert!((value("command_delay") - 0.012).abs() < 3e-4, "{found:?}");
    assert!((value("scale") - 1.05).abs() < 1e-3, "{found:?}");
    assert_eq!(found.causes.len(), 2, "{found:?}");
    let sentence = found.sentence();
    assert!(sentence.contains("the command arrives 12.0"), "{sentence}");
    assert!(sentence.contains("more than commanded"), "{sentence}");
    assert!(sentence.contains("all of the error"), "{sentence}");
    // The description is read as it stands, and predicts as a model does.
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, &guessed.text).unwrap();
    let errors = ExtendedRig::read(&path).unwrap().validate(&files).unwrap();
    assert_eq!(errors.len(), 2);
}

#[test]
fn a_rail_that_one_file_does_not_reach_hides_no_cause() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["laut.csv", "leise.csv"].map(|name| folder.path().join(name));
    german(&files[0], 20.0, 1.0, 1.0, 35.0);
    german(&files[1], 12.0, 2.0, 0.2, 35.0);
    let guessed = guess(&files, None).unwrap();
    let found = diagnose(&guessed.description, &guessed.measurement, Observer::none()).unwrap();
    let sentence = found.sentence();
    assert_eq!(found.verdict, Verdict::Named, "{sentence}");
    let scale = found.causes.iter().find(|own| own.found.name == "scale");
    assert!(
        (scale.unwrap().found.value - 1.05).abs() < 2e-3,
        "{found:?}"
    );
    let [(effect, values)] = &found.confirmed.effects[..] else {
        panic!("{found:?}");
    };
    assert_eq!(effect, "speed_limit");
    assert!((0.035 * values[0].value - 1.0).abs() < 0.01, "{values:?}");
    assert_eq!(found.confirmed.on_one_part, ["speed_limit"]);
    assert!(sentence.contains("the other not reaching it"), "{sentence}");
    assert!(sentence.contains("all of the error"), "{sentence}");
}

#[test]
fn a_voltage_and_a_position_are_an_axis_beside_a_reference_without_a_unit() {
    let folder = tempfile::tempdir().unwrap();
    // 2 m/s per V with a time constant of 0.1 s, exactly, under a square of 0.5 Hz.
    let (gain, pole, period) = (2.0, 10.0, 0.005);
    let mut text = String::from("time [s],reference,command [V],displacement [mm]\n");
    let (mut x, mut v) = (0.0, 0.0);
    for k in 0..2000 {
        let u = if (k / 200) % 2 == 0 { 0.4 } else { -0.4 };
        writeln!(text, "{:.3},{u},{u},{:.6}", period * f64::from(k), 1e3 * x).unwrap();
        let keep = f64::exp(-pole * period);
        let off = v - gain * u;
        x += gain * u * period + off * (1.0 - keep) / pole;
        v = gain * u + off * keep;
    }
    let file = folder.path().join("square.csv");
    std::fs::write(&file, text).unwrap();
    let guessed = guess(&[file], None).unwrap();
    assert_eq!(guessed.description.kind, "linear_axis");
    let value = |name: &str| guessed.description.nominal[name].value;
    let speed = value("force_gain") / value("viscous_friction");
    assert!((speed / gain - 1.0).abs() < 0.2, "{speed}");
}

#[test]
fn long_records_are_reduced_further_and_the_rate_they_were_recorded_at_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let period = |rows: u32, step: f64| {
        let mut text = String::from("time [s],command [mm],displacement [mm]\n");
        for k in 0..rows {
            let x = (0.02 * f64::from(k)).sin();
            writeln!(text, "{:.3},{x:.4},{x:.4}", step * f64::from(k)).unwrap();
        }
        let file = folder.path().join(format!("{rows}.csv"));
        std::fs::write(&file, text).unwrap();
        let guessed = guess(&[file], None).unwrap();
        let one = &guessed.measurement.recordings[0];
        assert!((one.recorded_period - step).abs() < 1e-9);
        one.period()
    };
    assert!((period(19_000, 0.004) - 0.004).abs() < 1e-9);
    assert!((period(21_000, 0.004) - 0.008).abs() < 1e-9);
    // No slower than they must be for 20,000 samples, nor than 100 Hz.
    assert!((period(53_000, 0.002) - 0.006).abs() < 1e-9);
    assert!((period(130_000, 0.002) - 0.010).abs() < 1e-9);
}

#[test]
fn what_cannot_be_told_is_asked() {
    let folder = tempfile::tempdir().unwrap();
    let asked = |header: &str, step: f64| -> String {
        let mut text = format!("{header}\n");
        for k in 0..300 {
            let (t, x) = (step * f64::from(k), (0.1 * f64::from(k)).sin());
            writeln!(text, "{t},{x},{x}").unwrap();
        }
        let file: PathBuf = folder.path().join("my.csv");
        std::fs::write(&file, text).unwrap();
        guess(&[file], None).unwrap_err().to_string()
    };
    let unit = asked("time [s],command [mm],displacement", 0.01);
    assert!(
        unit.contains("which unit has column `displacement`"),
        "{unit}"
    );
    let two = asked("time [s],x_left [mm],x_right [mm]", 0.01);
    assert!(two.contains("which columns are the command"), "{two}");
    assert!(
        two.contains("--columns MAP.toml") && two.contains("--template"),
        "{two}"
    );
    let slow = asked("time [s],command [mm],displacement [mm]", 5.0);
    assert!(
        slow.contains("0.200 Hz") && slow.contains("200 Hz"),
        "{slow}"
    );
}

//! Descriptions of axes that a voltage moves: what a one-input model writes is read by the diagnosis, and the drive
//! of an axis whose friction takes a fifth of its voltage.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

use plant::sensors::channel::Noise;
use recordings::{Channel, Named, Recording};
use rigs::kinds::{Description, DriveSearch, ExtendedRig};
use rigs::one_input::identify;

const PERIOD: f64 = 0.005;
const SAMPLES: usize = 4000;
const STEPS: usize = 20;

/// A voltage with power to some 8 Hz and the position (m) of `m x'' + c x' + k x = g u`, over `m`; without a mass
/// where `c` stands alone, `c x' + k x = g u`. Noise of 2 um.
fn axis(seed: u64, [mass, viscous, stiffness, gain]: [f64; 4], file: &Path) -> Recording {
    let noise = |channel: u64, sample: usize| {
        let sample = sample as u64;
        Noise {
            seed,
            channel,
            sample,
        }
        .gaussian()
    };
    let step = PERIOD / STEPS as f64;
    let (mut u, mut x, mut v) = (0.0, 0.0, 0.0);
    let [mut voltage, mut position] = [Vec::new(), Vec::new()];
    let mut text = String::from("time [s],drive [V],position [m]\n");
    for k in 0..SAMPLES {
        u += 0.2 * (2.0 * noise(1, k) - u);
        let shown = x + 2e-6 * noise(2, k);
        writeln!(text, "{:.4},{u:.9},{shown:.9}", k as f64 * PERIOD).unwrap();
        voltage.push(u);
        position.push(shown);
        for _ in 0..STEPS {
            let force = gain * u - stiffness * x;
            if mass > 0.0 {
                v += step * (force - viscous * v) / mass;
            } else {
                v = force / viscous;
            }
            x += step * v;
        }
    }
    std::fs::write(file, text).unwrap();
    let channels = vec![
        (Channel::ValveCommand, voltage),
        (Channel::Displacement, position),
    ];
    Recording::new("axis", PERIOD, channels).unwrap()
}

#[test]
fn every_one_input_model_of_a_voltage_is_a_description_that_the_diagnosis_reads() {
    let natural = TAU * 3.0;
    let on_a_spring = [1.0, 0.6 * natural, natural * natural, 0.5];
    let without_mass = [0.0, 1.0, 12.0, 0.05];
    for (name, rig) in [("spring", on_a_spring), ("lag", without_mass)] {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let recording = axis(5, rig, &file("one.csv"));
        axis(6, rig, &file("two.csv"));
        let named = |channel, head: &str, unit: &str| Named {
            channel,
            head: head.into(),
            unit: unit.into(),
        };
        let columns = [
            named(Channel::Time, "time [s]", "s"),
            named(Channel::ValveCommand, "drive [V]", "V"),
            named(Channel::Displacement, "position [m]", "m"),
        ];
        let found = identify(&[recording], 0.75).unwrap();
        let text = found.to_toml(name, &[file("one.csv")], &columns).unwrap();
        std::fs::write(file("model.toml"), &text).unwrap();
        let description = Description::read(&file("model.toml")).unwrap();
        assert_eq!(description.rig().unwrap().kind(), "linear_axis");
        let model = ExtendedRig::read(&file("model.toml")).unwrap();
        let scored = model.validate(&[file("two.csv")]).unwrap();
        println!("{name}: {:.2} %", scored[0].extended_percent);
        assert!(scored[0].extended_percent < 5.0, "{name}: {text}");
    }
}

#[test]
fn a_drive_overcomes_friction_that_nothing_brings_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let axis = r#"name = "Small table"
kind = "linear_axis"
data = ["monday.csv"]
columns.time = { column = "t [s]", unit = "s" }
columns.motor_voltage = { column = "drive [V]", unit = "V" }
columns.position = { column = "position [mm]", unit = "mm" }
nominal.mass = { value = 1.0, unit = "kg" }
nominal.viscous_friction = { value = 12.8, unit = "N s/m" }
nominal.coulomb_friction = { value = 0.5, unit = "N" }
nominal.force_gain = { value = 1.25, unit = "N/V" }
left_out.second_half = true
"#;
    std::fs::write(path("axis.toml"), axis).unwrap();
    let mut wanted = String::from("t [s],position [mm]\n");
    for k in 0..1001 {
        let t = 0.01 * f64::from(k);
        let edge = t.min(10.0 - t).min(1.0);
        let way = edge * edge * 8.0 * ((3.0 * t).sin() + (11.0 * t).sin());
        writeln!(wanted, "{t:.2},{way:.5}").unwrap();
    }
    std::fs::write(path("wanted.csv"), wanted).unwrap();
    let model = ExtendedRig::read(&path("axis.toml")).unwrap();
    let search = DriveSearch {
        limit: Some(2.0),
        highest: 5.0,
        corrections: 10,
    };
    let found = model.drive(&path("wanted.csv"), &search).unwrap();
    assert!(found.errors.last().unwrap() < &3.0, "{:?}", found.errors);
    assert!(found.peak <= 2.0);
}

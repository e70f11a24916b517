//! Descriptions of axes that a voltage moves: the drive of an axis whose friction takes a fifth of its voltage.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fmt::Write;

use rigs::kinds::{DriveSearch, ExtendedRig};

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

//! The physical rig against the same equations written in Python and integrated by SciPy's Radau.

use std::fmt::Write;

use acceptance::python::run_script;
use plant::servo_hydraulic::{INNER_STEP, ServoHydraulicRig};
use units::constants::{INCH, LBF, PSI};

const STEP: f64 = 0.002;

/// Sticks, slides, reverses, saturates the spool and runs into the cushion and the stop.
fn command(t: f64) -> f64 {
    match t {
        t if t < 0.1 => 0.0,
        t if t < 0.4 => 0.05,
        t if t < 1.4 => 1.5 * (40.0 * (t - 0.4) * (t - 0.1)).sin(),
        t if t < 1.7 => 0.0,
        t if t < 1.78 => -12.0,
        t if t < 1.9 => 6.0,
        _ => -1.0,
    }
}

#[test]
fn inner_steps_agree_with_radau_on_an_independent_model() {
    let rig = ServoHydraulicRig::default();
    let mut state = rig.rest();
    let mut csv = String::from(
        "time,valve_command,displacement,velocity,acceleration,actuator_force,supply_pressure,drift\n",
    );
    for k in 0..=1000 {
        let t = STEP * f64::from(k);
        let u = command(t);
        let table = &state.table;
        let acceleration = rig.derivatives(&state, u).table.velocity;
        writeln!(
            csv,
            "{t},{u},{},{},{},{},{},{}",
            table.displacement / INCH,
            table.velocity / INCH,
            acceleration / INCH,
            rig.table.actuator_force(table) / LBF,
            table.supply_pressure / PSI,
            state.specimen.drift / INCH,
        )
        .unwrap();
        state = rig.advance(&state, u, STEP, INNER_STEP);
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rig.csv");
    std::fs::write(&file, csv).unwrap();
    let report = run_script("servo_hydraulic_radau.py", [&file]);
    println!("{report}");
    assert_eq!(
        report
            .lines()
            .filter(|line| line.starts_with("ok "))
            .count(),
        6
    );
}

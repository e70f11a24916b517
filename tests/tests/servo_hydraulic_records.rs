//! The eight records on the physical rig with the yielding specimen.

use std::path::PathBuf;

use controllers::interlock::{Interlock, InterlockInput, Trip};
use controllers::three_variable::{ThreeVariableControl, ThreeVariableGains, ThreeVariableInput};
use controllers::{Controller, Motion as Sample};
use plant::instrumentation::{Instrumentation, InstrumentationState, TrueMotion};
use plant::servo_hydraulic::{ServoHydraulicInput, ServoHydraulicTable};
use plant::specimens::{YieldingSpecimen, YieldingState};
use plant::units::INCH;
use shakebench::motion::{Motion, Options};

const H: f64 = 0.002;

struct Outcome {
    error_percent: f64,
    peak: f64,
    trip: Trip,
    trip_time: f64,
    drift: f64,
    worst_tracking: f64,
    peak_velocity: f64,
    peak_force: f64,
}

fn run(
    motion: &Motion,
    gains: ThreeVariableGains,
    delay: f64,
    seed: u64,
    specimen_on: bool,
) -> Outcome {
    let table = ServoHydraulicTable::default();
    let specimen = YieldingSpecimen::default();
    let sensors = Instrumentation {
        delay,
        ..Instrumentation::laboratory(seed)
    };
    sensors.validate(H).unwrap();
    let filter = sensors.velocity_filter(H).unwrap();
    let mut law = ThreeVariableControl {
        gains,
        ..ThreeVariableControl::table_3_2()
    };
    let mut interlock = Interlock::laboratory();
    let (mut s, mut d, mut memory) = (
        table.rest(),
        YieldingState::default(),
        InstrumentationState::default(),
    );
    let (mut squares, mut peak, mut drift, mut worst): (f64, f64, f64, f64) = (0.0, 0.0, 0.0, 0.0);
    let (mut pv, mut pf): (f64, f64) = (0.0, 0.0);
    for k in 0..motion.len() {
        let force = if specimen_on { specimen.force(&d) } else { 0.0 };
        let acceleration = table.acceleration(&s, force);
        let truth = TrueMotion {
            displacement: s.displacement,
            velocity: s.velocity,
            acceleration,
            actuator_force: table.actuator_force(&s),
            specimen_acceleration: specimen.acceleration(&d),
        };
        let m = sensors.sample(&mut memory, &filter, &truth, H);
        let measured = Sample {
            displacement: m.displacement,
            velocity: m.velocity,
            acceleration: m.acceleration,
        };
        let reference = Sample {
            displacement: motion.displacement[k],
            velocity: motion.velocity[k],
            acceleration: motion.acceleration[k],
        };
        let command = law.step(
            &ThreeVariableInput {
                reference,
                measured,
            },
            H,
        );
        let valve_command = interlock.step(
            &InterlockInput {
                valve_command: command,
                reference_displacement: reference.displacement,
                measured,
                measured_force: m.actuator_force,
                heartbeat: k as i32,
                ..InterlockInput::default()
            },
            H,
        );
        squares += (reference.acceleration - acceleration).powi(2);
        peak = peak.max(s.displacement.abs());
        drift = drift.max(d.drift.abs());
        pv = pv.max(s.velocity.abs());
        pf = pf.max(truth.actuator_force.abs());
        worst = worst.max((s.displacement - reference.displacement).abs());
        let input = ServoHydraulicInput {
            valve_command,
            specimen_force: force,
            supply_lost: false,
        };
        s = table.advance(&s, &input, H);
        d = specimen.advance(&d, acceleration, H);
    }
    Outcome {
        error_percent: 100.0 * (squares / motion.len() as f64).sqrt() / motion.peak_acceleration(),
        peak,
        trip: interlock.memory.trip,
        trip_time: interlock.memory.trip_time,
        drift,
        worst_tracking: worst,
        peak_velocity: pv,
        peak_force: pf,
    }
}

fn records() -> Vec<Motion> {
    let shared = std::env::var_os("SHAKEBENCH_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared"),
        PathBuf::from,
    );
    let Ok(folder) = std::fs::read_dir(shared.join("records")) else {
        return Vec::new();
    };
    let mut files: Vec<_> = folder
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "csv" || e == "AT2"))
        .collect();
    files.sort();
    files
        .iter()
        .map(|path| shakebench::motion::load(path, &Options::default()).unwrap())
        .collect()
}

#[test]
fn explore() {
    for (delay, on) in [(0.0, true), (0.002, true), (0.0, false), (0.002, false)] {
        for m in records() {
            let o = run(&m, ThreeVariableGains::table_3_2(), delay, 1, on);
            println!(
                "{delay} {on} {:40} {:6.1} % peak {:.2} in trip {:?} at {:.2} drift {:.2} in tracking {:.2} in v {:.1} F {:.0} lbf; ref {:.2} in {:.2} g {:.1} in/s",
                m.name,
                o.error_percent,
                o.peak / INCH,
                o.trip,
                o.trip_time,
                o.drift / INCH,
                o.worst_tracking / INCH,
                o.peak_velocity / INCH,
                o.peak_force / 4.448,
                m.peak_displacement() / INCH,
                m.peak_acceleration() / 9.81,
                m.peak_velocity() / INCH
            );
        }
    }
}

//! Table, specimen and sensors as parts that hold each other's quantities over a step, against the
//! one-piece rig, every effect by itself.

use plant::identified::effects::{Effects, SensorEffects};
use plant::identified::extended_table::{ExtendedTable, ExtendedTableState};
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use plant::sensors::instrumentation::{Instrumentation, InstrumentationState, TrueMotion};
use plant::specimens::extended::{ExtendedSpecimen, ExtendedSpecimenState};
use plant::specimens::linear::LinearSpecimen;
use units::constants::{INCH, LBF, LBF_S_PER_INCH, LBF_S2_PER_INCH};

const DURATION: f64 = 3.0;

/// Displacement, acceleration, force, specimen's acceleration at every 10 ms.
type Trace = Vec<[f64; 4]>;
type Named<T> = (&'static str, fn(&mut T));

fn command(displacement: f64, time: f64) -> f64 {
    // A proportional law keeps the table, whose open loop is slightly unstable, near the middle.
    let reference = 0.5 * INCH * ((9.0 * time).sin() + 0.6 * (31.0 * time).sin());
    (6.0 / INCH * (reference - displacement)).clamp(-10.0, 10.0)
}

/// The command is renewed every 2 ms in both.
fn in_one_piece(rig: &IdentifiedRig, step: f64) -> Trace {
    let sampled = rig.sample(step, 4).expect("a valid rig");
    let mut state = IdentifiedRigState::default();
    let (mut u, mut trace) = (0.0, Vec::new());
    for k in 0..(DURATION / step).round() as usize {
        let time = step * k as f64;
        let reading = sampled.measure(&mut state, time);
        if k.is_multiple_of((0.002 / step).round() as usize) {
            u = command(sampled.motion(&state).displacement, time);
        }
        if k.is_multiple_of((0.01 / step).round() as usize) {
            trace.push(reading);
        }
        sampled.step(&mut state, u);
    }
    trace
}

fn in_parts(rig: &IdentifiedRig, step: f64) -> Trace {
    let table = ExtendedTable::new(&rig.shake_table, &rig.effects);
    let specimen = ExtendedSpecimen::new(rig.specimen, &rig.effects.specimen);
    let sensors = Instrumentation::default().with_effects(&rig.sensors);
    sensors.validate(step).expect("a valid rig");
    let filter = sensors.velocity_filter(step).expect("a valid rig");
    let mut sensed = InstrumentationState::default();
    let (mut s, mut d) = (
        ExtendedTableState::default(),
        ExtendedSpecimenState::default(),
    );
    let (mut u, mut trace) = (0.0, Vec::new());
    for k in 0..(DURATION / step).round() as usize {
        let time = step * k as f64;
        let (force, _) = specimen.outputs(&d, 0.0);
        let (acceleration, _) = table.outputs(&s, u, force);
        let (_, specimen_acceleration) = specimen.outputs(&d, acceleration);
        let truth = TrueMotion {
            displacement: s.table.displacement,
            velocity: s.table.velocity,
            acceleration,
            actuator_force: s.table.actuator[0],
            specimen_acceleration,
        };
        let m = sensors.sample(&mut sensed, &filter, &truth, step);
        if k.is_multiple_of((0.002 / step).round() as usize) {
            u = command(s.table.displacement, time);
        }
        if k.is_multiple_of((0.01 / step).round() as usize) {
            trace.push([
                m.displacement,
                m.acceleration,
                m.actuator_force,
                m.specimen_acceleration,
            ]);
        }
        table.advance(&mut s, u, force, step);
        specimen.advance(&mut d, acceleration, step);
    }
    trace
}

/// Root of the mean square of the difference over that of `a`, worst channel.
fn distance(a: &Trace, b: &Trace) -> f64 {
    (0..4)
        .map(|i| {
            let power: f64 = a.iter().map(|a| a[i].powi(2)).sum();
            let miss: f64 = a.iter().zip(b).map(|(a, b)| (a[i] - b[i]).powi(2)).sum();
            (miss / power.max(1e-30)).sqrt()
        })
        .fold(0.0, f64::max)
}

fn effects() -> Vec<(&'static str, Effects, SensorEffects)> {
    let rig: [Named<Effects>; 25] = [
        ("valve_null_bias", |e| e.valve.null_bias = 0.2),
        ("valve_dead_band", |e| e.valve.dead_band = 0.15),
        ("valve_flow_gain", |e| e.valve.flow_gain = -0.2),
        ("valve_asymmetric_gain", |e| e.valve.asymmetry = 0.2),
        ("valve_spool_lag", |e| e.valve.spool_frequency = 20.0),
        ("command_delay", |e| e.valve.command_delay = 0.0047),
        ("valve_flow_saturation", |e| {
            e.hydraulics.stall_force = 50.0 * LBF
        }),
        ("valve_spool_saturation", |e| e.valve.spool_limit = 1.0),
        ("valve_hysteresis", |e| e.valve.hysteresis = 0.15),
        ("supply_pressure_droop", |e| e.hydraulics.droop_loss = 0.3),
        ("coulomb_friction", |e| e.friction.coulomb_force = 3.0 * LBF),
        ("stribeck_friction", |e| {
            e.friction.coulomb_force = 1.0 * LBF;
            e.friction.stribeck_force = 2.0 * LBF;
        }),
        ("internal_leakage", |e| e.hydraulics.leakage = 0.05 / LBF),
        ("oil_column_compliance", |e| {
            e.hydraulics.compliance = 2e-4 / LBF
        }),
        ("added_payload", |e| {
            e.table.added_mass = 0.05 * LBF_S2_PER_INCH
        }),
        ("viscous_damping", |e| {
            e.table.viscous_damping = 0.6 * LBF_S_PER_INCH
        }),
        ("cubic_stiffness", |e| {
            e.table.cubic_stiffness = 25.0 * LBF / INCH.powi(3)
        }),
        ("foundation_compliance", |e| e.foundation.frequency = 9.0),
        ("specimen_yielding", |e| {
            e.specimen.yield_displacement = 0.4 * INCH
        }),
        ("specimen_stiffness", |e| e.specimen.stiffness_change = -0.3),
        ("specimen_damping", |e| e.specimen.damping_change = 2.0),
        ("specimen_second_mode", |e| {
            e.specimen.second_mode_frequency = 6.0
        }),
        ("specimen_degradation", |e| {
            e.specimen.degradation_loss = 0.3
        }),
        ("specimen_uplift", |e| {
            e.specimen.uplift_displacement = 0.3 * INCH
        }),
        ("specimen_absent", |e| e.specimen.absent = true),
    ];
    let sensors: [Named<SensorEffects>; 9] = [
        ("accelerometer_bias", |s| s.accelerometer_bias = 10.0 * INCH),
        ("accelerometer_scale", |s| s.accelerometer_scale = 0.15),
        ("accelerometer_tilt", |s| s.accelerometer_tilt = 0.04 / INCH),
        ("accelerometer_delay", |s| s.accelerometer_delay = 0.005),
        ("displacement_scale", |s| s.displacement_scale = -0.1),
        ("displacement_lag", |s| s.displacement_lag = 10.0),
        ("load_cell_scale", |s| s.load_cell_scale = 0.15),
        ("load_cell_bias", |s| s.load_cell_bias = 3.0 * LBF),
        ("mains_hum", |s| {
            s.hum_amplitude = 10.0 * INCH;
            s.hum_phase = 0.7;
        }),
    ];
    let on_rig = rig.into_iter().map(|(name, turn_on)| {
        let mut effects = Effects::default();
        turn_on(&mut effects);
        (name, effects, SensorEffects::default())
    });
    let on_sensors = sensors.into_iter().map(|(name, turn_on)| {
        let mut effects = SensorEffects::default();
        turn_on(&mut effects);
        (name, Effects::default(), effects)
    });
    on_rig.chain(on_sensors).collect()
}

#[test]
fn every_effect_in_parts_is_that_of_the_rig_in_one_piece() {
    let nominal = IdentifiedRig {
        specimen: Some(LinearSpecimen::appendix_a()),
        ..IdentifiedRig::default()
    };
    let plain = in_one_piece(&nominal, 2.5e-4);
    for (name, effects, sensors) in effects() {
        let rig = IdentifiedRig {
            effects,
            sensors,
            ..nominal
        };
        // The same step in both, since a delay between samples is cut where they lie.
        let [coarse, fine] = [5e-4, 2.5e-4].map(|h| (in_one_piece(&rig, h), in_parts(&rig, h)));
        let errors = [&coarse, &fine].map(|(whole, parts)| distance(whole, parts));
        // Coupling is of first order: extrapolated to no step, nothing must be left.
        let extrapolated: Trace = (0..fine.0.len())
            .map(|k| {
                std::array::from_fn(|i| {
                    let off = |(whole, parts): &(Trace, Trace)| parts[k][i] - whole[k][i];
                    fine.0[k][i] + 2.0 * off(&fine) - off(&coarse)
                })
            })
            .collect();
        let left = distance(&fine.0, &extrapolated);
        let size = distance(&plain, &fine.0);
        println!(
            "{name}: {:.1e}, {:.1e}, extrapolated {left:.1e} of {size:.2}",
            errors[0], errors[1]
        );
        assert!(
            left < 0.01 * size.min(1.0) && errors[1] < 4e-3,
            "{name}: {errors:?}, extrapolated {left}, effect {size}"
        );
    }
}

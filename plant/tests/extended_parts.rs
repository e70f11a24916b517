//! Table, specimen and sensors as parts that hold each other's quantities over a step, against the
//! one-piece rig, every effect by itself.

use plant::identified::effects::{self, Basis, Role};
use plant::identified::extended_table::{ExtendedTable, ExtendedTableState};
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use plant::sensors::instrumentation::{InstrumentationState, TrueMotion};
use plant::specimens::extended::{ExtendedSpecimen, ExtendedSpecimenState};
use plant::specimens::linear::LinearSpecimen;
use units::constants::INCH;

const DURATION: f64 = 3.0;

/// Displacement, acceleration, force, specimen's acceleration at every 10 ms.
type Trace = Vec<[f64; 4]>;

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
    let sensors = rig.sensors;
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

#[test]
fn every_effect_in_parts_is_that_of_the_rig_in_one_piece() {
    let nominal = IdentifiedRig {
        specimen: Some(LinearSpecimen::appendix_a()),
        ..IdentifiedRig::default()
    };
    let plain = in_one_piece(&nominal, 2.5e-4);
    for effect in effects::all() {
        let name = effect.name;
        let with = |values: &Vec<f64>| {
            let (mut rig, mut values) = (nominal, values.clone());
            let starts_off = effect.starts.iter().all(|start| start[0] == 0.0);
            for (value, parameter) in values.iter_mut().zip(effect.estimated()) {
                if starts_off && matches!(parameter.role, Role::Size { .. }) {
                    // An example of these is twice the weakest, which hardly shows.
                    *value *= 3.0;
                }
                if parameter.basis == Basis::Memory {
                    // Between samples, and within the memory at the finer step.
                    *value = 0.0047;
                }
            }
            effect.apply(&mut rig.effects, &mut rig.sensors, &values);
            rig
        };
        // The example that shows most: others may not reach this motion.
        let shows = |rig: &IdentifiedRig| distance(&plain, &in_one_piece(rig, 2.5e-4));
        let examples = effect.examples(3.0);
        let ends = [examples.first(), examples.last()];
        let rigs = ends.into_iter().flatten().map(with);
        let rig = rigs
            .max_by(|a, b| shows(a).total_cmp(&shows(b)))
            .expect("a start");
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

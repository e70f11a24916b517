//! Preview control on 200 physical rigs that are not the one of its model.
//!
//! `cargo run --release -p controllers --example preview_robustness [-- SEED]`
//!
//! The controller is designed by its rule on the default rig's linearisation; every rig differs from it in
//! area, oil, valve, friction, leakage, supply, payload and null, and carries the yielding specimen.
//! Nothing is identified again. The time of a step is printed too.

use std::time::Instant;

use controllers::preview::load::KnownLoad;
use controllers::preview::model::{Hydraulics, RigModel};
use controllers::preview::{Parameters, PreviewControl, PreviewInput};
use controllers::{Controller, Motion};
use plant::ModelError;
use plant::identified::seal_shape::SealShape;
use plant::identified::shake_table::ShakeTable;
use plant::sensors::instrumentation::{Instrumentation, InstrumentationState, TrueMotion};
use plant::servo_hydraulic::{ServoHydraulicInput, ServoHydraulicTable};
use plant::specimens::{YieldingSpecimen, YieldingState};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use units::constants::SAMPLING_PERIOD as H;

const RIGS: usize = 200;
const SAMPLES: usize = 5000;

/// Seven sines of 0.4 to 11 Hz, 0.2 to 0.3 g together, rising over 1 s.
fn reference() -> Vec<Motion> {
    let lines = [
        (0.4, 0.1),
        (0.9, 0.35),
        (1.7, 0.5),
        (3.1, 0.5),
        (4.9, 0.4),
        (7.3, 0.3),
        (11.0, 0.2),
    ];
    (0..SAMPLES)
        .map(|k| {
            let t = k as f64 * H;
            let u = t.min(1.0);
            let w = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            let dw = 30.0 * u * u * (1.0 - u) * (1.0 - u);
            let ddw = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u);
            let mut motion = Motion::default();
            for (i, (frequency, size)) in lines.into_iter().enumerate() {
                let omega = std::f64::consts::TAU * frequency;
                let (s, c) = (omega * t + 1.3 * i as f64 * i as f64).sin_cos();
                let (x, v, a) = (-size * s / omega / omega, -size * c / omega, size * s);
                motion.displacement += w * x;
                motion.velocity += dw * x + w * v;
                motion.acceleration += ddw * x + 2.0 * dw * v + w * a;
            }
            motion
        })
        .collect()
}

/// Error over the peak in %, none where the table leaves its stroke; adds each step's time (µs) to
/// `times`.
fn play(
    control: &mut PreviewControl,
    times: &mut Vec<f64>,
    rig: &ServoHydraulicTable,
    reference: &[Motion],
    seed: u64,
) -> Result<Option<f64>, ModelError> {
    let specimen = YieldingSpecimen::default();
    let sensors = Instrumentation {
        delay: H,
        ..Instrumentation::laboratory(seed)
    };
    let filter = sensors.velocity_filter(H)?;
    control.reset();
    let (mut state, mut on_table) = (rig.rest(), YieldingState::default());
    let mut seen = InstrumentationState::default();
    let (mut sum, mut peak) = (0.0, 0.0f64);
    for (k, wanted) in reference.iter().enumerate() {
        let acceleration = rig.acceleration(&state, specimen.force(&on_table));
        let truth = TrueMotion {
            displacement: state.displacement,
            velocity: state.velocity,
            acceleration,
            ..TrueMotion::default()
        };
        let measured = sensors.sample(&mut seen, &filter, &truth, H);
        let last = reference.len() - 1;
        let input = PreviewInput {
            reference: std::array::from_fn(|j| reference[(k + j).min(last)]),
            measured: Motion {
                displacement: measured.displacement,
                velocity: measured.velocity,
                acceleration: measured.acceleration,
            },
            ..PreviewInput::default()
        };
        let begun = Instant::now();
        let valve_command = control.step(&input, H);
        times.push(1e6 * begun.elapsed().as_secs_f64());
        sum += (acceleration - wanted.acceleration).powi(2);
        peak = peak.max(wanted.acceleration.abs());
        for _ in 0..4 {
            let specimen_force = specimen.force(&on_table);
            let before = rig.acceleration(&state, specimen_force);
            let input = ServoHydraulicInput {
                valve_command,
                specimen_force,
                supply_lost: false,
            };
            state = rig.advance(&state, &input, H / 4.0);
            let after = rig.acceleration(&state, specimen_force);
            on_table = specimen.advance(&on_table, 0.5 * (before + after), H / 4.0);
        }
        if state.displacement.abs() > rig.stops.stroke || !state.velocity.is_finite() {
            return Ok(None);
        }
    }
    Ok(Some(100.0 * (sum / reference.len() as f64).sqrt() / peak))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let seed: u64 = match std::env::args().nth(1) {
        Some(text) => text.parse()?,
        None => 1,
    };
    let nominal = ServoHydraulicTable::default();
    let (valve, cylinder) = (&nominal.valve, &nominal.cylinder);
    let compliance = cylinder.volume / (4.0 * cylinder.bulk_modulus);
    let omega = std::f64::consts::TAU * valve.frequency;
    let flow = valve.flow_coefficient * (0.5 * nominal.rest().supply_pressure).sqrt();
    let specimen = YieldingSpecimen::default();
    let mut known = specimen;
    known.columns.yield_force *= 1.2;
    known.columns.yield_displacement *= 1.2 / 0.8;
    let parameters = Parameters {
        rig: RigModel {
            shake_table: ShakeTable {
                table: nominal.table,
                ..ShakeTable::default()
            },
            hydraulics: Some(Hydraulics {
                spool_lag: 2.0 * valve.damping_ratio / omega,
                spool_inertia: 1.0 / (omega * omega),
                force_rate: cylinder.area * flow / compliance,
                oil_stiffness: cylinder.area.powi(2) / compliance,
                leakage_rate: (cylinder.leakage + valve.null_leakage) / compliance,
                seal_damping: nominal.friction.viscous,
            }),
        },
        load: KnownLoad {
            friction: nominal.friction.coulomb,
            shape: SealShape {
                presliding: 0.7 * nominal.friction.coulomb / nominal.friction.stiffness,
                excess: nominal.friction.static_force / nominal.friction.coulomb - 1.0,
                stribeck_velocity: nominal.friction.stribeck_velocity,
                sharpness: 3.0,
                relaxation: 0.003,
            },
            specimen: Some(known),
        },
        delay: 1,
        ..Parameters::default()
    }
    .tuned()?;
    let mut control = PreviewControl::new(parameters)?;
    let reference = reference();
    let mut times = Vec::with_capacity((RIGS + 1) * SAMPLES);
    let own = play(&mut control, &mut times, &nominal, &reference, seed)?;
    println!("the rig of the model: {:.2} %", own.unwrap_or(f64::NAN));

    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut errors = Vec::new();
    let mut lost = 0;
    for index in 0..RIGS {
        let mut within = |part: f64| random.random_range(1.0 - part..1.0 + part);
        let mut rig = nominal;
        rig.cylinder.area *= within(0.1);
        rig.cylinder.bulk_modulus *= within(0.3);
        rig.cylinder.leakage *= within(0.5);
        rig.valve.flow_coefficient *= within(0.15);
        rig.valve.frequency *= within(0.15);
        rig.valve.damping_ratio *= within(0.2);
        rig.valve.null_bias = within(0.2) - 1.0;
        rig.supply.pressure *= within(0.1);
        let friction = within(0.5);
        rig.friction.coulomb *= friction;
        rig.friction.static_force *= friction;
        rig.friction.viscous *= within(0.3);
        rig.friction.stiffness *= within(0.3);
        rig.added_payload = 0.3 * nominal.table.mass * (within(1.0) / 2.0);
        match play(
            &mut control,
            &mut times,
            &rig,
            &reference,
            seed + index as u64,
        )? {
            Some(error) => errors.push(error),
            None => lost += 1,
        }
    }
    errors.sort_by(f64::total_cmp);
    let at = |part: f64| {
        let place = (part * errors.len().saturating_sub(1) as f64) as usize;
        errors.get(place).copied().unwrap_or(f64::NAN)
    };
    println!(
        "seed {seed}: {} of {RIGS} rigs stay within their stroke; error: median {:.2} %, 95th \
         percentile {:.2} %, largest {:.2} %; {lost} lost",
        errors.len(),
        at(0.5),
        at(0.95),
        at(1.0)
    );
    times.sort_by(f64::total_cmp);
    let at = |part: f64| times[(part * (times.len() - 1) as f64) as usize];
    println!(
        "a step takes {:.2} us, {:.2} us at the 99.9th percentile",
        at(0.5),
        at(0.999)
    );
    Ok(())
}

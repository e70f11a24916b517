//! Valves that are not ideal, on a rig with equations of its own (`tests/strangers/src/hydraulic.rs`).

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::f64::consts::TAU;

use recordings::{Channel, Recording};
use rigs::closed_loop::{Found, Settings, identify};
use strangers::dice::Dice;
use strangers::hydraulic::Rig;

const DT: f64 = 0.002;
const INCH: f64 = 0.0254;

/// Sines of 0.05 to 30 Hz under a soft displacement loop, as sensors one sample late show them.
fn recorded(rig: &Rig, seconds: f64, size: f64) -> Recording {
    let dice = &mut Dice::new(7, 3);
    let count = (seconds / DT) as usize;
    let mut wanted = vec![0.0; count];
    for i in 3..1800 {
        let f = f64::from(i) / 60.0;
        let phase = dice.even(0.0, TAU);
        let amplitude = (1.0 + f / 2.0) / (1.0 + (f / 0.5).powi(2));
        let (mut re, mut im) = (phase.cos() * amplitude, phase.sin() * amplitude);
        let (s, c) = (TAU * f * DT).sin_cos();
        for value in &mut wanted {
            *value += re;
            (re, im) = (re * c - im * s, re * s + im * c);
        }
    }
    let square = wanted.iter().map(|v| v * v).sum::<f64>() / count as f64;
    for (k, value) in wanted.iter_mut().enumerate() {
        *value *= size / square.sqrt() * (k as f64 * DT / 2.0).min(1.0);
    }
    let mut state = rig.rest();
    let mut channels = [const { Vec::new() }; 4];
    let (mut before, mut integral, mut u) = ([0.0; 3], 0.0, 0.0);
    for (k, wanted) in wanted.iter().enumerate() {
        let now = rig.now(&state.values, u, 0.0);
        let shown = before;
        before = [state.values[4], now.acceleration, now.force];
        let x = shown[0] + 5e-4 * INCH * dice.gauss();
        integral += DT * (wanted - x);
        u = (3.0 * (wanted - x) + 0.4 * integral) / INCH;
        let a = shown[1] + 1.5 * INCH * dice.gauss();
        let f = shown[2] + 1.3 * dice.gauss();
        for (channel, value) in channels.iter_mut().zip([u, x, a, f]) {
            channel.push(value);
        }
        rig.advance(&mut state, k as f64 * DT, DT, u, 0.0);
    }
    let names = [
        Channel::ValveCommand,
        Channel::Displacement,
        Channel::Acceleration,
        Channel::ActuatorForce,
    ];
    let mut all: Vec<(Channel, Vec<f64>)> = names.into_iter().zip(channels).collect();
    all.push((Channel::Reference, wanted));
    Recording::new("stranger", DT, all).unwrap()
}

/// Largest part of the acceleration that the replay misses: flow that falls with the load, which the model lacks.
const MISSED: f64 = 0.06;

/// Fits 45 s, and gives the error of the replayed acceleration on the rest.
fn found(rig: &Rig) -> (Found, f64) {
    let recording = recorded(rig, 60.0, 6e-3);
    let split = (45.0 / DT) as usize;
    let found = identify(&[recording.cut(0, split)], Settings::default()).unwrap();
    println!(
        "{:?} {:?} {:?} {:?} {:?}",
        found.rig,
        found.shape,
        found.mean_squares,
        found.specimen.is_some(),
        found.warnings
    );
    let rest = found
        .replication(&recording.cut(split, recording.len()))
        .unwrap();
    (found, rest.relative_error)
}

/// What is found of a rig holds its truth within three standard errors.
fn overlap_is_found_on(rig: &Rig) {
    let (found, error) = found(rig);
    let valve = found.valve.as_ref().unwrap();
    assert_eq!(valve.causes()[0], "valve_dead_band");
    let oil = 4.0 * rig.bulk_modulus * rig.area * rig.area / rig.volume;
    let speed = rig.flow_coefficient * (rig.supply / 2.0).sqrt() / rig.area;
    let own = &found.standard_error;
    for (name, truth, value, error) in [
        (
            "overlap",
            rig.overlap,
            valve.curve.overlap,
            valve.standard_error.overlap,
        ),
        ("friction", rig.coulomb, found.rig.seal_friction, own[6]),
        ("oil", oil, found.rig.oil_stiffness, own[3]),
        ("gain", oil * speed, found.rig.force_rate, own[2]),
    ] {
        assert!(
            (value - truth).abs() < 3.0 * error,
            "{name}: {truth} {value} ± {error}"
        );
        assert!(error < 0.15 * truth, "{name}: ± {error}");
    }
    assert!(error < MISSED, "{error}");
}

#[test]
fn an_overlap_is_found_beside_friction_oil_and_gain() {
    overlap_is_found_on(&Rig {
        overlap: 0.03,
        ..Rig::default()
    });
}

/// The fit of an ideal valve takes it for soft oil and friction.
#[test]
fn an_overlap_of_half_the_command_is_found() {
    overlap_is_found_on(&Rig {
        overlap: 0.15,
        null_bias: -0.04,
        payload: 18.0,
        coulomb: 26.0,
        breakaway: 30.0,
        ..Rig::default()
    });
}

/// Without what the model lacks, load on the orifices and the bristles of another law, nothing is exchanged between
/// delay and spool. The sensors are one sample late.
#[test]
fn a_delay_and_a_spool_are_found_without_bias() {
    let usual = Rig::default();
    let rig = Rig {
        supply: 1e4 * usual.supply,
        flow_coefficient: 1e-2 * usual.flow_coefficient,
        coulomb: 0.05 * usual.coulomb,
        breakaway: 0.05 * usual.breakaway,
        null_loss: 0.2,
        delay: 2e-3,
        ..usual
    };
    let (found, error) = found(&rig);
    let omega = TAU * rig.valve_frequency;
    let own = &found.rig;
    assert!(
        (own.command_delay - 4e-3).abs() < 2e-4,
        "{}",
        own.command_delay
    );
    let lag = 2.0 * rig.valve_damping / omega;
    assert!((own.spool_lag - lag).abs() < 2e-4, "{}", own.spool_lag);
    let late = own.command_delay + own.spool_lag - 4e-3 - lag;
    assert!(late.abs() < 3e-5, "{late}");
    assert!(error < 0.01, "{error}");
}

#[test]
fn an_ideal_valve_stays_one() {
    let (found, error) = found(&Rig::default());
    assert!(found.valve.is_none(), "{:?}", found.valve);
    assert!(error < MISSED, "{error}");
}

#[test]
fn a_command_at_its_limit_is_refused_before_any_fit() {
    let recording = recorded(&Rig::default(), 20.0, 6e-3);
    let channels: Vec<(Channel, Vec<f64>)> = recording
        .channels()
        .map(|(channel, values)| match channel {
            Channel::ValveCommand => (channel, values.iter().map(|u| u.clamp(-0.1, 0.1)).collect()),
            _ => (channel, values.to_vec()),
        })
        .collect();
    let clipped = Recording::new("clipped", DT, channels).unwrap();
    let error = identify(&[clipped], Settings::default()).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("`valve_command` is clipped at -0.1"),
        "{text}"
    );
    assert!(text.contains("record a smaller motion"), "{text}");
}

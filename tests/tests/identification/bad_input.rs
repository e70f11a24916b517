//! Data that give no model are refused by name, with what to measure instead.

use acceptance::recordings::{PERIOD, Test};
use identification::data::{Channel, Recording};
use identification::identify::rig::{Options, identify};

fn refused(recording: Recording) -> String {
    identify(&[recording], Options::default())
        .unwrap_err()
        .to_string()
}

fn with(recording: &Recording, channel: Channel, values: Vec<f64>) -> Recording {
    let mut changed = recording.clone();
    changed.replace(channel, values).unwrap();
    changed
}

fn good() -> Recording {
    Test {
        duration: 20.0,
        ..Test::default()
    }
    .record()
}

#[test]
fn a_command_that_stands_still_is_no_excitation() {
    let recording = good();
    let message = refused(with(
        &recording,
        Channel::ValveCommand,
        vec![0.1; recording.len()],
    ));
    assert!(
        message.contains("no excitation: valve_command is constant at 0.1000 V"),
        "{message}"
    );
    assert!(
        message.contains("band-limited noise or an earthquake"),
        "{message}"
    );
}

#[test]
fn sensors_that_see_only_noise_are_no_excitation() {
    let recording = good();
    let noise = (0..recording.len())
        .map(|k| ((k * 7919 % 1009) as f64 / 1009.0 - 0.5) * 1e-5)
        .collect();
    let message = refused(with(&recording, Channel::Displacement, noise));
    assert!(
        message.contains("no excitation: `displacement` is mostly noise"),
        "{message}"
    );
}

#[test]
fn a_short_recording_says_how_long_it_must_be() {
    let message = refused(good().cut(0, 900));
    assert!(
        message.contains("900 samples are too short to fit 33 parameters"),
        "{message}"
    );
    assert!(
        message.contains("record at least 1760 samples (3.5 s)"),
        "{message}"
    );
}

#[test]
fn a_missing_and_a_dead_channel_are_named() {
    let recording = good();
    let message = refused(recording.clone().without(Channel::ActuatorForce));
    assert!(message.contains("no column `actuator_force`"), "{message}");
    let message = refused(with(
        &recording,
        Channel::Acceleration,
        vec![0.0; recording.len()],
    ));
    assert!(
        message.contains("channel `acceleration` is constant at 0"),
        "{message}"
    );
}

#[test]
fn a_sine_has_too_few_frequencies() {
    let recording = good();
    let sine = |gain: f64, phase: f64| -> Vec<f64> {
        let at = |k: usize| (std::f64::consts::TAU * 2.0 * k as f64 * PERIOD + phase).sin();
        (0..recording.len()).map(|k| gain * at(k)).collect()
    };
    let mut pure = recording.clone();
    let channels = [
        (Channel::ValveCommand, 1.0, 0.0),
        (Channel::Displacement, 0.01, 1.0),
        (Channel::Acceleration, -1.5, 1.0),
        (Channel::ActuatorForce, 40.0, 2.0),
    ];
    for (channel, gain, phase) in channels {
        pure = with(&pure, channel, sine(gain, phase));
    }
    // A sampled sine obeys its own recursion: break that so that only the band is at fault.
    let bent: Vec<f64> = pure
        .channel(Channel::ValveCommand)
        .unwrap()
        .iter()
        .map(|u| u + 0.002 * u.powi(3))
        .collect();
    let message = refused(with(&pure, Channel::ValveCommand, bent));
    assert!(
        message.starts_with("rank deficiency") || message.contains("feedback"),
        "{message}"
    );
    assert!(
        message.contains("instead of a sine") || message.contains("test signal"),
        "{message}"
    );
}

#[test]
fn pure_feedback_is_unidentifiable() {
    let recording = good();
    let x = recording.channel(Channel::Displacement).unwrap();
    let a = recording.channel(Channel::Acceleration).unwrap();
    let command = x
        .iter()
        .zip(a)
        .map(|(x, a)| -240.0 * x - 0.004 * a)
        .collect();
    let message = refused(with(&recording, Channel::ValveCommand, command));
    assert!(
        message.contains("feedback makes the plant unidentifiable"),
        "{message}"
    );
    assert!(
        message.contains("add a test signal to the command"),
        "{message}"
    );
}

#[test]
fn a_force_of_the_wrong_sign_is_an_unstable_result() {
    let recording = good();
    let force = recording.channel(Channel::ActuatorForce).unwrap();
    let turned = force.iter().map(|f| -f).collect();
    let message = refused(with(&recording, Channel::ActuatorForce, turned));
    assert!(
        message.contains("unstable result where a stable one is expected"),
        "{message}"
    );
    assert!(
        message.contains("check the signs of actuator_force"),
        "{message}"
    );
}

#[test]
fn a_displacement_of_the_wrong_sign_or_unit_is_named() {
    let recording = good();
    let displacement = recording.channel(Channel::Displacement).unwrap();
    for (factor, part) in [
        (-1.0, "have opposite signs"),
        (1e3, "times the second derivative of `displacement`"),
    ] {
        let values = displacement.iter().map(|x| factor * x).collect();
        let message = refused(with(&recording, Channel::Displacement, values));
        assert!(message.contains(part), "{message}");
        assert!(message.contains("no channels are swapped"), "{message}");
    }
}

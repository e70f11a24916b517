//! Data that give no model are refused by name, with what to measure instead.

use acceptance::recordings::{PERIOD, Test};
use identification::data::Recording;
use identification::identify::rig::{Options, identify};

fn refused(recording: Recording) -> String {
    identify(&[recording], Options::default())
        .unwrap_err()
        .to_string()
}

fn with(recording: &Recording, name: &str, values: Vec<f64>) -> Recording {
    let columns = recording
        .names()
        .map(|own| {
            let samples = if own == name {
                values.clone()
            } else {
                recording.channel(own).unwrap().to_vec()
            };
            (own.to_string(), samples)
        })
        .collect();
    Recording::new("test", PERIOD, columns).unwrap()
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
        "valve_command",
        vec![0.1; recording.len()],
    ));
    assert!(
        message.contains("no excitation: valve_command stands at 0.1000 V"),
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
    let message = refused(with(&recording, "displacement", noise));
    assert!(
        message.contains("no excitation: `displacement` is noise for the most part"),
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
    let columns = recording
        .names()
        .filter(|name| *name != "actuator_force")
        .map(|name| (name.to_string(), recording.channel(name).unwrap().to_vec()))
        .collect();
    let message = refused(Recording::new("test", PERIOD, columns).unwrap());
    assert!(
        message.contains("test: no column `actuator_force`"),
        "{message}"
    );
    let message = refused(with(&recording, "acceleration", vec![0.0; recording.len()]));
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
        ("valve_command", 1.0, 0.0),
        ("displacement", 0.01, 1.0),
        ("acceleration", -1.5, 1.0),
        ("actuator_force", 40.0, 2.0),
    ];
    for (name, gain, phase) in channels {
        pure = with(&pure, name, sine(gain, phase));
    }
    // A sampled sine obeys its own recursion: break that so that only the band is at fault.
    let bent: Vec<f64> = pure
        .channel("valve_command")
        .unwrap()
        .iter()
        .map(|u| u + 0.002 * u.powi(3))
        .collect();
    let message = refused(with(&pure, "valve_command", bent));
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
    let x = recording.channel("displacement").unwrap();
    let a = recording.channel("acceleration").unwrap();
    let command = x
        .iter()
        .zip(a)
        .map(|(x, a)| -240.0 * x - 0.004 * a)
        .collect();
    let message = refused(with(&recording, "valve_command", command));
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
    let force = recording.channel("actuator_force").unwrap();
    let turned = force.iter().map(|f| -f).collect();
    let message = refused(with(&recording, "actuator_force", turned));
    assert!(
        message.contains("unstable result where a stable one is expected"),
        "{message}"
    );
    assert!(
        message.contains("check the signs of actuator_force"),
        "{message}"
    );
}

//! Broken records are answered by name, never with a cause.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::f64::consts::TAU;

use diagnosis::{Observer, Verdict};
use plant::identified::effects::{Effects, ValveEffects};
use plant::identified::rig::IdentifiedRig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use recordings::{Channel, Recording, TimeBase};
use rigs::case::{Case, CaseError, Nominal, problems};
use rigs::kinds::shake_table::diagnose;
use rigs::kinds::shake_table::experiment::play;

const NOMINAL: &str = "
sample_rate = 500.0
[actuator]
denominator = [1.0, 56.18, 13330.0, 178.2]
voltage_to_force = [3430.0, 38600.0, 403.3]
velocity_to_force = [565.1, -1818.0, 312000.0]
[table]
mass = 0.1212
damping = 0.2465
stiffness = 23.3189
[specimen]
mass = 0.258799172
damping = 0.162608315
stiffness = 10.216981782
[controller]
kind = \"three_variable_control\"
proportional = 6.15
integral = 0.161
velocity_feedforward = 0.125
acceleration_feedforward = 0.0001
velocity_feedback = 0.005
acceleration_feedback = 0.0001
velocity_filter = 0.25
limit = 10.0
[noise]
displacement = 0.0005
acceleration = 1.5
actuator_force = 0.3
specimen_acceleration = 1.0
valve_command = 0.0005
[uncertainty]
relative = 0.01
";

const SAMPLES: usize = 3000;

/// A recording of the rig in closed loop with sensor noise that the controller does not see: enough
/// for looking at its columns.
fn recording(name: &str, nominal: &Nominal, rig: &IdentifiedRig, seed: u64) -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let period = 1.0 / nominal.sample_rate;
    let phases: Vec<f64> = (0..12).map(|_| TAU * random.random::<f64>()).collect();
    let reference: Vec<f64> = (0..SAMPLES)
        .map(|k| {
            let t = k as f64 * period;
            let waves = phases.iter().enumerate().map(|(i, phase)| {
                let f = 0.3 * 1.4f64.powi(i as i32);
                (TAU * f * t + phase).sin() / (1.0 + f * f)
            });
            0.004 * (t / 0.5).min(1.0) * waves.sum::<f64>()
        })
        .collect();
    let law = nominal.controller.unwrap();
    let rows = play(rig, &law, &reference, period).unwrap();
    let mut channels: [Vec<f64>; 4] = Default::default();
    for row in &rows {
        for i in 0..4 {
            let noise: f64 = random.sample(StandardNormal);
            channels[i].push(row[i] + nominal.noise[i] * noise);
        }
    }
    let valve_command = law.commands(&reference, &channels[0], &channels[1], period);
    let stamps = (0..SAMPLES).map(|k| k as f64 * period).collect();
    let mut columns: Vec<_> = Channel::OUTPUTS.into_iter().zip(channels).collect();
    columns.push((Channel::ValveCommand, valve_command));
    columns.push((Channel::Reference, reference));
    Recording::measured(name, TimeBase::Stamps(stamps), columns).unwrap()
}

/// Changes the samples of a channel.
fn edit(recording: &mut Recording, channel: Channel, change: impl FnOnce(&mut Vec<f64>)) {
    let mut values = recording.samples(channel).to_vec();
    change(&mut values);
    recording.replace(channel, values).unwrap();
}

/// Changes the time stamps.
fn edit_time(recording: &mut Recording, change: impl FnOnce(&mut Vec<f64>)) {
    let TimeBase::Stamps(stamps) = &mut recording.time else {
        panic!("no stamps");
    };
    change(stamps);
}

fn healthy() -> Case {
    let nominal = Nominal::parse(NOMINAL).unwrap();
    let rig = IdentifiedRig {
        shake_table: nominal.shake_table,
        specimen: nominal.specimen,
        effects: Effects {
            valve: ValveEffects {
                dead_band: 0.1,
                ..Default::default()
            },
            ..Default::default()
        },
        ..Default::default()
    };
    Case {
        identification: recording("identification", &nominal, &rig, 1),
        validation: recording("validation", &nominal, &rig, 2),
        small: None,
        baseline: None,
        nominal,
    }
}

fn refused(case: &Case) -> String {
    match diagnose(case, Observer::none()) {
        Err(error @ CaseError::Unfit { .. }) => error.to_string(),
        other => panic!("expected a refusal, got {other:?}"),
    }
}

#[test]
fn a_gap_is_named_with_its_place() {
    let mut case = healthy();
    edit_time(&mut case.validation, |time| {
        time[1200..].iter_mut().for_each(|t| *t += 0.006);
    });
    let message = refused(&case);
    assert!(
        message.contains("validation: a gap after 2.3980 s"),
        "{message}"
    );
    assert!(message.contains("about 3 samples"), "{message}");
}

#[test]
fn another_sampling_rate_is_named() {
    let mut case = healthy();
    edit_time(&mut case.identification, |time| {
        time.iter_mut().for_each(|t| *t *= 2.0);
    });
    let message = refused(&case);
    assert!(
        message.contains("identification: sampled at 250.0000 Hz"),
        "{message}"
    );
}

#[test]
fn a_clipped_sensor_is_named() {
    let mut case = healthy();
    edit(&mut case.identification, Channel::Acceleration, |values| {
        let limit = 0.4 * values.iter().fold(0.0f64, |m, a| m.max(a.abs()));
        values.iter_mut().for_each(|a| *a = a.clamp(-limit, limit));
    });
    let message = refused(&case);
    assert!(message.contains("`acceleration` is clipped"), "{message}");
}

/// Where no law is stated, neither is where the drive's output ends.
#[test]
fn a_command_at_its_rail_is_a_note_and_no_refusal() {
    let mut case = healthy();
    case.nominal.controller = None;
    edit(&mut case.validation, Channel::ValveCommand, |values| {
        let rail = 0.8 * values.iter().fold(0.0f64, |most, u| most.max(u.abs()));
        values.iter_mut().for_each(|u| *u = u.clamp(-rail, rail));
    });
    let found = diagnose(&case, Observer::none()).unwrap();
    let told = |note: &&String| note.starts_with("validation: the valve command is at");
    assert_eq!(
        found.notes.iter().filter(told).count(),
        1,
        "{:?}",
        found.notes
    );
    edit(&mut case.validation, Channel::ValveCommand, |values| {
        let rail = 0.05 * values.iter().fold(0.0f64, |most, u| most.max(u.abs()));
        values.iter_mut().for_each(|u| *u = u.clamp(-rail, rail));
    });
    let message = refused(&case);
    assert!(
        message.contains("the valve command is at its limit in"),
        "{message}"
    );
}

#[test]
fn a_sensor_that_stands_at_its_end_is_clipped_and_not_frozen() {
    let mut case = healthy();
    edit(&mut case.validation, Channel::Displacement, |values| {
        values.iter_mut().for_each(|x| *x = x.clamp(-0.001, 0.001));
    });
    let error = refused(&case);
    assert!(
        error.contains("validation: `displacement` is clipped"),
        "{error}"
    );
}

#[test]
fn a_converter_with_steps_as_coarse_as_the_noise_is_no_fault() {
    let mut case = healthy();
    let noise = case.nominal.noise;
    for (channel, noise) in Channel::OUTPUTS.into_iter().zip(noise) {
        let step = 2.0 * noise;
        let coarse = |values: &mut Vec<f64>| {
            for value in values.iter_mut() {
                *value = (*value / step).round() * step;
            }
        };
        edit(&mut case.identification, channel, coarse);
        edit(&mut case.validation, channel, coarse);
    }
    for recording in [&case.identification, &case.validation] {
        assert_eq!(problems(recording, &case.nominal), Vec::<String>::new());
    }
}

#[test]
fn dropped_samples_that_were_filled_are_named() {
    let mut case = healthy();
    for channel in Channel::OUTPUTS {
        edit(&mut case.identification, channel, |values| {
            for start in [400, 900, 1400] {
                let before = values[start - 1];
                values[start..start + 4].fill(before);
            }
        });
    }
    let error = refused(&case);
    assert!(
        error.contains("identification: 12 samples repeat the one before in all channels"),
        "{error}"
    );
}

#[test]
fn without_displacement_the_rest_is_used() {
    let mut case = healthy();
    case.identification = case.identification.without(Channel::Displacement);
    case.validation = case.validation.without(Channel::Displacement);
    let diagnosis = diagnose(&case, Observer::none()).unwrap();
    assert!(
        diagnosis
            .notes
            .iter()
            .any(|n| n.contains("`displacement` is missing")),
        "{:?}",
        diagnosis.notes
    );
    assert!(
        diagnosis
            .relations
            .keys()
            .all(|name| !name.starts_with("R4"))
    );
    let names: Vec<_> = diagnosis.effects.iter().map(|e| e.effect).collect();
    assert!(
        names.is_empty() || names == ["valve_dead_band"],
        "{names:?}"
    );
}

#[test]
fn a_valve_ten_times_as_weak_as_nominal_is_another_rig_and_no_effect() {
    let mut case = healthy();
    for b in &mut case.nominal.shake_table.actuator.voltage_to_force {
        *b *= 20.0;
    }
    match diagnose(&case, Observer::none()) {
        Ok(diagnosis) => {
            assert_eq!(diagnosis.verdict, Verdict::Unexplained);
            assert!(
                diagnosis
                    .notes
                    .iter()
                    .any(|n| n.contains("belongs to this rig")),
                "{:?}",
                diagnosis.notes
            );
        }
        Err(error) => assert!(error.to_string().contains("belong"), "{error}"),
    }
}

#[test]
fn noise_beyond_what_is_stated_is_named_and_no_effect() {
    let mut case = healthy();
    case.nominal.noise[1] /= 8.0;
    let diagnosis = diagnose(&case, Observer::none()).unwrap();
    assert_eq!(diagnosis.verdict, Verdict::Unexplained);
    assert!(
        diagnosis
            .notes
            .iter()
            .any(|n| n.starts_with("the noise of `acceleration` is") && n.contains("nominal.toml")),
        "{:?}",
        diagnosis.notes
    );
}

#[test]
fn a_frozen_sensor_is_named() {
    let mut case = healthy();
    edit(&mut case.validation, Channel::ActuatorForce, |values| {
        values[500..900].fill(1.0);
    });
    let message = refused(&case);
    assert!(
        message.contains("validation: `actuator_force` is frozen"),
        "{message}"
    );
}

#[test]
fn dropped_readings_are_named() {
    let mut case = healthy();
    edit(&mut case.identification, Channel::Displacement, |values| {
        values[77] = f64::NAN;
    });
    let message = refused(&case);
    assert!(message.contains("`displacement` has 1 empty"), "{message}");
    assert!(message.contains("sample 77"), "{message}");
}

#[test]
fn too_little_excitation_is_named() {
    let mut case = healthy();
    let recording = &mut case.identification;
    edit(recording, Channel::Displacement, |values| {
        values.iter_mut().for_each(|x| *x *= 1e-3);
    });
    let message = refused(&case);
    assert!(
        message.contains("identification: too little excitation"),
        "{message}"
    );
}

#[test]
fn a_table_that_sticks_at_low_level_and_a_command_at_its_limit_are_no_faults() {
    let mut case = healthy();
    let recording = &mut case.identification;
    edit(recording, Channel::Displacement, |values| {
        values.iter_mut().for_each(|x| *x *= 1e-3);
    });
    edit(recording, Channel::ValveCommand, |values| {
        values[500..600].fill(10.0);
    });
    assert_eq!(problems(recording, &case.nominal), Vec::<String>::new());
    edit(recording, Channel::ValveCommand, |values| {
        values[500..600].fill(9.0);
    });
    assert_eq!(problems(recording, &case.nominal).len(), 1);
}

#[test]
fn too_few_samples_are_named() {
    let mut case = healthy();
    case.validation = case.validation.cut(0, 100);
    let message = refused(&case);
    assert!(message.contains("100 samples are too few"), "{message}");
}

#[test]
fn a_sign_turned_over_is_told_from_an_effect() {
    let mut case = healthy();
    for recording in [&mut case.identification, &mut case.validation] {
        edit(recording, Channel::Acceleration, |values| {
            values.iter_mut().for_each(|a| *a = -*a);
        });
    }
    let message = refused(&case);
    assert!(
        message.contains("acceleration and displacement are not from one motion"),
        "{message}"
    );
}

/// Gravity on the accelerometer is larger than the acceleration of slow motion.
#[test]
fn a_table_that_pitches_is_told_from_wrong_columns() {
    let mut case = healthy();
    for recording in [&mut case.identification, &mut case.validation] {
        let displacement = recording.samples(Channel::Displacement).to_vec();
        edit(recording, Channel::Acceleration, |values| {
            let pairs = values.iter_mut().zip(&displacement);
            pairs.for_each(|(a, x)| *a += 16.4 * x);
        });
    }
    let found = diagnose(&case, Observer::none()).unwrap();
    let named: Vec<&str> = found.effects.iter().map(|own| own.effect).collect();
    assert!(named.contains(&"accelerometer_tilt"), "{named:?}");
}

#[test]
fn a_reversed_command_is_told_from_an_effect() {
    let mut case = healthy();
    for recording in [&mut case.identification, &mut case.validation] {
        edit(recording, Channel::ValveCommand, |values| {
            values.iter_mut().for_each(|u| *u = -*u);
        });
    }
    let message = refused(&case);
    assert!(
        message.contains("the force follows the reversed command"),
        "{message}"
    );
}

#[test]
fn channels_swapped_in_the_validation_record_alone_are_named() {
    let mut case = healthy();
    let recording = &mut case.validation;
    let acceleration = recording.samples(Channel::Acceleration).to_vec();
    let of_specimen = recording.samples(Channel::SpecimenAcceleration).to_vec();
    edit(recording, Channel::Acceleration, |values| {
        values.clone_from(&of_specimen);
    });
    edit(recording, Channel::SpecimenAcceleration, |values| {
        values.clone_from(&acceleration);
    });
    let message = refused(&case);
    assert!(message.contains("validation: "), "{message}");
}

#[test]
fn records_with_other_channels_are_not_of_one_rig() {
    let mut case = healthy();
    case.validation = case.validation.without(Channel::SpecimenAcceleration);
    let message = refused(&case);
    assert!(
        message.contains("check that both records are of one rig"),
        "{message}"
    );
}

#[test]
fn a_missing_channel_is_told_and_the_rest_used() {
    let mut case = healthy();
    case.identification = case.identification.without(Channel::SpecimenAcceleration);
    case.validation = case.validation.without(Channel::SpecimenAcceleration);
    let diagnosis = diagnose(&case, Observer::none()).unwrap();
    let notes = diagnosis.notes.join("; ");
    assert!(
        notes.contains("`specimen_acceleration` is missing"),
        "{notes}"
    );
    assert_ne!(diagnosis.verdict, Verdict::Adequate);
}

#[test]
fn rounded_time_stamps_that_the_nominal_rate_explains_are_no_fault() {
    let mut case = healthy();
    edit_time(&mut case.identification, |time| {
        time.iter_mut()
            .for_each(|t| *t = (*t * 100.0).round() / 100.0);
    });
    let found = problems(&case.identification, &case.nominal);
    assert_eq!(found, Vec::<String>::new());
    // Another rate behind the same rounding, and samples that are missing.
    case.nominal.sample_rate = 400.0;
    let found = problems(&case.identification, &case.nominal).join("; ");
    assert!(found.contains("sampled at 500.0000 Hz"), "{found}");
    case.nominal.sample_rate = 500.0;
    edit_time(&mut case.identification, |time| {
        time[1500..].iter_mut().for_each(|t| *t += 0.05);
    });
    let found = problems(&case.identification, &case.nominal).join("; ");
    assert!(found.contains("rounded to 0.01 s"), "{found}");
    edit_time(&mut case.identification, |time| time.fill(0.0));
    let found = problems(&case.identification, &case.nominal).join("; ");
    assert!(found.contains("time does not increase"), "{found}");
}

#[test]
fn the_extended_model_reads_back_as_written() {
    let diagnosis = diagnose(&healthy(), Observer::none()).unwrap();
    assert_eq!(diagnosis.verdict, Verdict::Named, "{}", diagnosis.sentence);
    assert_eq!(diagnosis.effects[0].effect, "valve_dead_band");
    let text = toml::to_string(&diagnosis.extended_model).unwrap();
    let back: rigs::kinds::shake_table::ExtendedModel = toml::from_str(&text).unwrap();
    assert!((back.effects.valve.dead_band - 0.1).abs() < 2e-3, "{text}");
    assert_eq!(back, diagnosis.extended_model);
}

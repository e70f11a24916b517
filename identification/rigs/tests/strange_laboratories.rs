//! Files of laboratories with equations of their own (`tests/strangers/src/laboratory`), which name no cause alone.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::path::PathBuf;

use diagnosis::{Observer, Verdict};
use rigs::kinds::guess::guess;
use rigs::kinds::{INTERVAL_95, RigDiagnosis, diagnose};
use strangers::laboratory::Laboratory;

fn diagnosed(seed: u64) -> RigDiagnosis {
    let drawn = Laboratory::draw(seed);
    let folder = tempfile::tempdir().unwrap();
    drawn.write(folder.path()).unwrap();
    let names = drawn.recordings.iter();
    let files: Vec<PathBuf> = names.map(|(name, _)| folder.path().join(name)).collect();
    let guessed = guess(&files, None).unwrap();
    let found = diagnose(&guessed.description, &guessed.measurement, Observer::none()).unwrap();
    println!("{}", found.sentence());
    found
}

/// An overlap of 0.186 mm beside the friction that every table has, and a delay.
#[test]
#[ignore = "slow: a minute"]
fn an_overlap_that_records_hardly_tell_from_friction_is_said_beside_it() {
    let found = diagnosed(2700);
    let sentence = found.sentence();
    assert!(sentence.contains(" or dead band ("), "{sentence}");
    let half_width = found.readings.iter().find_map(|own| {
        let mut effects = own.effects.iter();
        let (_, values) = effects.find(|(name, _)| name == "dead_band")?;
        Some(values[0].value)
    });
    let off = half_width.unwrap() / 1.86e-4 - 1.0;
    assert!(off.abs() < 0.1, "{half_width:?}");
}

/// An overlap of 0.179 mm under a flow that falls with speed, which one recording shows and the other does not.
#[test]
#[ignore = "slow: a minute"]
fn what_one_recording_shows_is_ranked_where_nothing_is_named() {
    let found = diagnosed(2709);
    assert_eq!(found.verdict, Verdict::Unexplained);
    let with = found.readings.iter().find_map(|own| {
        let mut effects = own.effects.iter();
        let (_, values) = effects.find(|(name, _)| name == "dead_band")?;
        Some((own.weight, values[0].value))
    });
    let (weight, half_width) = with.unwrap();
    assert!(weight > 0.1, "{weight}");
    assert!((half_width - 1.79e-4).abs() < 1e-5, "{half_width}");
}

/// A delay that a lag makes up for, and an accelerometer that reads 4.3 % less.
#[test]
#[ignore = "slow: a minute"]
fn a_loop_that_leaves_nothing_is_adequate_and_its_accelerometer_suspected() {
    let found = diagnosed(2609);
    assert_eq!(found.verdict, Verdict::Adequate);
    let sentence = found.sentence();
    let said = "the accelerometer reads 4 ± 4 % less than the displacement says";
    assert!(sentence.contains(said), "{sentence}");
}

/// A delay of 10.69 ms beside play, under three-variable control that reaches the rail.
#[test]
#[ignore = "slow: a minute"]
fn a_delay_is_found_where_a_rail_ends_the_feedback_of_acceleration() {
    let found = diagnosed(2710);
    let mut causes = found.causes.iter();
    let delay = causes.find(|own| own.found.name == "command_delay");
    let delay = &delay.unwrap().found;
    assert!(delay.standard_error < 1.5e-3, "{delay:?}");
    let off = (delay.value - 10.69e-3).abs() / delay.standard_error;
    assert!(off < INTERVAL_95, "{delay:?}");
}

/// A delay of 4.49 ms beside friction: other lags make up for it.
#[test]
#[ignore = "slow: a minute"]
fn a_delay_that_lags_make_up_for_is_suspected_with_what_data_leave_open() {
    let found = diagnosed(2911);
    let with = found.readings.iter().find_map(|own| {
        let mut causes = own.causes.iter();
        causes.find(|own| own.found.name == "command_delay")
    });
    let delay = &with.unwrap().found;
    let off = (delay.value - 4.49e-3).abs() / delay.standard_error;
    assert!(off < INTERVAL_95, "{delay:?}");
    let sentence = found.sentence();
    assert!(sentence.contains("Perhaps, but not for sure"), "{sentence}");
}

/// An overlap of 0.38 mm, which the second file's commands hardly exceed.
#[test]
#[ignore = "slow: a minute"]
fn an_overlap_is_found_where_commands_hardly_exceed_it() {
    let found = diagnosed(4000);
    for part in [&found.as_described, &found.swapped] {
        let mut effects = part.effects.iter();
        let overlap = effects.find(|own| own.effect == "dead_band").unwrap();
        let width = overlap.parameters[0].value;
        assert!((width - 0.381e-3).abs() < 0.02e-3, "{width}");
    }
}

/// A gain that differs with direction and an overlap, of which one file tells a friction: without them the middle of the
/// motion looks like a zero.
#[test]
#[ignore = "slow: a minute"]
fn a_zero_is_no_cause_where_effects_that_explain_more_have_none() {
    let found = diagnosed(4505);
    assert!(found.causes.is_empty(), "{:?}", found.causes);
    let asymmetry = found.readings.iter().find_map(|own| {
        let mut effects = own.effects.iter();
        effects.find(|(name, _)| name == "asymmetric_gain")
    });
    let (_, values) = asymmetry.unwrap();
    assert!((values[0].value - 0.0996).abs() < 0.01, "{values:?}");
}

/// An overlap beside a delay of 8.88 ms, after which an orifice's flow leaves half a percent.
#[test]
#[ignore = "slow: a minute"]
fn an_effect_of_unknown_size_is_not_named_where_nothing_is_left_without_it() {
    let found = diagnosed(3209);
    let effects: Vec<&str> = found
        .confirmed
        .effects
        .iter()
        .map(|own| own.0.as_str())
        .collect();
    assert_eq!(effects, ["dead_band"]);
    let causes: Vec<&str> = found
        .causes
        .iter()
        .map(|own| own.found.name.as_str())
        .collect();
    assert_eq!(causes, ["command_delay"]);
}

//! Files of laboratories with equations of their own (`tests/strangers/src/laboratory`), which name no cause alone.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::path::PathBuf;

use diagnosis::{Observer, Verdict};
use rigs::kinds::guess::guess;
use rigs::kinds::{RigDiagnosis, diagnose};
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
    assert!(sentence.contains("dead band (0.2"), "{sentence}");
    assert!(sentence.contains(" or dead band ("), "{sentence}");
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

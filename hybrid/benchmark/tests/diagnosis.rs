//! The transfer system of hybrid simulation with something that its model lacks: diagnosed from the record
//! of a plant written from the equations anew, and a tracking law designed again on what was found.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use hybrid::vrths::{BenchmarkCase, PERIOD};
use hybrid_benchmark::vrths::hidden::{HiddenOutcome, HiddenStudy, Recorded};
use hybrid_benchmark::vrths::study::ControllerScore;
use hybrid_benchmark::vrths::{motions, roster};
use identification::diagnosis::engine::Observer;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Steps of the plant a sample, of fourth order: what they are wrong by is far below a microsecond of delay,
/// which the diagnosis would see.
const INNER: usize = 16;

/// What the plant has beside the benchmark's numbers.
#[derive(Clone, Copy)]
struct Hidden {
    /// Of the valve, m.
    play: f64,
    /// Of the specimen's stiffness, relative.
    stiffer: f64,
    /// Of the command, samples.
    late: usize,
}

/// Forces (N) with noise of 2.2 N, one a sample, under `command` (m): the benchmark's definition.
fn forces(command: &[f64], hidden: Hidden, seed: u64) -> Vec<f64> {
    let (a1b0, beta1, beta2, a2, a3) = (2.1283e13, 425.0, 9.9976e4, 4.2297e6, 3.3);
    let (gain, m, nominal): (f64, f64, f64) = (1.0261, 29.13, 1.19e6);
    let c = 2.0 * 0.0097 * (m * nominal).sqrt();
    let k = nominal * (1.0 + hidden.stiffer);
    // Within its play the spool stays.
    let moved = |spool: f64, u: f64, x: f64| {
        let drive = gain * u - x;
        spool.clamp(drive - 0.5 * hidden.play, drive + 0.5 * hidden.play)
    };
    let rates = |[flow, rate, force, x, v]: [f64; 5], spool: f64, u: f64| {
        [
            rate,
            a1b0 * moved(spool, u, x) - beta1 * rate - beta2 * flow,
            flow - a2 * v - a3 * force,
            v,
            (force - c * v - k * x) / m,
        ]
    };
    let after = |state: [f64; 5], by: f64, rate: [f64; 5]| -> [f64; 5] {
        std::array::from_fn(|i| state[i] + by * rate[i])
    };
    let h = PERIOD / INNER as f64;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut state, mut spool) = ([0.0; 5], 0.0);
    let mut record = Vec::with_capacity(command.len());
    let late = std::iter::repeat_n(&0.0, hidden.late);
    for u in late.chain(command).take(command.len()) {
        // Twelve evenly distributed numbers make a nearly normal one.
        let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
        record.push(state[2] + 2.2 * noise);
        for _ in 0..INNER {
            spool = moved(spool, *u, state[3]);
            let first = rates(state, spool, *u);
            let second = rates(after(state, 0.5 * h, first), spool, *u);
            let third = rates(after(state, 0.5 * h, second), spool, *u);
            let last = rates(after(state, h, third), spool, *u);
            let mean =
                std::array::from_fn(|i| (first[i] + 2.0 * (second[i] + third[i]) + last[i]) / 6.0);
            state = after(state, h, mean);
        }
    }
    record
}

/// Five sines that grow from rest, 5 s.
fn command() -> Vec<f64> {
    let sines = [
        (0.7, 2.0e-3),
        (1.9, 1.5e-3),
        (3.6, 1.0e-3),
        (8.3, 3e-4),
        (15.1, 1e-4),
    ];
    let at = |sample: i32| {
        let t = f64::from(sample) * PERIOD;
        let grown = (t / 0.5).min(1.0).powi(2);
        let sum: f64 = sines
            .iter()
            .map(|(hertz, peak)| peak * (std::f64::consts::TAU * hertz * t).sin())
            .sum();
        grown * sum
    };
    (0..5 * 4096).map(at).collect()
}

/// The inverse of the plant, designed on the nominal plant, on what the record of `hidden` tells, and on
/// `told`, in case 1 on the built-in motion.
fn studied(hidden: Hidden, told: &[(&str, f64)], seed: u64) -> HiddenOutcome {
    let told = told
        .iter()
        .map(|(effect, value)| (effect.to_string(), *value));
    let study = HiddenStudy {
        hidden: told.collect(),
        cases: vec![BenchmarkCase::new(1).unwrap()],
        motions: motions::motions(&["built-in".to_string()], None, motions::INTENSITY).unwrap(),
        controllers: vec![roster::entry("inverse").unwrap()],
        seed,
    };
    let command = command();
    let record = Recorded {
        force: forces(&command, hidden, seed),
        command,
        ..Recorded::default()
    };
    study.run(&record, Observer::none()).unwrap()
}

/// J2 and J4 fall to less than `part` of what the nominal design has, and nearly to what a design has that
/// was told.
#[track_caller]
fn gains(outcome: &HiddenOutcome, part: [f64; 2]) {
    let designs = &outcome.controllers["inverse"];
    for (criterion, part) in [1, 3].into_iter().zip(part) {
        let of = |score: &ControllerScore| score.mean[criterion];
        let (before, after) = (of(&designs.nominal), of(&designs.extended));
        let told = of(&designs.informed);
        println!(
            "J{}: {before:.2} % by the nominal model, {after:.2} % by what was found, {told:.2} % told",
            criterion + 1
        );
        assert!(after < part * before, "J{}", criterion + 1);
        assert!(after < 1.2 * told, "J{}", criterion + 1);
    }
}

const PLAY: f64 = 1.5e-4;

fn with_play() -> HiddenOutcome {
    let hidden = Hidden {
        play: PLAY,
        stiffer: 0.0,
        late: 0,
    };
    let outcome = studied(hidden, &[("valve_play", PLAY)], 3);
    println!("{}", outcome.text());
    outcome
}

#[test]
#[ignore = "slow"]
fn play_in_a_plant_written_anew_is_named_and_the_law_designed_on_it_tracks() {
    let outcome = with_play();
    assert!(outcome.named.contains(&"valve_play".to_string()));
    let found = outcome.hidden[0].found.unwrap();
    assert!((found / PLAY - 1.0).abs() < 0.05, "{found}");
    gains(&outcome, [0.6, 0.4]);
}

/// A valve of another stiffness is named as well.
#[test]
#[ignore = "a goal that is not reached"]
fn open_play_alone_is_named() {
    assert_eq!(with_play().named, ["valve_play"]);
}

#[test]
fn a_stiffer_specimen_behind_a_delay_is_named_and_the_law_designed_on_both_tracks() {
    let hidden = Hidden {
        play: 0.0,
        stiffer: 0.08,
        late: 5,
    };
    let told = [("specimen_stiffness", 0.08), ("delay", 5.0 * PERIOD)];
    let outcome = studied(hidden, &told, 6);
    println!("{}", outcome.text());
    let mut named = outcome.named.clone();
    named.sort();
    assert_eq!(named, ["delay", "specimen_stiffness"]);
    for own in &outcome.hidden {
        let found = own.found.unwrap();
        assert!((found / own.value - 1.0).abs() < 0.01, "{own:?}");
    }
    gains(&outcome, [0.6, 0.4]);
}

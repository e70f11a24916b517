//! The transfer system of hybrid simulation with something that its model lacks: diagnosed from records
//! of a plant written from the equations anew, and the tracking laws designed again on what was found.

use identification::diagnosis::engine::{Observer, Verdict};
use identification::diagnosis::rigs::{Measurement, RigDiagnosis, TransferSystemRig, diagnose};
use plant::hybrid::BenchmarkCase;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shakebench::benchmark::vrths::hidden::HiddenStudy;
use shakebench::benchmark::vrths::{motions, roster};

const PERIOD: f64 = 1.0 / 4096.0;
/// Steps of the plant a sample, semi-implicit Euler.
const INNER: usize = 64;

/// What the plant has beside the benchmark's numbers.
#[derive(Clone, Copy, Default)]
struct Hidden {
    play: f64,
}

/// Forces (N) with noise of 2.2 N, one a sample, under `command` (m).
fn forces(command: &[f64], hidden: Hidden, seed: u64) -> Vec<f64> {
    let (a1b0, beta1, beta2, a2, a3) = (2.1283e13, 425.0, 9.9976e4, 4.2297e6, 3.3);
    let (gain, m, k): (f64, f64, f64) = (1.0261, 29.13, 1.19e6);
    let c = 2.0 * 0.0097 * (m * k).sqrt();
    let h = PERIOD / INNER as f64;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut flow, mut rate, mut force, mut x, mut v, mut spool) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut record = Vec::with_capacity(command.len());
    for u in command {
        // Twelve evenly distributed numbers make a nearly normal one.
        let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
        record.push(force + 2.2 * noise);
        for _ in 0..INNER {
            let drive: f64 = gain * u - x;
            if drive - spool > 0.5 * hidden.play {
                spool = drive - 0.5 * hidden.play;
            } else if drive - spool < -0.5 * hidden.play {
                spool = drive + 0.5 * hidden.play;
            }
            rate += h * (a1b0 * spool - beta1 * rate - beta2 * flow);
            flow += h * rate;
            force += h * (flow - a2 * v - a3 * force);
            v += h * (force - c * v - k * x) / m;
            x += h * v;
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
    (0..5 * 4096)
        .map(|sample| {
            let t = f64::from(sample) * PERIOD;
            let grown = (t / 0.5).min(1.0).powi(2);
            let sum: f64 = sines
                .iter()
                .map(|(hertz, peak)| peak * (std::f64::consts::TAU * hertz * t).sin())
                .sum();
            grown * sum
        })
        .collect()
}

fn diagnosed(hidden: Hidden, seed: u64) -> RigDiagnosis {
    let rig = TransferSystemRig::benchmark().unwrap();
    let command = command();
    let force = forces(&command, hidden, seed);
    let recording = rig.recording("record", command, force).unwrap();
    let measurement = Measurement {
        recordings: vec![recording],
    };
    diagnose(&rig.description, &measurement, Observer::none()).unwrap()
}

fn value(found: &RigDiagnosis, effect: &str) -> f64 {
    let mut effects = found.as_described.effects.iter();
    let effect = effects.find(|one| one.effect == effect).unwrap();
    effect.parameters[0].value
}

#[test]
fn what_a_plant_written_anew_hides_is_named() {
    let nothing = diagnosed(Hidden::default(), 1);
    assert_eq!(nothing.verdict, Verdict::Adequate, "{nothing:?}");

    let play = Hidden { play: 1.5e-4 };
    let found = diagnosed(play, 3);
    assert_eq!(found.named, ["valve_play"], "{found:?}");
    assert!((value(&found, "valve_play") / 1.5e-4 - 1.0).abs() < 0.05);
}

#[test]
fn a_law_designed_on_what_was_found_is_as_good_as_one_that_was_told() {
    let study = HiddenStudy {
        hidden: vec![("valve_play".to_string(), 2e-4)],
        cases: vec![BenchmarkCase::new(1).unwrap()],
        motions: motions::motions(&["built-in".to_string()], None, motions::INTENSITY).unwrap(),
        controllers: vec![roster::entry("inverse").unwrap()],
        seed: 4,
    };
    let outcome = study.run(Observer::none()).unwrap();
    assert_eq!(outcome.named, ["valve_play"]);
    let designs = &outcome.controllers["inverse"];
    for criterion in [1, 3] {
        let of =
            |score: &shakebench::benchmark::vrths::study::ControllerScore| score.mean[criterion];
        let (before, after) = (of(&designs.nominal), of(&designs.extended));
        assert!(after < 0.6 * before, "J{}: {before} {after}", criterion + 1);
        assert!(after < 1.2 * of(&designs.informed));
    }
}

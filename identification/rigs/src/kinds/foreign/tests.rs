//! A model that the tests know inside, diagnosed as if they did not.

use plant::signal_path::{SignalEffects, SignalPath};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

const STEP: f64 = 0.005;
const SAMPLES: usize = 4000;

/// `m x'' + c x' + k x + k3 x³ = f`, semi-implicit Euler in fine steps; f held over a step.
struct Oscillator {
    cubic: f64,
}

const FINE: usize = 8;
const NOMINAL: [f64; 3] = [1.0, 2.0, 400.0];

impl Simulator for Oscillator {
    fn simulate(
        &self,
        inputs: &[&[f64]],
        parameters: &[(usize, f64)],
        step: f64,
        steps: usize,
    ) -> Option<Vec<Vec<f64>>> {
        let mut values = NOMINAL;
        for (place, value) in parameters {
            values[*place] = *value;
        }
        let [mass, damping, stiffness] = values;
        let (mut x, mut v) = (0.0_f64, 0.0);
        let h = step / FINE as f64;
        let out = (0..steps).map(|k| {
            let now = x;
            for _ in 0..FINE {
                let back = stiffness * x + self.cubic * x.powi(3);
                v += h * (inputs[0][k] - damping * v - back) / mass;
                x += h * v;
            }
            now
        });
        Some(vec![out.collect()])
    }
}

/// A force of sines that do not repeat.
fn force() -> Vec<f64> {
    let at = |k: usize| {
        let t = STEP * k as f64;
        let sines = [(3.1, 40.0), (7.3, 60.0), (14.9, 80.0), (24.7, 60.0)];
        sines.iter().map(|(w, a)| a * (w * t + 0.3 * w).sin()).sum()
    };
    (0..SAMPLES).map(at).collect()
}

/// What a rig with these effects shows, with white noise of a share of its variation.
fn shown(
    cubic: f64,
    parameters: &[(usize, f64)],
    on_input: SignalEffects,
    on_output: SignalEffects,
    noise: f64,
) -> Vec<f64> {
    let force = SignalPath::pass(on_input, STEP, &force()).unwrap();
    let rig = Oscillator { cubic };
    let mut out = rig.simulate(&[&force], parameters, STEP, SAMPLES).unwrap();
    let mut out = SignalPath::pass(on_output, STEP, &out.remove(0)).unwrap();
    let deviation = recordings::mean_and_deviation(&out).1;
    let mut random = ChaCha8Rng::seed_from_u64(11);
    for y in &mut out {
        // Uniform: the diagnosis assumes no distribution.
        *y += noise * deviation * 3.0_f64.sqrt() * random.random_range(-1.0..1.0);
    }
    out
}

fn diagnosed(output: Vec<f64>) -> ForeignDiagnosis {
    let simulator = Oscillator { cubic: 0.0 };
    let signal = |name: &str, unit: &str| Signal {
        name: name.to_owned(),
        unit: unit.to_owned(),
    };
    let names = [("mass", "kg"), ("damping", "N s/m"), ("stiffness", "N/m")];
    let parameters = names
        .iter()
        .zip(NOMINAL)
        .map(|((name, unit), value)| Parameter {
            name: (*name).to_owned(),
            unit: (*unit).to_owned(),
            value,
            plus_minus: 0.02 * value,
        });
    let model = ForeignModel {
        name: "oscillator".to_owned(),
        simulator: &simulator,
        inputs: vec![signal("force", "N")],
        outputs: vec![signal("displacement", "m")],
        parameters: parameters.collect(),
        trials: vec![Trial {
            name: "record".to_owned(),
            step: STEP,
            stride: 1,
            inputs: vec![force()],
            outputs: vec![output],
            left_out: (0..SAMPLES).map(|k| k >= SAMPLES / 2).collect(),
        }],
    };
    diagnose(&model, Observer::none()).unwrap()
}

/// Names of the effects with their first parameter.
fn named(found: &ForeignDiagnosis) -> Vec<(&str, f64)> {
    let effects = found.found.confirmed.effects.iter();
    effects
        .map(|(name, values)| (name.as_str(), values[0].value))
        .collect()
}

#[test]
fn nothing_hidden_is_adequate_with_noise_and_without() {
    for noise in [0.0, 0.02] {
        let none = SignalEffects::NONE;
        let found = diagnosed(shown(0.0, &[], none, none, noise));
        assert_eq!(
            found.found.verdict,
            Verdict::Adequate,
            "{:?}",
            named(&found)
        );
        assert!(named(&found).is_empty());
    }
}

#[test]
fn play_of_the_input_is_named_with_its_width() {
    let play = SignalEffects {
        play: 40.0,
        ..SignalEffects::NONE
    };
    let found = diagnosed(shown(0.0, &[], play, SignalEffects::NONE, 0.02));
    assert_eq!(found.found.verdict, Verdict::Named);
    let [(name, width)] = named(&found)[..] else {
        panic!("{:?}", named(&found));
    };
    assert_eq!(name, "force.play");
    assert!((width / 40.0 - 1.0).abs() < 0.05, "{width}");
    assert!(found.predictable < 0.1, "{}", found.predictable);
}

#[test]
fn a_delay_is_named_with_the_places_that_no_record_can_tell_apart() {
    let late = SignalEffects {
        delay: 0.062,
        ..SignalEffects::NONE
    };
    let found = diagnosed(shown(0.0, &[], SignalEffects::NONE, late, 0.02));
    assert_eq!(found.found.verdict, Verdict::Named, "{:?}", found.found);
    let [(name, time)] = named(&found)[..] else {
        panic!("{:?}", named(&found));
    };
    assert!(name.ends_with(".delay"));
    assert!((time - 0.062).abs() < 1e-3, "{time}");
    assert_eq!(found.equivalents[0].1.len(), 1, "{:?}", found.equivalents);
}

#[test]
fn a_drift_and_a_dead_band_are_named_together() {
    let band = SignalEffects {
        dead_band: 25.0,
        ..SignalEffects::NONE
    };
    let softer = [(2, 0.8 * NOMINAL[2])];
    let found = diagnosed(shown(0.0, &softer, band, SignalEffects::NONE, 0.01));
    assert_eq!(found.found.verdict, Verdict::Named);
    let mut all = named(&found);
    all.sort_by(|a, b| a.0.cmp(b.0));
    let [(first, width), (second, change)] = all[..] else {
        panic!("{all:?}");
    };
    assert_eq!((first, second), ("force.dead_band", "stiffness.drift"));
    assert!(
        (width / 25.0 - 1.0).abs() < 0.05 && (change + 0.2).abs() < 0.01,
        "{all:?}"
    );
}

#[test]
fn a_cause_inside_the_model_is_seen_and_not_named() {
    let none = SignalEffects::NONE;
    let found = diagnosed(shown(4000.0, &[], none, none, 0.01));
    assert_eq!(
        found.found.verdict,
        Verdict::Unexplained,
        "{:?}",
        named(&found)
    );
    assert!(
        found
            .notes
            .iter()
            .any(|note| note.contains("inside the model"))
    );
}

#[test]
fn a_drift_within_what_was_stated_is_adequate() {
    let stiffer = [(2, 1.015 * NOMINAL[2])];
    let none = SignalEffects::NONE;
    let found = diagnosed(shown(0.0, &stiffer, none, none, 0.01));
    assert_eq!(
        found.found.verdict,
        Verdict::Adequate,
        "{:?}",
        named(&found)
    );
}

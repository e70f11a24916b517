//! Where no effect explains the records, the diagnosis proposes the motion that shows more of what is left.

use fmi_master::Algorithm;
use hidden_effects::case::{Case, Kind, Settings};
use hidden_effects::outside::Outside;
use identification::diagnosis::case::ControlLaw;
use identification::diagnosis::engine::{Observer, Verdict};
use identification::diagnosis::rigs::shake_table::experiment::{self, Motion, motions};
use identification::diagnosis::rigs::shake_table::left_over::{Residual, left_over, play, probe};
use identification::diagnosis::rigs::shake_table::predictor::{
    Disturbance, Noise, Predictor, Samples,
};
use laboratory::diagnosis::diagnose;
use laboratory::results::Out;
use laboratory::run::experiment::{Request, prepare};
use plant::identified::rig::IdentifiedRig;
use plant::specimens::linear::LinearSpecimen;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use units::constants::INCH;

const PERIOD: f64 = 2e-3;
const NOISE: [f64; 4] = [1.3e-5, 0.04, 1.3, 0.025];
const LAW: ControlLaw = ControlLaw {
    proportional: 6.15 / INCH,
    integral: 0.161 / INCH,
    velocity_feedforward: 0.125 / INCH,
    acceleration_feedforward: 1e-4 / INCH,
    velocity_feedback: 0.005 / INCH,
    acceleration_feedback: 1e-4 / INCH,
    velocity_filter: 0.25,
    limit: 10.0,
};

fn healthy() -> IdentifiedRig {
    IdentifiedRig {
        specimen: Some(LinearSpecimen::default()),
        ..Default::default()
    }
}

/// A record of `rig` with its sensors' noise, and what `model` leaves over of it.
fn record(rig: &IdentifiedRig, model: &IdentifiedRig, motion: &[f64]) -> (Samples, Vec<f64>) {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut channels = experiment::play(rig, &LAW, motion, PERIOD).unwrap();
    let command = experiment::commands(&LAW, motion, &channels, PERIOD);
    for row in &mut channels {
        for (value, noise) in row.iter_mut().zip(NOISE) {
            let normal: f64 = StandardNormal.sample(&mut random);
            *value += noise * normal;
        }
    }
    let samples = Samples { command, channels };
    let noise = Noise::new(NOISE, Disturbance::below(1e-3, 30.0, PERIOD));
    let predictor = Predictor::design(model, PERIOD, &noise).unwrap();
    let mut out = vec![0.0; 4 * samples.len()];
    let sampled = predictor.sample(model).unwrap();
    assert!(predictor.innovations(&sampled, &samples, &mut out));
    (samples, out)
}

fn mean_excess((samples, whitened): &(Samples, Vec<f64>)) -> f64 {
    let blocks = left_over(&Residual { samples, whitened }, PERIOD);
    blocks.iter().sum::<f64>() / blocks.len() as f64
}

/// What the model lacks is hidden; the proposed motion shows more of it than any record did, and is in the
/// best quarter of all motions.
#[test]
fn the_proposed_motion_shows_more_of_what_is_not_explained() {
    let model = healthy();
    let (mut drooping, mut stalling) = (model, model);
    drooping.effects.hydraulics.droop_loss = 0.03;
    stalling.effects.hydraulics.stall_force = 600.0;
    for there in [drooping, stalling] {
        // Noise, sweep and sine of a moderate size.
        let is_moderate = |motion: &Motion| (0.2..0.5).contains(&(motion.peak / INCH));
        let moderate: Vec<Motion> = motions(PERIOD).filter(is_moderate).collect();
        let records: Vec<_> = [3, 1, 2]
            .iter()
            .map(|place| &moderate[*place])
            .map(|motion| record(&there, &model, &motion.reference))
            .collect();
        let residuals: Vec<Residual<'_>> = records
            .iter()
            .map(|(samples, whitened)| Residual { samples, whitened })
            .collect();
        let found = probe(&model, &LAW, &residuals, PERIOD).unwrap();
        let shown = mean_excess(&record(&there, &model, &found.reference));
        let before = records.iter().map(mean_excess).fold(0.0, f64::max);
        let mut all: Vec<f64> = motions(PERIOD)
            .filter(|motion| play(&model, &LAW, motion, PERIOD).is_some())
            .map(|motion| mean_excess(&record(&there, &model, &motion.reference)))
            .collect();
        all.sort_by(f64::total_cmp);
        let upper = all[3 * all.len() / 4];
        let told = found.sentence();
        println!("{told}: before {before:.2}, shown {shown:.2}, upper quarter above {upper:.2}");
        assert!(shown > before, "{told}: {shown} {before}");
        assert!(shown >= upper, "{told}: {shown} {upper}");
    }
}

#[test]
fn what_does_not_follow_the_motion_asks_for_none() {
    let model = healthy();
    let motion = motions(PERIOD).nth(17).unwrap();
    let (samples, mut whitened) = record(&model, &model, &motion.reference);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for value in &mut whitened {
        let normal: f64 = StandardNormal.sample(&mut random);
        *value = 1.5 * normal;
    }
    let (samples, whitened) = (&samples, whitened.as_slice());
    let residual = Residual { samples, whitened };
    assert_eq!(probe(&model, &LAW, &[residual], PERIOD), None);
}

/// From files to a motion that `run` plays: drag grows with speed, and so does what is left.
#[test]
fn an_unexplained_case_leaves_a_motion_that_run_plays() {
    let folder = tempfile::tempdir().unwrap();
    let (case, out) = (folder.path().join("case"), folder.path().join("out"));
    let kind = Kind::ThisOutside(Outside::QuadraticDrag);
    Case::draw(32, &Settings::new(kind)).write(&case).unwrap();
    let report = diagnose(&case, &[], None, &Out::new(&out), Observer::none()).unwrap();
    assert_eq!(report.verdict, Verdict::Unexplained, "{}", report.sentence);
    let told = report.separating_experiment.unwrap();
    assert!(told.contains("the residual is largest at speeds"), "{told}");
    let motion = report.separating_motion.unwrap();
    assert_eq!(motion, out.join("separating_motion.csv"));
    let request = Request {
        reference: Some(motion),
        duration_s: Some(2.0),
        ..Request::built_in("three-variable")
    };
    let outcome = prepare(&request).unwrap().run(Algorithm::GaussSeidel);
    let outcome = outcome.unwrap();
    assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
}

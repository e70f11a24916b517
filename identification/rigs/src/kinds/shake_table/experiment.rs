//! The experiment that tells two models apart: simulate both under several motions, take the one
//! in which they differ most, as long as the rig can play it.

use plant::ModelError;
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use units::constants::INCH;

use crate::case::ControlLaw;

/// What a proposed experiment is for.
#[derive(Debug, Clone, PartialEq)]
pub enum Aim {
    /// To tell two models apart.
    Rivals {
        /// Root mean square difference of the channels, in standard deviations of their noise.
        separation: f64,
    },
    /// To show more of what no model explains.
    LeftOver {
        /// Where that is, in words.
        place: String,
        /// How many times as much of it a sample is expected as in the record that shows most.
        times: f64,
    },
}

/// A motion and what it is to show.
#[derive(Debug, Clone, PartialEq)]
pub struct SeparatingExperiment {
    /// Kind of motion.
    pub kind: &'static str,
    /// Peak displacement of its reference, m.
    pub peak: f64,
    /// What it is for.
    pub aim: Aim,
    /// Sampling period of the reference, s.
    pub period: f64,
    /// The reference, m, from rest to rest.
    pub reference: Vec<f64>,
}

impl SeparatingExperiment {
    /// It in words.
    pub fn sentence(&self) -> String {
        let motion = format!(
            "{} with a peak of {:.2} in ({:.1} mm)",
            self.kind,
            self.peak / INCH,
            1e3 * self.peak
        );
        match &self.aim {
            Aim::Rivals { separation } => format!(
                "{motion}: with it the rivals differ by {separation:.1} standard deviations of \
                 the noise"
            ),
            Aim::LeftOver { place, times } => format!(
                "{motion}: the residual is largest at {place}, and per sample this motion should \
                 show {times:.1} times as much of it as the best record"
            ),
        }
    }
}

/// A motion that may be proposed.
pub struct Motion {
    /// Its kind in words.
    pub kind: &'static str,
    /// Peak displacement, m.
    pub peak: f64,
    /// Displacement, m.
    pub reference: Vec<f64>,
}

/// Every motion that may be proposed.
pub fn motions(period: f64) -> impl Iterator<Item = Motion> {
    let samples = (DURATION / period) as usize;
    KINDS
        .into_iter()
        .enumerate()
        .flat_map(move |(index, kind)| {
            PEAKS.map(|peak| Motion {
                kind,
                peak,
                reference: reference(index, peak, samples, period),
            })
        })
}

/// Length of a proposed motion, s.
const DURATION: f64 = 20.0;
/// Over which it begins and ends, s.
const RAMP: f64 = 1.0;
/// Proposed amplitudes stay inside the stroke with room to spare, m.
const PEAKS: [f64; 5] = [0.03 * INCH, 0.1 * INCH, 0.3 * INCH, 0.7 * INCH, 1.1 * INCH];
const KINDS: [&str; 6] = [
    "slow triangle of 0.1 Hz",
    "sine sweep from 0.2 to 12 Hz",
    "steady sine of 1 Hz",
    "noise from 0.2 to 3 Hz",
    "noise from 2 to 12 Hz",
    "noise from 8 to 30 Hz",
];
/// Share of the law's limit that a proposed motion may ask of the command: beyond it both rigs saturate.
const OF_THE_LIMIT: f64 = 0.9;
/// Lines of a noise, whose phases are drawn.
const LINES: usize = 60;
const SEED: u64 = 20;

/// A sum of sines between `low` and `high` (Hz), evenly spaced on the logarithm and of one velocity.
fn noise(low: f64, high: f64, samples: usize, period: f64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let tau = std::f64::consts::TAU;
    let lines: Vec<(f64, f64)> = (0..LINES)
        .map(|i| {
            let place = (i as f64 + random.random_range(0.0..1.0)) / LINES as f64;
            let frequency = low * (high / low).powf(place);
            (frequency, random.random_range(0.0..tau))
        })
        .collect();
    let at = |t: f64| -> f64 {
        let all = lines.iter();
        all.map(|(f, phase)| (tau * f * t + phase).sin() / f).sum()
    };
    (0..samples).map(|k| at(k as f64 * period)).collect()
}

/// The motion of a kind with its `peak` (m).
fn reference(kind: usize, peak: f64, samples: usize, period: f64) -> Vec<f64> {
    let time = |k: usize| k as f64 * period;
    let mut phase = 0.0f64;
    let shape: Vec<f64> = match kind {
        0 => (0..samples)
            .map(|k| 1.0 - (4.0 * (0.1 * time(k) + 0.25).fract() - 2.0).abs())
            .collect(),
        1 => (0..samples)
            .map(|k| {
                let frequency = 0.2 * 60f64.powf(time(k) / DURATION);
                phase += std::f64::consts::TAU * frequency * period;
                phase.sin() / (1.0 + 0.2 * frequency * frequency)
            })
            .collect(),
        2 => (0..samples)
            .map(|k| (std::f64::consts::TAU * time(k)).sin())
            .collect(),
        3 => noise(0.2, 3.0, samples, period),
        4 => noise(2.0, 12.0, samples, period),
        _ => noise(8.0, 30.0, samples, period),
    };
    let ramp = |k: usize| {
        let from_the_ends = time(k).min(time(samples - 1 - k)) / RAMP;
        let share = from_the_ends.min(1.0);
        share * share * (3.0 - 2.0 * share)
    };
    let shape: Vec<f64> = (0..samples).map(|k| ramp(k) * shape[k]).collect();
    let largest = shape.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
    shape.into_iter().map(|v| peak * v / largest).collect()
}

/// What the sensors of `rig` show in closed loop with `law` on `reference`, without noise.
///
/// # Errors
/// A rig that cannot be sampled.
pub fn play(
    rig: &IdentifiedRig,
    law: &ControlLaw,
    reference: &[f64],
    period: f64,
) -> Result<Vec<[f64; 4]>, ModelError> {
    let plant = rig.sample(period, 2)?;
    let mut state = IdentifiedRigState::default();
    let mut controller = law.start(period);
    Ok((0..reference.len())
        .map(|k| {
            let shown = plant.measure(&mut state, k as f64 * period);
            let command = controller.command(reference, k, shown[0], shown[1]);
            plant.step(&mut state, command);
            shown
        })
        .collect())
}

/// The commands (V) that `law` gives where `reference` is asked and the sensors have `shown` what they did.
pub fn commands(law: &ControlLaw, reference: &[f64], shown: &[[f64; 4]], period: f64) -> Vec<f64> {
    let channel = |i: usize| -> Vec<f64> { shown.iter().map(|y| y[i]).collect() };
    law.commands(reference, &channel(0), &channel(1), period)
}

/// Whether `commands` stay within the limit of `law`.
pub fn is_playable(law: &ControlLaw, commands: &[f64]) -> bool {
    commands.iter().all(|u| u.abs() <= OF_THE_LIMIT * law.limit)
}

/// The most telling of the proposed motions for `a` against `b`, of those that neither drives to the
/// limit of the law.
pub fn separate(
    a: &IdentifiedRig,
    b: &IdentifiedRig,
    law: &ControlLaw,
    noise: &[f64; 4],
    period: f64,
) -> Option<SeparatingExperiment> {
    let separated = motions(period).filter_map(|motion| {
        let shown = |rig| play(rig, law, &motion.reference, period).ok();
        let (one, other) = (shown(a)?, shown(b)?);
        let stays = |shown| is_playable(law, &commands(law, &motion.reference, shown, period));
        if !(stays(&one) && stays(&other)) {
            return None;
        }
        let differences = one
            .iter()
            .zip(&other)
            .flat_map(|(y, z)| (0..4).map(move |i| (y[i] - z[i]) / noise[i]));
        let sum: f64 = differences.map(|d| d * d).sum();
        let separation = (sum / (4 * one.len()) as f64).sqrt();
        separation.is_finite().then_some((separation, motion))
    });
    let (separation, motion) = separated.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(SeparatingExperiment {
        kind: motion.kind,
        peak: motion.peak,
        aim: Aim::Rivals { separation },
        period,
        reference: motion.reference,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::specimens::linear::LinearSpecimen;
    use rand_distr::{Distribution, StandardNormal};

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

    #[test]
    fn the_proposed_motion_tells_two_rigs_apart_and_can_be_played() {
        let healthy = IdentifiedRig {
            specimen: Some(LinearSpecimen::default()),
            ..Default::default()
        };
        let (mut dry, mut viscous) = (healthy, healthy);
        dry.effects.friction.coulomb_force = 10.0;
        viscous.shake_table.table.damping += 60.0;
        let found = separate(&dry, &viscous, &LAW, &NOISE, PERIOD).unwrap();
        let Aim::Rivals { separation } = found.aim else {
            panic!("{}", found.sentence());
        };
        assert!(separation > 1.0, "{} {separation}", found.kind);
        let x = &found.reference;
        let ends = [x[0], x[1], x[x.len() - 2], x[x.len() - 1]];
        assert!(ends.iter().all(|x| x.abs() < 1e-4 * found.peak), "{ends:?}");
        let largest = x.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        assert!((largest / found.peak - 1.0).abs() < 1e-9 && largest < 1.4 * INCH);
        // What the first rig then records, with noise, is its own and not the other's.
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut record = play(&dry, &LAW, x, PERIOD).unwrap();
        for row in &mut record {
            for (value, noise) in row.iter_mut().zip(NOISE) {
                let normal: f64 = StandardNormal.sample(&mut random);
                *value += noise * normal;
            }
        }
        let missed = |rig: &IdentifiedRig| {
            let model = play(rig, &LAW, x, PERIOD).unwrap();
            let squares = record
                .iter()
                .zip(&model)
                .flat_map(|(y, z)| (0..4).map(move |i| ((y[i] - z[i]) / NOISE[i]).powi(2)));
            (squares.sum::<f64>() / (4 * x.len()) as f64).sqrt()
        };
        assert!((missed(&dry) - 1.0).abs() < 0.05, "{}", missed(&dry));
        assert!(missed(&viscous) > 1.3, "{}", missed(&viscous));
    }
}

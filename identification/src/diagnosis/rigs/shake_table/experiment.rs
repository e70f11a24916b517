//! The experiment that tells two models apart: simulate both under several motions, take the one
//! in which they differ most.

use plant::ModelError;
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use units::constants::INCH;

use crate::diagnosis::case::ControlLaw;

/// A motion and how well it separates two models.
#[derive(Debug, Clone, PartialEq)]
pub struct SeparatingExperiment {
    /// Kind of motion.
    pub kind: &'static str,
    /// Peak displacement of its reference, m.
    pub peak: f64,
    /// Root mean square difference of the channels, in standard deviations of their noise.
    pub separation: f64,
}

/// Length of a proposed motion, s.
const DURATION: f64 = 20.0;
/// Proposed amplitudes stay inside the stroke with room to spare, m.
const PEAKS: [f64; 4] = [0.1 * INCH, 0.3 * INCH, 0.7 * INCH, 1.1 * INCH];
const KINDS: [&str; 3] = [
    "slow triangle of 0.1 Hz",
    "sine sweep from 0.2 to 12 Hz",
    "steady sine of 1 Hz",
];

fn reference(kind: usize, peak: f64, samples: usize, period: f64) -> Vec<f64> {
    let mut phase = 0.0f64;
    (0..samples)
        .map(|k| {
            let t = k as f64 * period;
            let ramp = (t / 0.5).min(1.0);
            let value = match kind {
                0 => {
                    let cycle = (0.1 * t + 0.25).fract();
                    1.0 - (4.0 * cycle - 2.0).abs()
                }
                1 => {
                    let frequency = 0.2 * 60f64.powf(t / DURATION);
                    phase += std::f64::consts::TAU * frequency * period;
                    phase.sin() / (1.0 + 0.2 * frequency * frequency)
                }
                _ => (std::f64::consts::TAU * t).sin(),
            };
            peak * ramp * ramp * value
        })
        .collect()
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

/// The most telling of the proposed motions for `a` against `b`.
pub fn separate(
    a: &IdentifiedRig,
    b: &IdentifiedRig,
    law: &ControlLaw,
    noise: &[f64; 4],
    period: f64,
) -> Option<SeparatingExperiment> {
    let samples = (DURATION / period) as usize;
    let mut best: Option<SeparatingExperiment> = None;
    for (index, kind) in KINDS.into_iter().enumerate() {
        for peak in PEAKS {
            let motion = reference(index, peak, samples, period);
            let (Ok(one), Ok(other)) =
                (play(a, law, &motion, period), play(b, law, &motion, period))
            else {
                continue;
            };
            let sum: f64 = one
                .iter()
                .zip(&other)
                .flat_map(|(y, z)| (0..4).map(move |i| (y[i] - z[i]) / noise[i]))
                .map(|d| d * d)
                .sum();
            let separation = (sum / (4 * samples) as f64).sqrt();
            if separation.is_finite()
                && best
                    .as_ref()
                    .is_none_or(|best| separation > best.separation)
            {
                best = Some(SeparatingExperiment {
                    kind,
                    peak,
                    separation,
                });
            }
        }
    }
    best
}

//! The seals' friction once more, by replaying the recordings on the identified rig.
//!
//! The equations between the channels see the friction along the *measured* velocity, whose noise hides
//! what happens within a few micrometres of a reversal. Here the rig is simulated under the recorded
//! command, so that its own velocity decides when the seals slide, and the friction is what makes
//! simulated acceleration and displacement agree with the recorded ones (output error; Ljung, System
//! Identification, 1999, section 4.3). A rig that integrates its command would drift: a slow correction
//! towards the measured displacement holds it, too slow to hide the friction.

use nalgebra::{DMatrix, DVector};

use super::Found;
use super::equations::{EQUATIONS, Equations, HydraulicRig, PARAMETERS};
use super::friction::{SHAPE, SealShape, Searched};
use super::least_squares::{Coordinate, Residuals, minimise};
use super::simulation::Simulation;
use super::specimen::SpecimenOverMass;
use super::velocity::velocity;
use crate::data::{Channel, Recording};

/// Rate at which the replayed displacement is led back to the measured one, rad/s.
const CORRECTION: f64 = 1.0;
/// Time in which what went before a record has died away, s.
const SETTLING: f64 = 3.0;
/// Longest inner step, s.
const STEP: f64 = 5e-4;
/// Samples that are replayed of all recordings together, at most.
const MOST: usize = 60_000;
/// Length of the blocks whose scatter gives the standard errors, s.
const BLOCK: f64 = 2.0;
/// Share of the viscous force that the shape of the curve may take for dry friction, or the other way:
/// valve and seals are not quite what the model's form says.
const MISTAKEN: f64 = 0.02;
/// Parameters: Coulomb force and damping of the seals over those before, then the changes of the shape.
const FITTED: usize = 2 + SHAPE;

/// Places of the seals' damping and Coulomb force among the parameters.
const SEAL_DAMPING: usize = 5;
const SEAL_FRICTION: usize = 6;

/// A recording to be replayed.
#[derive(Debug, Clone, Copy)]
pub struct Replayed<'a> {
    /// It.
    pub recording: &'a Recording,
    /// Its payload over the first experiment's, kg.
    pub payload: f64,
    /// What stands on the table.
    pub specimen: Option<SpecimenOverMass>,
}

/// Friction as replaying finds it.
#[derive(Debug, Clone, PartialEq)]
pub struct Friction {
    /// Damping of the seals, N s/m.
    pub damping: f64,
    /// Their Coulomb force, N.
    pub coulomb: f64,
    /// The shape over it.
    pub shape: SealShape,
    /// Standard errors of damping (N s/m) and Coulomb force (N): the scatter between blocks of the
    /// records and, of the latter, a fiftieth of the viscous force.
    pub standard_errors: [f64; 2],
    /// Root mean square of the replay's errors in the parts that were not fitted, over that before.
    pub improvement: f64,
}

struct Replay<'a> {
    records: &'a [Replayed<'a>],
    rig: HydraulicRig,
    shape: SealShape,
    /// Root mean squares of the errors of displacement and acceleration over the part of the samples
    /// that tell something of their own, by which they are weighed.
    weights: [f64; 2],
    /// Standard deviation of the logarithm of the Coulomb force, as far as it is known.
    known: f64,
    /// Parts of each record between which errors count.
    part: (f64, f64),
}

impl Replay<'_> {
    fn at(&self, values: &[f64]) -> (HydraulicRig, SealShape) {
        let rig = HydraulicRig {
            seal_friction: self.rig.seal_friction * values[0].exp(),
            seal_damping: self.rig.seal_damping * values[1].exp(),
            ..self.rig
        };
        (rig, self.shape.changed(&values[2..]))
    }

    /// Errors of displacement and acceleration over their weights, record by record.
    fn errors(&self, values: &[f64]) -> Option<Vec<Vec<[f64; 2]>>> {
        let (rig, shape) = self.at(values);
        self.records
            .iter()
            .map(|own| {
                let recording = own.recording;
                let period = recording.period();
                let ways = recording.channel(Channel::Displacement)?;
                let measured = recording.channel(Channel::Acceleration)?;
                let commands = recording.channel(Channel::ValveCommand)?;
                let mut model = Simulation::new(rig, shape, own.payload, own.specimen, period)
                    .with_steps_of(STEP)
                    .starting_at(*ways.first()?);
                let lead = CORRECTION * rig.oil_stiffness / rig.force_rate;
                let share = MOST as f64 / self.records.len() as f64;
                let last = (self.part.1 * (recording.len() as f64).min(share)) as usize;
                let first = (self.part.0 * (recording.len() as f64).min(share)) as usize;
                let first = first.max((SETTLING / period) as usize);
                let mut errors = Vec::with_capacity(last.saturating_sub(first));
                for k in 0..last {
                    let shown = model.shown();
                    let error = [
                        shown.displacement - ways[k],
                        shown.acceleration - measured[k],
                    ];
                    model.step(commands[k] - lead * error[0]);
                    if !(error[0].is_finite() && error[1].is_finite()) {
                        return None;
                    }
                    if k >= first {
                        errors.push([0, 1].map(|i| error[i] / self.weights[i]));
                    }
                }
                // Zeros of the sensors are no friction.
                let mean = |i: usize| {
                    errors.iter().map(|e| e[i]).sum::<f64>() / errors.len().max(1) as f64
                };
                let means = [mean(0), mean(1)];
                for error in &mut errors {
                    for i in 0..2 {
                        error[i] -= means[i];
                    }
                }
                Some(errors)
            })
            .collect()
    }

    /// Root mean squares of the errors over their weights.
    fn sizes(&self, values: &[f64]) -> Option<[f64; 2]> {
        let errors = self.errors(values)?;
        let count = errors.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let all = || errors.iter().flatten();
        Some([0, 1].map(|i| (all().map(|e| e[i] * e[i]).sum::<f64>() / count).sqrt()))
    }

    /// The same weighed by its errors at `values`: root mean squares times the root of the samples over
    /// which they go together.
    fn weighed(mut self, values: &[f64]) -> Option<Self> {
        const TOGETHER: f64 = 0.5;
        let sizes = self.sizes(values)?;
        let errors = self.errors(values)?;
        let mut sums = [0.0; 2];
        let mut count = 0.0;
        for (own, errors) in self.records.iter().zip(&errors) {
            let length = (TOGETHER / own.recording.period()).max(1.0) as usize;
            for block in errors.chunks_exact(length) {
                for (i, sum) in sums.iter_mut().enumerate() {
                    *sum += block.iter().map(|e| e[i]).sum::<f64>().powi(2);
                }
                count += length as f64;
            }
        }
        for i in 0..2 {
            let together = sums[i] / (count * sizes[i].powi(2)).max(f64::MIN_POSITIVE);
            self.weights[i] *= sizes[i] * together.max(1.0).sqrt();
        }
        self.weights.iter().all(|w| *w > 0.0).then_some(self)
    }

    /// What is known beforehand, as residuals of unit variance: of seals, and the Coulomb force by the
    /// equations.
    fn surprise(&self, values: &[f64]) -> Vec<f64> {
        let mut all = self.at(values).1.surprise().to_vec();
        all.push(values[0] / self.known);
        all
    }
}

/// Change of each parameter by which derivatives are taken.
fn change(parameter: usize) -> f64 {
    // The last is the relaxation in ms.
    if parameter == FITTED - 1 { 1e-2 } else { 1e-3 }
}

impl Replay<'_> {
    /// Covariance of the parameters whose errors go together within blocks of time: `A⁻¹ B A⁻¹`, `A`
    /// the information, `B` the sum of the blocks' squared scores (White, Econometrica 50, 1982).
    fn covariance(&self, values: &[f64]) -> Option<DMatrix<f64>> {
        let here = self.errors(values)?;
        let mut slopes = Vec::new();
        for i in 0..FITTED {
            let mut moved = values.to_vec();
            moved[i] += change(i);
            slopes.push(self.errors(&moved)?);
        }
        let mut information = DMatrix::zeros(FITTED, FITTED);
        let mut scatter = DMatrix::zeros(FITTED, FITTED);
        let mut blocks = 0;
        for (number, own) in self.records.iter().enumerate() {
            let length = (BLOCK / own.recording.period()).max(1.0) as usize;
            let mut from = 0;
            while from < here[number].len() {
                let to = (from + length).min(here[number].len());
                let mut score = DVector::zeros(FITTED);
                for k in from..to {
                    for channel in 0..2 {
                        let error = here[number][k][channel];
                        let row = DVector::from_fn(FITTED, |i, _| {
                            (slopes[i][number][k][channel] - error) / change(i)
                        });
                        score += &row * error;
                        information += &row * row.transpose();
                    }
                }
                scatter += &score * score.transpose();
                blocks += 1;
                from = to;
            }
        }
        let known = self.surprise(values);
        for i in 0..FITTED {
            let mut moved = values.to_vec();
            moved[i] += change(i);
            let there = self.surprise(&moved);
            let square: f64 = (0..known.len())
                .map(|j| ((there[j] - known[j]) / change(i)).powi(2))
                .sum();
            information[(i, i)] += square;
        }
        let free = f64::from(blocks) - FITTED as f64;
        if free < 1.0 {
            return None;
        }
        // A parameter that does nothing has no information: it is held.
        for i in 0..FITTED {
            information[(i, i)] += 1e-9;
        }
        let inverse = information.try_inverse()?;
        Some(&inverse * scatter * inverse.transpose() * (f64::from(blocks) / free))
    }
}

impl Residuals for Replay<'_> {
    fn residuals(&self, values: &[f64]) -> Option<Vec<f64>> {
        let errors = self.errors(values)?;
        let mut all: Vec<f64> = errors.iter().flatten().flatten().copied().collect();
        all.extend(self.surprise(values));
        Some(all)
    }
}

/// Looks for the friction with which `rig`, whose Coulomb force is known to `known` of it (one standard
/// deviation), replays `records` best. None where there is none, where the
/// records are too short, or where what was not fitted is not replayed better with it.
pub fn friction(
    records: &[Replayed<'_>],
    rig: HydraulicRig,
    shape: SealShape,
    known: f64,
) -> Option<Friction> {
    /// Part that is fitted before the rest says whether it is better.
    const PART: f64 = 0.75;
    if rig.seal_friction <= 0.0 {
        return None;
    }
    let own = Replay {
        records,
        rig,
        shape,
        weights: [1.0; 2],
        known,
        part: (0.0, PART),
    };
    let start = [0.0; FITTED];
    let fitted = own.weighed(&start)?;
    let coordinates: Vec<Coordinate> = (0..FITTED)
        .map(|i| Coordinate {
            start: 0.0,
            // The search takes its derivatives over 1e-5 of it.
            scale: 1e5 * change(i),
            free: i != 1 || rig.seal_damping > 0.0,
            bounds: match i {
                0 | 1 => (-2.0, 2.0),
                _ => (-2.5, 2.5),
            },
        })
        .collect();
    let found = minimise(&fitted, &coordinates)?;
    let rest = Replay {
        part: (PART, 1.0),
        ..fitted
    };
    let size = |values: &[f64]| -> Option<f64> {
        let sizes = rest.sizes(values)?;
        Some(sizes[0].hypot(sizes[1]))
    };
    let improvement = size(&found.values)? / size(&start)?;
    let (better, shape) = fitted.at(&found.values);
    let covariance = fitted.covariance(&found.values)?;
    let error = |i: usize| covariance[(i, i)].max(0.0).sqrt();
    let mistaken = MISTAKEN * better.seal_damping * speed(records)?;
    Some(Friction {
        damping: better.seal_damping,
        coulomb: better.seal_friction,
        shape,
        standard_errors: [
            better.seal_damping * error(1),
            (better.seal_friction * error(0)).hypot(mistaken),
        ],
        improvement,
    })
}

/// Root mean square of the table's velocity, m/s.
fn speed(records: &[Replayed<'_>]) -> Option<f64> {
    let (mut square, mut count) = (0.0, 0);
    for own in records {
        let (x, a) = (
            own.recording.channel(Channel::Displacement)?,
            own.recording.channel(Channel::Acceleration)?,
        );
        let velocity = velocity(x, a, own.recording.period()).ok()?;
        square += velocity.iter().map(|v| v * v).sum::<f64>();
        count += velocity.len();
    }
    Some((square / count.max(1) as f64).sqrt())
}

impl Found {
    /// Takes the friction over with which the rig replays `recordings` better, if the equations at
    /// `values` still hold with it; `equations` makes them for a shape.
    pub(super) fn replay_friction(
        &mut self,
        recordings: &[Recording],
        values: &[f64],
        equations: &dyn Fn(SealShape) -> Option<Equations>,
    ) {
        /// What the equations leave over their noise where they hold, and how much worse it may be.
        const HOLD: f64 = 1.6;
        const WORSE: f64 = 1.2;
        let specimen = self.specimen.as_ref().map(|own| own.specimen);
        if self.rig.specimen_mass > 0.0 && specimen.is_none() {
            return;
        }
        let payloads = std::iter::once(0.0).chain(self.payloads.iter().copied());
        let records: Vec<Replayed> = recordings
            .iter()
            .zip(payloads)
            .map(|(recording, payload)| Replayed {
                recording,
                payload,
                specimen,
            })
            .collect();
        // Three times what the equations say of it, for their standard error holds for their form of the
        // friction alone.
        let known = 3.0 * self.standard_error[SEAL_FRICTION] / self.rig.seal_friction + 0.03;
        let Some(own) = friction(&records, self.rig, self.shape, known) else {
            return;
        };
        for (parameter, error) in [SEAL_DAMPING, SEAL_FRICTION]
            .into_iter()
            .zip(own.standard_errors)
        {
            self.widen(parameter, error);
        }
        let rig = HydraulicRig {
            seal_damping: own.damping,
            seal_friction: own.coulomb,
            ..self.rig
        };
        let mut moved = values.to_vec();
        moved[..PARAMETERS].copy_from_slice(&rig.coordinates());
        moved[PARAMETERS..PARAMETERS + SHAPE].fill(0.0);
        let left = equations(own.shape).and_then(|own| own.mean_squares(&moved));
        if let Some(left) = left
            && own.improvement < 1.0
            && (0..EQUATIONS).all(|i| left[i] < (WORSE * self.mean_squares[i]).max(HOLD))
        {
            (self.rig, self.shape, self.mean_squares) = (rig, own.shape, left);
        }
    }

    /// Raises the standard error of a parameter to `error`, with what goes together with it.
    fn widen(&mut self, parameter: usize, error: f64) {
        let factor = error / self.standard_error[parameter];
        if factor.is_finite() && factor > 1.0 {
            self.standard_error[parameter] = error;
            for i in 0..PARAMETERS {
                self.covariance[(parameter, i)] *= factor;
                self.covariance[(i, parameter)] *= factor;
            }
        }
    }
}

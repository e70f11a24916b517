//! The seals' friction, and what a valve lacks to an ideal one, by replaying the recordings on the identified
//! rig.
//!
//! The equations between the channels see the friction along the *measured* velocity, whose noise hides
//! what happens within a few micrometres of a reversal. Here the rig is simulated under the recorded
//! command, so that its own velocity decides when the seals slide, and the friction is what makes
//! simulated acceleration and displacement agree with the recorded ones (output error; Ljung, System
//! Identification, 1999, section 4.3). A rig that integrates its command would drift: a slow correction
//! towards the measured displacement holds it, too slow to hide the friction.

use nalgebra::{DMatrix, DVector};

use super::equations::{EQUATIONS, HydraulicRig, PARAMETERS};
use super::fitting::Fitting;
use super::friction::{SHAPE, SealShape, Searched};
use super::simulation::Simulation;
use super::specimen::SpecimenOverMass;
use super::velocity::velocity;
use super::{Found, Histories, LEAST_INERTIA};
use plant::identified::valve_curve::ValveCurve;
use recordings::{Channel, Recording};
use sysid::nonlinear::{Coordinate, Derivatives, Effort, Residuals, minimise_with};

/// Rate at which the replayed displacement is led back to the measured one, rad/s.
pub(super) const CORRECTION: f64 = 1.0;
/// Time in which what went before a record has died away, s.
const SETTLING: f64 = 3.0;
/// Longest inner step, s, and that of fits.
const STEP: f64 = 5e-4;
const FITTED_STEP: f64 = 1e-3;
/// Samples that are replayed of all recordings together, at most.
const MOST: usize = 60_000;
/// Length of the blocks whose scatter gives the standard errors, s, and how many there are of them at least to a
/// parameter: else they are shorter.
const BLOCK: f64 = 2.0;
const BLOCKS: f64 = 2.0;
/// Share of the viscous force that the shape of the curve may take for dry friction, or the other way:
/// valve and seals are not quite what the model's form says.
pub(super) const MISTAKEN: f64 = 0.02;
/// Parameters of the seals: logarithms of Coulomb force and damping over those before, then the changes of the
/// shape.
const SEALS: usize = 2 + SHAPE;
/// Parameters of valve and oil: logarithms of force rate, oil's stiffness and leakage rate over those before,
/// change of the spool's lag (ms), logarithm of its inertia over that before, change of the delay (ms).
const ACTUATOR: usize = 6;
/// Parameters of the valve's curve: overlap (V), share lost at null, logarithm of its width over that before,
/// asymmetry.
const CURVE: usize = 4;
/// All of them.
pub(super) const FITTED: usize = SEALS + ACTUATOR + CURVE;
/// The first of the curve's.
pub(super) const OF_CURVE: usize = SEALS + ACTUATOR;

/// Largest share of the gain that may be lost at null.
const MOST_LOST: f64 = 0.95;
/// Part that is fitted before the rest says whether it is better.
pub(super) const PART: f64 = 0.75;

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

/// What moves the table as the replay has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Actuator {
    pub rig: HydraulicRig,
    pub shape: SealShape,
    pub curve: ValveCurve,
}

impl Actuator {
    /// The same with the changes of a fit.
    pub(super) fn at(&self, values: &[f64]) -> Self {
        let (own, oil) = (&self.rig, &values[SEALS..]);
        let curve = &values[OF_CURVE..];
        Self {
            rig: HydraulicRig {
                seal_friction: own.seal_friction * values[0].exp(),
                seal_damping: own.seal_damping * values[1].exp(),
                force_rate: own.force_rate * oil[0].exp(),
                oil_stiffness: own.oil_stiffness * oil[1].exp(),
                leakage_rate: own.leakage_rate * oil[2].exp(),
                spool_lag: (own.spool_lag + 1e-3 * oil[3]).max(0.0),
                spool_inertia: (own.spool_inertia * oil[4].exp()).max(LEAST_INERTIA),
                command_delay: (own.command_delay + 1e-3 * oil[5]).max(0.0),
                ..self.rig
            },
            shape: self.shape.changed(&values[2..SEALS]),
            curve: ValveCurve {
                overlap: self.curve.overlap + curve[0],
                null_loss: (self.curve.null_loss + curve[1]).clamp(0.0, MOST_LOST),
                null_width: self.curve.null_width * curve[2].exp(),
                asymmetry: (self.curve.asymmetry + curve[3]).clamp(-0.9, 0.9),
                ..self.curve
            },
        }
    }

    /// Places among the rig's parameters of the first values, with the derivatives of the former by the latter.
    pub(super) fn slopes(&self) -> [(usize, usize, f64); 8] {
        let own = &self.rig;
        [
            (0, SEAL_FRICTION, own.seal_friction),
            (1, SEAL_DAMPING, own.seal_damping),
            (SEALS, 2, own.force_rate),
            (SEALS + 1, 3, own.oil_stiffness),
            (SEALS + 2, 4, own.leakage_rate),
            (SEALS + 3, 0, 1e-3),
            (SEALS + 4, 1, own.spool_inertia),
            (SEALS + 5, 11, 1e-3),
        ]
    }
}

#[derive(Clone, Copy)]
pub(super) struct Replay<'a> {
    pub records: &'a [Replayed<'a>],
    pub start: Actuator,
    /// Root mean squares of the errors of displacement and acceleration over the part of the samples
    /// that tell something of their own, by which they are weighed.
    pub weights: [f64; 2],
    /// Standard deviation of the logarithm of the Coulomb force, as far as it is known.
    pub known: f64,
    /// Parts of each record between which errors count.
    pub part: (f64, f64),
    /// Longest inner step, s.
    pub step: f64,
}

/// Errors of displacement and acceleration, sample by sample, of each record.
pub(super) type Errors = Vec<Vec<[f64; 2]>>;

impl Replay<'_> {
    fn at(&self, values: &[f64]) -> Actuator {
        self.start.at(values)
    }

    /// Errors of displacement and acceleration over their weights, record by record.
    pub(super) fn errors(&self, values: &[f64]) -> Option<Errors> {
        Some(self.raw(values)?.0)
    }

    /// As [`Self::errors`], and the means that were taken off.
    pub(super) fn raw(&self, values: &[f64]) -> Option<(Errors, Vec<[f64; 2]>)> {
        if !values.iter().all(|value| value.is_finite()) {
            return None;
        }
        let Actuator { rig, shape, curve } = self.at(values);
        let all = self.records.iter().map(|own| {
            let recording = own.recording;
            let period = recording.period();
            let ways = recording.channel(Channel::Displacement)?;
            let measured = recording.channel(Channel::Acceleration)?;
            let commands = recording.channel(Channel::ValveCommand)?;
            let mut model = Simulation::new(rig, shape, own.payload, own.specimen, period)
                .with_steps_of(self.step)
                .through(curve)
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
            let mean =
                |i: usize| errors.iter().map(|e| e[i]).sum::<f64>() / errors.len().max(1) as f64;
            let means = [mean(0), mean(1)];
            for error in &mut errors {
                for i in 0..2 {
                    error[i] -= means[i];
                }
            }
            Some((errors, [0, 1].map(|i| means[i] * self.weights[i])))
        });
        all.collect::<Option<_>>()
    }

    /// Root mean squares of the errors over their weights.
    pub(super) fn sizes(&self, values: &[f64]) -> Option<[f64; 2]> {
        let errors = self.errors(values)?;
        let count = errors.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let all = || errors.iter().flatten();
        Some([0, 1].map(|i| (all().map(|e| e[i] * e[i]).sum::<f64>() / count).sqrt()))
    }

    /// The same weighed by its errors at `values`: root mean squares times the root of the samples over
    /// which they go together.
    pub(super) fn weighed(mut self, values: &[f64]) -> Option<Self> {
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

    /// The same on the part of the records that is not fitted.
    pub(super) fn rest(&self) -> Self {
        Self {
            part: (PART, 1.0),
            ..*self
        }
    }

    /// What is known beforehand, as residuals of unit variance: of seals, and the Coulomb force by the
    /// equations.
    fn surprise(&self, values: &[f64]) -> Vec<f64> {
        let mut all = self.at(values).shape.surprise().to_vec();
        all.push(values[0] / self.known);
        all
    }
}

/// Change of each parameter by which derivatives are taken.
fn change(parameter: usize) -> f64 {
    match parameter {
        // Relaxation, lag and delay in ms.
        own if own == SEALS - 1 || own == SEALS + 3 || own == SEALS + 5 => 1e-2,
        _ => 1e-3,
    }
}

/// Coordinates of the fit from `start` of the parameters that are `free`, as changes of a rig whose valve has lost the
/// share `null_loss` at null.
pub(super) fn coordinates(
    start: &[f64; FITTED],
    null_loss: f64,
    free: impl Fn(usize) -> bool,
) -> Vec<Coordinate> {
    (0..FITTED)
        .map(|i| Coordinate {
            start: start[i],
            // The search takes its derivatives over 1e-5 of it.
            scale: 1e5 * change(i),
            free: free(i),
            bounds: match i {
                0 | 1 => (-2.0 - f64::from(u8::from(start[i] != 0.0)), 2.0),
                own if own < SEALS => (-2.5, 2.5),
                own if own == SEALS + 3 || own == SEALS + 5 => (-20.0, 20.0),
                own if own < OF_CURVE => (-2.0, 2.0),
                own if own == OF_CURVE => (-2.0, 2.0),
                own if own == OF_CURVE + 1 => (-null_loss, MOST_LOST - null_loss),
                own if own == OF_CURVE + 2 => (-2.0, 2.0),
                _ => (-0.5, 0.5),
            },
        })
        .collect()
}

impl Replay<'_> {
    /// Covariance of the parameters whose errors go together within blocks of time: `A⁻¹ B A⁻¹`, `A`
    /// the information, `B` the sum of the blocks' squared scores (White, Econometrica 50, 1982).
    ///
    /// Rows and columns are those of the parameters `free`.
    pub(super) fn covariance(&self, values: &[f64], free: &[usize]) -> Option<DMatrix<f64>> {
        let count = free.len();
        let here = self.errors(values)?;
        let mut slopes = Vec::new();
        for &i in free {
            let mut moved = values.to_vec();
            moved[i] += change(i);
            slopes.push(self.errors(&moved)?);
        }
        let mut information = DMatrix::zeros(count, count);
        let mut scatter = DMatrix::zeros(count, count);
        let mut blocks = 0;
        let samples = here.iter().map(Vec::len).sum::<usize>() as f64;
        let longest = samples / (BLOCKS * count as f64);
        for (number, own) in self.records.iter().enumerate() {
            let length = (BLOCK / own.recording.period()).min(longest).max(1.0) as usize;
            let mut from = 0;
            while from < here[number].len() {
                let to = (from + length).min(here[number].len());
                let mut score = DVector::zeros(count);
                for k in from..to {
                    for channel in 0..2 {
                        let error = here[number][k][channel];
                        let row = DVector::from_fn(count, |i, _| {
                            (slopes[i][number][k][channel] - error) / change(free[i])
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
        for (place, &i) in free.iter().enumerate() {
            let mut moved = values.to_vec();
            moved[i] += change(i);
            let there = self.surprise(&moved);
            let square: f64 = (0..known.len())
                .map(|j| ((there[j] - known[j]) / change(i)).powi(2))
                .sum();
            information[(place, place)] += square;
        }
        let more = f64::from(blocks) - count as f64;
        if more < 1.0 {
            return None;
        }
        // A parameter that does nothing has no information: it is held.
        for i in 0..count {
            information[(i, i)] += 1e-9;
        }
        let inverse = information.try_inverse()?;
        Some(&inverse * scatter * inverse.transpose() * (f64::from(blocks) / more))
    }
}

impl Residuals for Replay<'_> {
    fn residuals(&self, values: &[f64]) -> Option<Vec<f64>> {
        let errors = self.errors(values)?;
        Some(errors.iter().flatten().flatten().copied().collect())
    }

    fn priors(&self, values: &[f64]) -> Vec<f64> {
        self.surprise(values)
    }

    fn ignores_bounds(&self) -> bool {
        true
    }
}

/// Looks for the friction with which `start`, whose Coulomb force is known to `known` of it (one standard
/// deviation), replays `records` best. None where there is none, where the
/// records are too short, or where what was not fitted is not replayed better with it.
fn friction(records: &[Replayed<'_>], start: Actuator, known: f64) -> Option<Friction> {
    let rig = start.rig;
    if rig.seal_friction <= 0.0 {
        return None;
    }
    let own = Replay {
        records,
        start,
        weights: [1.0; 2],
        known,
        part: (0.0, PART),
        step: FITTED_STEP,
    };
    let start = [0.0; FITTED];
    let fitted = own.weighed(&start)?;
    let null_loss = fitted.start.curve.null_loss;
    let coordinates = coordinates(&start, null_loss, |i| {
        i < SEALS && (i != 1 || rig.seal_damping > 0.0)
    });
    let effort = Effort {
        iterations: 30,
        part: 1e-3,
        derivatives: Derivatives::Trusted,
    };
    let found = minimise_with(&fitted, &coordinates, effort)?;
    let rest = fitted.rest();
    let size = |values: &[f64]| -> Option<f64> {
        let sizes = rest.sizes(values)?;
        Some(sizes[0].hypot(sizes[1]))
    };
    let improvement = size(&found.values)? / size(&start)?;
    let Actuator {
        rig: better, shape, ..
    } = fitted.at(&found.values);
    let covariance =
        fitted.covariance(&found.values, &std::array::from_fn::<_, SEALS, _>(|i| i))?;
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
pub(super) fn speed(records: &[Replayed<'_>]) -> Option<f64> {
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

/// How a recording that was not fitted is replayed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Replication {
    /// Root mean square of the error of the acceleration over that of the acceleration, both without the
    /// sensor's noise.
    pub relative_error: f64,
    /// Root mean square of the acceleration, without the sensor's noise, m/s².
    pub rms: f64,
    /// Largest error of the acceleration over its peak, with the sensor's noise.
    pub peak_error: f64,
}

impl Found {
    /// What moves its table.
    pub(super) fn actuator(&self) -> Actuator {
        Actuator {
            rig: self.rig,
            shape: self.shape,
            curve: self.curve(),
        }
    }

    /// Replays a recording, with the first payload, under its own command. None where the recording lacks a
    /// channel or the rig runs away.
    pub fn replication(&self, recording: &Recording) -> Option<Replication> {
        let records = self.replayed(std::slice::from_ref(recording))?;
        let replay = Replay {
            records: &records,
            start: self.actuator(),
            weights: [1.0; 2],
            known: f64::INFINITY,
            part: (0.0, 1.0),
            step: STEP,
        };
        let errors = replay.errors(&[0.0; FITTED])?;
        let errors: Vec<f64> = errors.first()?.iter().map(|error| error[1]).collect();
        let measured = recording.channel(Channel::Acceleration)?;
        let measured = &measured[measured.len().saturating_sub(errors.len())..];
        let noise = self.noise[1] * self.noise[1];
        let square = |values: &[f64]| recordings::mean_and_deviation(values).1.powi(2) - noise;
        let peak = |values: &[f64]| values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let size = square(measured).max(f64::MIN_POSITIVE);
        Some(Replication {
            relative_error: (square(&errors).max(0.0) / size).sqrt(),
            rms: size.sqrt(),
            peak_error: peak(&errors) / peak(measured),
        })
    }

    /// The recordings that it was identified from, as they are replayed; none under a specimen that was not
    /// found.
    pub(super) fn replayed<'a>(&self, recordings: &'a [Recording]) -> Option<Vec<Replayed<'a>>> {
        let specimen = self.specimen.as_ref().map(|own| own.specimen);
        if self.rig.specimen_mass > 0.0 && specimen.is_none() {
            return None;
        }
        let payloads = std::iter::once(0.0).chain(self.payloads.iter().copied());
        let records = recordings.iter().zip(payloads);
        let replayed = records.map(|(recording, payload)| Replayed {
            recording,
            payload,
            specimen,
        });
        Some(replayed.collect())
    }

    /// Takes the friction over with which the rig replays `recordings` better, if the equations of `fitting`
    /// still hold with it.
    pub(super) fn replay_friction(&mut self, recordings: &[Recording], fitting: &Fitting) {
        /// What the equations leave over their noise where they hold, and how much worse it may be.
        const HOLD: f64 = 1.6;
        const WORSE: f64 = 1.2;
        let Some(records) = self.replayed(recordings) else {
            return;
        };
        // Three times what the equations say of it, for their standard error holds for their form of the
        // friction alone.
        let known = 3.0 * self.standard_error[SEAL_FRICTION] / self.rig.seal_friction + 0.03;
        let Some(own) = friction(&records, self.actuator(), known) else {
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
        let mut moved = rig.coordinates().to_vec();
        moved.extend([0.0; SHAPE]);
        moved.extend(&self.payloads);
        let histories = Histories {
            shape: Some(own.shape),
            ..self.histories()
        };
        let equations = fitting.equations(histories).ok();
        let left = equations.and_then(|own| own.mean_squares(&moved));
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

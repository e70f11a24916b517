//! The drive with which the extended model of a rig makes a wanted motion, within its rail.
//!
//! The drive is a polygon through evenly spaced knots. Their values minimise the squared error of the
//! simulated output (Levenberg-Marquardt, derivatives by differences of simulations), so that friction,
//! play and saturation of the model count. Knots at the rail that would go beyond it are left there. Of a rig
//! on a voltage, whose friction hides every derivative at rest, the search begins from knots that were chosen
//! one after another.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use units::convert;

use super::description::{DescriptionError, listed};
use super::extended::ExtendedRig;
use super::{Measurement, Rig, RigRecording};
use recordings::Channel;

/// Knots in a period of the highest frequency, and the most of them.
const KNOTS: f64 = 4.0;
const MOST_KNOTS: usize = 1200;
/// Residuals in a period of the highest frequency that are enough.
const RESIDUALS: f64 = 20.0;
/// Steps of a knot for a derivative, over the drive's reach: the first ones overcome friction at rest.
const STEPS: [f64; 4] = [0.5, 0.25, 0.1, 0.05];
/// Knots that a knot looks ahead to in the first drive of a rig on a voltage, each tried: a rig that answers
/// late needs more.
const AHEAD: [f64; 3] = [1.0, 2.0, 4.0];
/// Values of a knot that are tried to either side, and halvings of their distance after that.
const VALUES: i32 = 4;
const HALVINGS: usize = 4;
/// Damping of the first step over the mean of the squared derivatives, and what changes it.
const DAMPING: f64 = 1e-3;
const MORE: f64 = 10.0;
const LESS: f64 = 0.3;
/// Refused steps in a row, and the share of the error that a step must bring.
const SETBACKS: usize = 5;
const STALLED: f64 = 1e-3;

/// How to look for a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveSearch {
    /// Largest drive to either side, in the input's SI unit.
    pub limit: Option<f64>,
    /// Highest frequency of the drive, Hz.
    pub highest: f64,
    /// Largest number of corrections.
    pub corrections: usize,
}

/// A drive with what the model expects of it. Errors are `100 ||wanted - output|| / ||wanted - mean||`.
#[derive(Debug, Clone, PartialEq)]
pub struct RigDrive {
    /// What the rig is called.
    pub rig: String,
    /// Effects of its model.
    pub effects: Vec<String>,
    /// Headings and units of time (s), drive, and output.
    pub columns: [(String, String); 3],
    /// Time between samples, s.
    pub period: f64,
    /// The drive, in the unit of its column.
    pub drive: Vec<f64>,
    /// The output that the model expects, in the unit of its column.
    pub expected: Vec<f64>,
    /// The wanted output, in the same unit.
    pub wanted: Vec<f64>,
    /// Error of the first drive and after each correction, %.
    pub errors: Vec<f64>,
    /// Largest drive, in the unit of its column.
    pub peak: f64,
    /// Share of the samples at the rail.
    pub at_rail: f64,
}

impl ExtendedRig {
    /// The drive for the motion of the output in the file `wanted`, from rest at its first sample.
    ///
    /// # Errors
    /// A file without the columns of time and output; a kind of several inputs; a voltage without a limit;
    /// a motion that needs too many knots; a model that leaves the finite.
    pub fn drive(&self, wanted: &Path, search: &DriveSearch) -> Result<RigDrive, DescriptionError> {
        let description = self.description(&self.nominal);
        let rig = description.rig()?;
        let &[input] = rig.inputs() else {
            let names: Vec<&str> = rig.inputs().iter().map(|own| own.name()).collect();
            return Err(self.wrong(format!(
                "a drive is computed for rigs of one input; `{}` has {}",
                self.kind,
                listed(&names)
            )));
        };
        let output = rig.output();
        let follows = input.unit() == output.unit();
        let rest = description.motion(wanted, rig)?;
        let period = rest.period();
        let motion = rest.output().to_vec();
        let reach = match search.limit {
            Some(limit) if limit > 0.0 => limit,
            None if follows => 2.0 * motion.iter().fold(0.0f64, |most, x| most.max(x.abs())),
            _ => {
                return Err(self.wrong(format!(
                    "the largest `{}` is not known; pass --command-limit with what the amplifier accepts, \
                     such as \"10 V\"",
                    input.name()
                )));
            }
        };
        let mut problem = Problem {
            model: self,
            rest,
            input,
            rig,
            spacing: 1.0 / (KNOTS * search.highest * period),
            stride: (1.0 / (RESIDUALS * search.highest * period)).max(1.0) as usize,
            limit: search.limit.map_or(f64::INFINITY, |_| reach),
            reach,
            motion,
        };
        problem.spacing = problem.spacing.max(1.0);
        let knots = problem.knots();
        if knots > MOST_KNOTS {
            let seconds = problem.motion.len() as f64 * period;
            return Err(self.wrong(format!(
                "a drive of {seconds:.0} s up to {} Hz needs {knots} knots, the limit is {MOST_KNOTS}; pass --band \
                 0.1 {:.1}, or a shorter motion",
                search.highest,
                search.highest * MOST_KNOTS as f64 / knots as f64
            )));
        }
        let (drive, errors) = problem.solve(follows, search.corrections)?;
        let expected = problem.output(&drive)?;
        let column = |channel: Channel| {
            let own = self.columns.get(channel.name());
            own.map_or_else(
                || (channel.name().to_owned(), channel.unit().to_owned()),
                |own| (own.column.clone(), own.unit.clone()),
            )
        };
        let columns = [Channel::Time, input, output].map(column);
        let factor = |channel: Channel, unit: &str| {
            convert(1.0, channel.unit(), unit)
                .map_err(|why| self.wrong(format!("`columns.{}`: {why}", channel.name())))
        };
        let (volts, metres) = (
            factor(input, &columns[1].1)?,
            factor(output, &columns[2].1)?,
        );
        let scaled = |all: &[f64], by: f64| all.iter().map(|value| by * value).collect();
        let is_at_rail = |u: &&f64| u.abs() >= 0.999 * problem.limit;
        Ok(RigDrive {
            rig: self.name.clone(),
            effects: self.effects.keys().cloned().collect(),
            period,
            peak: volts * drive.iter().fold(0.0f64, |most, u| most.max(u.abs())),
            at_rail: drive.iter().filter(is_at_rail).count() as f64 / drive.len() as f64,
            drive: scaled(&drive, volts),
            expected: scaled(&expected, metres),
            wanted: scaled(&problem.motion, metres),
            columns,
            errors,
        })
    }
}

struct Problem<'a> {
    model: &'a ExtendedRig,
    rig: &'a dyn Rig,
    input: Channel,
    /// The rig at rest.
    rest: RigRecording,
    motion: Vec<f64>,
    /// Samples from knot to knot.
    spacing: f64,
    /// Samples from residual to residual.
    stride: usize,
    limit: f64,
    reach: f64,
}

impl Problem<'_> {
    fn knots(&self) -> usize {
        ((self.motion.len() - 1) as f64 / self.spacing).ceil() as usize + 1
    }

    /// The polygon through `knots`.
    fn polygon(&self, knots: &[f64]) -> Vec<f64> {
        let value = |k: usize| {
            let place = k as f64 / self.spacing;
            let before = (place as usize).min(knots.len() - 1);
            let after = (before + 1).min(knots.len() - 1);
            knots[before] + (place - before as f64) * (knots[after] - knots[before])
        };
        (0..self.motion.len()).map(value).collect()
    }

    fn output(&self, drive: &[f64]) -> Result<Vec<f64>, DescriptionError> {
        self.output_until(drive, self.motion.len())
    }

    /// The first `samples` of the output.
    fn output_until(&self, drive: &[f64], samples: usize) -> Result<Vec<f64>, DescriptionError> {
        let driven = self
            .rest
            .with_input(self.input, drive.to_vec(), self.rig.inputs());
        let lost = || self.model.wrong("the model cannot be driven".to_owned());
        let measurement = Measurement {
            recordings: vec![driven.ok_or_else(lost)?],
        };
        let (measured, point) = self
            .model
            .measured(&measurement, &self.model.nominal, true)?;
        let out = measured.simulate_to(&point, 0, samples);
        if out.iter().all(|y| y.is_finite()) {
            return Ok(out);
        }
        let what = "the simulation is not finite under a drive; pass a smaller --command-limit";
        Err(self.model.wrong(what.to_owned()))
    }

    /// Knots that are chosen one after another, each so that the motion is met best until `ahead` knots on if
    /// the drive stays there.
    fn one_after_another(&self, ahead: f64) -> Result<Vec<f64>, DescriptionError> {
        let mut knots = vec![0.0; self.knots()];
        for i in 0..knots.len() {
            let place = |knot: f64| (knot.max(0.0) * self.spacing) as usize;
            let from = place(i as f64 - 1.0);
            let until = (place(i as f64 + ahead) + 1).min(self.motion.len());
            let mut error = |value: f64| {
                knots[i..].fill(value);
                let out = self.output_until(&self.polygon(&knots), until)?;
                let pairs = self.motion[from..until].iter().zip(&out[from..]);
                Ok::<f64, DescriptionError>(pairs.map(|(wanted, y)| (wanted - y).powi(2)).sum())
            };
            let mut distance = self.reach / f64::from(VALUES);
            let mut best = (f64::INFINITY, 0.0);
            let mut try_at = |value: f64, best: &mut (f64, f64)| {
                let value = value.clamp(-self.limit, self.limit);
                let own = error(value)?;
                if own < best.0 {
                    *best = (own, value);
                }
                Ok::<(), DescriptionError>(())
            };
            for step in -VALUES..=VALUES {
                try_at(f64::from(step) * distance, &mut best)?;
            }
            for _ in 0..HALVINGS {
                distance *= 0.5;
                let middle = best.1;
                for value in [middle - distance, middle + distance] {
                    try_at(value, &mut best)?;
                }
            }
            knots[i..].fill(best.1);
        }
        Ok(knots)
    }

    /// What the model misses of the motion, at every residual.
    fn missed(&self, knots: &[f64]) -> Result<DVector<f64>, DescriptionError> {
        let out = self.output(&self.polygon(knots))?;
        let missed = self.motion.iter().zip(&out).step_by(self.stride);
        Ok(DVector::from_iterator(
            self.motion.len().div_ceil(self.stride),
            missed.map(|(wanted, y)| wanted - y),
        ))
    }

    /// Derivatives of what is missed by the knots, with steps of `step`.
    fn derivatives(
        &self,
        knots: &[f64],
        missed: &DVector<f64>,
        step: f64,
    ) -> Result<DMatrix<f64>, DescriptionError> {
        let mut slopes = DMatrix::zeros(missed.len(), knots.len());
        let mut changed = knots.to_vec();
        for (i, mut slope) in slopes.column_iter_mut().enumerate() {
            // Towards the inside, where the rail ends the way out.
            let step = if knots[i] + step > self.limit {
                -step
            } else {
                step
            };
            changed[i] = knots[i] + step;
            slope.copy_from(&((self.missed(&changed)? - missed) / step));
            changed[i] = knots[i];
        }
        Ok(slopes)
    }

    /// The drive and the errors on the way to it, %.
    fn solve(
        &self,
        follows: bool,
        corrections: usize,
    ) -> Result<(Vec<f64>, Vec<f64>), DescriptionError> {
        let count = self.knots();
        let at = |i: usize| (i as f64 * self.spacing) as usize;
        let own = |i: usize| self.motion[at(i).min(self.motion.len() - 1)];
        let mut knots: Vec<f64> = (0..count)
            .map(|i| {
                if follows {
                    own(i).clamp(-self.limit, self.limit)
                } else {
                    0.0
                }
            })
            .collect();
        let (_, deviation) = recordings::mean_and_deviation(&self.motion);
        let percent = |missed: &DVector<f64>| {
            let mean_square = missed.norm_squared() / missed.len() as f64;
            100.0 * mean_square.sqrt() / deviation.max(f64::MIN_POSITIVE)
        };
        let mut missed = self.missed(&knots)?;
        if !follows {
            // From rest no small change overcomes friction.
            for ahead in AHEAD {
                let tried = self.one_after_another(ahead)?;
                let after = self.missed(&tried)?;
                if after.norm() < missed.norm() {
                    (knots, missed) = (tried, after);
                }
            }
        }
        let mut errors = vec![percent(&missed)];
        let mut damping = DAMPING;
        for round in 0..corrections {
            let step = self.reach * STEPS[round.min(STEPS.len() - 1)];
            let slopes = self.derivatives(&knots, &missed, step)?;
            let gradient = slopes.tr_mul(&missed);
            // A knot at the rail whose way down leads out stays there.
            let is_held = |i: usize| {
                knots[i].abs() >= self.limit * (1.0 - 1e-9) && -gradient[i] * knots[i] > 0.0
            };
            let free: Vec<usize> = (0..count).filter(|i| !is_held(*i)).collect();
            let own = slopes.select_columns(&free);
            let normal = own.tr_mul(&own);
            let size = normal.trace() / free.len().max(1) as f64;
            let wanted = -own.tr_mul(&missed);
            let mut better = None;
            for _ in 0..SETBACKS {
                let mut damped = normal.clone();
                for i in 0..free.len() {
                    damped[(i, i)] += damping * size;
                }
                let Some(change) = damped.cholesky().map(|own| own.solve(&wanted)) else {
                    damping *= MORE;
                    continue;
                };
                let mut tried = knots.clone();
                for (i, by) in free.iter().zip(change.iter()) {
                    tried[*i] = (tried[*i] + by).clamp(-self.limit, self.limit);
                }
                let after = self.missed(&tried)?;
                if after.norm() < missed.norm() {
                    better = Some((tried, after));
                    damping *= LESS;
                    break;
                }
                damping *= MORE;
            }
            let is_small = round + 1 >= STEPS.len();
            let Some((tried, after)) = better else {
                if is_small {
                    break;
                }
                damping = DAMPING;
                continue;
            };
            let brought = 1.0 - after.norm() / missed.norm();
            (knots, missed) = (tried, after);
            errors.push(percent(&missed));
            if is_small && brought < STALLED {
                break;
            }
        }
        Ok((self.polygon(&knots), errors))
    }
}

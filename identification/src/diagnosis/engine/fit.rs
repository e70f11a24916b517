//! Maximum-likelihood fits by Levenberg-Marquardt, with the nuisance estimated along.

use nalgebra::{DMatrix, DVector};

use super::model::{ExtensibleModel, Point};

/// Internal coordinates move by this for a difference quotient.
const DIFFERENCE: f64 = 1e-3;
/// No nuisance moves farther than this many standard deviations in one step.
const LONGEST_STEP: f64 = 4.0;
/// Times that the nuisance is held four times as strongly, from a prior's own strength on.
const HOLDS: usize = 40;
/// Expected gains below this may be outweighed by the predictor's change along the step.
const WITHIN_GAINS_REACH: f64 = 1e3;

/// A model at a point with its residuals on the records it was fitted to.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Where.
    pub point: Point,
    /// `-2 log` likelihood up to a constant, priors included.
    pub cost: f64,
    /// Whitened residuals, the fitted records after one another.
    pub residuals: Vec<f64>,
}

/// Derivatives of the residuals by coordinates of a point.
#[derive(Debug, Clone)]
pub struct Jacobian {
    columns: Vec<Vec<f64>>,
    gram: DMatrix<f64>,
}

/// Whitened residuals and cost at `point` on `records`; nothing where it cannot be simulated.
pub fn evaluate<M: ExtensibleModel>(model: &M, point: &Point, records: &[usize]) -> Option<Fit> {
    let predictor = model.predictor(point)?;
    let residuals = residuals(model, &predictor, point, records)?;
    let samples: usize = records.iter().map(|&r| model.sample_count(r)).sum();
    let cost = squares(&residuals)
        + samples as f64 * model.log_determinant(&predictor)
        + point.prior_cost(model.candidates());
    cost.is_finite().then(|| Fit {
        point: point.clone(),
        cost,
        residuals,
    })
}

/// Whitened residuals at `point` with the gain of `predictor`.
pub fn residuals<M: ExtensibleModel>(
    model: &M,
    predictor: &M::Predictor,
    point: &Point,
    records: &[usize],
) -> Option<Vec<f64>> {
    let count: usize = records.iter().map(|&r| model.residual_count(r)).sum();
    let mut all = vec![0.0; count];
    let mut rest = all.as_mut_slice();
    for &record in records {
        let (mine, others) = rest.split_at_mut(model.residual_count(record));
        if !model.residuals(predictor, point, record, mine) {
            return None;
        }
        rest = others;
    }
    Some(all)
}

fn squares(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums at once keep the adders busy.
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = a4
        .remainder()
        .iter()
        .zip(b4.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a4.zip(b4) {
        for i in 0..4 {
            sums[i] += x[i] * y[i];
        }
    }
    sums.iter().sum::<f64>() + tail
}

/// Derivatives of the residuals at `fit` by the coordinates in `which` (nuisance first, then the
/// effects'), with the gain of `predictor`.
fn columns<M: ExtensibleModel>(
    model: &M,
    predictor: &M::Predictor,
    fit: &Fit,
    records: &[usize],
    which: impl Iterator<Item = usize>,
) -> Option<Vec<Vec<f64>>> {
    let count = fit.point.nuisance.len() + fit.point.effect_coordinates();
    let difference = |coordinate: usize, size: f64| {
        let mut step = vec![0.0; count];
        step[coordinate] = size;
        let moved = fit.point.moved(&step, model.candidates());
        if moved == fit.point {
            return None;
        }
        let mut column = residuals(model, predictor, &moved, records)?;
        for (c, r) in column.iter_mut().zip(&fit.residuals) {
            *c = (*c - r) / size;
        }
        Some(column)
    };
    which
        .map(|coordinate| {
            let size = if coordinate < fit.point.nuisance.len() {
                0.02
            } else {
                DIFFERENCE
            };
            // At an upper bound the other side is taken.
            difference(coordinate, size).or_else(|| difference(coordinate, -size))
        })
        .collect()
}

impl Jacobian {
    /// All coordinates of `fit`.
    pub fn at<M: ExtensibleModel>(model: &M, fit: &Fit, records: &[usize]) -> Option<Self> {
        let count = fit.point.nuisance.len() + fit.point.effect_coordinates();
        let predictor = model.predictor(&fit.point)?;
        Some(Self::of(columns(
            model,
            &predictor,
            fit,
            records,
            0..count,
        )?))
    }

    /// As [`Self::at`] by central differences: twice the work, and no false information along
    /// directions in which the residuals do not change.
    pub fn central<M: ExtensibleModel>(model: &M, fit: &Fit, records: &[usize]) -> Option<Self> {
        let count = fit.point.nuisance.len() + fit.point.effect_coordinates();
        let predictor = model.predictor(&fit.point)?;
        let columns = (0..count).map(|coordinate| {
            let nuisance = coordinate < fit.point.nuisance.len();
            let size = if nuisance { 0.02 } else { DIFFERENCE };
            let at = |size: f64| {
                let mut step = vec![0.0; count];
                step[coordinate] = size;
                let moved = fit.point.moved(&step, model.candidates());
                let residuals = residuals(model, &predictor, &moved, records)?;
                Some((moved != fit.point, residuals))
            };
            let ((up, mut column), (down, below)) = (at(size)?, at(-size)?);
            // At a bound only one side moves.
            let width = size * (f64::from(u8::from(up)) + f64::from(u8::from(down)));
            for (c, r) in column.iter_mut().zip(&below) {
                *c = (*c - r) / width.max(f64::MIN_POSITIVE);
            }
            Some(column)
        });
        Some(Self::of(columns.collect::<Option<_>>()?))
    }

    fn of(columns: Vec<Vec<f64>>) -> Self {
        let count = columns.len();
        let mut gram = DMatrix::zeros(count, count);
        for i in 0..count {
            for j in 0..=i {
                let value = dot(&columns[i], &columns[j]);
                gram[(i, j)] = value;
                gram[(j, i)] = value;
            }
        }
        Self { columns, gram }
    }

    /// How much `column` (in the residuals' space) would lower the cost of `fit` if it entered
    /// linearly with the best amplitude, everything in `self` estimated along; and that amplitude.
    pub fn score<M: ExtensibleModel>(&self, model: &M, fit: &Fit, column: &[f64]) -> (f64, f64) {
        let n = self.columns.len();
        let (hessian, gradient) = self.normal_equations(model, fit);
        let cross = DVector::from_fn(n, |i, _| dot(&self.columns[i], column));
        let Some(factor) = hessian.cholesky() else {
            return (0.0, 0.0);
        };
        let own = dot(column, column) - cross.dot(&factor.solve(&cross));
        let slope = -dot(column, &fit.residuals) - cross.dot(&factor.solve(&gradient));
        if own <= 1e-13 * dot(column, column) {
            return (0.0, 0.0);
        }
        (slope * slope / own, slope / own)
    }

    fn normal_equations<M: ExtensibleModel>(
        &self,
        model: &M,
        fit: &Fit,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let mut hessian = self.gram.clone();
        let n = self.columns.len();
        let mut gradient = DVector::from_fn(n, |i, _| -dot(&self.columns[i], &fit.residuals));
        add_priors(model, &fit.point, &mut hessian, &mut gradient);
        (hessian, gradient)
    }

    /// Covariance of all coordinates at `fit`.
    pub fn covariance<M: ExtensibleModel>(&self, model: &M, fit: &Fit) -> Option<DMatrix<f64>> {
        self.normal_equations(model, fit).0.try_inverse()
    }

    /// Standard deviations of all coordinates at `fit`, nuisance first.
    pub fn deviations<M: ExtensibleModel>(&self, model: &M, fit: &Fit) -> Option<Vec<f64>> {
        let covariance = self.covariance(model, fit)?;
        let variance = |i: usize| covariance[(i, i)].max(0.0);
        Some(
            (0..covariance.nrows())
                .map(|i| variance(i).sqrt())
                .collect(),
        )
    }
}

fn add_priors<M: ExtensibleModel>(
    model: &M,
    point: &Point,
    hessian: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
) {
    let nuisance = point.nuisance.len();
    for (i, p) in point.nuisance.iter().enumerate() {
        hessian[(i, i)] += 1.0;
        gradient[i] -= p;
    }
    for (place, off, spread) in point.prior_rows(model.candidates()) {
        let i = nuisance + place;
        if i < gradient.len() {
            hessian[(i, i)] += 1.0 / (spread * spread);
            gradient[i] -= off / (spread * spread);
        }
    }
}

/// Fits all coordinates of `start`. The first ones that `frozen` holds keep its derivatives; those
/// of the others are taken anew in every iteration.
pub fn fit<M: ExtensibleModel>(
    model: &M,
    start: &Point,
    records: &[usize],
    frozen: &Jacobian,
    iterations: usize,
) -> Option<Fit> {
    let mut best = evaluate(model, start, records)?;
    let held = frozen.columns.len();
    let count = start.nuisance.len() + start.effect_coordinates();
    // Directions that only the priors hold are a million times flatter than others: any damping
    // to begin with would stop them.
    let mut damping = 0.0f64;
    for _ in 0..iterations {
        let predictor = model.predictor(&best.point)?;
        let fresh = columns(model, &predictor, &best, records, held..count)?;
        let mut hessian = DMatrix::zeros(count, count);
        hessian
            .view_mut((0, 0), (held, held))
            .copy_from(&frozen.gram);
        let mut gradient = DVector::zeros(count);
        for (i, column) in frozen.columns.iter().chain(&fresh).enumerate() {
            gradient[i] = -dot(column, &best.residuals);
            for (j, other) in fresh.iter().enumerate() {
                let j = held + j;
                if i <= j {
                    let value = dot(column, other);
                    hessian[(i, j)] = value;
                    hessian[(j, i)] = value;
                }
            }
        }
        add_priors(model, &best.point, &mut hessian, &mut gradient);
        let mut gained = 0.0;
        let mut expected = 0.0;
        // The cost with the gain held, which is what the derivatives are of.
        let held_cost =
            |fit: &Fit| squares(&fit.residuals) + fit.point.prior_cost(model.candidates());
        let before = held_cost(&best);
        for _ in 0..5 {
            let mut damped = hessian.clone();
            for i in 0..count {
                damped[(i, i)] *= 1.0 + damping;
            }
            let Some(step) = bounded_step(damped, &gradient, start.nuisance.len()) else {
                damping = (damping * 20.0).max(1e-6);
                continue;
            };
            expected = gradient.dot(&step);
            let moved = best.point.moved(step.as_slice(), model.candidates());
            if let Some(next) = evaluate(model, &moved, records) {
                gained = best.cost - next.cost;
                if gained <= 0.0 && expected < WITHIN_GAINS_REACH {
                    // Near the optimum the gain's own dependence on the point can outweigh the
                    // step: judge with the gain held.
                    gained = residuals(model, &predictor, &moved, records).map_or(0.0, |held| {
                        before - squares(&held) - moved.prior_cost(model.candidates())
                    });
                }
                if gained > 0.0 {
                    best = next;
                    damping = if damping < 1e-5 { 0.0 } else { damping * 0.03 };
                    break;
                }
            }
            damping = (damping * 30.0).max(1e-5);
            if expected < 0.05 {
                break;
            }
        }
        if gained < 0.02 || expected < 0.02 {
            break;
        }
    }
    Some(best)
}

/// The step that solves `hessian` x = `gradient`, its first `nuisance` coordinates held as strongly as it
/// takes for none to go beyond [`LONGEST_STEP`]: a trust region in those alone. Shortening the whole step
/// instead would hold back what an effect explains where the nuisance pulls at what is still missing.
fn bounded_step(
    mut hessian: DMatrix<f64>,
    gradient: &DVector<f64>,
    nuisance: usize,
) -> Option<DVector<f64>> {
    let mut held = 0.0;
    for _ in 0..HOLDS {
        let step = hessian.clone().cholesky()?.solve(gradient);
        let longest = step.rows(0, nuisance).amax();
        if longest <= LONGEST_STEP {
            return Some(step);
        }
        let more = if held == 0.0 { 1.0 } else { 3.0 * held };
        for i in 0..nuisance {
            hessian[(i, i)] += more;
        }
        held += more;
    }
    None
}

/// Fits with derivatives taken anew at every round until the cost settles.
pub fn polish<M: ExtensibleModel>(
    model: &M,
    start: &Fit,
    records: &[usize],
    rounds: usize,
) -> Option<(Fit, Jacobian)> {
    polish_to(model, start, records, rounds, 0.0)
}

/// As [`polish`]; a fit that is far from noise is settled when a round gains less than `share` of
/// what is left above noise.
pub(super) fn polish_to<M: ExtensibleModel>(
    model: &M,
    start: &Fit,
    records: &[usize],
    rounds: usize,
    share: f64,
) -> Option<(Fit, Jacobian)> {
    let mut best = start.clone();
    let mut jacobian = Jacobian::at(model, &best, records)?;
    for _ in 0..rounds {
        let next = fit(model, &best.point, records, &jacobian, 3)?;
        let gain = (best.cost - next.cost).abs();
        let excess = (squares(&next.residuals) - next.residuals.len() as f64).max(0.0);
        best = next;
        jacobian = Jacobian::at(model, &best, records)?;
        if gain < 0.1 + share * excess {
            break;
        }
    }
    Some((best, jacobian))
}

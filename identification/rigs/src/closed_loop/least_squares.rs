//! Levenberg's and Marquardt's method for whitened residuals.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Residuals of unit variance as a function of the parameters; `None` where there is no model.
pub trait Residuals: Sync {
    /// The residuals at `values`.
    fn residuals(&self, values: &[f64]) -> Option<Vec<f64>>;
}

/// One parameter of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinate {
    /// Where the search starts.
    pub start: f64,
    /// A change that is small and shows.
    pub scale: f64,
    /// Whether it is fitted.
    pub free: bool,
    /// Least and largest value.
    pub bounds: (f64, f64),
}

/// Where a fit ended.
#[derive(Debug, Clone)]
pub struct Optimum {
    /// All parameters.
    pub values: Vec<f64>,
    /// Covariance of all parameters for residuals of unit variance; zero rows for held ones.
    pub covariance: DMatrix<f64>,
    /// Half the sum of squares.
    pub cost: f64,
    /// Number of residuals.
    pub residuals: usize,
    /// Whether further steps would move it by less than a tenth of the standard errors.
    pub converged: bool,
}

/// Largest number of iterations.
const ITERATIONS: usize = 60;

fn cost(residuals: &[f64]) -> f64 {
    0.5 * residuals.iter().map(|r| r * r).sum::<f64>()
}

/// How much work a fit takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Most iterations.
    pub iterations: usize,
    /// It ends with an iteration that lowers the cost by less than this part of it.
    pub part: f64,
    /// Where its derivatives come from.
    pub derivatives: Derivatives,
}

/// Where the derivatives of an iteration come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Derivatives {
    /// They are taken in each.
    Taken,
    /// They are carried from the one before by what the residuals did (Broyden, Mathematics of Computation 19,
    /// 1965), as long as steps keep most of their promises. A fit does not end with carried ones.
    Carried,
    /// The same, and it may end with them.
    Trusted,
}

/// The best there is.
pub const WHOLE: Effort = Effort {
    iterations: ITERATIONS,
    part: 0.0,
    derivatives: Derivatives::Taken,
};

/// Share of the promised gain below which a step says that derivatives are too old.
const KEPT: f64 = 0.5;

/// Derivatives of the residuals in units of the coordinates' scales, and what follows from them.
struct Slopes {
    jacobian: DMatrix<f64>,
    information: DMatrix<f64>,
    /// Whether they are those of the place, not carried there.
    fresh: bool,
}

impl Slopes {
    fn at(
        model: &impl Residuals,
        coordinates: &[Coordinate],
        free: &[usize],
        values: &[f64],
        here: &[f64],
    ) -> Option<Self> {
        let jacobian = jacobian(model, coordinates, free, values, here)?;
        Some(Self {
            information: jacobian.tr_mul(&jacobian),
            jacobian,
            fresh: true,
        })
    }

    /// Carries them over `step`, along which the residuals changed by `change`.
    fn carry(&mut self, step: &DVector<f64>, mut change: DVector<f64>) {
        let square = step.norm_squared();
        if square > 0.0 {
            change.gemv(-1.0, &self.jacobian, step, 1.0);
            change /= square;
            let along = self.jacobian.tr_mul(&change);
            self.information += &along * step.transpose() + step * along.transpose();
            self.information += step * step.transpose() * change.norm_squared();
            self.jacobian.ger(1.0, &change, step, 1.0);
        }
        self.fresh = false;
    }
}

/// Minimises half the sum of squares over the free coordinates; `None` where the start value gives
/// no model.
pub fn minimise(model: &impl Residuals, coordinates: &[Coordinate]) -> Option<Optimum> {
    minimise_with(model, coordinates, WHOLE)
}

/// As [`minimise`], with no more than an effort.
pub fn minimise_with(
    model: &impl Residuals,
    coordinates: &[Coordinate],
    effort: Effort,
) -> Option<Optimum> {
    let mut values: Vec<f64> = coordinates.iter().map(|c| c.start).collect();
    let free: Vec<usize> = (0..values.len()).filter(|&i| coordinates[i].free).collect();
    let mut here = model.residuals(&values)?;
    let mut least = cost(&here);
    let mut damping = 1e-3;
    let mut converged = false;
    let mut information = DMatrix::zeros(free.len(), free.len());
    let mut carried: Option<Slopes> = None;
    for _ in 0..effort.iterations {
        let mut slopes = match carried.take() {
            Some(own) => own,
            None => Slopes::at(model, coordinates, &free, &values, &here)?,
        };
        information.copy_from(&slopes.information);
        let before = DVector::from_column_slice(&here);
        let gradient = slopes.jacobian.tr_mul(&before);
        let mut accepted = None;
        for _ in 0..10 {
            let mut damped = information.clone();
            for i in 0..free.len() {
                damped[(i, i)] *= 1.0 + damping;
                damped[(i, i)] += 1e-12;
            }
            let Some(step) = damped.cholesky().map(|c| c.solve(&gradient)) else {
                damping *= 10.0;
                continue;
            };
            let mut trial = values.clone();
            for (row, &i) in free.iter().enumerate() {
                let (low, high) = coordinates[i].bounds;
                trial[i] = (values[i] - step[row] * coordinates[i].scale).clamp(low, high);
            }
            let there = model.residuals(&trial);
            if let Some(there) = there.filter(|there| cost(there) <= least) {
                accepted = Some((trial, there));
                break;
            }
            // Carried derivatives are taken again before a step is shortened.
            if !slopes.fresh {
                break;
            }
            damping = (damping * 5.0).max(1e-6);
        }
        let Some((trial, there)) = accepted else {
            if slopes.fresh {
                // No step lowers the cost: an optimum to rounding.
                converged = true;
                break;
            }
            continue;
        };
        damping = (0.2 * damping).max(1e-9);
        let gain = least - cost(&there);
        least -= gain;
        let is_little = gain < (effort.part * least).max(0.005);
        let is_sure = slopes.fresh || effort.derivatives == Derivatives::Trusted;
        converged = is_little && is_sure;
        if effort.derivatives != Derivatives::Taken && !is_little {
            let moved = free
                .iter()
                .map(|&i| (trial[i] - values[i]) / coordinates[i].scale);
            let moved = DVector::from_iterator(free.len(), moved);
            let promised = -gradient.dot(&moved) - 0.5 * (&information * &moved).dot(&moved);
            if gain > KEPT * promised {
                slopes.carry(&moved, DVector::from_column_slice(&there) - before);
                carried = Some(slopes);
            }
        }
        (here, values) = (there, trial);
        if converged {
            break;
        }
    }
    let mut covariance = DMatrix::zeros(values.len(), values.len());
    let eigen = information.symmetric_eigen();
    let floor = 1e-14 * eigen.eigenvalues.max();
    for (k, &value) in eigen.eigenvalues.iter().enumerate() {
        let vector = eigen.eigenvectors.column(k);
        for (row, &i) in free.iter().enumerate() {
            for (column, &j) in free.iter().enumerate() {
                covariance[(i, j)] += vector[row] * vector[column] / value.max(floor)
                    * coordinates[i].scale
                    * coordinates[j].scale;
            }
        }
    }
    Some(Optimum {
        values,
        covariance,
        cost: least,
        residuals: here.len(),
        converged,
    })
}

/// Derivatives of the residuals by the free coordinates in units of their scales.
fn jacobian(
    model: &impl Residuals,
    coordinates: &[Coordinate],
    free: &[usize],
    values: &[f64],
    here: &[f64],
) -> Option<DMatrix<f64>> {
    const CHANGE: f64 = 1e-5;
    let columns: Option<Vec<Vec<f64>>> = free
        .par_iter()
        .map(|&i| {
            let coordinate = &coordinates[i];
            let sign = if values[i] + CHANGE * coordinate.scale > coordinate.bounds.1 {
                -1.0
            } else {
                1.0
            };
            let mut moved = values.to_vec();
            moved[i] += sign * CHANGE * coordinate.scale;
            let there = model.residuals(&moved)?;
            let slope = sign / CHANGE;
            Some(
                there
                    .iter()
                    .zip(here)
                    .map(|(a, b)| (a - b) * slope)
                    .collect(),
            )
        })
        .collect();
    let columns = columns?;
    Some(DMatrix::from_fn(here.len(), free.len(), |i, j| {
        columns[j][i]
    }))
}

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

/// Minimises half the sum of squares over the free coordinates; `None` where the start value gives
/// no model.
pub fn minimise(model: &impl Residuals, coordinates: &[Coordinate]) -> Option<Optimum> {
    minimise_within(model, coordinates, ITERATIONS, 0.0)
}

/// As [`minimise`], in at most so many iterations, and until one lowers the cost by less than a part of it.
pub fn minimise_within(
    model: &impl Residuals,
    coordinates: &[Coordinate],
    iterations: usize,
    part: f64,
) -> Option<Optimum> {
    let mut values: Vec<f64> = coordinates.iter().map(|c| c.start).collect();
    let free: Vec<usize> = (0..values.len()).filter(|&i| coordinates[i].free).collect();
    let mut here = model.residuals(&values)?;
    let mut least = cost(&here);
    let mut damping = 1e-3;
    let mut converged = false;
    let mut information = DMatrix::zeros(free.len(), free.len());
    for _ in 0..iterations {
        let jacobian = jacobian(model, coordinates, &free, &values, &here)?;
        information = jacobian.transpose() * &jacobian;
        let gradient = jacobian.transpose() * DVector::from_column_slice(&here);
        let mut accepted = false;
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
            let gain = match model.residuals(&trial) {
                Some(there) if cost(&there) <= least => {
                    let gain = least - cost(&there);
                    least -= gain;
                    here = there;
                    values = trial;
                    Some(gain)
                }
                _ => None,
            };
            if let Some(gain) = gain {
                accepted = true;
                damping = (0.2 * damping).max(1e-9);
                converged = gain < (part * least).max(0.005);
                break;
            }
            damping = (damping * 5.0).max(1e-6);
        }
        if !accepted {
            // No step lowers the cost: an optimum to rounding.
            converged = true;
        }
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

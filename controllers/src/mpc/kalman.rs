//! Steady-state Kalman filter (Eq 5-8 to 5-11).

use nalgebra::{DMatrix, DVector};
use plant::linear::{discrete_riccati, discrete_riccati_residual};

use crate::ModelError;

const EQUATION: &str = "the Riccati equation of the Kalman filter (Eq 5-8; `process_noise`, \
                        `measurement_noise` and the disturbance model set it)";
const LARGEST_RESIDUAL: f64 = 1e-10;

/// `x[k|k] = x[k|k-1] + K (y - C x[k|k-1])`; the time update is the model's.
#[derive(Debug, Clone, PartialEq)]
pub struct SteadyStateKalmanFilter {
    /// Gain of the measurement update, n x p (Eq 5-9).
    pub gain: DMatrix<f64>,
    /// Norm of the Riccati equation's left-hand side over that of its solution, in the scaled
    /// states in which it is solved.
    pub residual: f64,
}

impl SteadyStateKalmanFilter {
    /// Solves Eq 5-8 for transition `a` (n x n), measurement `c` (p x n), process noise covariance
    /// `q` (n x n) and measurement noise covariance `r` (p x p, diagonal).
    ///
    /// # Errors
    /// No stabilising solution, or none to 1e-10.
    pub fn new(
        a: &DMatrix<f64>,
        c: &DMatrix<f64>,
        q: &DMatrix<f64>,
        r: &DMatrix<f64>,
    ) -> Result<Self, ModelError> {
        // Outputs in units of their noise; states in units of their noise, then in units of the
        // standard deviations so found: the numbers of the equation become comparable.
        let mut size = (q + a * q * a.transpose()).diagonal();
        let measure = DMatrix::from_diagonal(&r.diagonal().map(|variance| 1.0 / variance.sqrt()));
        let mut best: Option<Solution> = None;
        for _ in 0..PASSES {
            let solution = Solution::new(a, c, q, r, &size, &measure)?;
            size = DVector::from_fn(a.nrows(), |i, _| {
                solution.m[(i, i)] * solution.from[(i, i)].powi(2)
            });
            if best
                .as_ref()
                .is_none_or(|best| solution.residual < best.residual)
            {
                best = Some(solution);
            }
        }
        let Some(Solution {
            from,
            c: scaled_c,
            r: scaled_r,
            m,
            residual,
        }) = best.filter(|best| best.residual <= LARGEST_RESIDUAL)
        else {
            return Err(no_solution(format!(
                "its residual is larger than {LARGEST_RESIDUAL:e}"
            )));
        };
        let innovation = scaled_c.transpose() * &m * &scaled_c + &scaled_r;
        let gain = innovation
            .cholesky()
            .ok_or_else(|| no_solution("the innovation's covariance is singular".into()))?
            .solve(&(scaled_c.transpose() * &m))
            .transpose();
        Ok(Self {
            gain: &from * gain * &measure,
            residual,
        })
    }
}

const PASSES: usize = 3;

fn no_solution(reason: String) -> ModelError {
    ModelError::NoSolution {
        equation: EQUATION,
        reason,
    }
}

/// Solution of Eq 5-8 in scaled states and outputs.
struct Solution {
    /// From scaled to given states.
    from: DMatrix<f64>,
    /// Measurement, transposed, n x p.
    c: DMatrix<f64>,
    /// Measurement noise.
    r: DMatrix<f64>,
    m: DMatrix<f64>,
    residual: f64,
}

impl Solution {
    fn new(
        a: &DMatrix<f64>,
        c: &DMatrix<f64>,
        q: &DMatrix<f64>,
        r: &DMatrix<f64>,
        size: &DVector<f64>,
        measure: &DMatrix<f64>,
    ) -> Result<Self, ModelError> {
        // Powers of two scale without rounding.
        let unit = size.map(|variance| {
            if variance > 0.0 {
                variance.sqrt().log2().round().exp2()
            } else {
                1.0
            }
        });
        let (to, from) = (
            DMatrix::from_diagonal(&unit.map(|s| 1.0 / s)),
            DMatrix::from_diagonal(&unit),
        );
        let a = (&to * a * &from).transpose();
        let c = (measure * c * &from).transpose();
        let q = &to * q * &to;
        let r = measure * r * measure;
        let m = discrete_riccati(&a, &c, &q, &r).map_err(|error| match error {
            ModelError::NoSolution { reason, .. } => no_solution(reason),
            other => other,
        })?;
        let residual = discrete_riccati_residual(&a, &c, &q, &r, &m)
            .map_or(f64::INFINITY, |left| left.norm() / m.norm());
        Ok(Self {
            from,
            c,
            r,
            m,
            residual,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    #[test]
    fn a_measured_random_walk_has_its_closed_form_gain() {
        // M² - q M - q r = 0, K = M / (M + r).
        let (q, r): (f64, f64) = (0.09, 0.25);
        let one = dmatrix![1.0];
        let filter = SteadyStateKalmanFilter::new(&one, &one, &dmatrix![q], &dmatrix![r]).unwrap();
        let m = (q + (q * q + 4.0 * q * r).sqrt()) / 2.0;
        assert!((filter.gain[(0, 0)] - m / (m + r)).abs() < 1e-13);
        assert!(filter.residual < 1e-14);
    }

    #[test]
    fn a_walk_that_nothing_drives_is_refused_by_the_names_of_its_parameters() {
        let one = dmatrix![1.0];
        let error = SteadyStateKalmanFilter::new(&one, &one, &dmatrix![0.0], &one)
            .unwrap_err()
            .to_string();
        assert!(error.contains("no stabilising solution"), "{error}");
        assert!(error.contains("`process_noise`"), "{error}");
    }
}

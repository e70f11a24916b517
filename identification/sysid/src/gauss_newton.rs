//! Gauss-Newton refinement of a model's prediction errors (Eq 2-23 to 2-27), as Fisher scoring of
//! the Gaussian likelihood.
//!
//! Minimises `L = sum over experiments of 1/2 sum_k e_k' S^-1 e_k + N/2 ln det S` with
//! `e_k(theta)` the one-step prediction errors and `S(theta)` their covariance. With a model of
//! the noise that is right, the estimate is consistent and efficient for data taken in closed
//! loop too (Ljung, System Identification, 2nd ed., 1999, Section 13.4), and the inverse of the
//! Fisher information is its covariance. Damping after Levenberg and Marquardt. Several outputs of
//! different size are weighed by `S`, so no scaling by hand enters.

use nalgebra::{DMatrix, DVector};

use crate::levenberg_marquardt::{self, Problem, Quadratic, Taken, is_held};
use crate::prediction::{Parameter, PredictionModel, cost, scoring};
use recordings::IdentificationError;

/// Where the scoring ended.
#[derive(Debug, Clone)]
pub struct GaussNewtonEstimate {
    /// All parameters, held ones included.
    pub parameters: Vec<f64>,
    /// Covariance of all parameters; zero rows for held ones and those at a bound.
    pub covariance: DMatrix<f64>,
    /// Negative logarithm of the likelihood, less its constant.
    pub cost: f64,
    /// Iterations used.
    pub iterations: usize,
    /// Directions in parameter space of which the data say nothing (unit length in units of the
    /// parameters' scales).
    pub flat_directions: Vec<DVector<f64>>,
}

impl GaussNewtonEstimate {
    /// Standard error of a parameter.
    pub fn standard_error(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }

    /// Covariance and flat directions out of the information.
    fn judge(&mut self, parameters: &[Parameter], information: &DMatrix<f64>) {
        let count = parameters.len();
        let active: Vec<usize> = (0..count)
            .filter(|&i| {
                let (low, high) = parameters[i].bounds;
                let value = self.parameters[i];
                parameters[i].free && value > low && value < high && information[(i, i)] > 0.0
            })
            .collect();
        let (h, scale) = scaled(information, &active);
        let eigen = h.symmetric_eigen();
        let mut covariance = DMatrix::zeros(count, count);
        for (k, &eigenvalue) in eigen.eigenvalues.iter().enumerate() {
            let vector = eigen.eigenvectors.column(k);
            if eigenvalue < FLAT {
                let mut direction = DVector::zeros(count);
                for (row, &i) in active.iter().enumerate() {
                    direction[i] = vector[row] * scale[row] / parameters[i].scale;
                }
                self.flat_directions.push(direction.normalize());
            }
            let variance = 1.0 / eigenvalue.max(FLAT * 1e-3);
            for (row, &i) in active.iter().enumerate() {
                for (column, &j) in active.iter().enumerate() {
                    covariance[(i, j)] +=
                        vector[row] * vector[column] * scale[row] * scale[column] * variance;
                }
            }
        }
        self.covariance = covariance;
    }
}

const MAX_ITERATIONS: usize = 60;
const LEAST_DAMPING: f64 = 1e-9;
/// A tolerance that costs no accuracy.
pub const FINE: f64 = 0.1;
/// Eigenvalues of the information matrix below this, relative to the unit diagonal, are flat.
const FLAT: f64 = 1e-11;

/// How to go about a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// Ends where another iteration would move the estimate by less than about so many standard
    /// errors.
    pub tolerance: f64,
    /// Most iterations.
    pub iterations: usize,
    /// Damping of the first iteration, over the diagonal of the information.
    pub damping: f64,
}

impl Search {
    /// From far away.
    pub fn within(tolerance: f64) -> Self {
        Self {
            tolerance,
            iterations: MAX_ITERATIONS,
            damping: 1e-3,
        }
    }

    /// From beside an optimum: full steps from the start, so that directions of which the data
    /// say little are not crept along.
    pub fn nearby(tolerance: f64) -> Self {
        Self {
            damping: LEAST_DAMPING,
            ..Self::within(tolerance)
        }
    }
}

/// Fits the free parameters.
///
/// # Errors
/// The start makes no model, or no optimum is reached in the iterations allowed.
pub fn fit<const P: usize>(
    model: &impl PredictionModel<P>,
    parameters: &[Parameter],
    search: Search,
) -> Result<GaussNewtonEstimate, IdentificationError> {
    let (estimate, converged) = fit_within(model, parameters, search)?;
    if converged {
        return Ok(estimate);
    }
    Err(IdentificationError::NotConverged {
        method: "the Gauss-Newton refinement",
        reason: format!("not converged after {} iterations", search.iterations),
    })
}

/// Fits as [`fit`], and says whether it got there.
///
/// # Errors
/// The start makes no model.
pub fn fit_within<const P: usize>(
    model: &impl PredictionModel<P>,
    parameters: &[Parameter],
    search: Search,
) -> Result<(GaussNewtonEstimate, bool), IdentificationError> {
    let values: Vec<f64> = parameters.iter().map(|p| p.start).collect();
    let cost = cost(model, &values).ok_or(IdentificationError::NotConverged {
        method: "the Gauss-Newton refinement",
        reason: "the start value gives no model".into(),
    })?;
    let small = search.tolerance * search.tolerance;
    let mut scoring = Scoring::<P, _> {
        model,
        parameters,
        small,
    };
    let damped = levenberg_marquardt::Search {
        first: search.damping,
        lowered: |damping| (0.1 * damping).max(LEAST_DAMPING),
        raised: |damping| damping * if damping < 1e-4 { 100.0 } else { 10.0 },
        tries: [12, 0],
        pointless: small,
        iterations: search.iterations,
        ..levenberg_marquardt::Search::default()
    };
    let start = Place { values, cost };
    let found = levenberg_marquardt::minimise(&mut scoring, start, &damped)?;
    let mut estimate = GaussNewtonEstimate {
        parameters: found.place.values,
        covariance: DMatrix::zeros(0, 0),
        flat_directions: Vec::new(),
        cost: found.place.cost,
        iterations: found.iterations,
    };
    let count = parameters.len();
    let none = || DMatrix::zeros(count, count);
    estimate.judge(parameters, &found.information.unwrap_or_else(none));
    Ok((estimate, found.has_converged))
}

struct Place {
    values: Vec<f64>,
    cost: f64,
}

struct Scoring<'a, const P: usize, M> {
    model: &'a M,
    parameters: &'a [Parameter],
    /// Gain that does not matter.
    small: f64,
}

impl<const P: usize, M: PredictionModel<P>> Problem for Scoring<'_, P, M> {
    type Place = Place;
    type Error = IdentificationError;

    fn cost(&self, place: &Place) -> f64 {
        place.cost
    }

    fn expand(&mut self, place: &Place, _: bool) -> Result<Quadratic, IdentificationError> {
        let (information, gradient) = scoring(self.model, self.parameters, &place.values)?;
        let is_active = |&i: &usize| {
            let own = &self.parameters[i];
            own.free && !is_held(place.values[i], own.bounds, -gradient[i])
        };
        Ok(Quadratic {
            active: (0..self.parameters.len()).filter(is_active).collect(),
            information,
            downhill: -gradient,
        })
    }

    fn step(&self, quadratic: &Quadratic, damping: f64) -> Option<DVector<f64>> {
        let active = &quadratic.active;
        let (mut h, scale) = scaled(&quadratic.information, active);
        for i in 0..active.len() {
            h[(i, i)] += damping;
        }
        let g = DVector::from_fn(active.len(), |i, _| {
            quadratic.downhill[active[i]] * scale[i]
        });
        let eigen = h.symmetric_eigen();
        let mut coordinates = eigen.eigenvectors.tr_mul(&g);
        for (value, eigenvalue) in coordinates.iter_mut().zip(eigen.eigenvalues.iter()) {
            *value /= eigenvalue.max(damping.max(FLAT));
        }
        let solution = eigen.eigenvectors * coordinates;
        let mut step = DVector::zeros(quadratic.downhill.len());
        for (k, &i) in active.iter().enumerate() {
            step[i] = solution[k] * scale[k];
        }
        Some(step)
    }

    fn moved(&mut self, place: &Place, step: &DVector<f64>) -> Option<Place> {
        let moved = self.parameters.iter().zip(&place.values).zip(step.iter());
        let values = moved.map(|((own, value), by)| {
            let by = by.clamp(-own.largest_step, own.largest_step);
            let (low, high) = own.bounds;
            if own.free {
                (value + by).clamp(low, high)
            } else {
                *value
            }
        });
        let values: Vec<f64> = values.collect();
        let cost = cost(self.model, &values)?;
        Some(Place { values, cost })
    }

    fn has_settled(&self, taken: &Taken<'_, Place>) -> bool {
        taken.promise.abs() < self.small && taken.gain < self.small
    }
}

/// The information of the active parameters, scaled to a unit diagonal, and the scales.
fn scaled(information: &DMatrix<f64>, active: &[usize]) -> (DMatrix<f64>, Vec<f64>) {
    let scale: Vec<f64> = active
        .iter()
        .map(|&i| information[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip())
        .collect();
    let n = active.len();
    let h = DMatrix::from_fn(n, n, |i, j| {
        information[(active[i], active[j])] * scale[i] * scale[j]
    });
    (h, scale)
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector};

    use super::*;
    use crate::prediction::Predictor;

    /// `y_k = exp(-a k h) b + e_k`: errors in closed form.
    struct Decay {
        measured: Vec<f64>,
    }

    #[derive(Clone)]
    struct Decaying([f64; 3]);

    impl Predictor<1> for Decaying {
        fn covariance(&self) -> SMatrix<f64, 1, 1> {
            SMatrix::<f64, 1, 1>::new((2.0 * self.0[2]).exp())
        }
    }

    impl PredictionModel<1> for Decay {
        type Predictor = Decaying;

        fn experiments(&self) -> usize {
            1
        }

        fn samples(&self, _: usize) -> usize {
            self.measured.len()
        }

        fn predictor(&self, _: usize, parameters: &[f64]) -> Option<Decaying> {
            Some(Decaying([parameters[0], parameters[1], parameters[2]]))
        }

        fn predict(
            &self,
            _: usize,
            Decaying(p): &mut Decaying,
            first: usize,
            errors: &mut [SVector<f64, 1>],
        ) {
            for (k, error) in (first..).zip(errors) {
                error[0] = self.measured[k] - p[1] * (-p[0] * 0.01 * k as f64).exp();
            }
        }
    }

    #[test]
    fn estimate_and_errors_of_a_decay_match_linear_theory() {
        let noise = |k: usize| 1e-3 * ((k * 7919 % 1000) as f64 / 500.0 - 0.999);
        let model = Decay {
            measured: (0..500)
                .map(|k| 2.0 * (-0.03 * k as f64).exp() + noise(k))
                .collect(),
        };
        let start = [
            Parameter::new("rate", 1.0, 1.0),
            Parameter::new("size", 1.0, 1.0),
            Parameter::new("log noise", -2.0, 1.0),
        ];
        let got = fit(&model, &start, Search::within(FINE)).unwrap();
        assert!((got.parameters[0] - 3.0).abs() < 3.0 * got.standard_error(0));
        assert!((got.parameters[1] - 2.0).abs() < 3.0 * got.standard_error(1));
        // Noise uniform in +-1e-3: standard deviation 1e-3 / sqrt(3).
        let deviation = got.parameters[2].exp();
        assert!((deviation / (1e-3 / 3f64.sqrt()) - 1.0).abs() < 0.1);
        // Fisher information of a log standard deviation is 2 N.
        assert!((got.standard_error(2) - 1.0 / 1000f64.sqrt()).abs() < 1e-4);
        // Information of the two others by the closed-form derivatives.
        let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
        for k in 0..500 {
            let t = 0.01 * k as f64;
            let decay = (-3.0 * t).exp();
            let (da, db) = (-2.0 * t * decay, decay);
            aa += da * da;
            ab += da * db;
            bb += db * db;
        }
        let rate = deviation * (bb / (aa * bb - ab * ab)).sqrt();
        assert!((got.standard_error(0) / rate - 1.0).abs() < 0.02);
    }
}

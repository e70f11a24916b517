//! Gauss-Newton refinement of a model's prediction errors (Eq 2-23 to 2-27), as Fisher scoring of
//! the Gaussian likelihood.
//!
//! Minimises `L = sum over experiments of 1/2 sum_k e_k' S^-1 e_k + N/2 ln det S` with
//! `e_k(theta)` the one-step prediction errors and `S(theta)` their covariance. With a model of
//! the noise that is right, the estimate is consistent and efficient for data taken in closed
//! loop too (Ljung, System Identification, 2nd ed., 1999, Section 13.4), and the inverse of the
//! Fisher information is its covariance. Damping after Levenberg and Marquardt. Several outputs of
//! different size are weighed by `S`, so no scaling by hand enters.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use rayon::prelude::*;

use crate::IdentificationError;

/// Prediction errors of one experiment.
#[derive(Debug, Clone)]
pub struct Innovations<const P: usize> {
    /// Measured less predicted outputs, one vector a sample.
    pub errors: Vec<SVector<f64, P>>,
    /// Their covariance as the model has it.
    pub covariance: SMatrix<f64, P, P>,
}

/// One parameter of a prediction model.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Start value.
    pub start: f64,
    /// A change that matters little: derivatives are differences over a hundred-thousandth of it.
    pub scale: f64,
    /// Smallest and largest value allowed.
    pub bounds: (f64, f64),
    /// Largest change in one iteration.
    pub largest_step: f64,
    /// False for a parameter that is held at its start.
    pub free: bool,
    /// The experiment that alone depends on it, if only one does.
    pub experiment: Option<usize>,
}

impl Parameter {
    /// A free parameter without bounds that every experiment depends on.
    pub fn new(name: &str, start: f64, scale: f64) -> Self {
        Self {
            name: name.to_string(),
            start,
            scale,
            bounds: (f64::NEG_INFINITY, f64::INFINITY),
            largest_step: f64::INFINITY,
            free: true,
            experiment: None,
        }
    }
}

/// A model that predicts each sample from those before it.
pub trait PredictionModel<const P: usize>: Sync {
    /// Number of experiments that share the parameters.
    fn experiments(&self) -> usize;

    /// The errors of one experiment; `None` where the parameters make no model.
    fn innovations(&self, experiment: usize, parameters: &[f64]) -> Option<Innovations<P>>;
}

/// Where the scoring ended.
#[derive(Debug, Clone)]
pub struct Estimate {
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

impl Estimate {
    /// Standard error of a parameter.
    pub fn standard_error(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }
}

/// Whitened errors of one experiment and half of N times the log-determinant of their covariance.
struct Whitened<const P: usize> {
    errors: Vec<SVector<f64, P>>,
    inverse_root: SMatrix<f64, P, P>,
    log_determinant: f64,
}

impl<const P: usize> Whitened<P> {
    fn new(innovations: &Innovations<P>) -> Option<Self> {
        let root = innovations.covariance.cholesky()?.l();
        let inverse_root = root.try_inverse()?;
        let errors: Vec<_> = innovations
            .errors
            .iter()
            .map(|e| inverse_root * e)
            .collect();
        let log_determinant = root.diagonal().iter().map(|l| l.ln()).sum::<f64>();
        log_determinant.is_finite().then_some(Self {
            log_determinant: log_determinant * errors.len() as f64,
            errors,
            inverse_root,
        })
    }

    fn cost(&self) -> f64 {
        let square: f64 = self.errors.iter().map(SVector::norm_squared).sum();
        0.5 * square + self.log_determinant
    }
}

/// Derivative of an experiment's errors and covariance by one parameter, both whitened.
struct Sensitivity<const P: usize> {
    parameter: usize,
    errors: Vec<SVector<f64, P>>,
    covariance: SMatrix<f64, P, P>,
}

const MAX_ITERATIONS: usize = 60;
/// A tolerance for [`fit`] that costs no accuracy.
pub const FINE: f64 = 0.1;
/// Eigenvalues of the information matrix below this, relative to the unit diagonal, are flat.
const FLAT: f64 = 1e-11;

/// Fits the free parameters, until another iteration would move the estimate by less than about
/// `tolerance` standard errors.
///
/// # Errors
/// The start makes no model, or no optimum is reached in 60 iterations.
pub fn fit<const P: usize>(
    model: &impl PredictionModel<P>,
    parameters: &[Parameter],
    tolerance: f64,
) -> Result<Estimate, IdentificationError> {
    let (estimate, converged) = fit_within(model, parameters, tolerance, MAX_ITERATIONS)?;
    if converged {
        return Ok(estimate);
    }
    Err(IdentificationError::NotConverged {
        method: "the Gauss-Newton refinement",
        reason: format!("still moving after {MAX_ITERATIONS} iterations"),
    })
}

/// Fits as [`fit`] for at most so many iterations, and says whether it got there.
///
/// # Errors
/// The start makes no model.
pub fn fit_within<const P: usize>(
    model: &impl PredictionModel<P>,
    parameters: &[Parameter],
    tolerance: f64,
    iterations: usize,
) -> Result<(Estimate, bool), IdentificationError> {
    let failed = |reason: &str| IdentificationError::NotConverged {
        method: "the Gauss-Newton refinement",
        reason: reason.to_string(),
    };
    let mut values: Vec<f64> = parameters.iter().map(|p| p.start).collect();
    let mut base = evaluate(model, &values).ok_or_else(|| failed("the start makes no model"))?;
    let mut cost: f64 = base.iter().map(Whitened::cost).sum();
    let mut damping = 1e-3;
    for iteration in 1..=iterations {
        let (information, gradient) = scoring(model, parameters, &values, &base)?;
        let active: Vec<usize> = (0..parameters.len())
            .filter(|&i| parameters[i].free && !pushes_out(&parameters[i], values[i], gradient[i]))
            .collect();
        let mut accepted = false;
        for _ in 0..12 {
            let step = damped_step(&information, &gradient, &active, damping);
            let mut trial = values.clone();
            for &i in &active {
                let parameter = &parameters[i];
                let (low, high) = parameter.bounds;
                let most = parameter.largest_step;
                trial[i] = (values[i] + step[i].clamp(-most, most)).clamp(low, high);
            }
            let decrement = -active.iter().map(|&i| gradient[i] * step[i]).sum::<f64>();
            let next = evaluate(model, &trial);
            let next_cost = next
                .as_ref()
                .map_or(f64::INFINITY, |w| w.iter().map(Whitened::cost).sum());
            if next_cost <= cost {
                let gained = cost - next_cost;
                values = trial;
                cost = next_cost;
                if let Some(next) = next {
                    base = next;
                }
                damping = (damping * 0.1).max(1e-9);
                accepted = true;
                if decrement.abs() < tolerance * tolerance && gained < tolerance * tolerance {
                    let estimate = finish(model, parameters, values, &base, cost, iteration)?;
                    return Ok((estimate, true));
                }
                break;
            }
            if decrement.abs() < tolerance * tolerance {
                let estimate = finish(model, parameters, values, &base, cost, iteration)?;
                return Ok((estimate, true));
            }
            damping *= if damping < 1e-4 { 100.0 } else { 10.0 };
        }
        if !accepted {
            let estimate = finish(model, parameters, values, &base, cost, iteration)?;
            return Ok((estimate, true));
        }
    }
    let estimate = finish(model, parameters, values, &base, cost, iterations)?;
    Ok((estimate, false))
}

/// Where one held parameter would go in one step of all from the start values, and the standard
/// error of that (from an optimum of the others, a score test).
///
/// # Errors
/// The start makes no model.
pub fn score_test<const P: usize>(
    model: &impl PredictionModel<P>,
    parameters: &[Parameter],
    index: usize,
) -> Result<(f64, f64), IdentificationError> {
    let mut freed = parameters.to_vec();
    freed[index].free = true;
    let values: Vec<f64> = parameters.iter().map(|p| p.start).collect();
    let base = evaluate(model, &values).ok_or(IdentificationError::NotConverged {
        method: "the score test",
        reason: "the start makes no model".into(),
    })?;
    let (information, gradient) = scoring(model, &freed, &values, &base)?;
    let active: Vec<usize> = (0..freed.len())
        .filter(|&i| freed[i].free && !pushes_out(&freed[i], values[i], gradient[i]))
        .collect();
    let step = damped_step(&information, &gradient, &active, 1e-9);
    let mut unit = DVector::zeros(freed.len());
    unit[index] = -1.0;
    let variance = damped_step(&information, &unit, &active, 1e-9)[index];
    Ok((step[index], variance.max(0.0).sqrt()))
}

fn pushes_out(parameter: &Parameter, value: f64, gradient: f64) -> bool {
    let (low, high) = parameter.bounds;
    (value <= low && gradient > 0.0) || (value >= high && gradient < 0.0)
}

fn evaluate<const P: usize>(
    model: &impl PredictionModel<P>,
    values: &[f64],
) -> Option<Vec<Whitened<P>>> {
    (0..model.experiments())
        .map(|experiment| {
            let whitened = Whitened::new(&model.innovations(experiment, values)?)?;
            whitened.cost().is_finite().then_some(whitened)
        })
        .collect()
}

/// Fisher information and gradient of the cost.
fn scoring<const P: usize>(
    model: &impl PredictionModel<P>,
    parameters: &[Parameter],
    values: &[f64],
    base: &[Whitened<P>],
) -> Result<(DMatrix<f64>, DVector<f64>), IdentificationError> {
    let count = parameters.len();
    let mut information = DMatrix::zeros(count, count);
    let mut gradient = DVector::zeros(count);
    for (experiment, whitened) in base.iter().enumerate() {
        let reference = model.innovations(experiment, values);
        let Some(reference) = reference else { continue };
        let wanted: Vec<usize> = (0..count)
            .filter(|&i| {
                let p = &parameters[i];
                p.free && p.experiment.is_none_or(|only| only == experiment)
            })
            .collect();
        let sensitivities: Vec<Sensitivity<P>> = wanted
            .par_iter()
            .map(|&i| {
                sensitivity(
                    model, parameters, values, experiment, &reference, whitened, i,
                )
                .ok_or_else(|| IdentificationError::NotConverged {
                    method: "the Gauss-Newton refinement",
                    reason: format!(
                        "no model beside the present one along `{}`",
                        parameters[i].name
                    ),
                })
            })
            .collect::<Result<_, _>>()?;
        let samples = whitened.errors.len() as f64;
        let moment = whitened
            .errors
            .iter()
            .fold(SMatrix::<f64, P, P>::zeros(), |sum, w| {
                sum + w * w.transpose()
            });
        let rows: Vec<(usize, usize, f64)> = (0..sensitivities.len())
            .into_par_iter()
            .flat_map_iter(|i| {
                let a = &sensitivities[i];
                let sensitivities = &sensitivities;
                (0..=i).map(move |j| {
                    let b = &sensitivities[j];
                    let product = dot(&a.errors, &b.errors)
                        + 0.5 * samples * a.covariance.component_mul(&b.covariance).sum();
                    (a.parameter, b.parameter, product)
                })
            })
            .collect();
        for (i, j, product) in rows {
            information[(i, j)] += product;
            if i != j {
                information[(j, i)] += product;
            }
        }
        for s in &sensitivities {
            gradient[s.parameter] += dot(&whitened.errors, &s.errors)
                + 0.5 * samples * s.covariance.trace()
                - 0.5 * s.covariance.component_mul(&moment).sum();
        }
    }
    Ok((information, gradient))
}

fn sensitivity<const P: usize>(
    model: &impl PredictionModel<P>,
    parameters: &[Parameter],
    values: &[f64],
    experiment: usize,
    reference: &Innovations<P>,
    whitened: &Whitened<P>,
    index: usize,
) -> Option<Sensitivity<P>> {
    let parameter = &parameters[index];
    let mut change = 1e-5 * parameter.scale;
    if values[index] + change > parameter.bounds.1 {
        change = -change;
    }
    let mut moved = values.to_vec();
    moved[index] += change;
    let next = match model.innovations(experiment, &moved) {
        Some(next) => next,
        None => {
            change = -change;
            moved[index] = values[index] + change;
            model.innovations(experiment, &moved)?
        }
    };
    let l = whitened.inverse_root / change;
    Some(Sensitivity {
        parameter: index,
        errors: next
            .errors
            .iter()
            .zip(&reference.errors)
            .map(|(a, b)| l * (a - b))
            .collect(),
        covariance: l
            * (next.covariance - reference.covariance)
            * whitened.inverse_root.transpose(),
    })
}

fn dot<const P: usize>(a: &[SVector<f64, P>], b: &[SVector<f64, P>]) -> f64 {
    a.iter()
        .zip(b)
        .fold(SVector::<f64, P>::zeros(), |sum, (x, y)| {
            sum + x.component_mul(y)
        })
        .sum()
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

fn damped_step(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
    active: &[usize],
    damping: f64,
) -> DVector<f64> {
    let (mut h, scale) = scaled(information, active);
    for i in 0..active.len() {
        h[(i, i)] += damping;
    }
    let g = DVector::from_fn(active.len(), |i, _| -gradient[active[i]] * scale[i]);
    let eigen = h.symmetric_eigen();
    let mut coordinates = eigen.eigenvectors.tr_mul(&g);
    for (value, eigenvalue) in coordinates.iter_mut().zip(eigen.eigenvalues.iter()) {
        *value /= eigenvalue.max(damping.max(FLAT));
    }
    let solution = eigen.eigenvectors * coordinates;
    let mut step = DVector::zeros(gradient.len());
    for (k, &i) in active.iter().enumerate() {
        step[i] = solution[k] * scale[k];
    }
    step
}

fn finish<const P: usize>(
    model: &impl PredictionModel<P>,
    parameters: &[Parameter],
    values: Vec<f64>,
    base: &[Whitened<P>],
    cost: f64,
    iterations: usize,
) -> Result<Estimate, IdentificationError> {
    let (information, _) = scoring(model, parameters, &values, base)?;
    let count = parameters.len();
    let active: Vec<usize> = (0..count)
        .filter(|&i| {
            let (low, high) = parameters[i].bounds;
            parameters[i].free && values[i] > low && values[i] < high && information[(i, i)] > 0.0
        })
        .collect();
    let (h, scale) = scaled(&information, &active);
    let eigen = h.symmetric_eigen();
    let mut flat_directions = Vec::new();
    let mut covariance = DMatrix::zeros(count, count);
    for (k, &eigenvalue) in eigen.eigenvalues.iter().enumerate() {
        let vector = eigen.eigenvectors.column(k);
        if eigenvalue < FLAT {
            let mut direction = DVector::zeros(count);
            for (row, &i) in active.iter().enumerate() {
                direction[i] = vector[row] * scale[row] / parameters[i].scale;
            }
            flat_directions.push(direction.normalize());
        }
        let variance = 1.0 / eigenvalue.max(FLAT * 1e-3);
        for (row, &i) in active.iter().enumerate() {
            for (column, &j) in active.iter().enumerate() {
                covariance[(i, j)] +=
                    vector[row] * vector[column] * scale[row] * scale[column] * variance;
            }
        }
    }
    Ok(Estimate {
        parameters: values,
        covariance,
        cost,
        iterations,
        flat_directions,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `y_k = exp(-a k h) b + e_k`: errors in closed form.
    struct Decay {
        measured: Vec<f64>,
    }

    impl PredictionModel<1> for Decay {
        fn experiments(&self) -> usize {
            1
        }

        fn innovations(&self, _: usize, p: &[f64]) -> Option<Innovations<1>> {
            let errors = self.measured.iter().enumerate();
            Some(Innovations {
                errors: errors
                    .map(|(k, y)| {
                        SVector::<f64, 1>::new(y - p[1] * (-p[0] * 0.01 * k as f64).exp())
                    })
                    .collect(),
                covariance: SMatrix::<f64, 1, 1>::new((2.0 * p[2]).exp()),
            })
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
        let got = fit(&model, &start, FINE).unwrap();
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

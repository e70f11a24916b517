//! One-step prediction errors of a model with parameters, their Gaussian likelihood, and its
//! gradient and Fisher information by differences.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use rayon::prelude::*;

use recordings::IdentificationError;

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

/// A model that predicts each sample of `P` outputs from the samples before it.
pub trait PredictionModel<const P: usize>: Sync {
    /// The predictor at given parameters, with its state.
    type Predictor: Predictor<P>;

    /// Number of experiments that share the parameters.
    fn experiments(&self) -> usize;

    /// Number of samples of an experiment.
    fn samples(&self, experiment: usize) -> usize;

    /// The predictor of one experiment, before its first sample; `None` where the parameters make
    /// no model.
    fn predictor(&self, experiment: usize, parameters: &[f64]) -> Option<Self::Predictor>;

    /// Measured less predicted outputs of the samples from `first` on, as many as `errors` takes.
    /// The samples before `first` have been predicted already.
    fn predict(
        &self,
        experiment: usize,
        predictor: &mut Self::Predictor,
        first: usize,
        errors: &mut [SVector<f64, P>],
    );

    /// The errors of one experiment; `None` where the parameters make no model.
    fn errors(&self, experiment: usize, parameters: &[f64]) -> Option<Vec<SVector<f64, P>>> {
        let mut predictor = self.predictor(experiment, parameters)?;
        let mut errors = vec![SVector::zeros(); self.samples(experiment)];
        self.predict(experiment, &mut predictor, 0, &mut errors);
        let last = errors.last()?;
        last.iter().all(|value| value.is_finite()).then_some(errors)
    }
}

/// A predictor between two samples.
pub trait Predictor<const P: usize>: Clone + Send + Sync {
    /// Covariance of the errors as the model has it.
    fn covariance(&self) -> SMatrix<f64, P, P>;
}

/// What whitens errors of a covariance.
struct Whitening<const P: usize> {
    inverse_root: SMatrix<f64, P, P>,
    log_determinant: f64,
}

impl<const P: usize> Whitening<P> {
    fn new(covariance: SMatrix<f64, P, P>) -> Option<Self> {
        let root = covariance.cholesky()?.l();
        let log_determinant: f64 = root.diagonal().iter().map(|l| l.ln()).sum();
        log_determinant.is_finite().then_some(Self {
            inverse_root: root.try_inverse()?,
            log_determinant,
        })
    }
}

/// Samples taken at a time: the derivatives of a block stay in the cache.
const BLOCK: usize = 256;

/// Negative logarithm of the likelihood, less its constant: the sum over the experiments of
/// `1/2 sum_k e_k' S^-1 e_k + N/2 ln det S`. `None` where the parameters make no model.
pub fn cost<const P: usize>(model: &impl PredictionModel<P>, parameters: &[f64]) -> Option<f64> {
    let mut total = 0.0;
    for experiment in 0..model.experiments() {
        let mut predictor = model.predictor(experiment, parameters)?;
        let whitening = Whitening::new(predictor.covariance())?;
        let mut errors = [SVector::<f64, P>::zeros(); BLOCK];
        let samples = model.samples(experiment);
        let mut square = 0.0;
        for first in (0..samples).step_by(BLOCK) {
            let block = &mut errors[..BLOCK.min(samples - first)];
            model.predict(experiment, &mut predictor, first, block);
            for error in block {
                square += (whitening.inverse_root * *error).norm_squared();
            }
        }
        total += 0.5 * square + whitening.log_determinant * samples as f64;
    }
    total.is_finite().then_some(total)
}

/// A predictor at parameters of which one is moved.
struct Moved<const P: usize, Q> {
    parameter: usize,
    predictor: Q,
    /// Whitens and divides by the change.
    slope: SMatrix<f64, P, P>,
    /// Derivative of the covariance, whitened.
    covariance: SMatrix<f64, P, P>,
}

/// Fisher information and gradient of the cost by the free parameters.
///
/// # Errors
/// The values make no model, or none on either side of one of them.
pub fn scoring<const P: usize, M: PredictionModel<P>>(
    model: &M,
    parameters: &[Parameter],
    values: &[f64],
) -> Result<(DMatrix<f64>, DVector<f64>), IdentificationError> {
    let count = parameters.len();
    let mut information = DMatrix::zeros(count, count);
    let mut gradient = DVector::zeros(count);
    for experiment in 0..model.experiments() {
        let mut base = model
            .predictor(experiment, values)
            .ok_or_else(|| no_model("the present values give no model".into()))?;
        let whitening = Whitening::new(base.covariance())
            .ok_or_else(|| no_model("the errors have no covariance".into()))?;
        let mut moved: Vec<Moved<P, M::Predictor>> = (0..count)
            .into_par_iter()
            .filter(|&i| {
                let p = &parameters[i];
                p.free && p.experiment.is_none_or(|only| only == experiment)
            })
            .map(|i| {
                beside(model, parameters, values, experiment, &base, &whitening, i).ok_or_else(
                    || {
                        no_model(format!(
                            "no model beside the present one along `{}`",
                            parameters[i].name
                        ))
                    },
                )
            })
            .collect::<Result<_, _>>()?;
        let products = products(model, experiment, &mut base, &whitening, &mut moved);
        let last = moved.len();
        let samples = model.samples(experiment) as f64;
        // Second moment of the whitened errors.
        let moment = products.moment;
        for (i, a) in moved.iter().enumerate() {
            for (j, b) in moved.iter().enumerate() {
                information[(a.parameter, b.parameter)] += products.gram[(i, j)]
                    + 0.5 * samples * a.covariance.component_mul(&b.covariance).sum();
            }
            gradient[a.parameter] += products.gram[(i, last)]
                + 0.5 * samples * a.covariance.trace()
                - 0.5 * a.covariance.component_mul(&moment).sum();
        }
    }
    Ok((information, gradient))
}

fn no_model(reason: String) -> IdentificationError {
    IdentificationError::NotConverged {
        method: "the Gauss-Newton refinement",
        reason,
    }
}

/// The predictor with one parameter moved, towards the other side where there is none on this.
fn beside<const P: usize, M: PredictionModel<P>>(
    model: &M,
    parameters: &[Parameter],
    values: &[f64],
    experiment: usize,
    base: &M::Predictor,
    whitening: &Whitening<P>,
    index: usize,
) -> Option<Moved<P, M::Predictor>> {
    let parameter = &parameters[index];
    let mut change = 1e-5 * parameter.scale;
    if values[index] + change > parameter.bounds.1 {
        change = -change;
    }
    let mut values = values.to_vec();
    let at = values[index];
    values[index] = at + change;
    let predictor = match model.predictor(experiment, &values) {
        Some(predictor) => predictor,
        None => {
            change = -change;
            values[index] = at + change;
            model.predictor(experiment, &values)?
        }
    };
    let slope = whitening.inverse_root / change;
    let covariance =
        slope * (predictor.covariance() - base.covariance()) * whitening.inverse_root.transpose();
    Some(Moved {
        parameter: index,
        predictor,
        slope,
        covariance,
    })
}

/// Products of the whitened derivatives of the errors, summed over the samples.
struct Products<const P: usize> {
    /// Derivatives with derivatives; the last row and column are the errors themselves.
    gram: DMatrix<f64>,
    /// The errors' second moment.
    moment: SMatrix<f64, P, P>,
}

fn products<const P: usize, M: PredictionModel<P>>(
    model: &M,
    experiment: usize,
    base: &mut M::Predictor,
    whitening: &Whitening<P>,
    moved: &mut [Moved<P, M::Predictor>],
) -> Products<P> {
    let columns = moved.len() + 1;
    let rows = BLOCK * P;
    let samples = model.samples(experiment);
    let mut gram = DMatrix::zeros(columns, columns);
    let mut moment = SMatrix::<f64, P, P>::zeros();
    let mut errors = [SVector::<f64, P>::zeros(); BLOCK];
    let mut block = DMatrix::zeros(rows, columns);
    let mut transposed = DMatrix::zeros(columns, rows);
    for first in (0..samples).step_by(BLOCK) {
        let count = BLOCK.min(samples - first);
        model.predict(experiment, base, first, &mut errors[..count]);
        let errors = &errors[..count];
        if count < BLOCK {
            block.fill(0.0);
        }
        let (derivatives, own) = block.as_mut_slice().split_at_mut(rows * moved.len());
        derivatives
            .par_chunks_mut(rows)
            .zip(moved.par_iter_mut())
            .for_each(|(column, moved)| {
                let mut beside = [SVector::<f64, P>::zeros(); BLOCK];
                let beside = &mut beside[..count];
                model.predict(experiment, &mut moved.predictor, first, beside);
                for ((cells, a), b) in column.chunks_exact_mut(P).zip(beside).zip(errors) {
                    cells.copy_from_slice((moved.slope * (*a - b)).as_slice());
                }
            });
        for (cells, error) in own.chunks_exact_mut(P).zip(errors) {
            let white = whitening.inverse_root * error;
            moment += white * white.transpose();
            cells.copy_from_slice(white.as_slice());
        }
        block.transpose_to(&mut transposed);
        let (mut left, mut right) =
            gram.columns_range_pair_mut(..columns / 2, columns / 2..columns);
        let half = columns / 2;
        rayon::join(
            || left.gemm(1.0, &transposed, &block.columns(0, half), 1.0),
            || right.gemm(1.0, &transposed, &block.columns(half, columns - half), 1.0),
        );
    }
    Products { gram, moment }
}

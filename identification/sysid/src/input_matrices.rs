//! The input matrices of a subspace model by linear least squares (Eq 2-10), with `A`, `C` and
//! the gain `K` held.
//!
//! The regressions of the subspace method take `B` from estimated states, whose errors enter it.
//! With `A`, `C` and `K` given, the output is linear in `B`, `D`, the initial state and the level
//! of the outputs, so all of them follow from the measured output itself.

use nalgebra::{DMatrix, DVector};

use crate::least_squares::reduce;
use crate::subspace::SubspaceModel;
use recordings::IdentificationError;
use recordings::mean_and_deviation;

/// What the output is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// The one-step prediction, through `A - K C`. Without bias in closed loop too.
    Predicted,
    /// The simulation from the inputs alone, through `A`. For inputs that do not depend on the
    /// noise; there it is the better one where the noise is white on the outputs.
    Simulated,
}

/// Directions of the regression below this, relative, are left out.
const RANK: f64 = 1e-10;

/// The model with `B`, and `D` where `feedthrough` says so, fitted to inputs and outputs (one
/// vector a channel, those of the identification).
///
/// # Errors
/// The matrix that the output goes through, `A` or `A - K C`, is not stable.
pub fn refit(
    model: &SubspaceModel,
    inputs: &[&[f64]],
    outputs: &[&[f64]],
    feedthrough: bool,
    form: Form,
) -> Result<SubspaceModel, IdentificationError> {
    let (n, m, p) = (model.system.a.nrows(), inputs.len(), outputs.len());
    let samples = inputs
        .iter()
        .chain(outputs)
        .map(|channel| channel.len())
        .min()
        .unwrap_or(0);
    let c = &model.system.c;
    let gain = match form {
        Form::Predicted => model.gain.clone(),
        Form::Simulated => DMatrix::zeros(n, p),
    };
    let through = &model.system.a - &gain * c;
    let radius = through
        .complex_eigenvalues()
        .iter()
        .fold(0.0f64, |largest, pole| largest.max(pole.norm()));
    if radius >= 1.0 {
        return Err(IdentificationError::Unstable {
            what: format!("the subspace model's output depends on a pole of size {radius:.6}"),
            remedy: "record longer, or choose another order".into(),
        });
    }
    let weights: Vec<f64> = outputs
        .iter()
        .map(|values| mean_and_deviation(values).1.max(f64::MIN_POSITIVE))
        .collect();
    // What adds directly to the outputs: a level each, and D u.
    let direct = if feedthrough { 1 + m } else { 1 };
    let columns = n * m + n + direct * p;
    // Responses to each entry of B, of the initial state, of the levels and of D; the last column
    // is the response to the measured outputs.
    let mut states = DMatrix::zeros(n, columns + 1);
    for i in 0..n {
        states[(i, n * m + i)] = 1.0;
    }
    let mut next = states.clone();
    let mut responses = DMatrix::zeros(p, columns + 1);
    let reduced = reduce(samples * p, columns, 1, |row_index, row| {
        let (k, output) = (row_index / p, row_index % p);
        if output == 0 {
            responses.gemm(1.0, c, &states, 0.0);
            next.gemm(1.0, &through, &states, 0.0);
            for j in 0..m {
                let u = inputs[j][k] - model.means.0[j];
                for i in 0..n {
                    next[(i, j * n + i)] += u;
                }
            }
            for j in 0..direct {
                let added = match j {
                    0 => 1.0,
                    _ => inputs[j - 1][k] - model.means.0[j - 1],
                };
                for o in 0..p {
                    let column = n * m + n + j * p + o;
                    responses[(o, column)] += added;
                    for i in 0..n {
                        next[(i, column)] -= gain[(i, o)] * added;
                    }
                }
            }
            for o in 0..p {
                let y = outputs[o][k] - model.means.1[o];
                for i in 0..n {
                    next[(i, columns)] += gain[(i, o)] * y;
                }
            }
            std::mem::swap(&mut states, &mut next);
        }
        for (column, value) in row[..columns].iter_mut().enumerate() {
            *value = responses[(output, column)] / weights[output];
        }
        let measured = outputs[output][k] - model.means.1[output];
        row[columns] = (measured - responses[(output, columns)]) / weights[output];
    });
    let (solution, _) = reduced.solve(RANK)?;
    let solution = DVector::from_column_slice(solution.as_slice());
    let mut refitted = model.clone();
    refitted.system.b = DMatrix::from_fn(n, m, |i, j| solution[j * n + i]);
    for (o, mean) in refitted.means.1.iter_mut().enumerate() {
        *mean += solution[n * m + n + o];
    }
    if feedthrough {
        refitted.system.d = DMatrix::from_fn(p, m, |o, j| solution[n * m + n + (1 + j) * p + o]);
    }
    Ok(refitted)
}

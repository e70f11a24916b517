//! Whether what a model leaves is noise: noise cannot be predicted from the model's own signals.
//!
//! On the fitted part the errors of every output are regressed (with a little ridge) on the model's
//! inputs and outputs now and at earlier samples, on their squares, cubes and sizes, and on the signs
//! and squares of their rates: what a wrong model leaves of linear dynamics, friction, stiffening and
//! the like. On the part left out it is seen what the regression predicts. Coloured noise passes,
//! because it is independent of the signals.

use nalgebra::{DMatrix, DVector};

use super::measured::Bordered;
use diagnosis::{Point, SimulatedModel};
use recordings::mean_and_deviation;

/// Samples back at which signals are looked at.
const BACK: [usize; 7] = [0, 1, 2, 4, 8, 16, 32];
/// Rows of a regression at most.
const ROWS: usize = 6000;
/// Ridge, as a share of the mean square of the regressors.
const RIDGE: f64 = 1e-6;

/// Share of the squared error on the held-out data, over all outputs, that is predicted at `point`;
/// 0 where nothing is or it cannot be simulated.
pub(super) fn predictable(measured: &Bordered<'_>, point: &Point) -> f64 {
    let model = measured.model;
    let trials = 0..measured.blocks();
    let simulated: Option<Vec<Vec<Vec<f64>>>> = trials
        .map(|t| measured.simulate(point, t, model.trials[t].samples()))
        .collect();
    let Some(simulated) = simulated else {
        return 0.0;
    };
    // Regressors of every trial, all samples.
    let signals: Vec<Vec<Vec<f64>>> = model
        .trials
        .iter()
        .zip(&simulated)
        .map(|(trial, outputs)| {
            let inputs = trial.inputs.iter();
            let at_samples = |u: &Vec<f64>| -> Vec<f64> {
                u.iter()
                    .copied()
                    .step_by(trial.stride)
                    .take(trial.samples())
                    .collect()
            };
            inputs
                .map(at_samples)
                .chain(outputs.iter().cloned())
                .collect()
        })
        .collect();
    let scales: Vec<f64> = (0..signals.first().map_or(0, Vec::len))
        .map(|i| {
            let all: Vec<f64> = signals
                .iter()
                .flat_map(|own| own[i].iter().copied())
                .collect();
            mean_and_deviation(&all).1
        })
        .collect();
    let moving: Vec<usize> = (0..scales.len()).filter(|&i| scales[i] > 0.0).collect();
    let row = |t: usize, k: usize| -> Vec<f64> {
        let mut row = vec![1.0];
        for &i in &moving {
            let at = |back: usize| signals[t][i][k.saturating_sub(back)] / scales[i];
            row.extend(BACK.map(at));
            let (now, rate) = (at(0), at(0) - at(1));
            row.extend([now * now, now * now * now, now.abs()]);
            row.extend([sign(rate), rate * rate.abs(), now * now * rate]);
        }
        row
    };
    let (mut left, mut gone) = (0.0, 0.0);
    for j in 0..model.outputs.len() {
        if measured.scale(j) <= 0.0 {
            continue;
        }
        let mut parts: [Vec<(usize, usize, f64)>; 2] = [Vec::new(), Vec::new()];
        for t in 0..measured.blocks() {
            let errors = measured.errors_over_time(t, j, &simulated[t][j]);
            for (k, out) in measured.measured_samples(t) {
                if errors[k].is_finite() {
                    parts[usize::from(out)].push((t, k, errors[k]));
                }
            }
        }
        let [fitted, tested] = parts.map(|part| {
            let every = part.len().div_ceil(ROWS).max(1);
            part.into_iter().step_by(every).collect::<Vec<_>>()
        });
        let Some(predicted) = regressed(&fitted, &tested, &row) else {
            continue;
        };
        for ((_, _, error), own) in tested.iter().zip(&predicted) {
            left += error * error;
            gone += error * error - (error - own).powi(2);
        }
    }
    if left > 0.0 {
        (gone / left).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

/// What a regression on the `fitted` samples predicts on the `tested` ones.
fn regressed(
    fitted: &[(usize, usize, f64)],
    tested: &[(usize, usize, f64)],
    row: &dyn Fn(usize, usize) -> Vec<f64>,
) -> Option<Vec<f64>> {
    let (t, k, _) = fitted.first()?;
    let count = row(*t, *k).len();
    if fitted.len() < 4 * count {
        return None;
    }
    let mut hessian = DMatrix::zeros(count, count);
    let mut right = DVector::zeros(count);
    for (t, k, error) in fitted {
        let row = DVector::from_vec(row(*t, *k));
        right.axpy(*error, &row, 1.0);
        hessian.ger(1.0, &row, &row, 1.0);
    }
    let ridge = RIDGE * hessian.trace() / count as f64;
    for i in 0..count {
        hessian[(i, i)] += ridge;
    }
    let weights = hessian.cholesky()?.solve(&right);
    let predict = |(t, k, _): &(usize, usize, f64)| DVector::from_vec(row(*t, *k)).dot(&weights);
    Some(tested.iter().map(predict).collect())
}

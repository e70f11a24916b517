//! Subspace identification (Eq 2-6 to 2-10) in the predictor form, PBSID (Chiuso, Automatica 43,
//! 2007; Chiuso and Picci, 2005).
//!
//! The classical projections (MOESP, N4SID) put future inputs into the regression; under feedback
//! these depend on past noise, and the estimate is biased. Here a high-order predictor
//! (vector ARX) is fitted first, whose regressors are all past data: its errors are independent
//! of them with or without feedback. Its coefficients are the Markov parameters of the Kalman
//! predictor, from which the product of the extended observability matrix and the state sequence
//! is made; an SVD gives order and states, and two regressions give `A, B, C, D, K`.

use nalgebra::{DMatrix, DVector};
use plant::linear::DiscreteStateSpace;

use crate::least_squares::{Triangular, reduce};
use recordings::IdentificationError;
use recordings::mean_and_deviation;

/// What to fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Samples of the past in the predictor.
    pub past: usize,
    /// Rows of the extended observability matrix, at most `past`.
    pub future: usize,
    /// Number of states; by the singular values if not given.
    pub order: Option<usize>,
    /// Largest order that the rule may choose.
    pub largest_order: usize,
    /// Whether the inputs of a sample act on its outputs. Must be false where the outputs of a
    /// sample act on its inputs.
    pub feedthrough: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            past: 12,
            future: 10,
            order: None,
            largest_order: 10,
            feedthrough: false,
        }
    }
}

/// What came out.
#[derive(Debug, Clone)]
pub struct SubspaceModel {
    /// The sampled system, in the units of the data.
    pub system: DiscreteStateSpace,
    /// Kalman gain, states x outputs.
    pub gain: DMatrix<f64>,
    /// Singular values of the projected data, largest first.
    pub singular_values: DVector<f64>,
    /// Means of the inputs and of the outputs, which the model is about.
    pub means: (Vec<f64>, Vec<f64>),
    /// Predictions of the high-order predictor, one vector an output, in the units of the data;
    /// the first `past` samples are the measurements.
    pub predictions: Vec<Vec<f64>>,
}

/// Directions of the regression below this, relative, are left out.
const RANK: f64 = 1e-11;

/// Identifies a system from inputs and outputs (one vector a channel).
///
/// The order is the user's, or where the logarithm of the singular values falls most between one
/// and the next.
///
/// # Errors
/// Too few samples for the past window; an input that does not move.
pub fn identify(
    inputs: &[&[f64]],
    outputs: &[&[f64]],
    period: f64,
    options: Options,
) -> Result<SubspaceModel, IdentificationError> {
    let (m, p) = (inputs.len(), outputs.len());
    let samples = outputs.first().map_or(0, |channel| channel.len());
    let past = options.past.max(2);
    let future = options.future.clamp(2, past);
    let width = past * (m + p);
    let regressors = width + if options.feedthrough { m } else { 0 };
    if samples < past + 4 * regressors {
        return Err(IdentificationError::TooShort {
            recording: "subspace identification".into(),
            samples,
            parameters: regressors,
            needed: past + 4 * regressors,
            seconds: (past + 4 * regressors) as f64 * period,
        });
    }
    let scaled = Scaled::new(inputs, outputs)?;
    let channels = &scaled.channels;
    let fill_past = |k: usize, row: &mut [f64]| {
        // Sample k - 1 first; inputs before outputs.
        for back in 1..=past {
            for (channel, values) in channels.iter().enumerate() {
                row[(back - 1) * (m + p) + channel] = values[k - back];
            }
        }
    };
    let rows = samples - past;
    let through = if options.feedthrough { m } else { 0 };
    let products = lagged_products(channels, past, m, through);
    let direct = Triangular::from_products(products, regressors)
        .and_then(|own| own.solve_directly().map(|solution| (own, solution)));
    let (triangular, coefficients) = match direct {
        Some(both) => both,
        None => {
            let triangular = reduce(rows, regressors, p, |k, row| {
                fill_past(k + past, row);
                for i in 0..through {
                    row[width + i] = channels[i][k + past];
                }
                for i in 0..p {
                    row[regressors + i] = channels[m + i][k + past];
                }
            });
            let (coefficients, _) = triangular.solve(RANK)?;
            (triangular, coefficients)
        }
    };

    // Rows of the observability matrix times the reachability matrix of the predictor: row block
    // i sees the past through C A~^(i) ..., which are the predictor's coefficients moved by i.
    let mut product = DMatrix::zeros(future * p, width);
    for i in 0..future {
        for back in i..past {
            for channel in 0..(m + p) {
                for output in 0..p {
                    product[(i * p + output, (back - i) * (m + p) + channel)] =
                        coefficients[(back * (m + p) + channel, output)];
                }
            }
        }
    }
    let factor = triangular.regressor_factor();
    let projected = &product * factor.view((0, 0), (width, width)).transpose();
    let svd = projected.svd(true, false);
    let u = svd.u.ok_or_else(|| IdentificationError::NotConverged {
        method: "the singular value decomposition",
        reason: "the projected data contain numbers that are not finite".into(),
    })?;
    let singular_values = svd.singular_values;
    let order = match options.order {
        Some(order) => order.clamp(1, singular_values.len()),
        None => largest_drop(&singular_values, options.largest_order),
    };
    let mut to_state = u.columns(0, order).tr_mul(&product);
    for i in 0..order {
        let root = singular_values[i].max(f64::MIN_POSITIVE).sqrt();
        to_state.row_mut(i).scale_mut(1.0 / root);
    }

    let mut row = vec![0.0; width];
    let mut states = DMatrix::zeros(order, rows);
    let mut predictions = vec![Vec::with_capacity(samples); p];
    for (i, prediction) in predictions.iter_mut().enumerate() {
        prediction.extend_from_slice(&channels[m + i][..past]);
    }
    let mut errors = DMatrix::zeros(p, rows);
    for k in 0..rows {
        fill_past(k + past, &mut row);
        let window = DVector::from_column_slice(&row);
        let mut state = states.column_mut(k);
        state.gemv(1.0, &to_state, &window, 0.0);
        for i in 0..p {
            let mut value = coefficients.view((0, i), (width, 1)).column(0).dot(&window);
            for j in 0..regressors - width {
                value += coefficients[(width + j, i)] * channels[j][k + past];
            }
            predictions[i].push(value);
        }
    }

    // y = C x + D u, then x+ = A x + B u + K e.
    let output_rows = reduce(rows, order + through, p, |k, row| {
        row[..order].copy_from_slice(states.column(k).as_slice());
        for j in 0..through {
            row[order + j] = channels[j][k + past];
        }
        for i in 0..p {
            row[order + through + i] = channels[m + i][k + past];
        }
    });
    let (cd, _) = output_rows.solve(RANK)?;
    for k in 0..rows {
        for i in 0..p {
            let mut value = cd.view((0, i), (order, 1)).column(0).dot(&states.column(k));
            for j in 0..through {
                value += cd[(order + j, i)] * channels[j][k + past];
            }
            errors[(i, k)] = channels[m + i][k + past] - value;
        }
    }
    let state_rows = reduce(rows - 1, order + m + p, order, |k, row| {
        row[..order].copy_from_slice(states.column(k).as_slice());
        for j in 0..m {
            row[order + j] = channels[j][k + past];
        }
        row[order + m..order + m + p].copy_from_slice(errors.column(k).as_slice());
        row[order + m + p..].copy_from_slice(states.column(k + 1).as_slice());
    });
    let (abk, _) = state_rows.solve(RANK)?;
    let abk = abk.transpose();
    Ok(scaled.restore(
        &abk,
        &cd.transpose(),
        order,
        period,
        singular_values,
        predictions,
    ))
}

/// Products of the columns of the regression with each other, summed over the samples from `past`
/// on: the past of all channels (sample k - 1 first), `through` inputs of the sample, its outputs.
///
/// A column is the one before, a sample later: each product follows from the one up and left by
/// its two ends, so only the products with the first block are summed over all samples.
fn lagged_products(
    channels: &[Vec<f64>],
    past: usize,
    inputs: usize,
    through: usize,
) -> DMatrix<f64> {
    let count = channels.len();
    let samples = channels[0].len();
    let at = |lag: usize, channel: usize| -> Option<usize> {
        match (lag, channel < inputs) {
            (0, true) => (channel < through).then_some(past * count + channel),
            (0, false) => Some(past * count + through + channel - inputs),
            _ => Some((lag - 1) * count + channel),
        }
    };
    let size = past * count + through + count - inputs;
    let mut products = DMatrix::zeros(size, size);
    for (a, left) in channels.iter().enumerate() {
        for (b, right) in channels.iter().enumerate() {
            for apart in 0..=past {
                let ahead = &left[past..samples];
                let behind = &right[past - apart..samples - apart];
                let mut sum = dot(ahead, behind);
                for i in 0..=past - apart {
                    let j = i + apart;
                    if i > 0 {
                        // The window of k - i begins and ends a sample earlier.
                        sum += left[past - i] * right[past - j]
                            - left[samples - i] * right[samples - j];
                    }
                    if let (Some(row), Some(column)) = (at(i, a), at(j, b)) {
                        products[(row, column)] = sum;
                        products[(column, row)] = sum;
                    }
                }
            }
        }
    }
    products
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = a
        .remainder()
        .iter()
        .zip(b.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a.zip(b) {
        for i in 0..LANES {
            sums[i] += x[i] * y[i];
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// The order after which the singular values fall most, by ratio.
pub fn largest_drop(singular_values: &DVector<f64>, largest_order: usize) -> usize {
    let floor = singular_values.max() * 1e-14;
    (1..singular_values.len().min(largest_order + 1))
        .max_by(|&a, &b| {
            let drop = |n: usize| singular_values[n - 1].max(floor) / singular_values[n].max(floor);
            // Equal drops: the lower order.
            drop(a).total_cmp(&drop(b)).then(b.cmp(&a))
        })
        .unwrap_or(1)
}

/// Inputs, then outputs, about their means and over their deviations.
struct Scaled {
    inputs: usize,
    channels: Vec<Vec<f64>>,
    means: Vec<f64>,
    sizes: Vec<f64>,
}

impl Scaled {
    fn new(inputs: &[&[f64]], outputs: &[&[f64]]) -> Result<Self, IdentificationError> {
        let mut scaled = Self {
            inputs: inputs.len(),
            channels: Vec::new(),
            means: Vec::new(),
            sizes: Vec::new(),
        };
        for (index, values) in inputs.iter().chain(outputs).enumerate() {
            let (mean, size) = mean_and_deviation(values);
            if size <= 1e-12 * mean.abs() || size == 0.0 {
                let (kind, number) = if index < inputs.len() {
                    ("input", index + 1)
                } else {
                    ("output", index + 1 - inputs.len())
                };
                return Err(IdentificationError::NoExcitation {
                    recording: "subspace identification".into(),
                    what: format!("{kind} {number} is constant"),
                });
            }
            scaled
                .channels
                .push(values.iter().map(|v| (v - mean) / size).collect());
            scaled.means.push(mean);
            scaled.sizes.push(size);
        }
        Ok(scaled)
    }

    fn restore(
        &self,
        abk: &DMatrix<f64>,
        cd: &DMatrix<f64>,
        order: usize,
        period: f64,
        singular_values: DVector<f64>,
        mut predictions: Vec<Vec<f64>>,
    ) -> SubspaceModel {
        let m = self.inputs;
        let p = self.channels.len() - m;
        let (input, output) = self.sizes.split_at(m);
        for (i, prediction) in predictions.iter_mut().enumerate() {
            for value in prediction {
                *value = *value * output[i] + self.means[m + i];
            }
        }
        let system = DiscreteStateSpace {
            a: abk.view((0, 0), (order, order)).into_owned(),
            b: DMatrix::from_fn(order, m, |i, j| abk[(i, order + j)] / input[j]),
            c: DMatrix::from_fn(p, order, |i, j| cd[(i, j)] * output[i]),
            d: DMatrix::from_fn(p, m, |i, j| {
                if cd.ncols() > order {
                    cd[(i, order + j)] * output[i] / input[j]
                } else {
                    0.0
                }
            }),
            period,
        };
        SubspaceModel {
            system,
            gain: DMatrix::from_fn(order, p, |i, j| abk[(i, order + m + j)] / output[j]),
            singular_values,
            means: (self.means[..m].to_vec(), self.means[m..].to_vec()),
            predictions,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By their definition: columns of the past of all channels, inputs of the sample, its outputs.
    fn summed(channels: &[Vec<f64>], past: usize, inputs: usize, through: usize) -> DMatrix<f64> {
        let samples = channels[0].len();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let column = |channel: &[f64], lag: usize| channel[past - lag..samples - lag].to_vec();
        for lag in 1..=past {
            columns.extend(channels.iter().map(|channel| column(channel, lag)));
        }
        columns.extend(channels[..through].iter().map(|channel| column(channel, 0)));
        columns.extend(channels[inputs..].iter().map(|channel| column(channel, 0)));
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            product(&columns[i], &columns[j])
        })
    }

    #[test]
    fn products_that_follow_from_each_other_are_those_of_their_columns() {
        let channel = |rate: f64, shift: f64| -> Vec<f64> {
            (0..40)
                .map(|k| (rate * f64::from(k) + shift).sin() + 0.5)
                .collect()
        };
        let channels = [channel(0.7, 0.1), channel(1.9, 0.4), channel(0.3, 2.0)];
        for (past, inputs, through) in [(1, 1, 0), (3, 2, 0), (3, 2, 2), (5, 1, 1)] {
            let found = lagged_products(&channels, past, inputs, through);
            let expected = summed(&channels, past, inputs, through);
            assert_eq!(found.shape(), expected.shape());
            assert!(
                (found - expected).amax() < 1e-11,
                "{past} {inputs} {through}"
            );
        }
    }
}

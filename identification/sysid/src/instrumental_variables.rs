//! Continuous-time transfer functions by state-variable filter and instrumental variables
//! (Eq 2-15 to 2-22).
//!
//! Least squares on noisy outputs is biased; instruments that share the signal and not the noise
//! remove the bias (Garnier, Mensler and Richard, 2003). In open loop the instruments are the
//! outputs of the model of the last iteration, and the filter is its denominator (the simplified
//! refined method, Young and Jakeman, 1980). In closed loop the caller gives instruments made
//! from the reference, or from predictions out of past data.

use nalgebra::{DMatrix, DVector};
use plant::linear::TransferFunction;

use crate::state_variable_filter::{Between, equal_lags, filter};
use recordings::IdentificationError;

/// A measured signal with what stands for it free of its noise.
#[derive(Debug, Clone, Copy)]
pub struct Signal<'a> {
    /// As measured.
    pub measured: &'a [f64],
    /// The instrument; the measurement itself makes least squares of it.
    pub instrument: &'a [f64],
    /// How it runs between samples.
    pub between: Between,
}

impl<'a> Signal<'a> {
    /// A signal that is its own instrument.
    pub fn exact(measured: &'a [f64], between: Between) -> Self {
        Self {
            measured,
            instrument: measured,
            between,
        }
    }
}

/// Transfer functions from several inputs to one output over one denominator.
#[derive(Debug, Clone, PartialEq)]
pub struct InstrumentalVariablesEstimate {
    /// Monic, descending powers.
    pub denominator: Vec<f64>,
    /// One polynomial an input, descending powers.
    pub numerators: Vec<Vec<f64>>,
}

/// The signals of one experiment.
#[derive(Debug, Clone)]
pub struct Signals<'a> {
    /// The output.
    pub output: Signal<'a>,
    /// The inputs.
    pub inputs: Vec<Signal<'a>>,
}

/// One instrumental-variable regression over all experiments, with the given filter (monic, of
/// the denominator's order).
///
/// `powers[i]` lists the powers of `s` in the numerator of input `i`. Offsets of all channels are
/// taken up by one constant an experiment. `known` gives coefficients of the denominator that are
/// not fitted: the power of `s` and its value.
///
/// # Errors
/// Too few samples, or regressors that are not independent.
pub fn regress(
    experiments: &[Signals],
    powers: &[Vec<usize>],
    period: f64,
    filter_denominator: &[f64],
    known: &[(usize, f64)],
) -> Result<InstrumentalVariablesEstimate, IdentificationError> {
    let order = filter_denominator.len() - 1;
    let shared = order + powers.iter().map(Vec::len).sum::<usize>();
    let columns = shared + experiments.len();
    let samples: usize = experiments.iter().map(|e| e.output.measured.len()).sum();
    let settle =
        |e: &Signals| settling_samples(filter_denominator, period).min(e.output.measured.len() / 4);
    let rows: usize = experiments
        .iter()
        .map(|e| e.output.measured.len() - settle(e))
        .sum();
    if rows < 10 * columns {
        let needed = samples - rows + 10 * columns;
        return Err(IdentificationError::TooShort {
            recording: "instrumental variables".into(),
            samples,
            parameters: columns,
            needed,
            seconds: needed as f64 * period,
        });
    }
    let mut regressors = DMatrix::zeros(rows, columns);
    let mut instruments = DMatrix::zeros(rows, columns);
    let mut target = DVector::zeros(rows);
    let mut first = 0;
    for (index, experiment) in experiments.iter().enumerate() {
        let settle = settle(experiment);
        let count = experiment.output.measured.len() - settle;
        let mut put = |column: usize, measured: &[f64], clean: &[f64], sign: f64| {
            for row in 0..count {
                regressors[(first + row, column)] = sign * measured[settle + row];
                instruments[(first + row, column)] = sign * clean[settle + row];
            }
        };
        let filtered =
            |values: &[f64], between| filter(values, period, filter_denominator, between);
        let output = experiment.output;
        let measured = filtered(output.measured, output.between);
        let clean = filtered(output.instrument, output.between);
        for i in 0..order {
            put(i, &measured[order - 1 - i], &clean[order - 1 - i], -1.0);
        }
        let mut column = order;
        for (input, powers) in experiment.inputs.iter().zip(powers) {
            let measured = filtered(input.measured, input.between);
            let clean = filtered(input.instrument, input.between);
            for &power in powers {
                put(column, &measured[power], &clean[power], 1.0);
                column += 1;
            }
        }
        for row in first..first + count {
            regressors[(row, shared + index)] = 1.0;
            instruments[(row, shared + index)] = 1.0;
            target[row] = measured[order][settle + row - first];
            for &(power, value) in known {
                target[row] += value * measured[power][settle + row - first];
            }
        }
        first += count;
    }
    for &(power, _) in known {
        // A column that takes up the first row and nothing else.
        for matrix in [&mut regressors, &mut instruments] {
            let mut column = matrix.column_mut(order - 1 - power);
            column.fill(0.0);
            column[0] = 1.0;
        }
    }

    let theta = solve(&regressors, &instruments, &target)?;
    let mut denominator = vec![1.0];
    denominator.extend(theta.rows(0, order).iter());
    for &(power, value) in known {
        denominator[order - power] = value;
    }
    let mut numerators = Vec::new();
    let mut at = order;
    for powers in powers {
        let highest = powers.iter().copied().max().unwrap_or(0);
        let mut numerator = vec![0.0; highest + 1];
        for &power in powers {
            numerator[highest - power] = theta[at];
            at += 1;
        }
        numerators.push(numerator);
    }
    Ok(InstrumentalVariablesEstimate {
        denominator,
        numerators,
    })
}

/// `(Z' Phi)^-1 Z' y` (Eq 2-22) with columns scaled.
fn solve(
    rows: &DMatrix<f64>,
    instruments: &DMatrix<f64>,
    target: &DVector<f64>,
) -> Result<DVector<f64>, IdentificationError> {
    let n = rows.ncols();
    let lengths = |m: &DMatrix<f64>| -> Vec<f64> {
        (0..n)
            .map(|j| m.column(j).norm().max(f64::MIN_POSITIVE))
            .collect()
    };
    let (row_scale, instrument_scale) = (lengths(rows), lengths(instruments));
    let mut cross = instruments.transpose() * rows;
    let mut right = instruments.tr_mul(target);
    for i in 0..n {
        right[i] /= instrument_scale[i];
        for j in 0..n {
            cross[(i, j)] /= instrument_scale[i] * row_scale[j];
        }
    }
    let svd = cross.svd(true, true);
    let (largest, smallest) = (svd.singular_values.max(), svd.singular_values.min());
    if smallest.partial_cmp(&(1e-13 * largest)) != Some(std::cmp::Ordering::Greater) {
        return Err(IdentificationError::RankDeficient {
            what: "the filtered input and output are not independent".into(),
            remedy:
                "excite more frequencies than the model has parameters, or choose a lower order"
                    .into(),
        });
    }
    let mut theta = svd
        .solve(&right, 0.0)
        .map_err(|reason| IdentificationError::NotConverged {
            method: "the instrumental-variable regression",
            reason: reason.to_string(),
        })?;
    for j in 0..n {
        theta[j] /= row_scale[j];
    }
    Ok(theta)
}

/// The simplified refined instrumental-variable method for one input in open loop: filter and
/// instruments come from the model of the iteration before.
///
/// # Errors
/// See [`regress`]; an unstable model, whose output is not an instrument.
pub fn refine_open_loop(
    input: &[f64],
    output: &[f64],
    period: f64,
    order: usize,
    numerator_order: usize,
    cutoff: f64,
    between: Between,
) -> Result<InstrumentalVariablesEstimate, IdentificationError> {
    let powers = [(0..=numerator_order).rev().collect::<Vec<_>>()];
    let mut denominator = equal_lags(cutoff, order);
    let mut instrument = output.to_vec();
    let mut estimate = None;
    for _ in 0..12 {
        let signal = Signal {
            measured: output,
            instrument: &instrument,
            between: Between::Straight,
        };
        let signals = Signals {
            output: signal,
            inputs: vec![Signal::exact(input, between)],
        };
        let next = regress(&[signals], &powers, period, &denominator, &[])?;
        denominator = stabilised(&next.denominator);
        instrument = simulate(&next.numerators[0], &denominator, input, period, between);
        let done = estimate
            .as_ref()
            .is_some_and(|before: &InstrumentalVariablesEstimate| {
                let pairs = before.denominator.iter().zip(&next.denominator);
                pairs
                    .into_iter()
                    .all(|(a, b)| (a - b).abs() <= 1e-6 * b.abs())
            });
        estimate = Some(next);
        if done {
            break;
        }
    }
    let estimate = estimate.ok_or_else(|| IdentificationError::NotConverged {
        method: "the refined instrumental-variable method",
        reason: "there was no iteration".into(),
    })?;
    let poles = poles(&estimate.denominator);
    if let Some(pole) = poles.iter().find(|pole| pole.re >= 0.0) {
        return Err(IdentificationError::Unstable {
            what: format!(
                "the transfer function has a pole at {:+.4} {:+.4}i 1/s",
                pole.re, pole.im
            ),
            remedy: "lower the order, or record more periods of the slowest motion".into(),
        });
    }
    Ok(estimate)
}

/// Output of `numerator/denominator` (descending powers, strictly proper or proper) from rest at
/// the first sample.
pub fn simulate(
    numerator: &[f64],
    denominator: &[f64],
    input: &[f64],
    period: f64,
    between: Between,
) -> Vec<f64> {
    let first = input.first().copied().unwrap_or(0.0);
    let moved: Vec<f64> = input.iter().map(|value| value - first).collect();
    // The filter's gain is its constant term.
    let constant = denominator[denominator.len() - 1];
    let states = filter(&moved, period, denominator, between);
    let highest = numerator.len() - 1;
    (0..input.len())
        .map(|k| {
            let terms = numerator.iter().enumerate();
            terms
                .map(|(i, c)| c * states[highest - i][k] / constant)
                .sum()
        })
        .collect()
}

/// Roots of a monic polynomial.
pub fn poles(denominator: &[f64]) -> Vec<nalgebra::Complex<f64>> {
    TransferFunction {
        numerator: vec![1.0],
        denominator: denominator.to_vec(),
    }
    .poles()
}

/// The monic polynomial with its roots mirrored into the left half plane.
pub fn stabilised(denominator: &[f64]) -> Vec<f64> {
    let mut polynomial = vec![nalgebra::Complex::new(1.0, 0.0)];
    for root in poles(denominator) {
        let root = nalgebra::Complex::new(-root.re.abs().max(1e-6), root.im);
        let mut next = polynomial.clone();
        next.push(nalgebra::Complex::new(0.0, 0.0));
        for (i, &c) in polynomial.iter().enumerate() {
            next[i + 1] -= root * c;
        }
        polynomial = next;
    }
    polynomial.iter().map(|c| c.re).collect()
}

fn settling_samples(denominator: &[f64], period: f64) -> usize {
    let slowest = poles(denominator)
        .iter()
        .map(|pole| pole.re.abs())
        .fold(f64::MAX, f64::min);
    (6.0 / (slowest * period)).min(1e9) as usize
}

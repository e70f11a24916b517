//! One input, one output: poles, zeros, delay and offset by instrumental variables and then
//! Gauss-Newton on the simulated error (Fig 2-8).

use nalgebra::{SMatrix, SVector};

use crate::continuous::delay_by_correlation;
use crate::gauss_newton::{self, FINE, Search};
use crate::instrumental_variables::{poles, refine_open_loop, simulate};
use crate::prediction::{Parameter, PredictionModel, Predictor};
use crate::state_variable_filter::Between;
use recordings::IdentificationError;
use recordings::mean_and_deviation;

/// What to fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Structure {
    /// Number of poles.
    pub order: usize,
    /// Number of zeros.
    pub zeros: usize,
    /// Longest delay looked for, s; none for a model without delay.
    pub longest_delay: Option<f64>,
    /// Corner of the state-variable filter, rad/s: near the fastest pole.
    pub corner: f64,
    /// How the input runs between samples.
    pub between: Between,
}

/// The transfer function found.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunctionEstimate {
    /// Descending powers.
    pub numerator: Vec<f64>,
    /// Monic, descending powers.
    pub denominator: Vec<f64>,
    /// Delay, s.
    pub delay: f64,
    /// What adds to the output.
    pub offset: f64,
    /// Standard errors: numerator, denominator without its 1, delay. Right where the simulated
    /// error is white.
    pub standard_error: Vec<f64>,
    /// `||y - m|| / ||y - mean(y)||`.
    pub normalised_error: f64,
    /// The simulated output.
    pub simulated: Vec<f64>,
}

impl TransferFunctionEstimate {
    /// The output from an input alone, from rest, for data that were not fitted.
    pub fn simulate(&self, input: &[f64], period: f64, between: Between) -> Vec<f64> {
        let late = delayed(input, self.delay / period);
        let mut model = simulate(&self.numerator, &self.denominator, &late, period, between);
        for value in &mut model {
            *value += self.offset;
        }
        model
    }
}

struct OutputError<'a> {
    input: &'a [f64],
    output: &'a [f64],
    period: f64,
    structure: Structure,
    size: f64,
}

impl OutputError<'_> {
    fn simulate(&self, p: &[f64]) -> Vec<f64> {
        let Structure { order, zeros, .. } = self.structure;
        let (numerator, rest) = p.split_at(zeros + 1);
        let mut denominator = vec![1.0];
        denominator.extend(&rest[..order]);
        let late = delayed(self.input, rest[order] / self.period);
        let mut model = simulate(
            numerator,
            &denominator,
            &late,
            self.period,
            self.structure.between,
        );
        let (offset, start) = (rest[order + 1], rest[order + 2]);
        // The slowest pole carries what was going on before the first sample.
        let slowest = poles(&denominator)
            .iter()
            .map(|pole| pole.re)
            .fold(f64::NEG_INFINITY, f64::max)
            .min(0.0);
        for (k, value) in model.iter_mut().enumerate() {
            *value += offset + start * (slowest * k as f64 * self.period).exp();
        }
        model
    }
}

fn delayed(input: &[f64], samples: f64) -> Vec<f64> {
    let whole = samples.max(0.0).floor() as usize;
    let part = samples.max(0.0) - whole as f64;
    (0..input.len())
        .map(|k| {
            let back = |n: usize| input[k.saturating_sub(n)];
            (1.0 - part) * back(whole) + part * back(whole + 1)
        })
        .collect()
}

/// The errors of a whole simulation, and the logarithm of their size.
#[derive(Clone)]
struct Simulated {
    errors: Vec<f64>,
    log_noise: f64,
}

impl Predictor<1> for Simulated {
    fn covariance(&self) -> SMatrix<f64, 1, 1> {
        SMatrix::<f64, 1, 1>::new((2.0 * self.log_noise).exp())
    }
}

impl PredictionModel<1> for OutputError<'_> {
    type Predictor = Simulated;

    fn experiments(&self) -> usize {
        1
    }

    fn samples(&self, _: usize) -> usize {
        self.output.len()
    }

    fn predictor(&self, _: usize, p: &[f64]) -> Option<Simulated> {
        let model = self.simulate(p);
        let pairs = self.output.iter().zip(&model);
        let errors: Vec<f64> = pairs.map(|(y, m)| (y - m) / self.size).collect();
        let finite = errors.iter().all(|e| e.is_finite());
        finite.then_some(Simulated {
            errors,
            log_noise: p[p.len() - 1],
        })
    }

    fn predict(
        &self,
        _: usize,
        simulated: &mut Simulated,
        first: usize,
        errors: &mut [SVector<f64, 1>],
    ) {
        for (error, own) in errors.iter_mut().zip(&simulated.errors[first..]) {
            error[0] = *own;
        }
    }
}

/// Identifies a stable transfer function.
///
/// # Errors
/// Too little data, an input that does not move, an unstable result.
pub fn identify(
    input: &[f64],
    output: &[f64],
    period: f64,
    structure: Structure,
) -> Result<TransferFunctionEstimate, IdentificationError> {
    let (_, moves) = mean_and_deviation(input);
    let (mean, size) = mean_and_deviation(output);
    if moves == 0.0 || size == 0.0 {
        return Err(IdentificationError::NoExcitation {
            recording: "transfer function".into(),
            what: if moves == 0.0 {
                "the input is constant".into()
            } else {
                "the output is constant".into()
            },
        });
    }
    let Structure { order, zeros, .. } = structure;
    // The lag of the poles is in the correlation too: half of it is a start.
    let delay = structure.longest_delay.map_or(0.0, |longest| {
        0.5 * delay_by_correlation(input, output, period, longest)
    });
    let late = delayed(input, delay / period);
    let start = refine_open_loop(
        &late,
        output,
        period,
        order,
        zeros,
        structure.corner,
        structure.between,
    )?;
    let model = OutputError {
        input,
        output,
        period,
        structure,
        size,
    };
    let mut parameters = Vec::new();
    for (i, &b) in start.numerators[0].iter().enumerate() {
        let mut parameter = Parameter::new(&format!("b{}", zeros - i), b, 0.1 * b.abs());
        parameter.largest_step = 0.5 * b.abs();
        parameters.push(parameter);
    }
    for (i, &a) in start.denominator[1..].iter().enumerate() {
        let mut parameter = Parameter::new(&format!("a{}", order - 1 - i), a, 0.1 * a.abs());
        parameter.largest_step = 0.5 * a.abs();
        parameters.push(parameter);
    }
    let mut own_delay = Parameter::new("delay", delay, period);
    own_delay.free = structure.longest_delay.is_some();
    own_delay.bounds = (0.0, structure.longest_delay.unwrap_or(0.0));
    own_delay.largest_step = period;
    parameters.push(own_delay);
    parameters.push(Parameter::new("offset", mean, size));
    parameters.push(Parameter::new("start", 0.0, size));
    let mut noise = Parameter::new("logarithm of noise", 0.1f64.ln(), 1.0);
    noise.bounds = (1e-9f64.ln(), 10f64.ln());
    noise.largest_step = 1.5;
    parameters.push(noise);
    let found = gauss_newton::fit(&model, &parameters, Search::within(FINE))?;
    let p = &found.parameters;
    let mut denominator = vec![1.0];
    denominator.extend(&p[zeros + 1..zeros + 1 + order]);
    if let Some(pole) = poles(&denominator).iter().find(|pole| pole.re >= 0.0) {
        return Err(IdentificationError::Unstable {
            what: format!(
                "the transfer function has a pole at {:+.4} {:+.4}i 1/s",
                pole.re, pole.im
            ),
            remedy: "lower the order, or record more periods of the slowest motion".into(),
        });
    }
    let simulated = model.simulate(p);
    let square: f64 = output
        .iter()
        .zip(&simulated)
        .map(|(y, m)| (y - m).powi(2))
        .sum();
    Ok(TransferFunctionEstimate {
        numerator: p[..=zeros].to_vec(),
        denominator,
        delay: p[zeros + 1 + order],
        offset: p[zeros + order + 2],
        standard_error: (0..zeros + order + 2)
            .map(|i| found.standard_error(i))
            .collect(),
        normalised_error: (square / output.len() as f64).sqrt() / size,
        simulated,
    })
}

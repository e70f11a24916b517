//! Identification: a subspace start, then output errors made least.

use nalgebra::{Complex, DMatrix};
use sysid::subspace;

use crate::fit::{Fitted, Shape, improve, with_covariance};
use crate::model::{KIND, Model, delayed, filtered};
use crate::{Error, Recording};

pub use crate::model::KIND as MODEL;

/// Orders that are tried.
const ORDERS: [usize; 7] = [1, 2, 3, 4, 5, 6, 8];
/// Samples that orders are compared on.
const COMPARED: usize = 6000;
/// Error on data that were not fitted within which a lower order is taken.
const ALIKE: f64 = 1.02;
/// Iterations while orders are compared, and of the last fit.
const FEW: usize = 12;
const MANY: usize = 40;

/// Identifies a rig from the first `fit_part` of a recording; the rest is predicted.
///
/// # Errors
/// Commands that do not move, or move alike; data that give no model.
pub fn identify(recording: &Recording, fit_part: f64) -> Result<Model, Error> {
    check(recording)?;
    let split = ((recording.len() as f64 * fit_part) as usize).clamp(1, recording.len() - 1);
    let (fitted, rest) = (
        recording.part(0..split),
        recording.part(split..recording.len()),
    );
    let short = fitted.part(0..fitted.len().min(COMPARED));
    let none = || {
        Error::at(
            recording.name.clone(),
            "no stable model was found; record longer or excite more frequencies",
        )
    };
    let mut best: Option<(f64, Fitted)> = None;
    let mut worse = 0;
    for order in ORDERS {
        let starts = starts(&short, order);
        let tried = starts
            .iter()
            .filter_map(|start| improve(&short, start, FEW));
        let Some(found) = tried.min_by(|a, b| product(&a.square).total_cmp(&product(&b.square)))
        else {
            continue;
        };
        let error = prediction_error(&rest, &found.shape).ok_or_else(none)?;
        let is_better = best
            .as_ref()
            .is_none_or(|(least, _)| error * ALIKE < *least);
        if is_better {
            best = Some((error, found));
            worse = 0;
        } else {
            worse += 1;
        }
        // Two higher orders that predict no better end the search.
        if worse >= 2 {
            break;
        }
    }
    let (_, found) = best.ok_or_else(none)?;
    let found = improve(&fitted, &found.shape, MANY).ok_or_else(none)?;
    let found = with_covariance(&fitted, found).ok_or_else(none)?;
    Ok(model(&found, recording, &rest))
}

fn check(recording: &Recording) -> Result<(), Error> {
    let refused = |what: String| Err(Error::at(recording.name.clone(), what));
    let (n, m) = (recording.len() as f64, recording.commands.len());
    let centred: Vec<Vec<f64>> = recording
        .commands
        .iter()
        .map(|own| {
            let mean = own.iter().sum::<f64>() / n;
            own.iter().map(|value| value - mean).collect()
        })
        .collect();
    let dot = |i: usize, j: usize| -> f64 {
        centred[i].iter().zip(&centred[j]).map(|(a, b)| a * b).sum()
    };
    if let Some(i) = (0..m).find(|&i| dot(i, i).is_nan() || dot(i, i) <= 0.0) {
        return refused(format!(
            "`command_{}` does not move; move every actuator in the recording",
            i + 1
        ));
    }
    let correlation = DMatrix::from_fn(m, m, |i, j| dot(i, j) / (dot(i, i) * dot(j, j)).sqrt());
    let least = correlation.symmetric_eigenvalues().min();
    if least < 1e-4 {
        return refused(
            "the commands move alike, so that their effects cannot be told apart; move the actuators by independent \
             signals, or one after the other"
                .into(),
        );
    }
    Ok(())
}

fn product(square: &[f64]) -> f64 {
    square.iter().map(|value| value.max(1e-60).ln()).sum()
}

/// Shapes from which the search begins: by a subspace method, and by poles spread over the band.
fn starts(recording: &Recording, order: usize) -> Vec<Shape> {
    let actuators = recording.commands.len();
    let mut starts = Vec::new();
    let of = |channels: &[Vec<f64>]| -> Vec<Vec<f64>> { channels.to_vec() };
    let (inputs, outputs) = (of(&recording.commands), of(&recording.strokes));
    let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
    let outputs: Vec<&[f64]> = outputs.iter().map(Vec::as_slice).collect();
    let options = subspace::Options {
        past: 24,
        future: 16,
        order: Some(order),
        largest_order: 10,
        feedthrough: false,
    };
    if let Ok(found) = subspace::identify(&inputs, &outputs, recording.period, options) {
        let poles = found.system.poles();
        let continuous = poles.iter().filter(|pole| pole.im >= 0.0).map(|pole| {
            let size = pole.norm().clamp(1e-3, 1.0 - 1e-6);
            let value = Complex::new(size.ln(), pole.im.atan2(pole.re)) / recording.period;
            match pole.im.abs() < 1e-9 {
                true => Complex::new(value.re, 0.0),
                false => value,
            }
        });
        let poles = continuous.collect();
        starts.push(Shape {
            poles,
            delays: vec![0.0; actuators],
        });
    }
    let (low, high) = (4.0f64, 0.4 / recording.period);
    let spread = |count: usize| -> Vec<Complex<f64>> {
        let place = |i: usize| low * (high / low).powf((i as f64 + 1.0) / (count as f64 + 1.0));
        (0..count).map(|i| Complex::new(-place(i), 0.0)).collect()
    };
    starts.push(Shape {
        poles: spread(order),
        delays: vec![1.0; actuators],
    });
    if order >= 3 {
        let mut poles = spread(order - 2);
        poles.push(Complex::new(-0.5 * high, 0.7 * high));
        starts.push(Shape {
            poles,
            delays: vec![0.5; actuators],
        });
    }
    starts
}

/// Geometric mean of the strokes' residuals if only the linear coefficients are fitted again.
fn prediction_error(rest: &Recording, shape: &Shape) -> Option<f64> {
    let fitted = improve(rest, shape, 0)?;
    Some((0.5 * product(&fitted.square) / rest.strokes.len() as f64).exp())
}

fn model(found: &Fitted, recording: &Recording, rest: &Recording) -> Model {
    let shape = &found.shape;
    let (actuators, order) = (recording.commands.len(), shape.order());
    let count = found.covariance.as_ref().map_or(0, DMatrix::nrows);
    let width = found.linear.nrows();
    let numbers = count.saturating_sub(actuators * width);
    // A number that was held at its bound has no standard error.
    let deviation = |i: usize| match &found.covariance {
        Some(own) if own[(i, i)] > 0.0 => own[(i, i)].sqrt(),
        _ => f64::NAN,
    };
    let residue = |i: usize, j: usize| -> Vec<[f64; 2]> {
        let mut at = j * order;
        let of = shape.poles.iter().map(|pole| {
            let re = found.linear[(at, i)];
            let im = if pole.im > 0.0 {
                found.linear[(at + 1, i)]
            } else {
                0.0
            };
            at += if pole.im > 0.0 { 2 } else { 1 };
            [re, im]
        });
        of.collect()
    };
    let residues: Vec<Vec<Vec<[f64; 2]>>> = (0..actuators)
        .map(|i| (0..actuators).map(|j| residue(i, j)).collect())
        .collect();
    let gain = |i: usize, j: usize| -> f64 {
        let of = shape.poles.iter().zip(&residues[i][j]);
        of.map(|(pole, [re, im])| (-Complex::new(*re, *im) / pole).re)
            .sum()
    };
    // The gain's change by each of its residues and by each pole, the covariance between.
    let gain_error = |i: usize, j: usize| -> f64 {
        let Some(covariance) = &found.covariance else {
            return f64::NAN;
        };
        let mut slope = nalgebra::DVector::zeros(count);
        let (mut number, mut at) = (0, numbers + i * width + j * order);
        for (pole, [re, im]) in shape.poles.iter().zip(&residues[i][j]) {
            let by = -Complex::new(1.0, 0.0) / pole;
            slope[at] = by.re;
            // The gain's change by the logarithm of the decay, which moves real and imaginary part alike.
            slope[number] = (Complex::new(*re, *im) / pole).re;
            (number, at) = (number + 1, at + 1);
            if pole.im > 0.0 {
                slope[at] = -by.im;
                // By the logarithm of the imaginary part over the decay.
                let turned = Complex::new(0.0, pole.im);
                slope[number] = (Complex::new(*re, *im) / (pole * pole) * turned).re;
                (number, at) = (number + 1, at + 1);
            }
        }
        (slope.transpose() * covariance * &slope)[(0, 0)]
            .max(0.0)
            .sqrt()
    };
    let mut number = 0;
    let pole_errors = shape.poles.iter().map(|pole| {
        let re = -pole.re * deviation(number);
        number += 1;
        if pole.im > 0.0 {
            let im = pole.im * (deviation(number - 1).powi(2) + deviation(number).powi(2)).sqrt();
            number += 1;
            return [re, im];
        }
        [re, 0.0]
    });
    let poles_standard_error: Vec<[f64; 2]> = pole_errors.collect();
    let delays =
        (0..actuators).map(|i| recording.period * deviation(numbers.saturating_sub(actuators) + i));
    let grid = |of: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
        (0..actuators)
            .map(|i| (0..actuators).map(|j| of(i, j)).collect())
            .collect()
    };
    let mut model = Model {
        kind: KIND.into(),
        period_s: recording.period,
        delay_s: shape
            .delays
            .iter()
            .map(|delay| delay * recording.period)
            .collect(),
        poles_rad_s: shape.poles.iter().map(|pole| [pole.re, pole.im]).collect(),
        static_gain: grid(&gain),
        static_gain_standard_error: grid(&gain_error),
        poles_standard_error,
        delay_standard_error_s: delays.collect(),
        residual_m: Vec::new(),
        fit_percent: Vec::new(),
        residues,
    };
    let simulated = model.strokes(&rest.commands, rest.period);
    for (measured, simulated) in rest.strokes.iter().zip(&simulated) {
        let left = without_free_motion(&model, measured, simulated);
        let n = measured.len() as f64;
        let mean = measured.iter().sum::<f64>() / n;
        let spread = measured.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        let error = left.iter().map(|e| e * e).sum::<f64>();
        model.residual_m.push((error / n).sqrt());
        model
            .fit_percent
            .push(100.0 * (1.0 - (error / spread.max(1e-300)).sqrt()));
    }
    model
}

impl Model {
    /// Strokes (m) of commands (m) held for `period` (s) each, from rest about their first samples.
    #[must_use]
    pub fn strokes(&self, commands: &[Vec<f64>], period: f64) -> Vec<Vec<f64>> {
        let length = commands.first().map_or(0, Vec::len);
        let mut strokes = vec![vec![0.0; length]; self.actuators()];
        let poles = self.poles();
        for (j, command) in commands.iter().enumerate() {
            let input = delayed(command, self.delay_s[j] / period);
            for (p, pole) in poles.iter().enumerate() {
                let states = filtered(&input, *pole, period);
                for (stroke, residues) in strokes.iter_mut().zip(&self.residues) {
                    let [re, im] = residues[j][p];
                    for (y, x) in stroke.iter_mut().zip(&states) {
                        *y += re * x.re - im * x.im;
                    }
                }
            }
        }
        strokes
    }
}

/// What is left of a stroke where motion from before the recording, which dies away with the model's poles, and an offset are
/// fitted.
pub(crate) fn without_free_motion(model: &Model, measured: &[f64], simulated: &[f64]) -> Vec<f64> {
    let left: Vec<f64> = measured.iter().zip(simulated).map(|(a, b)| a - b).collect();
    let mut columns = vec![vec![1.0; left.len()]];
    for pole in model.poles() {
        let by = (pole * model.period_s).exp();
        let mut state = Complex::new(1.0, 0.0);
        let mut parts = [
            Vec::with_capacity(left.len()),
            Vec::with_capacity(left.len()),
        ];
        for _ in 0..left.len() {
            parts[0].push(state.re);
            parts[1].push(state.im);
            state *= by;
        }
        let count = if pole.im > 0.0 { 2 } else { 1 };
        columns.extend(parts.into_iter().take(count));
    }
    crate::fit::left_over(&columns, &left)
}

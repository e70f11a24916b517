//! A closed loop's linear equation, fitted as it stands: where a simulation's fit may begin.
//!
//! Apart from the delay of `r` this equation is linear:
//! `x' + T x'' + Q x''' = K (s r - x) + f s r' + i K ∫(s r - x) + c - F sgn x'`. Every signal passes through the same lags, so that their derivatives are those lags' own (state-variable
//! filters; Young and Jakeman, International Journal of Control 31, 1980), and one delay after the other is tried.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::RigRecording;
use recordings::Channel;

/// Cut-off of the lags, Hz, and at most as a share of the sampling rate.
const CUT_OFF: f64 = 15.0;
const HIGHEST: f64 = 0.125;
/// Delays that are tried, s.
const DELAYS: (i32, i32) = (-2, 30);
const DELAY: f64 = 1e-3;
/// Rows at most.
const ROWS: usize = 6000;
/// Speed, over its root mean square, within which friction turns.
const TURN: f64 = 0.05;

/// Columns whose coefficients are not negative: both lags, feedforward, integral and friction.
const POSITIVE: [usize; 5] = [0, 1, 4, 5, 6];

/// The coefficients, and the delay that leaves the least.
#[derive(Debug, Clone, Copy)]
pub(super) struct LinearLoop {
    /// K, 1/s.
    pub gain: f64,
    /// s.
    pub scale: f64,
    /// s.
    pub delay: f64,
    /// T, s.
    pub lag: f64,
    /// Q, s².
    pub second_lag: f64,
    /// f.
    pub feedforward: f64,
    /// i, 1/s.
    pub integral: f64,
}

/// A signal behind four equal lags, with its first three derivatives.
fn filtered(signal: impl Iterator<Item = f64>, pole: f64, period: f64) -> Vec<[f64; 4]> {
    let c = 0.5 * pole * period;
    let (keep, take) = ((1.0 - c) / (1.0 + c), c / (1.0 + c));
    let mut before: Option<[f64; 5]> = None;
    signal
        .map(|value| {
            let last = before.unwrap_or([value; 5]);
            let mut stages = [value; 5];
            for i in 1..5 {
                stages[i] = keep * last[i] + take * (stages[i - 1] + last[i - 1]);
            }
            before = Some(stages);
            let [_, a, b, c, d] = stages;
            [
                d,
                pole * (c - d),
                pole.powi(2) * (b - 2.0 * c + d),
                pole.powi(3) * (a - 3.0 * b + 3.0 * c - d),
            ]
        })
        .collect()
}

impl LinearLoop {
    /// Of `command` and output at `places`; none where the output has gaps or the equation no answer.
    pub(super) fn of(recording: &RigRecording, command: Channel, places: &[usize]) -> Option<Self> {
        let (r, x) = (recording.input(command), recording.output());
        let (period, n) = (recording.period(), x.len());
        let (&first, &last) = (places.first()?, places.last()?);
        if last >= n || r.len() < n || x[..=last].iter().any(|x| !x.is_finite()) {
            return None;
        }
        let n = last + 1;
        let pole = TAU * CUT_OFF.min(HIGHEST / period);
        let speed = |k: usize| {
            let (a, b) = (k.saturating_sub(2), (k + 2).min(n - 1));
            (x[b] - x[a]) / ((b - a).max(1) as f64 * period)
        };
        let usual = ((0..n).map(|k| speed(k).powi(2)).sum::<f64>() / n as f64).sqrt();
        let rubs = filtered(
            (0..n).map(|k| (speed(k) / (TURN * usual)).tanh()),
            pole,
            period,
        );
        let outputs = filtered(x[..n].iter().copied(), pole, period);
        let commands = filtered(r[..n].iter().copied(), pole, period);
        let sum = |signal: &[[f64; 4]]| -> Vec<f64> {
            let add = |sum: &mut f64, own: &[f64; 4]| {
                *sum += own[0] * period;
                Some(*sum)
            };
            signal.iter().scan(0.0, add).collect()
        };
        let (output_sums, command_sums) = (sum(&outputs), sum(&commands));
        // Behind what the lags show of the begin.
        let settled = first + (8.0 / (pole * period)) as usize;
        let stride = (places.len() / ROWS).max(1);
        let rows = || {
            places
                .iter()
                .copied()
                .filter(|k| *k > settled)
                .step_by(stride)
        };
        let count = rows().count();
        if count < 200 {
            return None;
        }
        let target = DVector::from_iterator(count, rows().map(|k| outputs[k][1]));
        let fits = (DELAYS.0..=DELAYS.1).filter_map(|tried| {
            let delay = f64::from(tried) * DELAY;
            let columns = rows().map(|k| {
                let place = (k as f64 - delay / period).clamp(0.0, (n - 1) as f64);
                let (before, share) = (place as usize, place.fract());
                let after = (before + 1).min(n - 1);
                let at = |one: f64, two: f64| one * (1.0 - share) + two * share;
                let late = |i: usize| at(commands[before][i], commands[after][i]);
                let late_sum = at(command_sums[before], command_sums[after]);
                let x = &outputs[k];
                let time = k as f64 / n as f64;
                let integrals = late_sum - output_sums[k];
                [
                    -x[2],
                    -x[3],
                    late(0),
                    -x[0],
                    late(1),
                    integrals,
                    -rubs[k][0],
                    1.0,
                    time,
                ]
            });
            let columns: Vec<[f64; 9]> = columns.collect();
            let sizes: [f64; 9] = std::array::from_fn(|i| {
                let squares: f64 = columns.iter().map(|row| row[i] * row[i]).sum();
                squares.sqrt().max(f64::MIN_POSITIVE)
            });
            let matrix = DMatrix::from_fn(count, 9, |k, i| columns[k][i] / sizes[i]);
            let normal = matrix.tr_mul(&matrix) + DMatrix::<f64>::identity(9, 9) * 1e-12;
            let right = matrix.tr_mul(&target);
            // What cannot be negative and would be leaves the equation.
            let mut kept: Vec<usize> = (0..9).collect();
            let found = loop {
                let count = kept.len();
                let own = DMatrix::from_fn(count, count, |i, j| normal[(kept[i], kept[j])]);
                let right = DVector::from_fn(count, |i, _| right[kept[i]]);
                let solved = own.cholesky()?.solve(&right);
                let mut all = DVector::zeros(9);
                kept.iter()
                    .zip(&solved)
                    .for_each(|(i, value)| all[*i] = *value);
                match kept
                    .iter()
                    .position(|i| POSITIVE.contains(i) && all[*i] < 0.0)
                {
                    Some(place) => kept.remove(place),
                    None => break all,
                };
            };
            let left = (&target - &matrix * &found).norm_squared();
            let own = |i: usize| found[i] / sizes[i];
            let gain = own(3);
            let scale = own(2) / gain;
            let loop_ = Self {
                gain,
                scale,
                delay,
                lag: own(0),
                second_lag: own(1),
                feedforward: own(4) / scale,
                integral: own(5) / gain,
            };
            (gain > 0.0 && scale > 0.0 && left.is_finite()).then_some((left, loop_))
        });
        fits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, own)| own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recordings::Recording;

    #[test]
    fn a_motor_s_loop_is_read_from_its_equation_friction_and_delay_included() {
        let (mass, resistance, inductance, constant) = (40.0, 1.0, 2e-3, 70.0);
        let (gain, ahead, delay, force) = (30.0, 0.5, 6.6e-3, 6.0);
        let (rate, n, steps) = (200.0, 6000_usize, 200);
        let wave = |t: f64| {
            let tone = |f: f64, size: f64| size * (TAU * f * t + f).sin();
            tone(0.4, 5e-3) + tone(1.3, 2e-3) + tone(3.1, 1e-3) + tone(6.3, 5e-4) + tone(9.7, 3e-4)
        };
        let (mut current, mut x, mut v) = (0.0f64, 0.0f64, 0.0f64);
        let h = 1.0 / rate / f64::from(steps);
        let mut measured = Vec::new();
        for k in 0..n {
            measured.push(x + 2e-6 * (k as f64 * 91.7).sin());
            for part in 0..steps {
                let t = k as f64 / rate + f64::from(part) * h - delay;
                let slope = (wave(t + h) - wave(t)) / h;
                let flow = gain * (1.05 * wave(t) - x) + ahead * 1.05 * slope;
                current += h * (constant * flow - resistance * current - constant * v) / inductance;
                v += h * (constant * current - force * (v / 2e-3).tanh()) / mass;
                x += h * v;
            }
        }
        let command = Channel::Other {
            name: "command",
            unit: "m",
        };
        let channels = vec![
            (command, (0..n).map(|k| wave(k as f64 / rate)).collect()),
            (Channel::Displacement, measured),
        ];
        let recording = Recording::new("motor", 1.0 / rate, channels).unwrap();
        let recording = RigRecording::new(recording, &[command], Channel::Displacement);
        let places: Vec<usize> = (0..n).collect();
        let found = LinearLoop::of(&recording, command, &places).unwrap();
        let near = |found: f64, truth: f64, share: f64| (found / truth - 1.0).abs() < share;
        assert!((found.delay - delay).abs() < 2e-3, "{found:?}");
        assert!(near(found.gain, gain, 0.08), "{found:?}");
        assert!(near(found.scale, 1.05, 0.01), "{found:?}");
        assert!(near(found.feedforward, ahead, 0.2), "{found:?}");
        let lag = mass * resistance / (constant * constant);
        assert!((found.lag - lag).abs() < 2e-3, "{found:?} {lag}");
        assert!(found.integral.abs() < 0.1, "{found:?}");
    }
}

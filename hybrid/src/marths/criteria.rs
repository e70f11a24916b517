//! The benchmark's criteria, with the true tracking error and the error against a perfect actuator.

use super::PERIOD;
use super::run::{Histories, Motions};

/// Number of [`COLUMNS`].
pub const COUNT: usize = 27;

/// Names of the criteria: J1 in ms, the others in percent.
pub const COLUMNS: [&str; COUNT] = [
    "J1_1",
    "J1_2",
    "J2_1",
    "J2_2",
    "J3_1",
    "J3_2",
    "J5_x",
    "J5_th",
    "J6_x",
    "J6_th",
    "J7_x",
    "J7_th",
    "J8_x2",
    "J8_th2",
    "J8_x3",
    "J8_th3",
    "J9_x",
    "J9_th",
    "J10_x2",
    "J10_th2",
    "J10_x3",
    "J10_th3",
    "true_J2_1",
    "true_J2_2",
    "H7_x",
    "H7_th",
    "H8",
];

/// The criteria of a run in the order of [`COLUMNS`], against the whole structure's motion and that
/// with a perfect actuator. J4 is J1 and left out; H8 is the largest of the four.
#[must_use]
pub fn criteria(run: &Histories, reference: &Motions, perfect: &Histories) -> [f64; COUNT] {
    let mut scores = [0.0; COUNT];
    for i in 0..2 {
        let (target, measured) = (&run.target[i], &run.measured[i]);
        scores[i] = 1000.0 * PERIOD * lag(measured, target) as f64;
        scores[2 + i] = deviation(measured, target);
        scores[4 + i] = peak(measured, target);
        scores[6 + i] = deviation(&run.fed[i], &run.motions[i]);
        scores[8 + i] = peak(&run.fed[i], &run.motions[i]);
        scores[10 + i] = deviation(&run.fed[i], &reference[i]);
        scores[16 + i] = peak(&run.fed[i], &reference[i]);
        scores[22 + i] = deviation(&run.stroke[i], target);
        scores[24 + i] = deviation(&run.fed[i], &perfect.fed[i]);
    }
    for j in 0..4 {
        let (own, whole) = (&run.motions[2 + j], &reference[2 + j]);
        scores[12 + j] = deviation(own, whole);
        scores[18 + j] = peak(own, whole);
        scores[26] = scores[26].max(deviation(own, &perfect.motions[2 + j]));
    }
    scores
}

/// Standard deviation of the difference over that of `wanted`, percent.
fn deviation(signal: &[f64], wanted: &[f64]) -> f64 {
    let error = squares(signal.iter().zip(wanted).map(|(a, b)| a - b));
    100.0 * (error / squares(wanted.iter().copied())).sqrt()
}

/// Largest magnitude of the difference over that of `wanted`, percent.
fn peak(signal: &[f64], wanted: &[f64]) -> f64 {
    let error = largest(signal.iter().zip(wanted).map(|(a, b)| a - b));
    100.0 * error / largest(wanted.iter().copied())
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |largest: f64, value| {
        if largest.is_nan() || value.is_nan() {
            return f64::NAN;
        }
        largest.max(value.abs())
    })
}

/// Sum of squares about the mean.
fn squares(values: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let mean = values.clone().sum::<f64>() / values.len() as f64;
    values.map(|value| (value - mean).powi(2)).sum()
}

/// Lags that are looked at, samples to either side.
const LAGS: i32 = 100;

/// The lag, samples, of `late` behind `wanted` with the largest magnitude of the cross-correlation,
/// means kept.
fn lag(late: &[f64], wanted: &[f64]) -> i32 {
    let n = late.len().min(wanted.len());
    let (late, wanted) = (&late[..n], &wanted[..n]);
    let mut best = (f64::NEG_INFINITY, 0);
    for lag in -LAGS..=LAGS {
        let shift = (lag.unsigned_abs() as usize).min(n);
        let (ahead, behind) = match lag >= 0 {
            true => (wanted, late),
            false => (late, wanted),
        };
        let sum: f64 = ahead[..n - shift]
            .iter()
            .zip(&behind[shift..])
            .map(|(a, b)| a * b)
            .sum();
        if sum.abs() > best.0 {
            best = (sum.abs(), lag);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shifted_signal_has_its_lag_to_either_side() {
        let wave = |shift: f64| -> Vec<f64> {
            (0..4000)
                .map(|k| {
                    let t = f64::from(k) - shift;
                    (-(t - 2000.0).powi(2) / 9e4).exp() * (0.05 * t).sin()
                })
                .collect()
        };
        for shift in [-7, 0, 1, 40] {
            assert_eq!(lag(&wave(f64::from(shift)), &wave(0.0)), shift);
        }
    }

    #[test]
    fn deviations_take_the_mean_off_and_peaks_do_not() {
        let wanted = [1.0, -1.0, 3.0, -3.0];
        let signal = wanted.map(|v| v + 0.5);
        assert!(deviation(&signal, &wanted) < 1e-12);
        assert!((peak(&signal, &wanted) - 50.0 / 3.0).abs() < 1e-12);
        assert!(peak(&[1.0, f64::NAN, 3.0, -3.0], &wanted).is_nan());
    }
}

//! The benchmark's nine evaluation criteria.

/// Histories of one run, one value per sample.
#[derive(Debug, Clone, Default)]
pub struct Histories {
    /// Noisy, unquantised measurement of the specimen's displacement, m.
    pub measured: Vec<f64>,
    /// True displacement of the specimen, m.
    pub displacement: Vec<f64>,
    /// Displacements of the numerical substructure, floors 1 to 3, m; the first is the desired one.
    pub numerical: [Vec<f64>; 3],
    /// Command to the actuator, m.
    pub command: Vec<f64>,
    /// Measured force, N.
    pub force: Vec<f64>,
    /// Largest magnitude of the specimen's force, N.
    pub peak_force: f64,
}

/// Displacements of the reference structure, floors 1 to 3, m.
pub type Reference = [Vec<f64>; 3];

/// Lags that the tracking delay is looked for among, samples.
const LAGS: usize = 50;

/// `J1..J9`: J1 in ms rounded to 0.1, the others in percent rounded to 0.01, as the published
/// program rounds them.
#[must_use]
pub fn criteria(run: &Histories, reference: &Reference, period: f64) -> [f64; 9] {
    let desired = &run.numerical[0];
    let delay = period * tracking_lag(&run.measured, desired) as f64;
    let percent = |ratio: f64| (10_000.0 * ratio).round() / 100.0;
    [
        (10_000.0 * delay).round() / 10.0,
        percent(normalised_deviation(&run.measured, desired)),
        percent(normalised_peak(&run.measured, desired)),
        percent(normalised_deviation(&run.measured, &reference[0])),
        percent(normalised_peak(&run.measured, &reference[0])),
        percent(normalised_deviation(&run.numerical[1], &reference[1])),
        percent(normalised_deviation(&run.numerical[2], &reference[2])),
        percent(normalised_peak(&run.numerical[1], &reference[1])),
        percent(normalised_peak(&run.numerical[2], &reference[2])),
    ]
}

/// Standard deviation of `signal - wanted` over that of `wanted`.
#[must_use]
pub fn normalised_deviation(signal: &[f64], wanted: &[f64]) -> f64 {
    let error = sum_of_squares(signal.iter().zip(wanted).map(|(a, b)| a - b));
    (error / sum_of_squares(wanted.iter().copied())).sqrt()
}

/// Largest magnitude of `signal - wanted` over that of `wanted`.
fn normalised_peak(signal: &[f64], wanted: &[f64]) -> f64 {
    let largest = |a: f64, b: f64| {
        if b.abs() > a || b.is_nan() {
            b.abs()
        } else {
            a
        }
    };
    let error = signal
        .iter()
        .zip(wanted)
        .map(|(a, b)| a - b)
        .fold(0.0, largest);
    error / wanted.iter().copied().fold(0.0, largest)
}

/// Sum of squares about the mean.
fn sum_of_squares(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    let (sum, squares) = values.fold((0.0, 0.0), |(sum, squares), v| (sum + v, squares + v * v));
    squares - sum * sum / count
}

/// The lag, samples, at which `late` correlates best with `wanted` (Pearson).
fn tracking_lag(late: &[f64], wanted: &[f64]) -> usize {
    let n = late.len().min(wanted.len());
    if n <= LAGS {
        return 0;
    }
    let (late, wanted) = (&late[..n], &wanted[..n]);
    // All products but those of the last samples in one pass, lag beside lag.
    let mut products = [0.0; LAGS];
    for (i, w) in wanted[..=n - LAGS].iter().enumerate() {
        for (product, l) in products.iter_mut().zip(&late[i..i + LAGS]) {
            *product += w * l;
        }
    }
    for (lag, product) in products.iter_mut().enumerate() {
        for i in n - LAGS + 1..n - lag {
            *product += wanted[i] * late[i + lag];
        }
    }
    let moments = |values: &[f64]| {
        values
            .iter()
            .fold((0.0, 0.0), |(sum, squares), v| (sum + v, squares + v * v))
    };
    let (mut sum_l, mut squares_l) = moments(late);
    let (mut sum_w, mut squares_w) = moments(wanted);
    let mut best = (f64::NEG_INFINITY, 0);
    for (lag, product) in products.iter().enumerate() {
        if lag > 0 {
            let (l, w) = (late[lag - 1], wanted[n - lag]);
            (sum_l, squares_l) = (sum_l - l, squares_l - l * l);
            (sum_w, squares_w) = (sum_w - w, squares_w - w * w);
        }
        let count = (n - lag) as f64;
        let spread = (squares_l - sum_l * sum_l / count) * (squares_w - sum_w * sum_w / count);
        let correlation = (product - sum_l * sum_w / count) / spread.sqrt();
        if correlation > best.0 {
            best = (correlation, lag);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(n: usize, shift: f64) -> Vec<f64> {
        let at = |k: usize| k as f64 - shift;
        (0..n)
            .map(|k| (0.02 * at(k)).sin() + 0.3 * (0.05 * at(k)).cos() + 0.1)
            .collect()
    }

    #[test]
    fn a_shifted_signal_has_its_shift() {
        let wanted = wave(5000, 0.0);
        for shift in [0, 1, 19, 49] {
            assert_eq!(tracking_lag(&wave(5000, shift as f64), &wanted), shift);
        }
        // A lead is never negative.
        assert_eq!(tracking_lag(&wave(5000, -10.0), &wanted), 0);
    }

    #[test]
    fn deviations_take_the_mean_off_and_peaks_do_not() {
        let wanted = [1.0, -1.0, 3.0, -3.0];
        let signal = wanted.map(|v| v + 0.5);
        assert!(normalised_deviation(&signal, &wanted) < 1e-12);
        assert!((normalised_peak(&signal, &wanted) - 0.5 / 3.0).abs() < 1e-15);
        let bad = [1.0, f64::NAN, 3.0, -3.0];
        assert!(normalised_peak(&bad, &wanted).is_nan());
        assert!(normalised_deviation(&bad, &wanted).is_nan());
    }
}

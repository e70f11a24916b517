//! Whiteness of prediction errors, and their correlation with the input.

/// Autocorrelation of one channel's errors, and their cross-correlation with the input.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualTest {
    /// Autocorrelation at lags 1, 2, ...
    pub autocorrelation: Vec<f64>,
    /// Cross-correlation with the input at lags 0, 1, ... (input before error).
    pub cross_correlation: Vec<f64>,
    /// Half-width of the 99 % band of a correlation of independent signals.
    pub band: f64,
    /// Half-width of the same band for the cross-correlation; wider, since the input is coloured.
    pub cross_band: f64,
}

/// Correlations up to `lags`.
pub fn residual_test(errors: &[f64], input: &[f64], lags: usize) -> ResidualTest {
    let centred = |values: &[f64]| -> Vec<f64> {
        let (mean, deviation) = recordings::mean_and_deviation(values);
        let size = deviation.max(f64::MIN_POSITIVE);
        values.iter().map(|value| (value - mean) / size).collect()
    };
    let (e, u) = (centred(errors), centred(input));
    let count = e.len().max(1) as f64;
    let lags = lags.min(e.len().saturating_sub(1));
    let correlation = |a: &[f64], b: &[f64], lag: usize| -> f64 {
        a.iter().zip(&b[lag..]).map(|(x, y)| x * y).sum::<f64>() / count
    };
    let autocorrelation: Vec<f64> = (1..=lags).map(|lag| correlation(&e, &e, lag)).collect();
    let cross_correlation = (0..=lags).map(|lag| correlation(&u, &e, lag)).collect();
    let band = 2.576 / count.sqrt();
    // Variance of the cross-correlation: sum over all lags of both autocorrelations' product
    // (Ljung 1999, Eq 16.39). Truncated where the errors' own correlation is taken.
    let sum: f64 = 1.0
        + 2.0
            * autocorrelation
                .iter()
                .enumerate()
                .map(|(i, r)| r * correlation(&u, &u, i + 1))
                .sum::<f64>();
    ResidualTest {
        autocorrelation,
        cross_correlation,
        band,
        cross_band: band * sum.max(1.0).sqrt(),
    }
}

impl ResidualTest {
    /// Part of the lags whose autocorrelation leaves the 99 % band; 0.01 is expected.
    pub fn outside(&self) -> f64 {
        outside(&self.autocorrelation, self.band)
    }

    /// The same for the cross-correlation with the input.
    pub fn cross_outside(&self) -> f64 {
        outside(&self.cross_correlation, self.cross_band)
    }

    /// Whether the errors are white: not many lags outside, and none far.
    pub fn is_white(&self) -> bool {
        small(&self.autocorrelation, self.band)
    }
}

fn outside(values: &[f64], band: f64) -> f64 {
    values.iter().filter(|value| value.abs() > band).count() as f64 / values.len().max(1) as f64
}

fn small(values: &[f64], band: f64) -> bool {
    let largest = values
        .iter()
        .fold(0.0f64, |most, value| most.max(value.abs()));
    outside(values, band) <= 0.1 && largest <= 2.0 * band
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn white_and_coloured_errors_are_told_apart() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut draw = || random.random_range(-1.0..1.0);
        let white: Vec<f64> = (0..4000).map(|_| draw()).collect();
        let input: Vec<f64> = (0..4000).map(|_| draw()).collect();
        let test = residual_test(&white, &input, 25);
        let no_input_left = |test: &ResidualTest| small(&test.cross_correlation, test.cross_band);
        assert!(test.is_white() && no_input_left(&test));
        let coloured: Vec<f64> = white.windows(2).map(|w| w[1] + 0.3 * w[0]).collect();
        assert!(!residual_test(&coloured, &input[1..], 25).is_white());
        let left: Vec<f64> = (1..4000).map(|k| white[k] + 0.2 * input[k - 1]).collect();
        assert!(!no_input_left(&residual_test(&left, &input[1..], 25)));
    }
}

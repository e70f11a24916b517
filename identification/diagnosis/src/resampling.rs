//! Intervals and significance by resampling blocks, so that samples may be correlated.

use nalgebra::{DMatrix, DVector, DVectorView};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Seed of [`gain_interval`].
pub const SEED: u64 = 1;
/// Seed of [`bootstrap`].
pub const BOOTSTRAP_SEED: u64 = 20_170_401;
/// Draws of a bootstrap.
const DRAWS: usize = 1000;
/// Length of a block of [`bootstrap`], samples.
const BLOCK: usize = 250;

/// Runs of neighbouring samples whose scatter tells standard errors.
const RUNS: usize = 24;

/// Samples that count as one: `1 + 2 Σ ρ_k` over the first positive autocorrelations (Geyer's
/// initial positive sequence, Statistical Science 7, 1992).
pub fn correlation_time(residuals: &[f64]) -> f64 {
    let n = residuals.len();
    let mean = residuals.iter().sum::<f64>() / n.max(1) as f64;
    let power: f64 = residuals.iter().map(|r| (r - mean).powi(2)).sum();
    if power == 0.0 {
        return 1.0;
    }
    let mut sum = 0.0;
    let mut lag = 1;
    while lag < n / 4 {
        // Long lags stand for their neighbours.
        let stride = (lag / 16).max(1);
        let product: f64 = residuals
            .iter()
            .zip(&residuals[lag..])
            .map(|(a, b)| (a - mean) * (b - mean))
            .sum();
        if product <= 0.05 * power {
            break;
        }
        sum += stride as f64 * product / power;
        lag += stride;
    }
    1.0 + 2.0 * sum
}

/// Covariance of coordinates with the inverse information `inverse`, from the scatter of the gradient
/// `columns' errors` between runs of neighbouring samples (Newey and West, Econometrica 55, 1987, with runs for
/// lags): errors may be correlated, or larger where the columns are.
pub fn scattered(inverse: &DMatrix<f64>, columns: &[&[f64]], errors: &[f64]) -> DMatrix<f64> {
    let n = errors.len();
    let mut scatter = DMatrix::zeros(columns.len(), columns.len());
    for run in 0..RUNS {
        let (from, to) = (run * n / RUNS, (run + 1) * n / RUNS);
        let of = |column: &&[f64]| dot(&column[from..to], &errors[from..to]);
        let gradient = DVector::from_iterator(columns.len(), columns.iter().map(of));
        scatter += &gradient * gradient.transpose();
    }
    inverse * scatter * inverse
}

/// Of as many values as both have.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    DVectorView::from_slice(&a[..n], n).dot(&DVectorView::from_slice(&b[..n], n))
}

/// 95 % interval of `1 - (sum of after²) / (sum of before²)` by circular block bootstrap (Politis
/// and Romano 1992); the blocks are ten correlation times long.
pub fn gain_interval(before: &[f64], after: &[f64]) -> (f64, f64) {
    let n = before.len().min(after.len());
    if n < 16 {
        return (f64::NEG_INFINITY, f64::INFINITY);
    }
    let block = ((10.0 * correlation_time(after)) as usize).clamp(1, n / 8);
    let sums = |values: &[f64]| {
        let mut total = vec![0.0];
        // Round the end to the begin, so that every sample is drawn as often.
        for value in values[..n].iter().chain(&values[..block]) {
            total.push(total[total.len() - 1] + value * value);
        }
        total
    };
    let (before, after) = (sums(before), sums(after));
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let mut gains: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let (mut a, mut b) = (0.0, 0.0);
            for _ in 0..n.div_ceil(block) {
                let start = random.random_range(0..n);
                b += before[start + block] - before[start];
                a += after[start + block] - after[start];
            }
            1.0 - a / b
        })
        .collect();
    gains.sort_by(f64::total_cmp);
    (gains[DRAWS * 25 / 1000], gains[DRAWS * 975 / 1000 - 1])
}

/// Running sums of `values`, the first is zero.
pub fn running(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut total = 0.0;
    std::iter::once(0.0)
        .chain(values.map(|value| {
            total += value;
            total
        }))
        .collect()
}

/// 95 % interval of `1 - sqrt(after/before)` from running sums of squares.
pub fn share_gone(before: &[f64], after: &[f64]) -> [f64; 2] {
    bootstrap([before, after], |[b, a]| {
        1.0 - (a / b.max(f64::MIN_POSITIVE)).sqrt()
    })
}

/// 95 % interval of a `statistic` of means, from the [`running`] sums of what they are means of:
/// moving-block bootstrap over the samples.
pub fn bootstrap<const N: usize>(
    sums: [&[f64]; N],
    statistic: impl Fn([f64; N]) -> f64,
) -> [f64; 2] {
    let n = sums.iter().map(|s| s.len()).min().unwrap_or(0);
    let n = n.saturating_sub(1);
    if n < 4 {
        return [0.0, 0.0];
    }
    let block = BLOCK.min(n / 2).max(1);
    let blocks = n.div_ceil(block);
    let mut random = ChaCha8Rng::seed_from_u64(BOOTSTRAP_SEED);
    let mut values: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let mut means = [0.0; N];
            for _ in 0..blocks {
                let start = random.random_range(0..=n - block);
                for (mean, sums) in means.iter_mut().zip(&sums) {
                    *mean += (sums[start + block] - sums[start]) / (blocks * block) as f64;
                }
            }
            statistic(means)
        })
        .collect();
    values.sort_by(f64::total_cmp);
    [values[DRAWS / 40], values[DRAWS - 1 - DRAWS / 40]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mean of 240 samples whose errors differ from run to run only: as sure as that of 24 numbers.
    #[test]
    fn errors_that_stay_for_a_run_count_once() {
        let of_run = |k: usize| ((k / 10) as f64 * 2.4).sin();
        let errors: Vec<f64> = (0..240).map(of_run).collect();
        let column = vec![1.0; 240];
        let inverse = DMatrix::from_element(1, 1, 1.0 / 240.0);
        let found = scattered(&inverse, &[&column], &errors)[(0, 0)];
        let squares: f64 = (0..24).map(|run| of_run(10 * run).powi(2)).sum();
        assert!((found - squares / 24.0 / 24.0).abs() < 1e-12);
    }

    #[test]
    fn correlation_time_of_a_first_order_process() {
        // 1 + 2 Σ a^k = (1 + a) / (1 - a) for x_k = a x_{k-1} + e_k.
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut x = 0.0;
        let series: Vec<f64> = (0..200_000)
            .map(|_| {
                x = 0.8 * x + random.random_range(-1.0..1.0);
                x
            })
            .collect();
        let time = correlation_time(&series);
        assert!((8.0..9.5).contains(&time), "{time}");
        // The mean is no part of it.
        let moved: Vec<f64> = series.iter().map(|x| x + 100.0).collect();
        assert!((correlation_time(&moved) / time - 1.0).abs() < 1e-6);
        assert_eq!(correlation_time(&[2.0; 50]), 1.0);
    }

    #[test]
    fn a_gain_that_is_the_same_everywhere_has_no_interval() {
        for samples in [16, 100, 1001] {
            let before: Vec<f64> = (0..samples)
                .map(|k| (0.7 * f64::from(k)).sin() + 2.0)
                .collect();
            let after: Vec<f64> = before.iter().map(|value| 0.5 * value).collect();
            let (low, high) = gain_interval(&before, &after);
            assert!(
                (low - 0.75).abs() < 1e-9 && (high - 0.75).abs() < 1e-9,
                "{low} {high}"
            );
        }
        let few = gain_interval(&[2.0; 15], &[1.0; 15]);
        assert_eq!(few, (f64::NEG_INFINITY, f64::INFINITY));
    }

    #[test]
    fn the_interval_of_a_gain_that_is_known() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        let after: Vec<f64> = (0..5000).map(|_| random.random_range(-1.0..1.0)).collect();
        let before: Vec<f64> = after
            .iter()
            .map(|a| a + random.random_range(-1.0..1.0))
            .collect();
        let (low, high) = gain_interval(&before, &after);
        assert!(low < 0.5 && 0.5 < high && high - low < 0.1, "{low} {high}");
    }

    /// Means of any parts of a steady series are those of all of it, whatever the blocks cover.
    #[test]
    fn an_interval_of_steady_means_is_their_statistic() {
        for samples in [5, 37, 1000, 1999] {
            let sums = [3.0, 8.0].map(|value| running(std::iter::repeat_n(value, samples)));
            let [low, high] = bootstrap([&sums[0], &sums[1]], |[a, b]| b - 2.0 * a);
            assert!(
                (low - 2.0).abs() < 1e-9 && (high - 2.0).abs() < 1e-9,
                "{samples}"
            );
        }
        let few = running([1.0, 2.0, 3.0].into_iter());
        assert_eq!(few, [0.0, 1.0, 3.0, 6.0]);
        assert_eq!(bootstrap([&few], |[mean]| mean), [0.0, 0.0]);
    }

    #[test]
    fn interval_holds_the_share_of_a_steady_gain() {
        let sums = |size: f64| -> Vec<f64> {
            let mut total = 0.0;
            (0..5001)
                .map(|k| {
                    let here = total;
                    total += size * (1.0 + 0.5 * (0.37 * f64::from(k)).sin());
                    here
                })
                .collect()
        };
        let [low, high] = share_gone(&sums(4.0), &sums(1.0));
        assert!(
            low <= 0.5 && 0.5 <= high && high - low < 0.05,
            "{low} {high}"
        );
    }
}

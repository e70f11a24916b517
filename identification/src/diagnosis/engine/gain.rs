//! What the extended model brings on a record that it has not seen.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::data::mean_and_deviation;
use crate::diagnosis::rigs::shake_table::predictor::{Predictor, Samples};

/// Seed of the bootstrap.
pub const BOOTSTRAP_SEED: u64 = 20_170_401;
const RESAMPLES: usize = 1000;
/// Length of a bootstrap block, samples.
const BLOCK: usize = 250;

/// Prediction errors before and after, normalised by the channels' standard deviations.
#[derive(Debug, Clone, PartialEq)]
pub struct Gain {
    /// Per channel before, after, and what a perfect model leaves.
    pub channels: Vec<ChannelGain>,
    /// Root mean square of the channels' values before.
    pub before_nrmse: f64,
    /// And after.
    pub after_nrmse: f64,
    /// And at the noise floor.
    pub noise_floor_nrmse: f64,
    /// Whitened error before, in units of the noise floor.
    pub before_ratio: f64,
    /// And after.
    pub after_ratio: f64,
    /// 95 % interval of the share of the error that is gone, `1 - after/before`, from a
    /// moving-block bootstrap.
    pub interval_95: [f64; 2],
}

/// One channel's errors.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelGain {
    /// Its name.
    pub channel: &'static str,
    /// NRMSE of the nominal model.
    pub before: f64,
    /// NRMSE of the extended model.
    pub after: f64,
    /// NRMSE of a perfect model.
    pub floor: f64,
    /// 95 % intervals of `before` and `after` from a moving-block bootstrap.
    pub intervals_95: [[f64; 2]; 2],
}

/// Compares two predictions of `samples`: whitened innovations with the predictor that made them.
pub fn gain(
    samples: &Samples,
    names: &[&'static str; 4],
    before: (&Predictor, &[f64]),
    after: (&Predictor, &[f64]),
) -> Gain {
    let scale = [0, 1, 2, 3].map(|i| {
        let channel: Vec<f64> = samples.channels.iter().map(|row| row[i]).collect();
        mean_and_deviation(&channel).1.max(f64::MIN_POSITIVE)
    });
    let floor = after.0.floor();
    let live: Vec<usize> = (0..4).filter(|&i| floor[i] > 0.0).collect();
    let squares = |(predictor, whitened): (&Predictor, &[f64])| -> Vec<[f64; 4]> {
        whitened
            .chunks_exact(4)
            .map(|row| {
                let e = predictor.physical(&[row[0], row[1], row[2], row[3]]);
                [0, 1, 2, 3].map(|i| (e[i] / scale[i]).powi(2))
            })
            .collect()
    };
    let (squares_before, squares_after) = (squares(before), squares(after));
    let n = squares_before.len().max(1) as f64;
    let rms = |rows: &[[f64; 4]], i: usize| (rows.iter().map(|r| r[i]).sum::<f64>() / n).sqrt();
    let channels: Vec<ChannelGain> = live
        .iter()
        .map(|&i| ChannelGain {
            channel: names[i],
            before: rms(&squares_before, i),
            after: rms(&squares_after, i),
            floor: floor[i] / scale[i],
            intervals_95: [&squares_before, &squares_after].map(|rows| {
                let sums = running(rows.iter().map(|row| row[i]));
                bootstrap([&sums], |[mean]| mean.sqrt())
            }),
        })
        .collect();
    let overall = |value: fn(&ChannelGain) -> f64| {
        let sum: f64 = channels.iter().map(|c| value(c).powi(2)).sum();
        (sum / channels.len().max(1) as f64).sqrt()
    };
    let whitened_rms = |whitened: &[f64]| {
        let count = n * live.len().max(1) as f64;
        (whitened.iter().map(|r| r * r).sum::<f64>() / count).sqrt()
    };
    let sums = |rows: &[[f64; 4]]| {
        running(
            rows.iter()
                .map(|row| live.iter().map(|&i| row[i]).sum::<f64>()),
        )
    };
    Gain {
        before_nrmse: overall(|c| c.before),
        after_nrmse: overall(|c| c.after),
        noise_floor_nrmse: overall(|c| c.floor),
        before_ratio: whitened_rms(before.1),
        after_ratio: whitened_rms(after.1),
        interval_95: share_gone(&sums(&squares_before), &sums(&squares_after)),
        channels,
    }
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
    let mut values: Vec<f64> = (0..RESAMPLES)
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
    [
        values[RESAMPLES / 40],
        values[RESAMPLES - 1 - RESAMPLES / 40],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

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

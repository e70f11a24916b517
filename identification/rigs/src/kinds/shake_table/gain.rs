//! What the extended model brings on a record that it has not seen.

use super::predictor::{Predictor, Samples};
use diagnosis::resampling::{bootstrap, running, share_gone};
use recordings::mean_and_deviation;

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

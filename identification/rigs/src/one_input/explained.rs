//! What a transfer function explains of the displacement, what the coherence with the command allows, and
//! where the difference lies. Of a rig that integrates its command the velocity is what counts: the drift that
//! friction and offsets leave of its displacement would outweigh every motion.

use std::f64::consts::TAU;

use super::Rest;
use super::fit::{Own, measured, missed};
use super::structure::DelayedTransferFunction;

/// Error beyond that of the coherence from which on a model lacks dynamics: so many times in power, and this
/// share of the displacement.
const LACKS: f64 = 1.5;
const WORTH: f64 = 0.02;
/// Incoherent power over that of the sensor's noise from which on a rig is not linear.
const NONLINEAR: f64 = 4.0;
/// Share of what is missed that a band is to hold.
const MOST: f64 = 0.6;
/// Windows by which quiet and lively motion are told apart, s, and the fewest.
const WINDOW: f64 = 1.0;
const FEWEST: usize = 9;
/// Ratio of the errors of quiet and lively motion from which on they are worth a word.
const APART: f64 = 1.3;

/// What is explained of data that were not fitted; root mean squares over that of the displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Explained {
    /// Whether all shares are of the velocity and not of the displacement.
    pub of_velocity: bool,
    /// What the model leaves.
    pub left: f64,
    /// What the command does not explain linearly.
    pub incoherent: f64,
    /// The sensor's white noise.
    pub noise: f64,
    /// Where most of what could be explained lies; where the model explains that, where most of what is
    /// incoherent lies. Hz.
    pub band: (f64, f64),
    /// Frequency (Hz), gain as measured and of the model where it misses most.
    pub worst: (f64, f64, f64),
    /// What is left of the quietest and of the liveliest third of the windows.
    pub by_size: Option<(f64, f64)>,
}

impl Explained {
    /// Of the bands and the time histories that were not fitted; `noise` is the deviation of the sensor's white
    /// noise, m.
    pub(super) fn of(
        model: &DelayedTransferFunction,
        unseen: &[Own],
        rest: &[Rest],
        noise: f64,
    ) -> Self {
        let (mut size, mut left, mut incoherent, mut white) = (0.0, 0.0, 0.0, 0.0);
        let mut lacking = Vec::new();
        let mut unexplained = Vec::new();
        let mut worst = (0.0, (0.0, 1.0, 1.0));
        let of_velocity = model.denominator.last() == Some(&0.0);
        for own in unseen {
            let lines = own.band.omega.len() as f64;
            let unit = own.bands.scale[1];
            let weight = if of_velocity {
                own.band.middle().powi(2)
            } else {
                1.0
            };
            let power = weight * (own.band.projected(1) * unit).norm_sqr();
            let floor = weight * own.band.noise[(1, 1)].re * unit * unit * lines;
            let error = weight * missed(model, *own);
            size += power + floor;
            left += error + floor;
            incoherent += floor;
            white += weight * noise * noise * lines;
            let frequency = own.band.middle() / TAU;
            lacking.push((frequency, error));
            unexplained.push((frequency, floor));
            if error > worst.0 {
                let as_measured = measured(*own).value.norm();
                let modelled = model.response(own.band.middle(), own.bands.period).norm();
                worst = (error, (frequency, as_measured, modelled));
            }
        }
        let share = |power: f64| (power / size.max(f64::MIN_POSITIVE)).sqrt();
        let mut found = Self {
            of_velocity,
            left: share(left),
            incoherent: share(incoherent),
            noise: share(white).min(share(incoherent)),
            band: (0.0, 0.0),
            worst: worst.1,
            by_size: by_size(rest),
        };
        found.band = narrowest(if found.lacks_dynamics() {
            lacking
        } else {
            unexplained
        });
        found
    }

    /// Whether the coherence allows clearly more than the model explains.
    pub fn lacks_dynamics(&self) -> bool {
        let (left, allowed) = (self.left.powi(2), self.incoherent.powi(2));
        left > LACKS * allowed + WORTH * WORTH
    }

    /// Whether a transfer function cannot explain what is far above the sensor's noise.
    pub fn is_nonlinear(&self) -> bool {
        let (incoherent, noise) = (self.incoherent.powi(2), self.noise.powi(2));
        incoherent > NONLINEAR * noise + WORTH * WORTH
    }

    /// The sentence for a reader; none where nothing is to be said.
    pub(super) fn sentence(&self) -> Option<String> {
        let percent = |left: f64| 100.0 * (1.0 - left);
        let what = if self.of_velocity {
            "velocity"
        } else {
            "displacement"
        };
        let (low, high) = self.band;
        let size = self.by_size.map_or_else(String::new, |(quiet, lively)| {
            format!(
                "; it is {:.0} % of the displacement where the table moves least and {:.0} % where it \
                 moves most",
                100.0 * quiet,
                100.0 * lively
            )
        });
        if self.lacks_dynamics() {
            let (frequency, real, modelled) = self.worst;
            return Some(format!(
                "the model explains {:.1} % of the {what} that was not fitted, and the coherence with \
                 the command allows {:.1} %: most of the difference is at {low:.1} to {high:.1} Hz (at \
                 {frequency:.1} Hz the gain is {real:.2}, the model's {modelled:.2}); the rest includes \
                 what is not linear{size}",
                percent(self.left),
                percent(self.incoherent),
            ));
        }
        self.is_nonlinear().then(|| {
            format!(
                "the model explains {:.1} % of the {what} that was not fitted, and no transfer function \
                 more than {:.1} %, though the sensor's noise would allow {:.1} %: the rig does something that \
                 is not linear, such as friction, a dead band or unequal areas; most of the rest is at \
                 {low:.1} to {high:.1} Hz{size}",
                percent(self.left),
                percent(self.incoherent),
                percent(self.noise),
            )
        })
    }
}

/// The narrowest range of frequencies, by its ratio, that holds [`MOST`] of the power.
fn narrowest(mut powers: Vec<(f64, f64)>) -> (f64, f64) {
    powers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = powers.iter().map(|own| own.1).sum();
    let mut best: (f64, f64) = (0.0, f64::INFINITY);
    let (mut from, mut sum) = (0, 0.0);
    for (to, own) in powers.iter().enumerate() {
        sum += own.1;
        while from < to && sum - powers[from].1 >= MOST * all {
            sum -= powers[from].1;
            from += 1;
        }
        let range = (powers[from].0, own.0);
        if sum >= MOST * all && range.1 / range.0 < best.1 / best.0.max(f64::MIN_POSITIVE) {
            best = range;
        }
    }
    if best.1.is_finite() { best } else { (0.0, 0.0) }
}

/// What is left of the quietest and of the liveliest third of the windows, where they differ.
fn by_size(rest: &[Rest]) -> Option<(f64, f64)> {
    let mut windows: Vec<(f64, f64)> = Vec::new();
    for own in rest {
        let length = ((WINDOW / own.period).round() as usize).max(2);
        let pairs = own.measured.chunks_exact(length);
        for (y, m) in pairs.zip(own.simulated.chunks_exact(length)) {
            let mean = y.iter().sum::<f64>() / length as f64;
            let size = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
            let error = y.iter().zip(m).map(|(y, m)| (y - m).powi(2)).sum::<f64>();
            windows.push((size, error));
        }
    }
    if windows.len() < FEWEST {
        return None;
    }
    windows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let third = windows.len() / 3;
    let share = |own: &[(f64, f64)]| {
        let sum = |of: fn(&(f64, f64)) -> f64| own.iter().map(of).sum::<f64>();
        (sum(|w| w.1) / sum(|w| w.0).max(f64::MIN_POSITIVE)).sqrt()
    };
    let quiet = share(&windows[..third]);
    let lively = share(&windows[windows.len() - third..]);
    let ratio = quiet.max(lively) / quiet.min(lively).max(f64::MIN_POSITIVE);
    (ratio > APART).then_some((quiet, lively))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_narrowest_range_holds_most() {
        // 1 to 8 Hz evenly, with a peak at 4 and 5 Hz.
        let powers = (1..=8).map(|f| (f64::from(f), if f == 4 || f == 5 { 10.0 } else { 1.0 }));
        assert_eq!(narrowest(powers.collect()), (4.0, 5.0));
        assert_eq!(narrowest(Vec::new()), (0.0, 0.0));
    }

    #[test]
    fn friction_shows_where_a_table_moves_least() {
        // 10 s at 1 mm and 10 s at 0.1 mm, each with the same error.
        let y: Vec<f64> = (0..2000)
            .map(|k| {
                let size = if k < 1000 { 1e-3 } else { 1e-4 };
                size * (0.1 * f64::from(k)).sin()
            })
            .collect();
        let m = y.iter().map(|y| y + 2e-5).collect();
        let rest = Rest {
            recording: "own".into(),
            start: 0.0,
            period: 0.01,
            measured: y,
            simulated: m,
        };
        let (quiet, lively) = by_size(std::slice::from_ref(&rest)).unwrap();
        assert!((quiet / (2e-5 / 0.707e-4) - 1.0).abs() < 0.1, "{quiet}");
        assert!((lively / (2e-5 / 0.707e-3) - 1.0).abs() < 0.1, "{lively}");
    }
}

//! Time stamps that were rounded when they were written: 0.01 s stamps of samples every 0.002 s.

/// What rounded time stamps say of the clock behind them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoundedStamps {
    /// The decimal step that all stamps are multiples of, s.
    pub step: f64,
    /// The even period that explains every stamp to half that step, s; none where no round one does.
    pub period: Option<f64>,
}

/// Stamps that are needed to tell a period.
const FEWEST: usize = 20;

impl RoundedStamps {
    /// Looks at `time` (s). The period is `expected` where that explains the stamps, otherwise the
    /// roundest rate in Hz or period in s that does. None where the stamps are finer than a
    /// twentieth of their mean spacing, so that rounding explains nothing.
    pub fn of(time: &[f64], expected: Option<f64>) -> Option<Self> {
        let (first, last) = (*time.first()?, *time.last()?);
        let mean = (last - first) / (time.len() - 1) as f64;
        if time.len() < FEWEST || !time.iter().all(|t| t.is_finite()) || mean <= 0.0 {
            return None;
        }
        let step = decimal_step(time).filter(|step| *step >= 0.05 * mean)?;
        let explains = |period: &f64| spread(time, *period) <= step * (1.0 + 1e-6);
        let period = expected
            .into_iter()
            .chain(round_periods(slope(time)))
            .find(explains);
        Some(Self { step, period })
    }
}

/// The coarsest power of ten of a second that all stamps are multiples of.
fn decimal_step(time: &[f64]) -> Option<f64> {
    (0..=7).map(|digits| 10f64.powi(-digits)).find(|step| {
        time.iter()
            .all(|t| (t / step - (t / step).round()).abs() < 1e-3)
    })
}

/// Range of what the stamps are away from an even base.
fn spread(time: &[f64], period: f64) -> f64 {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (k, t) in time.iter().enumerate() {
        let off = t - k as f64 * period;
        (low, high) = (low.min(off), high.max(off));
    }
    high - low
}

/// Least squares of the stamps over their number.
fn slope(time: &[f64]) -> f64 {
    let middle = 0.5 * (time.len() - 1) as f64;
    let (mut cross, mut square) = (0.0, 0.0);
    for (k, t) in time.iter().enumerate() {
        let k = k as f64 - middle;
        cross += k * t;
        square += k * k;
    }
    cross / square
}

/// Rates in whole and tenths of a hertz and periods down to whole microseconds next to `period`,
/// the roundest first. Finer ones would explain a lost sample away as a slower clock.
fn round_periods(period: f64) -> impl Iterator<Item = f64> {
    let rates = [1.0, 10.0].map(|place| place / (place / period).round());
    let periods = [1e3, 1e4, 1e5, 1e6].map(|place| (period * place).round() / place);
    let all = rates.into_iter().chain(periods);
    all.filter(|period| period.is_finite() && *period > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamps(period: f64, step: f64, count: usize) -> Vec<f64> {
        let stamp = |k: usize| (k as f64 * period / step).round() * step;
        (0..count).map(stamp).collect()
    }

    #[test]
    fn the_clock_behind_rounded_stamps_is_found() {
        for (period, step) in [
            (0.002, 0.01),
            (0.002, 1.0),
            (1.0 / 512.0, 0.001),
            (1.0 / 1024.0, 0.001),
            (0.0025, 0.001),
            (1.0 / 300.0, 0.01),
        ] {
            let time = stamps(period, step, 4000);
            let found = RoundedStamps::of(&time, None).unwrap();
            assert_eq!(found.step, step);
            assert!(
                (found.period.unwrap() / period - 1.0).abs() < 1e-12,
                "{period} {found:?}"
            );
            let floored: Vec<f64> = (0..4000)
                .map(|k| (k as f64 * period / step + 1e-9).floor() * step)
                .collect();
            let found = RoundedStamps::of(&floored, Some(period)).unwrap();
            assert_eq!(found.period, Some(period));
        }
    }

    #[test]
    fn a_missing_sample_is_not_rounded_away() {
        let mut time = stamps(0.002, 0.01, 4000);
        time[2000..].iter_mut().for_each(|t| *t += 0.05);
        let found = RoundedStamps::of(&time, Some(0.002)).unwrap();
        assert_eq!(found.period, None);
        // Fine stamps are uneven, not rounded.
        let fine: Vec<f64> = (0..4000)
            .map(|k| 0.002 * f64::from(k) + 3.7e-5 * f64::from(k % 3))
            .collect();
        assert_eq!(RoundedStamps::of(&fine, None), None);
    }
}

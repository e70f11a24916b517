//! What an identified rig misses on a motion that it has not seen.

use super::{Prediction, TRIANGLE};

/// Part of what a model misses that is left under feedback: the middle of fourteen rigs of `judge_rigs` (seeds 77 to 84
/// and 401 to 406) that fresh seeds check.
const FED_BACK: f64 = 0.8;

/// Error (RMS) of the model's acceleration on a motion of any size, in two independent parts. One does not grow
/// with the motion, such as what an unseen voltage at the valve makes; the other is a share of the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Missed {
    /// m/s².
    floor: f64,
    /// Error over the acceleration (RMS).
    share: f64,
}

impl Missed {
    /// From the motions that were not fitted: mean squares of the errors over those of the motions are a
    /// straight line. The acceleration of a slow triangle is friction and noise, and says nothing of others.
    pub(super) fn of(predictions: &[Prediction]) -> Self {
        let lively = predictions.iter().filter(|own| own.motion != TRIANGLE);
        let points = lively.filter_map(|own| {
            let size = own.rms_m_s2?;
            Some((size.powi(2), (own.replayed_percent? / 100.0 * size).powi(2)))
        });
        Self::line(&points.collect::<Vec<_>>())
    }

    /// From squares of motions and of their errors.
    fn line(points: &[(f64, f64)]) -> Self {
        let count = points.len().max(1) as f64;
        let sum = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>();
        let (x, y) = (sum(&|p| p.0) / count, sum(&|p| p.1) / count);
        let spread = sum(&|p| (p.0 - x).powi(2));
        let slope = sum(&|p| (p.0 - x) * (p.1 - y)) / spread;
        let (floor, slope) = match y - slope * x {
            // Motions of one size, or one motion: all of it grows with the motion.
            floor if !floor.is_finite() => (0.0, y / x),
            floor if floor < 0.0 => (0.0, y / x),
            _ if slope < 0.0 => (y, 0.0),
            floor => (floor, slope),
        };
        let root = |square: f64| if square > 0.0 { square.sqrt() } else { 0.0 };
        Self {
            floor: root(floor),
            share: root(slope),
        }
    }

    /// Error (RMS, m/s²) on a motion of an acceleration (RMS, m/s²), under the recorded command.
    pub(super) fn at(&self, acceleration: f64) -> f64 {
        self.floor.hypot(self.share * acceleration)
    }

    /// The same under a controller, whose feedback takes a part of it.
    pub(super) fn tracked(&self, acceleration: f64) -> f64 {
        FED_BACK * self.at(acceleration)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_and_the_share_of_two_motions_are_found() {
        let point = |size: f64| (size * size, 0.03_f64.powi(2) + (0.02 * size).powi(2));
        let missed = Missed::line(&[point(0.6), point(2.5)]);
        assert!((missed.floor - 0.03).abs() < 1e-12 && (missed.share - 0.02).abs() < 1e-12);
        let expected = 0.03_f64.hypot(0.02 * 0.36);
        assert!((missed.at(0.36) - expected).abs() < 1e-12);
        assert!(missed.tracked(0.36) < missed.at(0.36) && missed.tracked(0.36) > 0.0);
    }

    #[test]
    fn no_part_is_negative() {
        // The larger motion has more than its share: together 3 % of both.
        let missed = Missed::line(&[(1.0, 1e-4), (9.0, 89e-4)]);
        assert_eq!(missed.floor, 0.0);
        assert!((missed.share - 0.03).abs() < 1e-12);
        // The larger motion has the smaller error.
        let missed = Missed::line(&[(1.0, 3e-4), (9.0, 1e-4)]);
        assert_eq!(missed.share, 0.0);
        assert!((missed.floor - 2e-4_f64.sqrt()).abs() < 1e-12);
        assert_eq!(Missed::line(&[(4.0, 1e-4)]).at(1.0), 0.005);
        assert_eq!(Missed::line(&[]).at(1.0), 0.0);
    }
}

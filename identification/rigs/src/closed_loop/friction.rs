//! How the shape of the seals' dry friction is searched.

pub use plant::identified::seal_shape::SealShape;

use super::seals::Seals;

/// Number of [`SealShape`]'s parameters.
pub const SHAPE: usize = 5;

/// What the search needs of a shape.
pub trait Searched: Sized {
    /// What is known of seals before any data, as residuals of unit variance: an excess of
    /// 0.25 ± 0.25, a Stribeck velocity of 4 mm/s and a sharpness of 3, each within a factor of
    /// two to three.
    fn surprise(&self) -> [f64; 3];

    /// The shape `changes` away: logarithms, but excess and relaxation (ms) themselves.
    #[must_use]
    fn changed(&self, changes: &[f64]) -> Self;

    /// The history along `velocity` (m/s, a sample every `period` s) and its derivatives by
    /// [`Self::changed`]'s changes.
    fn histories(&self, velocity: &[f64], period: f64) -> Vec<Vec<f64>>;
}

impl Searched for SealShape {
    fn surprise(&self) -> [f64; 3] {
        [
            (self.excess - 0.25) / 0.25,
            (self.stribeck_velocity / 4e-3).ln(),
            (self.sharpness / 3.0).ln() / 0.7,
        ]
    }

    fn changed(&self, changes: &[f64]) -> Self {
        let at = |i: usize| changes.get(i).copied().unwrap_or(0.0);
        Self {
            presliding: self.presliding * at(0).exp(),
            excess: (self.excess + at(1)).max(0.0),
            stribeck_velocity: self.stribeck_velocity * at(2).exp(),
            sharpness: (self.sharpness * at(3).exp()).clamp(1.0, 12.0),
            relaxation: (self.relaxation + 1e-3 * at(4)).max(0.0),
        }
    }

    fn histories(&self, velocity: &[f64], period: f64) -> Vec<Vec<f64>> {
        const CHANGE: f64 = 0.05;
        let history = |shape: &Self| Seals::new(*shape).history(velocity, period);
        let mut all = vec![history(self)];
        for i in 0..SHAPE {
            let beside = |sign: f64| {
                let mut changes = [0.0; SHAPE];
                changes[i] = sign * CHANGE;
                history(&self.changed(&changes))
            };
            // Upwards only: what may not be negative may be zero.
            let up = beside(1.0);
            let slope = up.iter().zip(&all[0]).map(|(a, b)| (a - b) / CHANGE);
            let slope = slope.collect();
            all.push(slope);
        }
        all
    }
}

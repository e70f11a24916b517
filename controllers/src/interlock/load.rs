//! The mass that the actuator moves, from force and motion.
//!
//! ```text
//! F = m a + m_s a_s + c v + f tanh(v / v_f) + k x + F_0
//! ```
//!
//! by recursive least squares (Ljung 1999, Section 11.2) without forgetting. `a_s` is the measured acceleration of a
//! specimen, 0 without one; a specimen that moves with the table cannot be distinguished from it, which the
//! standard error shows. `m` is compared with the stated mass as soon as that error allows, which is long before a motion
//! reaches its peak.

use units::constants::{G, INCH};

use super::InterlockInput;

/// Unknowns of the regression.
const COUNT: usize = 6;
/// Sizes of the regressors, which scale the start of the covariance.
const SIZES: [f64; COUNT] = [1.0, 1.0, 0.1, 1.0, 0.01, 1.0];
/// Speed at which friction has its full size, m/s.
const SLIDING: f64 = 0.1 * INCH;
/// A sample counts above this acceleration, m/s².
const STIRRED: f64 = 0.015 * G;
/// Fewest samples that count.
const FEWEST: usize = 50;
/// Samples in sequence that must contradict the stated mass.
const SUSTAINED: usize = 10;
/// Standard errors that must lie between.
const CERTAIN: f64 = 4.0;

/// The regression's memory.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Load {
    covariance: [[f64; COUNT]; COUNT],
    found: [f64; COUNT],
    /// Sum of the squares of the innovations over their expected growth, N².
    squares: f64,
    /// Samples that were used, and those in sequence that contradict.
    samples: usize,
    against: usize,
}

impl Load {
    /// The mass that moves and its standard error, kg; none before enough samples.
    pub(super) fn mass(&self) -> Option<[f64; 2]> {
        if self.samples < FEWEST {
            return None;
        }
        let p = &self.covariance;
        let variance = self.squares / (self.samples - COUNT) as f64;
        Some([self.found[0], (variance * p[0][0]).max(0.0).sqrt()])
    }

    /// Takes a sample; whether the mass is surely more than `tolerance` of the `stated` one (kg) above it. Noise of
    /// the accelerometer makes it smaller, so that a mass which seems too small says nothing.
    pub(super) fn exceeds(&mut self, input: &InterlockInput, stated: f64, tolerance: f64) -> bool {
        let y = &input.measured;
        let row = [
            y.acceleration,
            input.specimen_acceleration,
            y.velocity,
            (y.velocity / SLIDING).tanh(),
            y.displacement,
            1.0,
        ];
        let all = row.iter().chain([&input.measured_force]);
        if all.clone().any(|value| !value.is_finite()) {
            return false;
        }
        if y.acceleration.abs() >= STIRRED {
            self.take(&row, input.measured_force);
        }
        let off = self
            .mass()
            .is_some_and(|[mass, error]| mass - stated > tolerance * stated + CERTAIN * error);
        self.against = if off { self.against + 1 } else { 0 };
        self.against >= SUSTAINED
    }

    fn take(&mut self, row: &[f64; COUNT], force: f64) {
        if self.samples == 0 {
            for (n, size) in SIZES.iter().enumerate() {
                // A wide start: a hundred newton by each.
                self.covariance[n][n] = 1e4 / (size * size);
            }
        }
        let p = &mut self.covariance;
        let weighted: [f64; COUNT] =
            std::array::from_fn(|i| (0..COUNT).map(|j| p[i][j] * row[j]).sum());
        let expected = 1.0 + (0..COUNT).map(|i| row[i] * weighted[i]).sum::<f64>();
        let off = force - (0..COUNT).map(|i| row[i] * self.found[i]).sum::<f64>();
        for i in 0..COUNT {
            self.found[i] += weighted[i] / expected * off;
            for (entry, other) in p[i].iter_mut().zip(&weighted) {
                *entry -= weighted[i] * other / expected;
            }
        }
        self.squares += off * off / expected;
        self.samples = self.samples.saturating_add(1);
    }
}

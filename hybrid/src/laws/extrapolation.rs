//! Derivatives of a signal a little ahead of its latest sample.

use nalgebra::DMatrix;

use controllers::ModelError;

/// Derivatives that are given: the signal itself and five more.
pub const DERIVATIVES: usize = 6;

/// Name of the parameter of components that sets the window.
pub const WINDOW_SAMPLES: &str = "window_samples";

/// Longest window, samples.
const LONGEST: usize = 32;

/// A polynomial of some degree fitted by least squares to the latest samples of a signal, and its
/// derivatives at a time ahead of the latest.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Extrapolation {
    window: usize,
    /// Row i weighs the samples, the latest first, for derivative i per sample^i.
    weights: [[f64; LONGEST]; DERIVATIVES],
    past: [f64; LONGEST],
}

impl Extrapolation {
    /// Fits degree `degree` to `window` samples and evaluates `lead` samples ahead; derivatives
    /// above the degree are zero.
    ///
    /// # Errors
    /// Refuses windows that do not determine the polynomial or are longer than 32 samples, and
    /// leads that are not finite.
    pub fn new(degree: usize, window: usize, lead: f64) -> Result<Self, ModelError> {
        ModelError::require_finite("lead_samples", lead)?;
        if window <= degree || window > LONGEST {
            return Err(ModelError::Parameter {
                name: WINDOW_SAMPLES,
                value: window as f64,
                expected: "more samples than the degree, at most 32",
            });
        }
        // In units of the window, from -1 to 0.
        let span = (window - 1).max(1) as f64;
        let basis = DMatrix::from_fn(window, degree + 1, |i, j| {
            (-(i as f64) / span).powi(j as i32)
        });
        let Ok(fit) = basis.svd(true, true).pseudo_inverse(1e-14) else {
            return Err(ModelError::Parameter {
                name: WINDOW_SAMPLES,
                value: window as f64,
                expected: "a window that determines the polynomial",
            });
        };
        let mut weights = [[0.0; LONGEST]; DERIVATIVES];
        let at = lead / span;
        for (order, row) in weights.iter_mut().enumerate() {
            for power in order..=degree {
                let falling: f64 = (0..order).map(|n| (power - n) as f64).product();
                let factor = falling * at.powi((power - order) as i32) / span.powi(order as i32);
                for (i, weight) in row.iter_mut().take(window).enumerate() {
                    *weight += factor * fit[(power, i)];
                }
            }
        }
        Ok(Self {
            window,
            weights,
            past: [0.0; LONGEST],
        })
    }

    /// Takes the latest `value` of a signal sampled every `period` (s) and gives the derivatives,
    /// unit/s^i.
    #[inline]
    pub fn step(&mut self, value: f64, period: f64) -> [f64; DERIVATIVES] {
        self.past.copy_within(0..self.window - 1, 1);
        self.past[0] = value;
        let mut derivatives = [0.0; DERIVATIVES];
        let mut scale = 1.0;
        for (derivative, row) in derivatives.iter_mut().zip(&self.weights) {
            let mut sum = 0.0;
            for (weight, past) in row[..self.window].iter().zip(&self.past) {
                sum += weight * past;
            }
            *derivative = sum * scale;
            scale /= period;
        }
        derivatives
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.past = [0.0; LONGEST];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_continued_exactly() {
        let h = 0.01;
        for (degree, window) in [(3, 4), (3, 12), (5, 16)] {
            let mut law = Extrapolation::new(degree, window, 1.5).unwrap();
            let f = |t: f64| 1.0 + t - 2.0 * t * t + 0.5 * t.powi(3);
            let mut got = [0.0; DERIVATIVES];
            for k in 0..40 {
                got = law.step(f(k as f64 * h), h);
            }
            let t = (39.0 + 1.5) * h;
            let wanted = [f(t), 1.0 - 4.0 * t + 1.5 * t * t, -4.0 + 3.0 * t, 3.0];
            for i in 0..4 {
                assert!((got[i] - wanted[i]).abs() < 1e-5, "{degree} {i} {got:?}");
            }
        }
        assert!(Extrapolation::new(4, 4, 0.0).is_err());
        assert!(Extrapolation::new(4, 33, 0.0).is_err());
    }
}

//! Loop shaping: the second-order displacement controller of Section 3.4 as a sampled law.

use units::constants::INCH;

use crate::pid::{PidInput, VALVE_LIMIT, limit_and_integrate};
use crate::{Controller, ModelError};

/// `C(s) = g (s² + n1 s + n0) / (s (s + p))` on the displacement error (Eq 3-10).
///
/// As a sampled law it is discretised by the trapezoidal rule (Tustin) in the form
/// `u = g (e + (n1 - p) l + n0 ∫l dt)`, `dl/dt = e - p l`: exact for its integrator under an error
/// that is linear between samples. The integral stands still while the command is at its limit
/// and would be pushed further.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LoopShaping {
    /// The coefficients.
    pub coefficients: LoopShapingCoefficients,
    /// Largest magnitude of the valve command, V.
    pub limit: f64,
    /// What the law remembers.
    pub memory: LoopShapingMemory,
}

/// Coefficients of a controller of the form of Eq 3-10.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LoopShapingCoefficients {
    /// `g`, V/m.
    pub gain: f64,
    /// `n1`, 1/s.
    pub numerator_rate: f64,
    /// `n0`, 1/s².
    pub numerator_constant: f64,
    /// `p`, 1/s.
    pub pole: f64,
}

/// Memory of [`LoopShaping`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct LoopShapingMemory {
    /// Error at the previous sample, m.
    pub error: f64,
    /// Lagged error, m s.
    pub lag: f64,
    /// Integral part of the command, V.
    pub integral: f64,
}

impl LoopShapingCoefficients {
    /// Eq 3-10, `6.986 (s² + 0.2975 s + 0.5892) / (s (s + 0.01046))` V/in.
    pub fn equation_3_10() -> Self {
        Self {
            gain: 6.986 / INCH,
            numerator_rate: 0.2975,
            numerator_constant: 0.5892,
            pole: 0.01046,
        }
    }

    /// Checks the coefficients.
    ///
    /// # Errors
    /// A coefficient with which there is no such controller, by name.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_positive("gain", self.gain)?;
        ModelError::require_finite("numerator_rate", self.numerator_rate)?;
        ModelError::require_finite("numerator_constant", self.numerator_constant)?;
        ModelError::require_non_negative("pole", self.pole)
    }
}

impl LoopShaping {
    /// The law with these coefficients.
    pub fn new(coefficients: LoopShapingCoefficients) -> Self {
        Self {
            coefficients,
            limit: VALVE_LIMIT,
            memory: LoopShapingMemory::default(),
        }
    }

    /// The controller of Eq 3-10.
    pub fn equation_3_10() -> Self {
        Self::new(LoopShapingCoefficients::equation_3_10())
    }
}

impl Default for LoopShaping {
    fn default() -> Self {
        Self::equation_3_10()
    }
}

impl Controller for LoopShaping {
    type Input = PidInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.coefficients.validate()?;
        ModelError::require_positive("valve_limit", self.limit)
    }

    fn step(&mut self, input: &PidInput, period: f64) -> f64 {
        let LoopShapingCoefficients {
            gain,
            numerator_rate,
            numerator_constant,
            pole,
        } = self.coefficients;
        let memory = &mut self.memory;
        let half = 0.5 * period;
        let error = input.reference - input.measured;
        let lag = ((1.0 - pole * half) * memory.lag + half * (error + memory.error))
            / (1.0 + pole * half);
        let increment = gain * numerator_constant * half * (lag + memory.lag);
        let others = gain * (error + (numerator_rate - pole) * lag);
        memory.error = error;
        memory.lag = lag;
        limit_and_integrate(&mut memory.integral, increment, others, self.limit)
    }

    fn reset(&mut self) {
        self.memory = LoopShapingMemory::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sampled_law_is_tustins_transform_of_equation_3_10() {
        // Difference equation from s = (2 / h)(z - 1)/(z + 1), multiplied out by hand.
        let h = 0.002;
        let mut law = LoopShaping {
            limit: 1e9,
            ..LoopShaping::equation_3_10()
        };
        let LoopShapingCoefficients {
            gain: g,
            numerator_rate: n1,
            numerator_constant: n0,
            pole: p,
        } = law.coefficients;
        let w = 2.0 / h;
        let b = [w * w + n1 * w + n0, 2.0 * (n0 - w * w), w * w - n1 * w + n0];
        let a = [w * (w + p), -2.0 * w * w, w * (w - p)];
        let (mut e, mut u) = ([0.0; 2], [0.0; 2]);
        for k in 0..2000_i32 {
            let error = (f64::from(k) * 0.013).sin() * 1e-3;
            let command = law.step(
                &PidInput {
                    reference: error,
                    measured: 0.0,
                },
                h,
            );
            let expected =
                (g * (b[0] * error + b[1] * e[0] + b[2] * e[1]) - a[1] * u[0] - a[2] * u[1]) / a[0];
            assert!((command - expected).abs() < 1e-9, "{command} {expected}");
            e = [error, e[0]];
            u = [expected, u[0]];
        }
    }

    #[test]
    fn bad_coefficients_are_refused_by_name() {
        let mut law = LoopShaping::equation_3_10();
        law.coefficients.pole = -0.1;
        let error = law.validate().unwrap_err().to_string();
        assert!(error.contains("`pole` is -0.1"), "{error}");
        let mut law = LoopShaping::equation_3_10();
        law.coefficients.gain = 0.0;
        assert!(law.validate().unwrap_err().to_string().contains("`gain`"));
    }
}

//! Feed-forward by the inverse of a model, with or without proportional and integral control on
//! what is left.

use crate::vrths::TransferSystemParameters;
use units::vocabulary;

use super::TrackingInput;
use super::extrapolation::{DERIVATIVES, Extrapolation};
use controllers::{Controller, ModelError};

/// `u = sum_i a_i x_d^(i) + (P + I / s) (x_d - x_m)`, with `x_d` the desired displacement led by
/// some samples (Carrion and Spencer 2007, model-based compensation).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ModelInverse {
    /// `a_i`, s^i.
    pub coefficients: [f64; DERIVATIVES],
    /// `P`.
    pub proportional: f64,
    /// `I`, 1/s.
    pub integral: f64,
    /// Where the derivatives come from.
    pub desired: Extrapolation,
    /// Integral part of the command, m.
    pub integrated: f64,
}

impl ModelInverse {
    /// The inverse of a plant up to its derivative `order`, without feedback or lead.
    ///
    /// # Errors
    /// Refuses an order above 5.
    pub fn of(plant: &TransferSystemParameters, order: usize) -> Result<Self, ModelError> {
        let mut coefficients = plant.inverse();
        for coefficient in coefficients.iter_mut().skip(order + 1) {
            *coefficient = 0.0;
        }
        Ok(Self {
            coefficients,
            proportional: 0.0,
            integral: 0.0,
            desired: Extrapolation::new(order, order + 1, 0.0)?,
            integrated: 0.0,
        })
    }

    /// The transfer system without a specimen: no mass, and a spring of 1 N/m.
    pub fn without_specimen() -> TransferSystemParameters {
        TransferSystemParameters {
            specimen_mass: f64::MIN_POSITIVE,
            specimen_stiffness: 1.0,
            specimen_damping_ratio: 0.0,
            ..TransferSystemParameters::default()
        }
    }
}

impl Controller for ModelInverse {
    type Input = TrackingInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        for coefficient in self.coefficients {
            ModelError::require_finite("coefficients", coefficient)?;
        }
        ModelError::require_finite(vocabulary::PROPORTIONAL_GAIN, self.proportional)?;
        ModelError::require_finite(vocabulary::INTEGRAL_GAIN, self.integral)
    }

    fn step(&mut self, input: &TrackingInput, period: f64) -> f64 {
        let desired = self.desired.step(input.desired, period);
        let forward: f64 = self
            .coefficients
            .iter()
            .zip(&desired)
            .map(|(a, x)| a * x)
            .sum();
        let error = desired[0] - input.measured;
        self.integrated += self.integral * period * error;
        forward + self.proportional * error + self.integrated
    }

    fn reset(&mut self) {
        self.integrated = 0.0;
        self.desired.reset();
    }
}

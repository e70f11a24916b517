//! Disturbance model of the prediction: an independent random walk on each output (Eq 5-6).

use nalgebra::Vector3;
use units::constants::INCH;

use crate::ModelError;

/// Outputs are displacement, velocity and acceleration; each carries a random walk that moves by
/// `C_d B_d d[k]` a sample, `d` white with unit variance, and that the horizon holds constant.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct OutputDisturbance {
    /// Diagonal of `B_d`.
    pub input: [f64; 3],
    /// Diagonal of `C_d`: m, m/s, m/s² per unit of state.
    pub output: [f64; 3],
}

impl OutputDisturbance {
    /// Eq 5-6, converted from in, in/s, in/s².
    pub fn equation_5_6() -> Self {
        Self {
            input: [0.002, 0.002, 0.008],
            output: [1e4, 1e4, 2.5e4].map(|gain| gain * INCH),
        }
    }

    /// Checks the gains.
    ///
    /// # Errors
    /// A gain that is not positive: a walk that nothing drives cannot be estimated.
    pub fn validate(&self) -> Result<(), ModelError> {
        for value in self.input {
            ModelError::require_positive("disturbance_input_gain", value)?;
        }
        for value in self.output {
            ModelError::require_positive("disturbance_output_gain", value)?;
        }
        Ok(())
    }

    /// Standard deviation of a sample's move of each walk: m, m/s, m/s².
    pub fn step(&self) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.input[i] * self.output[i])
    }
}

impl Default for OutputDisturbance {
    fn default() -> Self {
        Self::equation_5_6()
    }
}

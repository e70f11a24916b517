//! The sliding mode control of H. Li, A. Maghareh, J. W. Condori Uribe, H. Montoya, S. J. Dyke and
//! Z. Xu, "Sliding mode control design for the benchmark problem in real-time hybrid simulation",
//! Mechanical Systems and Signal Processing 151 (2021), with the constants of its published
//! program.

use crate::vrths::TransferSystemParameters;

use super::TrackingInput;
use super::extrapolation::Extrapolation;
use controllers::{Controller, ModelError};

/// The actuator reduced to `a / (s² + b s + c)` behind a lag `(d s + 1) / (e s + 1)`, which a lead
/// takes out; on the rest
///
/// ```text
/// sigma = e' + lambda e,   e = x - x_d
/// v = (x_d'' - lambda e' + b x' + c x - kappa sat(sigma / phi)) / a
/// kappa = beta_b b |x'| + beta_c c |x| + eta
/// ```
///
/// `x`, `x'` are the states of the reduced model, corrected by the measured displacement with
/// `observer_gain`. The published program designs its Kalman filter without process noise, so that
/// this gain is zero and the law follows its model: it is a feed-forward.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TrackingSlidingMode {
    /// `a`, 1/s².
    pub model_gain: f64,
    /// `b`, 1/s.
    pub model_damping: f64,
    /// `c`, 1/s².
    pub model_stiffness: f64,
    /// `d`, s.
    pub lag_zero: f64,
    /// `e`, s.
    pub lag_pole: f64,
    /// `lambda`, 1/s.
    pub rate: f64,
    /// `beta_b`.
    pub damping_uncertainty: f64,
    /// `beta_c`.
    pub stiffness_uncertainty: f64,
    /// `eta`, m/s².
    pub reaching: f64,
    /// `phi`, m/s; the program switches, which a sampled law cannot follow.
    pub boundary_layer: f64,
    /// Correction of displacement (1/s) and velocity (1/s²) of the model by the measurement.
    pub observer_gain: [f64; 2],
    /// Where the derivatives of the desired displacement come from; the program reads them from
    /// the numerical substructure.
    pub desired: Extrapolation,
    /// What the law remembers.
    pub memory: TrackingSlidingModeMemory,
}

/// Memory of [`TrackingSlidingMode`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct TrackingSlidingModeMemory {
    displacement: f64,
    velocity: f64,
    unled: f64,
    command: f64,
}

impl TrackingSlidingMode {
    /// The published law; its lead by one sample is that of the derivatives. The published model
    /// leaves the command gain out, as its plant does; here it is part of both.
    ///
    /// # Errors
    /// None with these constants.
    pub fn published() -> Result<Self, ModelError> {
        Ok(Self {
            model_gain: 53_354.0 * TransferSystemParameters::default().command_gain,
            model_damping: 221.64,
            model_stiffness: 54_290.0,
            lag_zero: 0.000_105_95,
            lag_pole: 0.021_072,
            rate: 150.0,
            damping_uncertainty: 0.36,
            stiffness_uncertainty: 0.1,
            reaching: 0.1,
            boundary_layer: 5e-3,
            observer_gain: [0.0; 2],
            desired: Extrapolation::new(3, 8, 1.0)?,
            memory: TrackingSlidingModeMemory::default(),
        })
    }
}

impl Controller for TrackingSlidingMode {
    type Input = TrackingInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_positive("model_gain", self.model_gain)?;
        ModelError::require_positive("model_damping", self.model_damping)?;
        ModelError::require_positive("model_stiffness", self.model_stiffness)?;
        ModelError::require_positive("lag_zero", self.lag_zero)?;
        ModelError::require_positive("lag_pole", self.lag_pole)?;
        ModelError::require_positive("rate", self.rate)?;
        ModelError::require_non_negative("damping_uncertainty", self.damping_uncertainty)?;
        ModelError::require_non_negative("stiffness_uncertainty", self.stiffness_uncertainty)?;
        ModelError::require_non_negative("reaching", self.reaching)?;
        ModelError::require_positive("boundary_layer", self.boundary_layer)
    }

    fn step(&mut self, input: &TrackingInput, period: f64) -> f64 {
        let [wanted, wanted_rate, wanted_acceleration, ..] =
            self.desired.step(input.desired, period);
        let memory = &mut self.memory;
        let (x, v) = (memory.displacement, memory.velocity);
        let error_rate = v - wanted_rate;
        let surface = error_rate + self.rate * (x - wanted);
        let switching = self.damping_uncertainty * self.model_damping * v.abs()
            + self.stiffness_uncertainty * self.model_stiffness * x.abs()
            + self.reaching;
        let acceleration = wanted_acceleration
            - self.rate * error_rate
            - switching * (surface / self.boundary_layer).clamp(-1.0, 1.0);
        let unled =
            (acceleration + self.model_damping * v + self.model_stiffness * x) / self.model_gain;

        // The lead (e s + 1) / (d s + 1) by Tustin's rule.
        let rate = 2.0 / period;
        let command = ((1.0 + self.lag_pole * rate) * unled
            + (1.0 - self.lag_pole * rate) * memory.unled
            - (1.0 - self.lag_zero * rate) * memory.command)
            / (1.0 + self.lag_zero * rate);
        (memory.unled, memory.command) = (unled, command);

        // The model moves as it was told, but for the correction.
        let innovation = input.measured - x;
        memory.displacement +=
            period * (v + 0.5 * period * acceleration + self.observer_gain[0] * innovation);
        memory.velocity += period * (acceleration + self.observer_gain[1] * innovation);
        command
    }

    fn reset(&mut self) {
        self.memory = TrackingSlidingModeMemory::default();
        self.desired.reset();
    }
}

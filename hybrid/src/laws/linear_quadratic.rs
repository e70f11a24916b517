//! Linear quadratic Gaussian tracking: a model's inverse, state feedback on what is left, and a
//! Kalman filter that gives the states and the disturbance at the command.

use crate::vrths::TransferSystemParameters;
use nalgebra::{DMatrix, DVector};
use plant::linear::{StateSpace, discrete_riccati};
use units::vocabulary;

use super::TrackingInput;
use super::extrapolation::{DERIVATIVES, Extrapolation};
use controllers::mpc::kalman::SteadyStateKalmanFilter;
use controllers::{Controller, ModelError};

/// States of the plant: displacement and four derivatives over `SCALE^i`.
const STATES: usize = 5;
/// With the disturbance at the command.
const ALL: usize = STATES + 1;
/// Time of the states' scaling, 1/s.
const SCALE: f64 = 150.0;

/// What the law is designed for.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LinearQuadraticDesign {
    /// Weight of the command's square against that of the displacement error's.
    pub command_weight: f64,
    /// Standard deviation of white noise on the command, m.
    pub command_noise: f64,
    /// Step of the disturbance's random walk at the command a sample, one standard deviation, m.
    pub disturbance_step: f64,
    /// Noise of the measured displacement, one standard deviation, m.
    pub measurement_noise: f64,
    /// Lead of the desired displacement, samples.
    pub lead: f64,
}

impl Default for LinearQuadraticDesign {
    fn default() -> Self {
        Self {
            command_weight: 1.0,
            command_noise: 1e-5,
            disturbance_step: 1e-5,
            measurement_noise: 1.6e-5,
            lead: 1.5,
        }
    }
}

/// `u = sum_i a_i x_d^(i) + K (X_d - X) - w`, with states `X` and disturbance `w` from a Kalman
/// filter on a nominal plant.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LinearQuadraticTracking {
    inverse: [f64; DERIVATIVES],
    feedback: [f64; STATES],
    transition: [[f64; ALL]; ALL],
    input: [f64; ALL],
    correction: [f64; ALL],
    desired: Extrapolation,
    estimate: [f64; ALL],
}

impl LinearQuadraticTracking {
    /// Designs the law for `plant`, sampled every `period` (s).
    ///
    /// # Errors
    /// Weights and noises for which a Riccati equation has no stabilising solution.
    pub fn design(
        plant: &TransferSystemParameters,
        design: &LinearQuadraticDesign,
        period: f64,
    ) -> Result<Self, ModelError> {
        plant.validate()?;
        ModelError::require_positive(vocabulary::COMMAND_WEIGHT, design.command_weight)?;
        let denominator = plant.denominator();
        let mut a = DMatrix::zeros(STATES, STATES);
        let mut b = DMatrix::zeros(STATES, 1);
        for i in 0..STATES {
            if i + 1 < STATES {
                a[(i, i + 1)] = SCALE;
            }
            let power = SCALE.powi(i as i32 + 1 - STATES as i32);
            a[(STATES - 1, i)] -= denominator[i] / denominator[STATES] * power;
        }
        b[(STATES - 1, 0)] = plant.command_gain * plant.valve_gain / denominator[STATES]
            * SCALE.powi(1 - STATES as i32);
        let one = |i: usize, j: usize| DMatrix::from_fn(i, j, |i, j| f64::from(i == j));
        let sampled = StateSpace::new(a, b, one(1, STATES), DMatrix::zeros(1, 1))?.sample(period);
        let (a, b) = (&sampled.a, &sampled.b);

        let mut weight = DMatrix::zeros(STATES, STATES);
        weight[(0, 0)] = 1.0;
        let r = DMatrix::from_element(1, 1, design.command_weight);
        let x = discrete_riccati(a, b, &weight, &r)?;
        let bx = b.transpose() * &x;
        let gain = &bx * a / ((&bx * b)[(0, 0)] + design.command_weight);

        let mut transition = one(ALL, ALL);
        transition.view_mut((0, 0), (STATES, STATES)).copy_from(a);
        transition.view_mut((0, STATES), (STATES, 1)).copy_from(b);
        let mut q = DMatrix::zeros(ALL, ALL);
        q.view_mut((0, 0), (STATES, STATES))
            .copy_from(&(b * b.transpose() * design.command_noise.powi(2)));
        q[(STATES, STATES)] = design.disturbance_step.powi(2);
        let measured = one(1, ALL);
        let noise = DMatrix::from_element(1, 1, design.measurement_noise.powi(2));
        let filter = SteadyStateKalmanFilter::new(&transition, &measured, &q, &noise)?;

        // The held command is late by half a sample, which the inverse takes out with a lead.
        let vector = |v: &DVector<f64>| std::array::from_fn(|i| v[i]);
        Ok(Self {
            inverse: super::held_inverse(plant.inverse(), period),
            feedback: std::array::from_fn(|i| gain[(0, i)]),
            transition: std::array::from_fn(|i| std::array::from_fn(|j| transition[(i, j)])),
            input: std::array::from_fn(|i| if i < STATES { b[(i, 0)] } else { 0.0 }),
            correction: vector(&filter.gain.column(0).into_owned()),
            desired: Extrapolation::new(5, 16, design.lead)?,
            estimate: [0.0; ALL],
        })
    }
}

impl Controller for LinearQuadraticTracking {
    type Input = TrackingInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        for value in self.feedback {
            ModelError::require_finite("feedback", value)?;
        }
        Ok(())
    }

    fn step(&mut self, input: &TrackingInput, period: f64) -> f64 {
        let innovation = input.measured - self.estimate[0];
        for (state, gain) in self.estimate.iter_mut().zip(&self.correction) {
            *state += gain * innovation;
        }
        let desired = self.desired.step(input.desired, period);
        let mut command: f64 = self.inverse.iter().zip(&desired).map(|(a, x)| a * x).sum();
        let mut scale = 1.0;
        for i in 0..STATES {
            command += self.feedback[i] * (desired[i] * scale - self.estimate[i]);
            scale /= SCALE;
        }
        command -= self.estimate[STATES];
        let before = self.estimate;
        for i in 0..ALL {
            let mut sum = self.input[i] * command;
            for j in 0..ALL {
                sum += self.transition[i][j] * before[j];
            }
            self.estimate[i] = sum;
        }
        command
    }

    fn reset(&mut self) {
        self.estimate = [0.0; ALL];
        self.desired.reset();
    }
}

#[cfg(test)]
mod tests {
    use crate::vrths::{PERIOD, TransferSystem};

    use super::*;

    #[test]
    fn a_constant_disturbance_at_the_command_is_taken_out() {
        let plant = TransferSystemParameters::default();
        let design = LinearQuadraticDesign::default();
        let mut law = LinearQuadraticTracking::design(&plant, &design, PERIOD).unwrap();
        let mut system = TransferSystem::default();
        for _ in 0..3 * 4096 {
            let input = TrackingInput {
                desired: 1e-3,
                measured: system.state.displacement,
                force: 0.0,
            };
            let command = law.step(&input, PERIOD);
            system.step(command + 2e-4);
        }
        assert!((system.state.displacement - 1e-3).abs() < 1e-7);
        let none = LinearQuadraticDesign {
            command_weight: 0.0,
            ..design
        };
        assert!(LinearQuadraticTracking::design(&plant, &none, PERIOD).is_err());
    }
}

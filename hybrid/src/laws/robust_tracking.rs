//! Loop shaping for tracking: a model's inverse, and feedback on what is left that is synthesised
//! to withstand the largest uncertainty of the shaped plant's coprime factors.

use crate::vrths::TransferSystemParameters;
use nalgebra::DMatrix;
use plant::linear::{StateSpace, TransferFunction};

use super::TrackingInput;
use super::extrapolation::{DERIVATIVES, Extrapolation};
use controllers::synthesis::coprime;
use controllers::{Controller, ModelError};

/// Order of plant and weight together, which is that of the robust controller.
const SHAPED: usize = 6;
/// Order of the feedback: robust controller and weight.
const ORDER: usize = SHAPED + 1;
/// `gamma` over its minimum.
const GAMMA_FACTOR: f64 = 1.1;

/// `u = sum_i a_i x_d^(i) + C (x_d - x_m)`, `C = W K` with the weight
/// `W = (w_c / s) (1 + s / w_z)` and `K` by robust stabilisation of `W G` (Glover and McFarlane).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RobustTracking {
    inverse: [f64; DERIVATIVES],
    transition: [[f64; ORDER]; ORDER],
    input: [f64; ORDER],
    output: [f64; ORDER],
    feedthrough: f64,
    gamma_min: f64,
    desired: Extrapolation,
    state: [f64; ORDER],
}

impl RobustTracking {
    /// Synthesises the law for `plant`, sampled every `period` (s): integral action with crossover
    /// `crossover` (rad/s), a zero of the weight at `zero` (rad/s), and the desired displacement
    /// led by `lead` samples.
    ///
    /// # Errors
    /// A target for which the synthesis has no solution.
    pub fn synthesise(
        plant: &TransferSystemParameters,
        crossover: f64,
        zero: f64,
        lead: f64,
        period: f64,
    ) -> Result<Self, ModelError> {
        plant.validate()?;
        ModelError::require_positive("crossover", crossover)?;
        ModelError::require_positive("zero", zero)?;
        // Time in 1 / crossover.
        let denominator: Vec<f64> = plant
            .denominator()
            .iter()
            .enumerate()
            .rev()
            .map(|(i, a)| a * crossover.powi(i as i32))
            .collect();
        let gain = plant.command_gain * plant.valve_gain;
        let model = TransferFunction::new(&[gain], &denominator)?;
        let weight = TransferFunction::new(&[crossover / zero, 1.0], &[1.0, 0.0])?;
        let shaped = weight.series(&model).to_state_space()?;
        let robust = coprime::stabilise(&shaped, GAMMA_FACTOR)?;
        let k = &robust.controller;
        let w = weight.to_state_space()?;
        if k.order() != SHAPED || w.order() != 1 {
            return Err(ModelError::Shape {
                what: "controller of the synthesis",
                expected: format!("order {SHAPED}"),
                got: format!("order {}", k.order()),
            });
        }
        // W behind K: the states of K, then that of W.
        let mut a = DMatrix::zeros(ORDER, ORDER);
        a.view_mut((0, 0), (SHAPED, SHAPED)).copy_from(&k.a);
        a.view_mut((SHAPED, 0), (1, SHAPED))
            .copy_from(&(&w.b * &k.c));
        a.view_mut((SHAPED, SHAPED), (1, 1)).copy_from(&w.a);
        let mut b = DMatrix::zeros(ORDER, 1);
        b.view_mut((0, 0), (SHAPED, 1)).copy_from(&k.b);
        b.view_mut((SHAPED, 0), (1, 1)).copy_from(&(&w.b * &k.d));
        let mut c = DMatrix::zeros(1, ORDER);
        c.view_mut((0, 0), (1, SHAPED)).copy_from(&(&w.d * &k.c));
        c.view_mut((0, SHAPED), (1, 1)).copy_from(&w.c);
        let sampled = StateSpace::new(a * crossover, b * crossover, c, &w.d * &k.d)?.sample(period);
        Ok(Self {
            inverse: super::held_inverse(plant.inverse(), period),
            transition: std::array::from_fn(|i| std::array::from_fn(|j| sampled.a[(i, j)])),
            input: std::array::from_fn(|i| sampled.b[(i, 0)]),
            output: std::array::from_fn(|i| sampled.c[(0, i)]),
            feedthrough: sampled.d[(0, 0)],
            gamma_min: robust.gamma_min,
            desired: Extrapolation::new(5, 16, lead)?,
            state: [0.0; ORDER],
        })
    }

    /// The smallest `gamma` that any controller reaches; below about 4 the target suits the plant.
    pub fn gamma_min(&self) -> f64 {
        self.gamma_min
    }
}

impl Controller for RobustTracking {
    type Input = TrackingInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("feedthrough", self.feedthrough)
    }

    fn step(&mut self, input: &TrackingInput, period: f64) -> f64 {
        let desired = self.desired.step(input.desired, period);
        let error = desired[0] - input.measured;
        let mut command = self.feedthrough * error;
        for (a, x) in self.inverse.iter().zip(&desired) {
            command += a * x;
        }
        let before = self.state;
        for i in 0..ORDER {
            command += self.output[i] * before[i];
            let mut sum = self.input[i] * error;
            for j in 0..ORDER {
                sum += self.transition[i][j] * before[j];
            }
            self.state[i] = sum;
        }
        command
    }

    fn reset(&mut self) {
        self.state = [0.0; ORDER];
        self.desired.reset();
    }
}

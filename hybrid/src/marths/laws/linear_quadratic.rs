//! Linear quadratic Gaussian tracking with integral action for both actuators at once.

use controllers::mpc::kalman::SteadyStateKalmanFilter;
use nalgebra::{DMatrix, SMatrix, SVector};
use plant::ModelError;
use plant::linear::discrete_riccati;
use units::vocabulary;

use super::{Inverse, Law};
use crate::marths::{NOISE, Pair, PlantParameters, Volts};

/// States of the plant: four behind each command.
const STATES: usize = 8;
/// With a constant disturbance at each command, which makes the integral action.
const ALL: usize = STATES + 2;

/// What the law is designed for.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LinearQuadraticDesign {
    /// Weight of a command's square against that of a stroke's error.
    pub command_weight: f64,
    /// White noise at each command, one standard deviation, m.
    pub command_noise: f64,
    /// Step of the disturbance at each command a sample, one standard deviation, m.
    pub disturbance_step: f64,
    /// Noise of the measured strokes, one standard deviation, m.
    pub measurement_noise: f64,
}

impl Default for LinearQuadraticDesign {
    fn default() -> Self {
        Self {
            command_weight: 0.1,
            command_noise: 1e-5,
            disturbance_step: 1e-5,
            measurement_noise: NOISE,
        }
    }
}

/// `u = u_f + K (X_f - X) - w`: the inverse's command `u_f` with the states `X_f` that it leads the model
/// through, and the states `X` and disturbances `w` of a Kalman filter.
#[derive(Debug, Clone)]
pub struct LinearQuadratic {
    inverse: Inverse,
    transition: SMatrix<f64, ALL, ALL>,
    input: SMatrix<f64, ALL, 2>,
    output: SMatrix<f64, 2, ALL>,
    correction: SMatrix<f64, ALL, 2>,
    feedback: SMatrix<f64, 2, STATES>,
    wanted: SVector<f64, ALL>,
    estimate: SVector<f64, ALL>,
    range: [Pair; 2],
}

impl LinearQuadratic {
    /// At rest.
    ///
    /// # Errors
    /// As [`Inverse::new`]; weights and noises for which a Riccati equation has no stabilising solution.
    pub fn new(
        plant: PlantParameters,
        design: &LinearQuadraticDesign,
        order: usize,
        window: usize,
    ) -> Result<Self, ModelError> {
        let inverse = Inverse::new(plant, order, window)?;
        ModelError::require_positive(vocabulary::COMMAND_WEIGHT, design.command_weight)?;
        // Both maps are linear: their columns are what unit states and commands give.
        let unit = |place: usize| -> [[f64; 4]; 2] {
            [0, 1].map(|i| std::array::from_fn(|k| f64::from(u8::from(4 * i + k == place))))
        };
        let mut a = DMatrix::zeros(STATES, STATES);
        let mut b = DMatrix::zeros(STATES, 2);
        let mut c = DMatrix::zeros(2, STATES);
        for place in 0..STATES {
            let states = unit(place);
            for (i, column) in plant.columns.iter().enumerate() {
                for (k, value) in column.after(states[i], 0.0).into_iter().enumerate() {
                    a[(4 * i + k, place)] = value;
                }
            }
            for (i, stroke) in plant.strokes(&states).into_iter().enumerate() {
                c[(i, place)] = stroke;
            }
        }
        for (i, column) in plant.columns.iter().enumerate() {
            for (k, value) in column.after([0.0; 4], 1.0).into_iter().enumerate() {
                b[(4 * i + k, i)] = value;
            }
        }
        let weight = DMatrix::identity(2, 2) * design.command_weight;
        let x = discrete_riccati(&a, &b, &(c.transpose() * &c), &weight)?;
        let bx = b.transpose() * &x;
        let unsolvable = ModelError::Parameter {
            name: vocabulary::COMMAND_WEIGHT,
            value: design.command_weight,
            expected: "a weight with which the gain can be computed",
        };
        let gain = (&bx * &b + weight)
            .lu()
            .solve(&(&bx * &a))
            .ok_or(unsolvable)?;

        let mut transition = DMatrix::identity(ALL, ALL);
        transition.view_mut((0, 0), (STATES, STATES)).copy_from(&a);
        transition.view_mut((0, STATES), (STATES, 2)).copy_from(&b);
        let mut measured = DMatrix::zeros(2, ALL);
        measured.view_mut((0, 0), (2, STATES)).copy_from(&c);
        let mut noise = DMatrix::zeros(ALL, ALL);
        noise
            .view_mut((0, 0), (STATES, STATES))
            .copy_from(&(&b * b.transpose() * design.command_noise.powi(2)));
        for i in STATES..ALL {
            noise[(i, i)] = design.disturbance_step.powi(2);
        }
        let readings = DMatrix::identity(2, 2) * design.measurement_noise.powi(2);
        let filter = SteadyStateKalmanFilter::new(&transition, &measured, &noise, &readings)?;
        Ok(Self {
            inverse,
            transition: SMatrix::from_fn(|i, j| transition[(i, j)]),
            input: SMatrix::from_fn(|i, j| if i < STATES { b[(i, j)] } else { 0.0 }),
            output: SMatrix::from_fn(|i, j| measured[(i, j)]),
            correction: SMatrix::from_fn(|i, j| filter.gain[(i, j)]),
            feedback: SMatrix::from_fn(|i, j| gain[(i, j)]),
            wanted: SVector::zeros(),
            estimate: SVector::zeros(),
            range: Volts::default().range(),
        })
    }
}

impl Law for LinearQuadratic {
    fn feedback(&mut self, measured: Pair) -> Pair {
        let innovation = SVector::from(measured) - self.output * self.estimate;
        self.estimate += self.correction * innovation;
        measured
    }

    fn step(&mut self, target: Pair, measured: Pair) -> Pair {
        let forward = SVector::from(self.inverse.step(target, measured));
        let off = (self.wanted - self.estimate)
            .fixed_rows::<STATES>(0)
            .into_owned();
        let disturbance = self.estimate.fixed_rows::<2>(STATES).into_owned();
        let command = forward + self.feedback * off - disturbance;
        let command = [0, 1].map(|i| command[i].clamp(self.range[i][0], self.range[i][1]));
        self.estimate = self.transition * self.estimate + self.input * SVector::from(command);
        self.wanted = self.transition * self.wanted + self.input * forward;
        command
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marths::{Plant, RATE};

    /// Static gains 5 % off and a push at a command: without integral action either stays as an error.
    #[test]
    fn constant_targets_are_reached_though_plant_and_commands_are_off() {
        let nominal = PlantParameters::default();
        let mut plant = nominal;
        plant.static_gain = plant.static_gain.map(|row| row.map(|gain| 1.05 * gain));
        let mut plant = Plant::new(plant).unwrap();
        let design = LinearQuadraticDesign::default();
        let mut law = LinearQuadratic::new(nominal, &design, 2, 12).unwrap();
        let target = [1e-3, -5e-4];
        for _ in 0..(6.0 * RATE) as usize {
            let strokes = law.feedback(plant.strokes());
            let command = law.step(target, strokes);
            plant.step([command[0] + 2e-4, command[1]]);
        }
        for (stroke, target) in plant.strokes().into_iter().zip(target) {
            assert!((stroke - target).abs() < 1e-7, "{stroke} {target}");
        }
        let free = LinearQuadraticDesign {
            command_weight: 0.0,
            ..design
        };
        assert!(LinearQuadratic::new(nominal, &free, 2, 12).is_err());
    }
}

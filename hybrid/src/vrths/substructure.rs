//! The numerical substructure: what remains of a frame when the specimen is taken out.

use nalgebra::{DMatrix, DVector};

use plant::ModelError;

use super::Frame;
use plant::linear::matrix_of;

/// Ground acceleration (m/s²) at the beginning, the middle and the end of a step.
pub type GroundMotion = [f64; 3];

/// `M_n x_n'' + C_n x_n' + K_n x_n = -M 1 a_g - e f`, integrated by the classical Runge-Kutta
/// method of order 4 with the force `f` held over each step; `e` picks the degree of freedom that
/// the specimen is attached to. The force that is fed is a number of samples old.
///
/// Any frame will do; being linear, a step is one matrix, computed when it is made.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NumericalSubstructure {
    order: usize,
    period: f64,
    /// `2 n` rows of `2 n + 4`: states, force, ground acceleration thrice.
    step: Vec<f64>,
    /// `n` rows of `2 n + 1`: relative acceleration from states and force, without the ground's.
    acceleration: Vec<f64>,
    /// `M_n^-1 M 1`, by which the ground's acceleration enters.
    influence: Vec<f64>,
    state: Vec<f64>,
    scratch: Vec<f64>,
    /// Forces that are not yet fed, the oldest first, N.
    waiting: Vec<f64>,
}

impl NumericalSubstructure {
    /// What remains of `frame` when mass, damping and stiffness of a specimen (`[kg, N s/m, N/m]`)
    /// are taken off its degree of freedom `interface` (from 0), at rest. Forces are fed
    /// `force_delay` samples late.
    ///
    /// # Errors
    /// Refuses frames whose matrices do not fit, and a mass that does not stay positive.
    pub fn new(
        frame: &Frame,
        specimen: [f64; 3],
        interface: usize,
        force_delay: usize,
        period: f64,
    ) -> Result<Self, ModelError> {
        frame.validate()?;
        ModelError::require_positive("period", period)?;
        let n = frame.order();
        if interface >= n {
            return Err(ModelError::Parameter {
                name: "interface",
                value: interface as f64,
                expected: "a degree of freedom of the frame",
            });
        }
        let without = |matrix: &DMatrix<f64>, part: f64| {
            let mut rest = matrix.clone();
            rest[(interface, interface)] -= part;
            rest
        };
        let mass = without(&frame.mass, specimen[0]);
        let Some(inverse) = mass.cholesky().map(|factor| factor.inverse()) else {
            return Err(ModelError::NotForSimulation {
                model: "numerical substructure",
                reason: "its mass matrix without the specimen is not positive definite".to_string(),
            });
        };
        let damping = &inverse * without(&frame.damping, specimen[1]);
        let stiffness = &inverse * without(&frame.stiffness, specimen[2]);
        let influence = &inverse * &frame.mass * DVector::from_element(n, 1.0);
        let push = inverse.column(interface).into_owned();

        let slope = |x: &DVector<f64>, force: f64, ground: f64| {
            let (position, velocity) = (x.rows(0, n), x.rows(n, n));
            let acceleration = -(&damping * velocity)
                - &stiffness * position
                - &push * force
                - &influence * ground;
            let mut slope = DVector::zeros(2 * n);
            slope.rows_mut(0, n).copy_from(&velocity);
            slope.rows_mut(n, n).copy_from(&acceleration);
            slope
        };
        let step = matrix_of(2 * n + 4, 2 * n, |from, to| {
            let x = DVector::from_column_slice(&from[..2 * n]);
            let (force, ground) = (from[2 * n], &from[2 * n + 1..]);
            let k1 = slope(&x, force, ground[0]);
            let k2 = slope(&(&x + &k1 * (0.5 * period)), force, ground[1]);
            let k3 = slope(&(&x + &k2 * (0.5 * period)), force, ground[1]);
            let k4 = slope(&(&x + &k3 * period), force, ground[2]);
            let next = x + (k1 + (k2 + k3) * 2.0 + k4) * (period / 6.0);
            to.copy_from_slice(next.as_slice());
        });
        let acceleration = matrix_of(2 * n + 1, n, |from, to| {
            let x = DVector::from_column_slice(&from[..2 * n]);
            to.copy_from_slice(&slope(&x, from[2 * n], 0.0).as_slice()[n..]);
        });
        Ok(Self {
            order: n,
            period,
            step,
            acceleration,
            influence: influence.as_slice().to_vec(),
            state: vec![0.0; 2 * n],
            scratch: vec![0.0; 2 * n],
            waiting: vec![0.0; force_delay],
        })
    }

    /// Number of degrees of freedom.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Length of a step, s.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Goes on from where `other`, a substructure of the same frame, is.
    pub fn resume(&mut self, other: &Self) {
        self.state.clone_from(&other.state);
        self.waiting.clone_from(&other.waiting);
    }

    /// Displacements, m.
    pub fn displacements(&self) -> &[f64] {
        &self.state[..self.order]
    }

    /// Velocities relative to the ground, m/s.
    pub fn velocities(&self) -> &[f64] {
        &self.state[self.order..]
    }

    /// Total acceleration of degree of freedom `i`, m/s², under a ground acceleration of `ground`
    /// and the force that is about to be fed: the oldest that waits, or `force` where none does.
    pub fn total_acceleration(&self, i: usize, force: f64, ground: f64) -> f64 {
        let width = 2 * self.order + 1;
        let row = &self.acceleration[i * width..(i + 1) * width];
        let force = self.waiting.first().copied().unwrap_or(force);
        let relative: f64 = row.iter().zip(&self.state).map(|(a, x)| a * x).sum();
        relative + row[width - 1] * force + (1.0 - self.influence[i]) * ground
    }

    /// Puts it at rest.
    pub fn reset(&mut self) {
        self.state.fill(0.0);
        self.waiting.fill(0.0);
    }

    /// Advances one period with `force` (N), measured at its beginning, entering the delay.
    #[inline]
    pub fn step(&mut self, force: f64, ground: GroundMotion) {
        let fed = match self.waiting.first().copied() {
            None => force,
            Some(oldest) => {
                self.waiting.rotate_left(1);
                if let Some(last) = self.waiting.last_mut() {
                    *last = force;
                }
                oldest
            }
        };
        let states = 2 * self.order;
        for (row, next) in self.step.chunks_exact(states + 4).zip(&mut self.scratch) {
            let (from_states, inputs) = row.split_at(states);
            let mut sum = inputs[0] * fed;
            for (a, x) in from_states.iter().zip(&self.state) {
                sum += a * x;
            }
            for (b, a_g) in inputs[1..].iter().zip(ground) {
                sum += b * a_g;
            }
            *next = sum;
        }
        std::mem::swap(&mut self.state, &mut self.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vrths::{BenchmarkCase, ReferenceFrame};

    /// Fed without delay with the exact force of the specimen at the middle of the step, the
    /// substructure is the whole frame.
    #[test]
    fn the_two_parts_make_the_whole() {
        let frame = BenchmarkCase::ALL[0].frame();
        let specimen = [0.0, 0.0, 1.19e6];
        let h = 1.0 / 4096.0;
        let mut part = NumericalSubstructure::new(&frame, specimen, 0, 0, h).unwrap();
        let mut whole = ReferenceFrame::new(&frame, h).unwrap();
        let ground = |t: f64| 3.0 * (20.0 * t).sin();
        let mut worst: f64 = 0.0;
        for k in 0..8192 {
            let t = k as f64 * h;
            let (x, v) = (part.displacements()[0], part.velocities()[0]);
            part.step(
                1.19e6 * (x + 0.5 * h * v),
                [ground(t), ground(t + 0.5 * h), ground(t + h)],
            );
            whole.step(ground(t), ground(t + h));
            for i in 0..3 {
                worst = worst.max((part.displacements()[i] - whole.displacement(i)).abs());
            }
        }
        assert!(worst < 1e-6, "{worst:e}");
    }

    #[test]
    fn the_force_is_fed_one_sample_late() {
        let frame = BenchmarkCase::ALL[0].frame();
        let mut part = NumericalSubstructure::new(&frame, [0.0; 3], 0, 1, 1.0 / 4096.0).unwrap();
        part.step(1000.0, [0.0; 3]);
        assert_eq!(part.displacements(), [0.0; 3]);
        assert!((part.total_acceleration(0, 0.0, 0.0) + 1.0).abs() < 1e-12);
        part.step(0.0, [0.0; 3]);
        assert!(part.displacements()[0] < 0.0);
    }

    #[test]
    fn at_rest_under_a_moving_ground_the_total_acceleration_is_nothing() {
        let frame = BenchmarkCase::ALL[2].frame();
        let part = NumericalSubstructure::new(&frame, [0.0; 3], 0, 1, 1.0 / 4096.0).unwrap();
        for i in 0..3 {
            assert!(part.total_acceleration(i, 0.0, 5.0).abs() < 1e-9);
        }
        let heavy = [frame.mass[(0, 0)] + 1.0, 0.0, 0.0];
        assert!(NumericalSubstructure::new(&frame, heavy, 0, 1, 1.0 / 4096.0).is_err());
        assert!(NumericalSubstructure::new(&frame, [0.0; 3], 3, 1, 1.0 / 4096.0).is_err());
    }
}

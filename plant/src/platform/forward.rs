//! The pose that strokes give.

use nalgebra::{Rotation3, Vector3, Vector6};

use super::{MOST, Platform, Pose, refused};
use crate::ModelError;

/// Most iterations.
const ITERATIONS: usize = 40;

/// Step, over the platform's size, below which the search has converged.
const CONVERGED: f64 = 1e-13;

/// Longest step, over the platform's size and in rad.
const LONGEST: f64 = 0.5;

/// A pose found from strokes.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Found {
    /// The pose.
    pub pose: Pose,
    /// What each stroke is off by at that pose, m: its measured value less that of the pose.
    pub residual: [f64; MOST],
    /// Iterations.
    pub iterations: usize,
    /// Whether the search came to rest. Strokes that no pose has may come to rest with a residual.
    pub converged: bool,
}

impl Found {
    /// Largest residual, m, and its actuator, from 0.
    #[must_use]
    pub fn largest(&self) -> (f64, usize) {
        let mut largest = (0.0, 0);
        for (i, value) in self.residual.iter().enumerate() {
            if value.abs() > largest.0 {
                largest = (value.abs(), i);
            }
        }
        largest
    }

    /// The pose, if the search came to rest and no stroke is off by more than `tolerance`, m.
    ///
    /// # Errors
    /// Strokes outside of the set that the platform reaches, with the actuator that is off most.
    pub fn within(&self, tolerance: f64) -> Result<Pose, ModelError> {
        let (off, actuator) = self.largest();
        if self.converged && off <= tolerance {
            return Ok(self.pose);
        }
        let state = if self.converged { "nearest" } else { "last" };
        Err(refused(format!(
            "the strokes belong to no pose: at the {state} one actuator {} is off by {off:.3e} m (allowed \
             {tolerance:.1e}); check the order of the actuators and the geometry",
            actuator + 1
        )))
    }
}

impl Platform {
    /// The pose of strokes (m), searched from `start`. `strokes` beyond the actuators are ignored.
    #[must_use]
    pub fn pose(&self, strokes: &[f64; MOST], start: &Pose) -> Found {
        let mut found = Found {
            pose: *start,
            residual: [0.0; MOST],
            iterations: 0,
            converged: false,
        };
        let scale = self.scale();
        let (mut translation, mut rotation) = (start.translation(), start.rotation());
        while found.iterations < ITERATIONS && !found.converged {
            let mut right = Vector6::zeros();
            for (i, wanted) in strokes.iter().enumerate().take(self.actuators()) {
                let (stroke, row) = self.row(i, &translation, &rotation);
                right += row.component_mul(&scale) * (wanted - stroke);
            }
            let Some(factor) = self.normal(&translation, &rotation).cholesky() else {
                break;
            };
            let step = factor.solve(&right).component_mul(&scale);
            if !step.iter().all(|value| value.is_finite()) {
                break;
            }
            let moved = Vector3::new(step[0], step[1], step[2]);
            let turned = Vector3::new(step[3], step[4], step[5]);
            let length = (moved.norm() / self.size).max(turned.norm());
            let by = if length > LONGEST {
                LONGEST / length
            } else {
                1.0
            };
            translation += moved * by;
            rotation = Rotation3::new(turned * by) * rotation;
            found.iterations += 1;
            found.converged = length < CONVERGED;
            // Rounding keeps some poses from coming nearer; a step this small no longer changes a stroke.
            found.converged |= found.iterations > 8 && length < 1e3 * CONVERGED;
        }
        found.pose = Pose::of(translation, &rotation);
        for (i, residual) in found.residual.iter_mut().enumerate().take(self.actuators()) {
            *residual = strokes[i] - self.row(i, &translation, &rotation).0;
        }
        found
    }
}

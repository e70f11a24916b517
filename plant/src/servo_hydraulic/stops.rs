//! The ends of the stroke: cushions and hard stops.

use crate::ModelError;
use units::constants::{INCH, LBF_PER_INCH, LBF_S_PER_INCH, STROKE};

/// A cushion that brakes an outward motion near the end of the stroke (a check valve frees the way
/// back) and a stop that the piston meets there. Assumed values.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Stops {
    /// Distance of both hard stops from the middle position, m.
    pub stroke: f64,
    /// Length of the cushion before each stop, m.
    pub cushion_length: f64,
    /// Damping of a cushion where it ends at the stop, N s/m; it grows with the square of the way
    /// into the cushion.
    pub cushion_damping: f64,
    /// Stiffness of a stop, N/m.
    pub stiffness: f64,
    /// Loss of a stop per velocity (Hunt and Crossley, 1975), s/m.
    pub loss: f64,
}

impl Default for Stops {
    fn default() -> Self {
        Self {
            stroke: STROKE,
            cushion_length: 0.1 * INCH,
            cushion_damping: 200.0 * LBF_S_PER_INCH,
            stiffness: 5e4 * LBF_PER_INCH,
            loss: 0.02 / INCH,
        }
    }
}

impl Stops {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated; the cushion is shorter than the stroke.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_positive("stroke", self.stroke)?;
        ModelError::require_positive("stop_stiffness", self.stiffness)?;
        ModelError::require_non_negative("cushion_damping", self.cushion_damping)?;
        ModelError::require_non_negative("stop_loss", self.loss)?;
        if self.cushion_length > 0.0 && self.cushion_length < self.stroke {
            return Ok(());
        }
        Err(ModelError::Parameter {
            name: "cushion_length",
            value: self.cushion_length,
            expected: "a positive number below the stroke",
        })
    }

    /// Elastic and dissipative force of cushion and stop on the piston, N.
    pub fn forces(&self, displacement: f64, velocity: f64) -> (f64, f64) {
        let depth = displacement.abs() - (self.stroke - self.cushion_length);
        if depth <= 0.0 {
            return (0.0, 0.0);
        }
        let side = displacement.signum();
        let outward = velocity * side;
        let way = (depth / self.cushion_length).min(1.0);
        let mut lost = self.cushion_damping * way * way * outward.max(0.0);
        let elastic = self.stiffness * (displacement.abs() - self.stroke).max(0.0);
        // A stop pushes but never pulls.
        lost += (elastic * self.loss * outward).max(-elastic);
        (-side * elastic, -side * lost)
    }

    /// True while a hard stop is touched.
    pub fn is_hit(&self, displacement: f64) -> bool {
        displacement.abs() >= self.stroke
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_only_push_inward_and_only_take_energy() {
        let stops = Stops::default();
        for x in [-1.6, -1.45, -1.2, 0.0, 1.3, 1.41, 1.5, 1.52] {
            for v in [-40.0, -0.1, 0.0, 3.0, 40.0] {
                let (x, v) = (x * INCH, v * INCH);
                let (elastic, lost) = stops.forces(x, v);
                assert!((elastic + lost) * x <= 0.0, "at {x} m, {v} m/s");
                assert!(lost * v <= 0.0);
                if x.abs() < 1.4 * INCH {
                    assert_eq!((elastic, lost), (0.0, 0.0));
                }
            }
        }
    }
}

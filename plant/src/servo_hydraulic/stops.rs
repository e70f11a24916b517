//! The ends of the stroke: cushions and hard stops.

use crate::ModelError;
use units::Parameters as _;
use units::constants::{INCH, LBF_PER_INCH, LBF_S_PER_INCH, STROKE};

/// A cushion that brakes an outward motion near the end of the stroke (a check valve frees the way
/// back) and a stop that the piston meets there. Assumed values.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct Stops {
    /// Distance of the hard stops from the middle, m.
    #[parameter("m" => "in", positive)]
    pub stroke: f64,
    /// Length of the cushions, m.
    #[parameter("m" => "in")]
    pub cushion_length: f64,
    /// Damping of a cushion at its end, N.s/m.
    #[parameter("N.s/m" => "lbf.s/in", non_negative)]
    pub cushion_damping: f64,
    /// Stiffness of the hard stops, N/m.
    #[parameter("N/m" => "lbf/in", name = "stop_stiffness", positive)]
    pub stiffness: f64,
    /// Loss of the hard stops, s/m.
    #[parameter("s/m" => "s/in", name = "stop_loss", non_negative)]
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
        self.check()?;
        if self.cushion_length > 0.0 && self.cushion_length < self.stroke {
            return Ok(());
        }
        Err(ModelError::Parameter {
            name: Self::CUSHION_LENGTH,
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

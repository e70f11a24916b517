//! The table on its spring: `m dv/dt + c v + k x = F` (Eq 2-5, 2-28).

use crate::ModelError;
use crate::linear::TransferFunction;
use units::Parameters;
use units::constants::{LBF_PER_INCH, LBF_S_PER_INCH, LBF_S2_PER_INCH};

/// Mass, damping and stiffness of the table, SI.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
#[parameters(prefix = "table_")]
pub struct Table {
    /// Mass of the table, kg.
    #[parameter("kg" => "lbf.s2/in", positive)]
    pub mass: f64,
    /// Viscous damping of the table, N.s/m.
    #[parameter("N.s/m" => "lbf.s/in", non_negative)]
    pub damping: f64,
    /// Stiffness from table to ground, N/m.
    #[parameter("N/m" => "lbf/in", positive)]
    pub stiffness: f64,
}

impl Table {
    /// Takes mass (lbf s²/in), damping (lbf s/in) and stiffness (lbf/in).
    pub fn from_thesis_units(mass: f64, damping: f64, stiffness: f64) -> Self {
        Self {
            mass: mass * LBF_S2_PER_INCH,
            damping: damping * LBF_S_PER_INCH,
            stiffness: stiffness * LBF_PER_INCH,
        }
    }

    /// Eq 2-28: `8.248 / (s² + 2.034 s + 192.4)` in/lbf.
    pub fn equation_2_28() -> Self {
        Self::from_transfer_function(8.248, 2.034, 192.4)
    }

    /// The table of the de-rounded set, see [`crate::identified::actuator::PublishedActuator::Derounded`].
    pub fn derounded() -> Self {
        Self::from_transfer_function(8.24826748953721, 2.0335133699351586, 192.353521018731)
    }

    /// The listing of Appendix A.
    pub fn appendix_a() -> Self {
        Self::from_thesis_units(0.1212, 0.2465, 23.3189)
    }

    fn from_transfer_function(gain: f64, damping: f64, stiffness: f64) -> Self {
        Self::from_thesis_units(1.0 / gain, damping / gain, stiffness / gain)
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// A mass or stiffness that is not positive, a negative damping.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }

    /// `G_table(s)`, force (N) to displacement (m).
    pub fn transfer_function(&self) -> TransferFunction {
        TransferFunction {
            numerator: vec![1.0],
            denominator: vec![self.mass, self.damping, self.stiffness],
        }
    }
}

impl Default for Table {
    fn default() -> Self {
        Self::equation_2_28()
    }
}

//! The sections of a model file in TOML, and its units.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use units::constants::{INCH, LBF};

use plant::identified::valve_curve::ValveCurve;
use recordings::IdentificationError;

/// The name of the thesis's units, and the default of a file that names none.
pub const INCH_POUND: &str = "inch, lbf, second, volt";
/// The name of SI units.
pub const SI: &str = "metre, newton, second, volt";

/// Parameters by effect and name.
pub type EffectSections = BTreeMap<String, BTreeMap<String, f64>>;

/// `F = G1(s) u + G2(s) dx/dt`, coefficients in descending powers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActuatorSection {
    /// `[1, a2, a1, a0]`.
    pub denominator: Vec<f64>,
    /// `[b2, b1, b0]` of G1.
    pub voltage_to_force: Vec<f64>,
    /// `[e2, e1, e0]` of G2.
    pub velocity_to_force: Vec<f64>,
}

/// Mass, damping and stiffness.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BodySection {
    /// Mass.
    pub mass: f64,
    /// Damping.
    pub damping: f64,
    /// Stiffness.
    pub stiffness: f64,
}

/// Standard errors, laid out as the parameters are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StandardErrors {
    /// The actuator's; the leading 1 of the denominator has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub actuator: Option<ActuatorSection>,
    /// The table's.
    pub table: BodySection,
    /// The specimen's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specimen: Option<BodySection>,
    /// The delay's, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_delay: Option<f64>,
    /// Those of `[hydraulics]`, SI; of the valve's curve they begin with `valve_`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub hydraulics: BTreeMap<String, f64>,
    /// The effects', SI.
    #[serde(default, skip_serializing_if = "EffectSections::is_empty")]
    pub effects: EffectSections,
}

/// Factors from a file's units to SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    /// Metres in the unit of length.
    pub length: f64,
    /// Newtons in the unit of force.
    pub force: f64,
}

impl Units {
    /// Inch and pound-force.
    pub const INCH_POUND: Self = Self {
        length: INCH,
        force: LBF,
    };
    /// SI.
    pub const SI: Self = Self {
        length: 1.0,
        force: 1.0,
    };

    /// The set of a name; `file` is what messages call the file.
    ///
    /// # Errors
    /// Names other than the two known sets.
    pub fn named(units: &str, file: &str) -> Result<Self, IdentificationError> {
        match units {
            INCH_POUND => Ok(Self::INCH_POUND),
            SI | "SI" => Ok(Self::SI),
            other => Err(IdentificationError::ModelFile {
                path: file.to_string(),
                what: format!("units = \"{other}\""),
                expected: "\"inch, lbf, second, volt\" or \"metre, newton, second, volt\"",
            }),
        }
    }
}

/// `[hydraulics]`: what the form of Eq 2-4 has no place for, SI whatever the file's units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HydraulicSection {
    /// `2 D/w` of the spool, s.
    pub spool_lag: f64,
    /// `1/w²` of the spool, s².
    pub spool_inertia: f64,
    /// N/(V s).
    pub force_rate: f64,
    /// N/m.
    pub oil_stiffness: f64,
    /// 1/s.
    pub leakage_rate: f64,
    /// N s/m.
    pub seal_damping: f64,
    /// Coulomb friction of the seals, N.
    pub seal_friction: f64,
    /// Deflection of the seals before they slide, m.
    pub seal_presliding: f64,
    /// Breakaway force over the Coulomb force, less one.
    pub seal_excess: f64,
    /// m/s.
    pub seal_stribeck_velocity: f64,
    /// Exponent with which the seals begin to slide.
    pub seal_sharpness: f64,
    /// Damping of their deflection over its stiffness, s.
    pub seal_relaxation: f64,
    /// Delay of the accelerometers relative to the displacement, s.
    pub accelerometer_delay: f64,
    /// Delay of the load cell relative to the displacement, s.
    pub load_cell_delay: f64,
    /// What the accelerometers show over the displacement's second derivative.
    pub accelerometer_scale: f64,
    /// The valve's opening by its spool's position, where it is not an ideal one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub valve_curve: Option<ValveCurve>,
}

/// `[uncertainty]`: how far a diagnosis may take the parameters from their values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct UncertaintySection {
    /// Relative standard deviation of every parameter.
    pub relative: f64,
}

/// `[covariance]`: how the errors of the identified parameters go together, SI whatever the file's
/// units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CovarianceSection {
    /// The parameters, in the order of rows and columns.
    pub parameters: Vec<String>,
    /// The covariance, row after row.
    pub matrix: Vec<Vec<f64>>,
}

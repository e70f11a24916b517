//! A reaction mass that gives way.

use std::f64::consts::TAU;

use crate::ModelError;

/// Reaction mass on a spring: `M (x_f'' + 2 zeta w x_f' + w² x_f) = -(force on the table from the
/// wall)`. Piston, springs and displacement sensor move relative to it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FoundationEffects {
    /// Natural frequency, Hz; 0 is a rigid foundation.
    pub frequency: f64,
    /// Mass in masses of the table.
    pub mass_ratio: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
}

impl Default for FoundationEffects {
    fn default() -> Self {
        Self {
            frequency: 0.0,
            mass_ratio: 12.0,
            damping_ratio: 0.05,
        }
    }
}

impl FoundationEffects {
    /// Acceleration of the reaction mass (m/s²) that exerts `force` (N) on a table of `table_mass`
    /// (kg), at its `displacement` (m) and `velocity` (m/s).
    pub fn acceleration(
        &self,
        table_mass: f64,
        force: f64,
        displacement: f64,
        velocity: f64,
    ) -> f64 {
        let omega = TAU * self.frequency;
        -force / (self.mass_ratio * table_mass)
            - omega * (2.0 * self.damping_ratio * velocity + omega * displacement)
    }

    /// Refuses a negative frequency or damping and a mass that is not positive.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_non_negative("foundation_frequency", self.frequency)?;
        ModelError::require_positive("foundation_mass_ratio", self.mass_ratio)?;
        ModelError::require_non_negative("foundation_damping_ratio", self.damping_ratio)
    }
}

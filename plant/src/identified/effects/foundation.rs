//! A reaction mass that gives way.

use std::f64::consts::TAU;

use super::quantity::{FREQUENCY, RATIO};
use super::{Component, Effect, Family, Parameter, Scale};
use crate::ModelError;
use units::vocabulary;

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
}

impl Family for FoundationEffects {
    type Memory = ();

    const EFFECTS: &'static [Effect] = &[Effect {
        equation: "M (x_f'' + 2 zeta w x_f' + w² x_f) = -(F - c v - k x), w = 2 pi f",
        sentence: "the reaction mass moves, with a natural frequency of {}",
        parameters: &[
            Parameter::new(
                "frequency",
                FREQUENCY,
                "Natural frequency of the reaction mass, relative to which the piston moves; 0 is rigid",
            )
            .size(Scale::Logarithmic, 18.0, (3.0, 30.0))
            .on_table(|e| &mut e.foundation.frequency)
            .min(0.0),
            Parameter::new("mass_ratio", RATIO, "Reaction mass in masses of the table")
                .shape(Scale::Logarithmic, 12.0, 0.1, (4.0, 40.0))
                .on_table(|e| &mut e.foundation.mass_ratio)
                .min(1e-3),
            Parameter::new(vocabulary::DAMPING_RATIO, RATIO, "Damping ratio of the reaction mass")
                .shape(Scale::Logarithmic, 0.05, 0.25, (0.01, 0.3))
                .on_table(|e| &mut e.foundation.damping_ratio)
                .min(0.0),
        ],
        // A lightly damped mode is found from nearby only.
        starts: &[
            &[6.3, 12.0, 0.05],
            &[7.3, 12.0, 0.05],
            &[8.5, 12.0, 0.05],
            &[9.8, 12.0, 0.05],
            &[11.4, 12.0, 0.05],
            &[13.2, 12.0, 0.05],
            &[15.3, 12.0, 0.05],
            &[17.7, 12.0, 0.05],
        ],
        is_linear: true,
        needs_co_simulation: true,
        ..Effect::new("foundation_compliance", Component::ShakeTable)
    }];

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_non_negative("foundation_frequency", self.frequency)?;
        ModelError::require_positive("foundation_mass_ratio", self.mass_ratio)?;
        ModelError::require_non_negative("foundation_damping_ratio", self.damping_ratio)
    }

    fn is_active(&self) -> bool {
        self.frequency != 0.0
    }
}

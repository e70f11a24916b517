//! What the table carries and rubs against beyond Eq 2-5.

use super::quantity::{CUBIC_STIFFNESS, DAMPING, MASS};
use super::{AtStart, Component, Effect, Family, Parameter, TableMotion};
use crate::ModelError;
use units::constants::{INCH, LBF, LBF_S_PER_INCH, LBF_S2_PER_INCH};
use units::vocabulary;

/// Mass, viscous damping and a hardening spring beside those of Eq 2-28.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TableEffects {
    /// Mass on the table that the model does not know, kg.
    pub added_mass: f64,
    /// Extra damping, N s/m.
    pub viscous_damping: f64,
    /// k3 of the force `k3 x³`, N/m³.
    pub cubic_stiffness: f64,
}

const LBF_PER_INCH3: f64 = LBF / (INCH * INCH * INCH);

impl Family for TableEffects {
    type Memory = ();

    const EFFECTS: &'static [Effect] = &[
        Effect {
            equation: "(m + m_p) a = F - c v - k x",
            sentence: "the table carries an unknown mass of {}",
            parameters: &[Parameter::new(
                "mass",
                MASS,
                "Mass on the table that the model does not know; 0 is off",
            )
            .positive(0.006 * LBF_S2_PER_INCH, 0.06 * LBF_S2_PER_INCH)
            .on_table(|e| &mut e.table.added_mass)
            .at_start(AtStart::Acceleration)],
            starts: &[&[0.01 * LBF_S2_PER_INCH], &[0.035 * LBF_S2_PER_INCH]],
            is_linear: true,
            ..Effect::new(vocabulary::ADDED_PAYLOAD, Component::ShakeTable)
        },
        Effect {
            equation: "m a = F - (c + c_a) v - k x",
            sentence: "the table has extra damping of {}",
            parameters: &[Parameter::new(
                "damping",
                DAMPING,
                "Extra damping of the table; 0 is off",
            )
            .positive(0.05 * LBF_S_PER_INCH, 0.8 * LBF_S_PER_INCH)
            .on_table(|e| &mut e.table.viscous_damping)],
            starts: &[&[0.1 * LBF_S_PER_INCH], &[0.4 * LBF_S_PER_INCH]],
            is_linear: true,
            ..Effect::new("viscous_damping", Component::ShakeTable)
        },
        Effect {
            equation: "m a = F - c v - k x - k3 x³",
            sentence: "the table has an extra cubic stiffness of {}",
            parameters: &[Parameter::new(
                "stiffness",
                CUBIC_STIFFNESS,
                "k3 of an extra force k3 x^3; 0 is off",
            )
            .positive(2.0 * LBF_PER_INCH3, 30.0 * LBF_PER_INCH3)
            .on_table(|e| &mut e.table.cubic_stiffness)],
            starts: &[&[4.0 * LBF_PER_INCH3], &[15.0 * LBF_PER_INCH3]],
            ..Effect::new(vocabulary::CUBIC_STIFFNESS, Component::ShakeTable)
        },
    ];

    fn is_active(&self) -> bool {
        [self.added_mass, self.viscous_damping, self.cubic_stiffness]
            .into_iter()
            .any(|size| size != 0.0)
    }

    #[inline]
    fn resisting_force(&self, motion: &TableMotion, (): &()) -> f64 {
        self.cubic_stiffness * motion.displacement.powi(3)
    }

    fn without_resistance(self) -> Self {
        Self {
            cubic_stiffness: 0.0,
            ..self
        }
    }

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("added_mass", self.added_mass)?;
        ModelError::require_finite("viscous_damping", self.viscous_damping)?;
        ModelError::require_finite(vocabulary::CUBIC_STIFFNESS, self.cubic_stiffness)
    }
}

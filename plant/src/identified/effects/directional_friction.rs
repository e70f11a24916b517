//! Dry friction that is larger one way than the other, as of a seal that points one way.

use super::friction::{COULOMB_FORCE, FRICTION_LAW, STICKS, TRANSITION_VELOCITY, tanh};
use super::quantity::FORCE;
use super::{Component, Effect, Family, Parameter, TableMotion};
use crate::ModelError;
use units::constants::{INCH, LBF};
use units::vocabulary;

/// Friction `F_c + D` forwards and `F_c - D` backwards, smooth about rest:
/// `(F_c + D tanh(v/v_0)) tanh(v/v_0)`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DirectionalFriction {
    /// F_c, the mean of both directions, N.
    pub coulomb_force: f64,
    /// D, N.
    pub difference: f64,
    /// v_0, over which the sign changes, m/s.
    pub transition_velocity: f64,
}

impl Default for DirectionalFriction {
    fn default() -> Self {
        Self {
            coulomb_force: 0.0,
            difference: 0.0,
            transition_velocity: 0.05 * INCH,
        }
    }
}

impl Family for DirectionalFriction {
    type Memory = ();

    const EFFECTS: &'static [Effect] = &[Effect {
        equation: "m a = F - (F_c + D tanh(v/v_0)) tanh(v/v_0) - c v - k x",
        sentence: "the table has dry friction of {}, and {} more forwards and less backwards",
        parameters: &[
            COULOMB_FORCE
                .about("Mean force of both directions opposing the velocity; 0 is off")
                .on_table(|e| &mut e.directional_friction.coulomb_force),
            Parameter::new(
                "difference",
                FORCE,
                "Force that is added forwards and taken off backwards; 0 is off",
            )
            .signed(0.2 * LBF, 2.0 * LBF)
            .on_table(|e| &mut e.directional_friction.difference),
            TRANSITION_VELOCITY.on_table(|e| &mut e.directional_friction.transition_velocity),
        ],
        starts: &[
            &[0.8 * LBF, 0.4 * LBF, 0.1 * INCH],
            &[0.8 * LBF, -0.4 * LBF, 0.1 * INCH],
            &[2.5 * LBF, 1.2 * LBF, 0.1 * INCH],
            &[2.5 * LBF, -1.2 * LBF, 0.1 * INCH],
        ],
        confounded_with: &[vocabulary::COULOMB_FRICTION, "load_cell_bias"],
        contains: Some(vocabulary::COULOMB_FRICTION),
        is_fast: true,
        tolerance: STICKS,
        law: FRICTION_LAW,
        ..Effect::new("directional_friction", Component::ShakeTable)
    }];

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("directional_friction.coulomb_force", self.coulomb_force)?;
        ModelError::require_finite("directional_friction.difference", self.difference)?;
        ModelError::require_positive(
            "directional_friction.transition_velocity",
            self.transition_velocity,
        )
    }

    #[inline]
    fn is_active(&self) -> bool {
        self.coulomb_force != 0.0 || self.difference != 0.0
    }

    fn without_resistance(self) -> Self {
        Self::default()
    }

    #[inline]
    fn resisting_force(&self, motion: &TableMotion, (): &()) -> f64 {
        if !self.is_active() {
            return 0.0;
        }
        let sign = tanh(motion.velocity / self.transition_velocity);
        (self.coulomb_force + self.difference * sign) * sign
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_opposes_the_motion_by_another_force_each_way() {
        let friction = DirectionalFriction {
            coulomb_force: 8.0,
            difference: -3.0,
            ..Default::default()
        };
        for (velocity, force) in [(0.1, 5.0), (-0.1, -11.0), (0.0, 0.0)] {
            let motion = TableMotion {
                displacement: 0.02,
                velocity,
            };
            assert_eq!(friction.resisting_force(&motion, &()), force);
        }
    }
}

//! Dry friction that fades as the table is first moved farther, as of a guide that runs in.

use super::friction::{COULOMB_FORCE, FRICTION_LAW, STICKS, TRANSITION_VELOCITY, tanh};
use super::quantity::{LENGTH, RATIO};
use super::{Component, Effect, Family, Parameter, Scale, TableMotion};
use crate::ModelError;
use units::constants::{INCH, LBF};
use units::vocabulary;

/// Friction `F_c (1 - L (1 - exp(-x_max/x_0))) tanh(v/v_0)`, where `x_max` is the table's greatest
/// excursion so far.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FadingFriction {
    /// F_c, before the table has moved, N.
    pub coulomb_force: f64,
    /// L, share of it that is lost at last.
    pub loss: f64,
    /// x_0, m.
    pub fading_displacement: f64,
    /// v_0, over which the sign changes, m/s.
    pub transition_velocity: f64,
}

impl Default for FadingFriction {
    fn default() -> Self {
        Self {
            coulomb_force: 0.0,
            loss: 0.5,
            fading_displacement: 0.3 * INCH,
            transition_velocity: 0.05 * INCH,
        }
    }
}

impl Family for FadingFriction {
    /// The greatest excursion so far, m.
    type Memory = f64;

    const EFFECTS: &'static [Effect] = &[Effect {
        equation: "m a = F - F_c (1 - L (1 - exp(-x_max/x_0))) tanh(v/v_0) - c v - k x",
        sentence: "the table has dry friction of {}, of which it loses up to {} as it is first \
                   moved farther",
        parameters: &[
            COULOMB_FORCE
                .about("Force opposing the velocity before the table has moved; 0 is off")
                .on_table(|e| &mut e.fading_friction.coulomb_force),
            Parameter::new("loss", RATIO, "Share of it that is lost at last")
                .size(Scale::Linear(0.2), 0.2, (0.0, 1.0))
                .on_table(|e| &mut e.fading_friction.loss)
                .without_switch()
                .max(1.0),
            Parameter::new(
                "fading_displacement",
                LENGTH,
                "Greatest excursion so far at which 1 - 1/e of the loss has come",
            )
            .shape(
                Scale::Logarithmic,
                0.3 * INCH,
                1.0,
                (0.02 * INCH, 3.0 * INCH),
            )
            .on_table(|e| &mut e.fading_friction.fading_displacement)
            .min(1e-6),
            TRANSITION_VELOCITY.on_table(|e| &mut e.fading_friction.transition_velocity),
        ],
        starts: &[
            &[1.0 * LBF, 0.5, 0.3 * INCH, 0.1 * INCH],
            &[3.0 * LBF, 0.3, 0.3 * INCH, 0.1 * INCH],
            &[3.0 * LBF, 0.7, 0.3 * INCH, 0.1 * INCH],
        ],
        confounded_with: &[vocabulary::COULOMB_FRICTION],
        contains: Some(vocabulary::COULOMB_FRICTION),
        is_fast: true,
        needs_co_simulation: true,
        tolerance: STICKS,
        law: FRICTION_LAW,
        ..Effect::new("fading_friction", Component::ShakeTable)
    }];

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("fading_friction.coulomb_force", self.coulomb_force)?;
        ModelError::require_finite("fading_friction.loss", self.loss)?;
        ModelError::require_positive(
            "fading_friction.fading_displacement",
            self.fading_displacement,
        )?;
        ModelError::require_positive(
            "fading_friction.transition_velocity",
            self.transition_velocity,
        )
    }

    #[inline]
    fn is_active(&self) -> bool {
        self.coulomb_force != 0.0
    }

    fn without_resistance(self) -> Self {
        Self::default()
    }

    #[inline]
    fn resisting_force(&self, motion: &TableMotion, greatest: &f64) -> f64 {
        if !self.is_active() {
            return 0.0;
        }
        let excursion = greatest.max(motion.displacement.abs());
        let lost = -self.loss * (-excursion / self.fading_displacement).exp_m1();
        self.coulomb_force * (1.0 - lost) * tanh(motion.velocity / self.transition_velocity)
    }

    #[inline]
    fn remember(&self, greatest: &mut f64, motion: &TableMotion) {
        *greatest = greatest.max(motion.displacement.abs());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_keeps_what_the_greatest_excursion_left() {
        let friction = FadingFriction {
            coulomb_force: 10.0,
            loss: 0.6,
            fading_displacement: 0.01,
            ..Default::default()
        };
        let at = |displacement: f64| TableMotion {
            displacement,
            velocity: 1.0,
        };
        let mut greatest = 0.0;
        assert_eq!(friction.resisting_force(&at(0.0), &greatest), 10.0);
        for displacement in [0.004, -0.01, 0.002] {
            friction.remember(&mut greatest, &at(displacement));
        }
        assert_eq!(greatest, 0.01);
        let left = 10.0 * (1.0 - 0.6 * (1.0 - (-1.0f64).exp()));
        for displacement in [0.0, -0.01] {
            let force = friction.resisting_force(&at(displacement), &greatest);
            assert!((force - left).abs() < 1e-12, "{force}");
        }
    }
}

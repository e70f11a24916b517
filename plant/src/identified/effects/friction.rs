//! Dry friction between table and guide.

use super::quantity::{FORCE, RATIO, VELOCITY};
use super::{Component, Effect, Family, Parameter, Scale, TableMotion};
use crate::ModelError;
use units::constants::{INCH, LBF};
use units::vocabulary;

/// Coulomb friction with a breakaway bump at low speed, opposing the table's velocity:
/// `(F_c + F_s exp(-|v/v_s|^delta)) tanh(v/v_0)`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FrictionEffects {
    /// F_c, N.
    pub coulomb_force: f64,
    /// F_s, the bump above F_c, N.
    pub stribeck_force: f64,
    /// v_s, m/s.
    pub stribeck_velocity: f64,
    /// delta.
    pub stribeck_exponent: f64,
    /// v_0, over which the sign changes, m/s.
    pub transition_velocity: f64,
}

impl Default for FrictionEffects {
    fn default() -> Self {
        Self {
            coulomb_force: 0.0,
            stribeck_force: 0.0,
            stribeck_velocity: 0.5 * INCH,
            stribeck_exponent: 2.0,
            transition_velocity: 0.05 * INCH,
        }
    }
}

/// The Coulomb force of an effect of friction.
pub(super) const COULOMB_FORCE: Parameter = Parameter::new(
    "coulomb_force",
    FORCE,
    "Constant force opposing the velocity, also that of Stribeck friction; 0 is off",
)
.positive(0.4 * LBF, 4.0 * LBF);

/// The bump of an effect of friction.
pub(super) const STRIBECK_FORCE: Parameter = Parameter::new(
    "stribeck_force",
    FORCE,
    "Breakaway bump above the Coulomb force at low speed; 0 is off",
)
.positive(0.8 * LBF, 3.0 * LBF);

/// The velocity over which the bump fades.
pub(super) const STRIBECK_VELOCITY: Parameter = Parameter::new(
    vocabulary::STRIBECK_VELOCITY,
    VELOCITY,
    "Velocity at which the bump has fallen to 1/e",
)
.shape(
    Scale::Logarithmic,
    0.5 * INCH,
    0.7,
    (0.1 * INCH, 3.0 * INCH),
)
.min(1e-6);

/// The velocity over which friction changes its sign.
pub(super) const TRANSITION_VELOCITY: Parameter = Parameter::new(
    "transition_velocity",
    VELOCITY,
    "Velocity over which friction changes its sign: tanh(v / transition_velocity)",
)
.shape(
    Scale::Logarithmic,
    0.1 * INCH,
    0.5,
    (0.005 * INCH, 1.0 * INCH),
)
.min(1e-6);

/// The law that friction of all kinds changes the form of.
pub(super) const FRICTION_LAW: &str = "friction";
/// Tolerance of friction: where the table sticks the constant gain is not the best one and leaves
/// traces.
pub(super) const STICKS: f64 = 1.6;

impl Family for FrictionEffects {
    type Memory = ();

    const EFFECTS: &'static [Effect] = &[
        Effect {
            equation: "m a = F - F_c tanh(v/v_0) - c v - k x",
            sentence: "the table has dry friction of {}",
            parameters: &[
                COULOMB_FORCE.on_table(|e| &mut e.friction.coulomb_force),
                TRANSITION_VELOCITY.on_table(|e| &mut e.friction.transition_velocity),
            ],
            starts: &[&[0.8 * LBF, 0.1 * INCH], &[2.5 * LBF, 0.1 * INCH]],
            confounded_with: &["stribeck_friction"],
            is_fast: true,
            tolerance: STICKS,
            law: FRICTION_LAW,
            ..Effect::new(vocabulary::COULOMB_FRICTION, Component::ShakeTable)
        },
        Effect {
            equation: "m a = F - (F_c + F_s exp(-|v/v_s|^delta)) tanh(v/v_0) - c v - k x",
            sentence: "the table has dry friction of {} and {} more to break away",
            parameters: &[
                COULOMB_FORCE
                    .on_table(|e| &mut e.friction.coulomb_force)
                    .of(vocabulary::COULOMB_FRICTION),
                STRIBECK_FORCE.on_table(|e| &mut e.friction.stribeck_force),
                STRIBECK_VELOCITY.on_table(|e| &mut e.friction.stribeck_velocity),
                Parameter::new(
                    "stribeck_exponent",
                    RATIO,
                    "Exponent delta in the bump's exp(-|v / stribeck_velocity|^delta)",
                )
                .shape(Scale::Logarithmic, 2.0, 0.4, (0.4, 5.0))
                .on_table(|e| &mut e.friction.stribeck_exponent)
                .min(1e-2),
                TRANSITION_VELOCITY
                    .on_table(|e| &mut e.friction.transition_velocity)
                    .of(vocabulary::COULOMB_FRICTION),
            ],
            starts: &[
                &[1.0 * LBF, 1.0 * LBF, 0.3 * INCH, 2.0, 0.1 * INCH],
                &[1.0 * LBF, 2.0 * LBF, 1.0 * INCH, 2.0, 0.1 * INCH],
            ],
            confounded_with: &[vocabulary::COULOMB_FRICTION],
            contains: Some(vocabulary::COULOMB_FRICTION),
            is_fast: true,
            tolerance: STICKS,
            law: FRICTION_LAW,
            ..Effect::new("stribeck_friction", Component::ShakeTable)
        },
    ];

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("coulomb_force", self.coulomb_force)?;
        ModelError::require_finite("stribeck_force", self.stribeck_force)?;
        ModelError::require_positive(vocabulary::STRIBECK_VELOCITY, self.stribeck_velocity)?;
        ModelError::require_positive("stribeck_exponent", self.stribeck_exponent)?;
        ModelError::require_positive("transition_velocity", self.transition_velocity)
    }

    #[inline]
    fn is_active(&self) -> bool {
        self.coulomb_force != 0.0 || self.stribeck_force != 0.0
    }

    fn without_resistance(self) -> Self {
        Self::default()
    }

    #[inline]
    fn resisting_force(&self, motion: &TableMotion, (): &()) -> f64 {
        if !self.is_active() {
            return 0.0;
        }
        let velocity = motion.velocity;
        let mut force = self.coulomb_force;
        if self.stribeck_force != 0.0 {
            let ratio = (velocity / self.stribeck_velocity).abs();
            let power = if self.stribeck_exponent == 2.0 {
                ratio * ratio
            } else {
                ratio.powf(self.stribeck_exponent)
            };
            force += self.stribeck_force * (-power).exp();
        }
        force * tanh(velocity / self.transition_velocity)
    }
}

/// tanh, short-cut where it has saturated.
#[inline]
pub(super) fn tanh(x: f64) -> f64 {
    if x.abs() > 19.0 {
        x.signum()
    } else {
        1.0 - 2.0 / ((2.0 * x).exp() + 1.0)
    }
}

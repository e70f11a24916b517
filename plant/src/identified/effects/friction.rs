//! Dry friction between table and guide.

use crate::ModelError;

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
            stribeck_velocity: 0.5 * units::constants::INCH,
            stribeck_exponent: 2.0,
            transition_velocity: 0.05 * units::constants::INCH,
        }
    }
}

impl FrictionEffects {
    /// Refuses velocities that are not positive.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("coulomb_force", self.coulomb_force)?;
        ModelError::require_finite("stribeck_force", self.stribeck_force)?;
        ModelError::require_positive("stribeck_velocity", self.stribeck_velocity)?;
        ModelError::require_positive("stribeck_exponent", self.stribeck_exponent)?;
        ModelError::require_positive("transition_velocity", self.transition_velocity)
    }

    /// True when there is friction at all.
    #[inline]
    pub fn is_active(&self) -> bool {
        self.coulomb_force != 0.0 || self.stribeck_force != 0.0
    }

    /// Force opposing `velocity` (m/s), N.
    #[inline]
    pub fn force(&self, velocity: f64) -> f64 {
        if !self.is_active() {
            return 0.0;
        }
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
fn tanh(x: f64) -> f64 {
    if x.abs() > 19.0 {
        x.signum()
    } else {
        1.0 - 2.0 / ((2.0 * x).exp() + 1.0)
    }
}

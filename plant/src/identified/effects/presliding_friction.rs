//! Dry friction whose contact gives way elastically before it slides.

use super::friction::{COULOMB_FORCE, FRICTION_LAW, STICKS, STRIBECK_FORCE, STRIBECK_VELOCITY};
use super::quantity::LENGTH;
use super::{Component, Effect, Family, Parameter, Scale, TableMotion};
use crate::ModelError;
use units::constants::{INCH, LBF};
use units::vocabulary;

/// Friction `(F_c + F_s exp(-(v/v_s)^2)) z`, where the bristles' deflection `z`, in units of that at which they
/// slide, follows `dz/dx = (1 - z sign v) / d`: the law of Dahl (Aerospace Corporation TOR-0158, 1968) with the
/// breakaway bump of LuGre (Canudas de Wit and others, IEEE Trans. Autom. Control 40, 1995).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PreslidingFriction {
    /// F_c, N.
    pub coulomb_force: f64,
    /// d, over which the contact begins to slide, m.
    pub presliding_displacement: f64,
    /// F_s, the bump above F_c, N.
    pub stribeck_force: f64,
    /// v_s, m/s.
    pub stribeck_velocity: f64,
}

impl Default for PreslidingFriction {
    fn default() -> Self {
        Self {
            coulomb_force: 0.0,
            presliding_displacement: 1e-3 * INCH,
            stribeck_force: 0.0,
            stribeck_velocity: 0.5 * INCH,
        }
    }
}

impl PreslidingFriction {
    /// The deflection at `motion`, from what it was at a displacement in `memory`.
    #[inline]
    fn deflection(&self, [then, was]: &[f64; 2], motion: &TableMotion) -> f64 {
        let slides = if motion.velocity < 0.0 { -1.0 } else { 1.0 };
        let way = (motion.displacement - then).abs();
        slides + (was - slides) * (-way / self.presliding_displacement).exp()
    }
}

impl Family for PreslidingFriction {
    /// Displacement (m) and deflection after the last step.
    type Memory = [f64; 2];

    const EFFECTS: &'static [Effect] = &[Effect {
        equation: "m a = F - (F_c + F_s exp(-(v/v_s)^2)) z - c v - k x, dz/dx = (1 - z sign v) / d",
        sentence: "the table has dry friction of {} that gives way before it slides, and {} more to break away",
        parameters: &[
            COULOMB_FORCE
                .about("Force opposing the velocity once the contact slides; 0 is off")
                .on_table(|e| &mut e.presliding_friction.coulomb_force),
            Parameter::new(
                "presliding_displacement",
                LENGTH,
                "Displacement over which the contact begins to slide",
            )
            .shape(
                Scale::Logarithmic,
                1e-3 * INCH,
                1.0,
                (5e-5 * INCH, 0.03 * INCH),
            )
            .on_table(|e| &mut e.presliding_friction.presliding_displacement)
            .min(1e-9),
            STRIBECK_FORCE
                .about("Breakaway bump above the Coulomb force at low speed")
                .on_table(|e| &mut e.presliding_friction.stribeck_force)
                .without_switch(),
            STRIBECK_VELOCITY.on_table(|e| &mut e.presliding_friction.stribeck_velocity),
        ],
        starts: &[
            &[1.0 * LBF, 1e-3 * INCH, 0.3 * LBF, 0.5 * INCH],
            &[1.0 * LBF, 4e-3 * INCH, 0.3 * LBF, 0.5 * INCH],
            &[1.0 * LBF, 1e-3 * INCH, 1.0 * LBF, 0.5 * INCH],
        ],
        confounded_with: &[vocabulary::COULOMB_FRICTION, "stribeck_friction"],
        contains: Some(vocabulary::COULOMB_FRICTION),
        is_fast: true,
        needs_co_simulation: true,
        tolerance: STICKS,
        law: FRICTION_LAW,
        ..Effect::new("presliding_friction", Component::ShakeTable)
    }];

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("presliding_friction.coulomb_force", self.coulomb_force)?;
        ModelError::require_finite("presliding_friction.stribeck_force", self.stribeck_force)?;
        ModelError::require_positive(
            "presliding_friction.presliding_displacement",
            self.presliding_displacement,
        )?;
        ModelError::require_positive(
            "presliding_friction.stribeck_velocity",
            self.stribeck_velocity,
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
    fn resisting_force(&self, motion: &TableMotion, memory: &[f64; 2]) -> f64 {
        if !self.is_active() {
            return 0.0;
        }
        let mut level = self.coulomb_force;
        if self.stribeck_force != 0.0 {
            let speed = motion.velocity / self.stribeck_velocity;
            level += self.stribeck_force * (-speed * speed).exp();
        }
        level * self.deflection(memory, motion)
    }

    #[inline]
    fn remember(&self, memory: &mut [f64; 2], motion: &TableMotion) {
        if self.is_active() {
            *memory = [motion.displacement, self.deflection(memory, motion)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against Dahl's equation integrated in small steps, over two reversals.
    #[test]
    fn the_deflection_follows_dahl_s_equation() {
        let friction = PreslidingFriction {
            coulomb_force: 8.0,
            presliding_displacement: 2e-4,
            ..Default::default()
        };
        let at = |k: usize| {
            let t = k as f64 / 200.0;
            TableMotion {
                displacement: 1e-3 * (1.0 - t.cos()),
                velocity: 1e-3 * t.sin(),
            }
        };
        let (mut memory, mut z) = ([0.0; 2], 0.0);
        for k in 0..1800 {
            let steps = 1000;
            let from = k as f64 / 200.0;
            for i in 0..steps {
                let t = from + (i as f64 + 0.5) / (200.0 * steps as f64);
                let way = 1e-3 * t.sin() / (200.0 * steps as f64);
                z += (way - way.abs() * z) / 2e-4;
            }
            let force = friction.resisting_force(&at(k + 1), &memory);
            friction.remember(&mut memory, &at(k + 1));
            assert!((force - 8.0 * z).abs() < 0.02, "{k}: {force}, {}", 8.0 * z);
        }
    }
}

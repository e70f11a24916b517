//! Compensation of dry friction by a model of the seals along the wanted motion (B. Armstrong-Hélouvry, P.
//! Dupont and C. Canudas de Wit, Automatica 30, 1994, section 5.3: feedforward by a friction model).

use plant::identified::seal_shape::SealShape;
use units::Parameters;

use super::rig::KnownRig;
use crate::{ModelError, Motion};

/// `u = (df/dt + p f)/g` with `f = F_c s(z, v)` of [`SealShape`], whose deflection `z` before sliding
/// follows the wanted velocity at the time at which the valve has opened: `v_d + T a_d`, `T` the spool's lag and
/// a period.
///
/// The wanted motion, not the measured one, moves the model: nothing is fed back, so no limit cycle can
/// come of friction that is taken for too large.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct FrictionCompensation {
    /// Coulomb friction of the seals, N.
    #[parameter("N" => "lbf", name = "seal_friction", min = 0.0, non_negative)]
    pub friction: f64,
    /// Its shape.
    #[parameters]
    pub shape: SealShape,
    /// What the law remembers.
    pub memory: FrictionMemory,
}

/// Memory of [`FrictionCompensation`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct FrictionMemory {
    /// Deflection of the seals over that at which they slide.
    deflection: f64,
    /// Velocity at the sample before, m/s; absent before the first.
    velocity: Option<f64>,
    /// Friction at the sample before, N.
    force: f64,
}

impl Default for FrictionCompensation {
    /// Without friction.
    fn default() -> Self {
        Self {
            friction: 0.0,
            shape: crate::preview::Parameters::default().load.shape,
            memory: FrictionMemory::default(),
        }
    }
}

impl FrictionCompensation {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }

    /// What is added to the valve command of this sample, V.
    pub fn step(&mut self, reference: &Motion, rig: &KnownRig, period: f64) -> f64 {
        let lead = rig.hydraulics.spool_lag + period;
        let velocity = reference.velocity + lead * reference.acceleration;
        let before = self.memory.velocity.replace(velocity).unwrap_or(velocity);
        let deflection = self
            .shape
            .follow(self.memory.deflection, [before, velocity], period);
        let force = self.friction * self.shape.force(deflection, velocity);
        let rate = (force - self.memory.force) / period;
        self.memory.deflection = deflection;
        self.memory.force = force;
        rig.opening(force, rate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the valve adds makes the force of the oil follow the friction: the opening, integrated as the
    /// oil does, gives the friction's own history.
    #[test]
    fn the_oil_under_what_is_added_carries_the_friction() {
        let rig = KnownRig::default();
        let mut law = FrictionCompensation {
            friction: 13.0,
            ..FrictionCompensation::default()
        };
        let period = 0.002;
        let own = &rig.hydraulics;
        let lead = own.spool_lag + period;
        let (mut oil, mut worst, mut most) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut velocities = Vec::new();
        for k in 0..2000 {
            let phase = std::f64::consts::TAU * f64::from(k) * period;
            let reference = Motion {
                displacement: 0.0,
                velocity: 0.1 * phase.sin(),
                acceleration: 0.1 * std::f64::consts::TAU * phase.cos(),
            };
            velocities.push(reference.velocity + lead * reference.acceleration);
            let opening = law.step(&reference, &rig, period);
            let expected = law.memory.force;
            oil += period * (own.force_rate * opening - own.leakage_rate * oil);
            worst = worst.max((oil - expected).abs());
            most = most.max(expected.abs());
        }
        assert!(worst < 0.02 * law.friction, "{worst} N of {most} N");
        let history = law.shape.history(&velocities, period);
        let last = law.friction * history.last().unwrap();
        assert!((law.memory.force - last).abs() < 1e-9);
        // Beyond the bump the seals slide at the Coulomb force.
        assert!(most < 1.5 * law.friction && most > 0.99 * law.friction);
    }
}

//! Compensation of the force with which a specimen acts on the table, from measurements (interaction or
//! payload compensation of laboratory controllers; J. P. Conte and T. L. Trombetti, Earthquake Engineering and
//! Structural Dynamics 29, 2000, give the interaction).

use units::Parameters;

use super::lag::Lag;
use super::rig::KnownRig;
use crate::{ModelError, Motion};

/// `u = -(df/dt + p f)/g` with `f = m a + c v + k x - F`, what the table's motion takes beyond the
/// actuator's force, through a lag of second order.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct SpecimenForceCompensation {
    /// Specimen: corner of the lag on its force, rad/s.
    #[parameter("rad/s" => "Hz", name = "specimen_corner", positive)]
    pub corner: f64,
    /// What the law remembers.
    pub memory: Lag,
}

/// Damping ratio of the lag: flat as far as a lag of second order can be.
pub const LAG_DAMPING: f64 = std::f64::consts::FRAC_1_SQRT_2;

impl Default for SpecimenForceCompensation {
    fn default() -> Self {
        Self {
            corner: 30.0,
            memory: Lag::default(),
        }
    }
}

impl SpecimenForceCompensation {
    /// Checks the parameters.
    ///
    /// # Errors
    /// A corner that is not positive.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }

    /// Force of the specimen on the table (N) from the measured motion and the actuator's force (N).
    #[inline]
    pub fn force(measured: &Motion, actuator_force: f64, rig: &KnownRig) -> f64 {
        let table = &rig.table;
        table.mass * measured.acceleration
            + table.damping * measured.velocity
            + table.stiffness * measured.displacement
            - actuator_force
    }

    /// What is added to the valve command of this sample, V.
    pub fn step(
        &mut self,
        measured: &Motion,
        actuator_force: f64,
        rig: &KnownRig,
        period: f64,
    ) -> f64 {
        let force = Self::force(measured, actuator_force, rig);
        self.memory.step(force, self.corner, LAG_DAMPING, period);
        -rig.opening(self.memory.value, self.memory.rate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rigid mass on the table: its force is its mass times the acceleration.
    #[test]
    fn the_force_of_a_rigid_mass_is_found_and_opposed() {
        let rig = KnownRig::default();
        let table = &rig.table;
        let mut law = SpecimenForceCompensation {
            corner: 200.0,
            ..SpecimenForceCompensation::default()
        };
        let (mass, omega, period) = (45.0, 6.0, 0.002);
        let mut worst = 0.0_f64;
        for k in 0..4000 {
            let phase = omega * period * f64::from(k);
            let measured = Motion {
                displacement: 0.01 * phase.sin(),
                velocity: 0.01 * omega * phase.cos(),
                acceleration: -0.01 * omega * omega * phase.sin(),
            };
            let actuator = (table.mass + mass) * measured.acceleration
                + table.damping * measured.velocity
                + table.stiffness * measured.displacement;
            let got = law.step(&measured, actuator, &rig, period);
            // The lag is late by 2 D/w and half a period.
            let late = 2.0 * LAG_DAMPING / law.corner + 0.5 * period;
            let phase = phase - omega * late;
            let force = 0.01 * mass * omega * omega * phase.sin();
            let rate = 0.01 * mass * omega.powi(3) * phase.cos();
            if k > 500 {
                worst = worst.max((got + rig.opening(force, rate)).abs());
            }
        }
        let size = rig.opening(0.0, 0.01 * mass * omega.powi(3));
        assert!(worst < 0.02 * size, "{worst} V of {size} V");
    }
}

//! The linear specimen of Appendix A: one storey on the table.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};

use crate::ModelError;
use crate::linear::zero_order_hold;
use units::Parameters;
use units::constants::{INCH, LBF};

/// A mass on a linear spring and damper that stand on the table (Eq A-1):
/// `ms (at + d'') + cs d' + ks d = 0`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct LinearSpecimen {
    /// Mass of the storey, kg.
    #[parameter("kg" => "lbf.s2/in", positive)]
    pub mass: f64,
    /// Viscous damping of the storey, N.s/m.
    #[parameter("N.s/m" => "lbf.s/in", non_negative)]
    pub damping: f64,
    /// Stiffness of the storey, N/m.
    #[parameter("N/m" => "lbf/in", non_negative)]
    pub stiffness: f64,
}

impl LinearSpecimen {
    /// Takes mass (kg), period (s) and damping ratio.
    pub fn from_period(mass: f64, period: f64, damping_ratio: f64) -> Self {
        let omega = TAU / period;
        Self {
            mass,
            damping: 2.0 * damping_ratio * mass * omega,
            stiffness: mass * omega * omega,
        }
    }

    /// Appendix A: 100 lbf at 386.4 in/s², period 1 s, damping 5 %.
    pub fn appendix_a() -> Self {
        Self::from_period(100.0 * LBF / (386.4 * INCH), 1.0, 0.05)
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// A mass that is not positive, negative damping or stiffness.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }

    /// Force on the table in N, positive along the drift.
    pub fn force(&self, state: &SpecimenState) -> f64 {
        self.stiffness * state.drift + self.damping * state.drift_velocity
    }

    /// Absolute acceleration of the mass in m/s² (Eq 4-15).
    pub fn acceleration(&self, state: &SpecimenState) -> f64 {
        -self.force(state) / self.mass
    }

    /// Transition over `step` seconds with the table's acceleration held.
    pub fn sample(&self, step: f64) -> SampledSpecimen {
        let (ks, cs) = (self.stiffness / self.mass, self.damping / self.mass);
        let (transition, input) = zero_order_hold(
            &Matrix2::new(0.0, 1.0, -ks, -cs),
            &Vector2::new(0.0, -1.0),
            step,
        );
        SampledSpecimen {
            step,
            transition,
            input,
        }
    }
}

impl Default for LinearSpecimen {
    fn default() -> Self {
        Self::appendix_a()
    }
}

/// Motion of the specimen relative to the table.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct SpecimenState {
    /// Drift in m.
    pub drift: f64,
    /// Drift velocity in m/s.
    pub drift_velocity: f64,
}

/// The specimen's exact transition over one step with held input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledSpecimen {
    step: f64,
    transition: Matrix2<f64>,
    input: Vector2<f64>,
}

impl SampledSpecimen {
    /// The step it was made for, s.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// The state one step later under `table_acceleration` (m/s²).
    pub fn advance(&self, state: &SpecimenState, table_acceleration: f64) -> SpecimenState {
        let next = self.transition * Vector2::new(state.drift, state.drift_velocity)
            + self.input * table_acceleration;
        SpecimenState {
            drift: next.x,
            drift_velocity: next.y,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_vibration_has_the_period_and_damping_asked_for() {
        let specimen = LinearSpecimen::appendix_a();
        let mut state = SpecimenState {
            drift: 0.01,
            drift_velocity: 0.0,
        };
        let damped = TAU * (1.0f64 - 0.05 * 0.05).sqrt();
        let sampled = specimen.sample(0.002);
        for step in 1..=2000 {
            state = sampled.advance(&state, 0.0);
            let t = 0.002 * f64::from(step);
            let decay = (-0.05 * TAU * t).exp();
            let ratio = 0.05 * TAU / damped;
            let expected = 0.01 * decay * ((damped * t).cos() + ratio * (damped * t).sin());
            assert!((state.drift - expected).abs() < 1e-14, "at {t} s");
        }
    }

    #[test]
    fn the_storey_of_appendix_a_weighs_100_lbf() {
        let specimen = LinearSpecimen::appendix_a();
        // 386.4 in/s² are 9.81456 m/s²; 100 lbf are 444.822 N.
        assert!((specimen.mass * 9.814_56 - 444.822_161_526_05).abs() < 1e-9);
        let omega = (specimen.stiffness / specimen.mass).sqrt();
        assert!((omega - TAU).abs() < 1e-12);
        let ratio = specimen.damping / (2.0 * specimen.mass * omega);
        assert!((ratio - 0.05).abs() < 1e-15);
    }

    #[test]
    fn a_sampled_specimen_knows_its_step() {
        assert_eq!(LinearSpecimen::appendix_a().sample(0.005).step(), 0.005);
    }
}

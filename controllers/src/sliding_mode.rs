//! Sliding mode over a displacement and a force loop (Sections 4.2 and 4.3, Fig 4-3).
//!
//! # The law
//! With the tracking error `e = x - x_d` and the surface `S = de/dt + lambda e` (Eq 4-7 as meant),
//! `dS/dt = -K S - K_s sat(S / phi)` gives (Eq 4-17, 4-18, with the table's damping)
//!
//! ```text
//! F      = F_disp + F_v/a
//! F_disp = m lambda K (x_d - x) + k x
//! F_v/a  = m (K + lambda) (v_d - v) + m a_d + m_s a_s + c v - m K_s sat(S / phi)
//! ```
//!
//! `a_s` is the specimen's absolute acceleration: `m_s a_s` is the force that it takes from the
//! table (Eq 4-15). The displacement loop gets `F_disp / k`, the force loop `F`. The switching term
//! is the option of a boundary layer; Eq 4-17 has none (`K_s = 0`).
//!
//! # Choice of lambda and K
//! `lambda = K`: the surface is reached as fast as it is slid along (a double pole, no overshoot).
//! Both lie a decade below the highest crossover of the sampled force loop with its share of the
//! valve, so that the loop that has to make `F` adds less than 6 degrees of lag at the rate at which
//! the law relies on it: [`rate_by_rule`](crate::tuning::sliding_mode::rate_by_rule). The low-level
//! loops are those of [`hierarchy`](crate::hierarchy).

use plant::identified::table::Table;
use plant::specimens::linear::LinearSpecimen;
use units::{Parameters, vocabulary};

use crate::hierarchy::{LowLevelReferences, SlidingModeInput};
use crate::prediction_over_delay::PredictionOverDelay;
use crate::{Controller, ModelError, Motion};

/// `lambda = K` of [`rate_by_rule`](crate::tuning::sliding_mode::rate_by_rule) on the identified table at 500 Hz with `beta = 0.5`, 1/s.
pub const IDENTIFIED_RATE: f64 = 69.6;

/// The sliding-mode law.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct SlidingMode {
    /// The table: `m`, `c`, `k`.
    pub table: Table,
    /// Mass of the specimen whose acceleration is measured, kg.
    #[parameter("kg", name = vocabulary::SPECIMEN_MASS, non_negative)]
    pub specimen_mass: f64,
    /// lambda of Eq 4-7, 1/s.
    #[parameter("1/s", positive)]
    pub surface_rate: f64,
    /// K of Eq 4-12, 1/s.
    #[parameter("1/s", positive)]
    pub reaching_rate: f64,
    /// K_s of the switching term, 0 for none, m/s2.
    ///
    /// Zero for the law as printed.
    #[parameter("m/s2" => "g", non_negative)]
    pub switching_gain: f64,
    /// phi of the switching term, m/s.
    #[parameter("m/s" => "in/s", positive)]
    pub boundary_layer: f64,
    /// Prediction over transport delay; absent where the loop has none.
    pub prediction: Option<PredictionOverDelay>,
}

impl SlidingMode {
    /// Without switching and without delay.
    pub fn new(table: Table, specimen_mass: f64, surface_rate: f64, reaching_rate: f64) -> Self {
        Self {
            table,
            specimen_mass,
            surface_rate,
            reaching_rate,
            switching_gain: 0.0,
            boundary_layer: 0.01,
            prediction: None,
        }
    }

    /// Gains of the force command on displacement, velocity and acceleration error,
    /// `[m lambda K, m (lambda + K), m]`; inside the boundary layer `K_s / phi` adds to `K`.
    pub fn error_gains(&self) -> [f64; 3] {
        let mass = self.table.mass;
        let reaching = self.reaching_rate + self.switching_gain / self.boundary_layer;
        [
            mass * self.surface_rate * reaching,
            mass * (self.surface_rate + reaching),
            mass,
        ]
    }

    /// The surface `S` in m/s (Eq 4-7).
    pub fn surface(&self, reference: &Motion, measured: &Motion) -> f64 {
        measured.velocity - reference.velocity
            + self.surface_rate * (measured.displacement - reference.displacement)
    }

    /// `(F_disp, F_v/a)` of Eq 4-18 in N.
    pub fn forces(
        &self,
        reference: &Motion,
        measured: &Motion,
        specimen_acceleration: f64,
    ) -> (f64, f64) {
        let Table {
            mass,
            damping,
            stiffness,
        } = self.table;
        let (lambda, k) = (self.surface_rate, self.reaching_rate);
        let switching = self.switching_gain
            * (self.surface(reference, measured) / self.boundary_layer).clamp(-1.0, 1.0);
        let displacement_force =
            mass * lambda * k * (reference.displacement - measured.displacement)
                + stiffness * measured.displacement;
        let motion_force = mass * (k + lambda) * (reference.velocity - measured.velocity)
            + mass * reference.acceleration
            + self.specimen_mass * specimen_acceleration
            + damping * measured.velocity
            - mass * switching;
        (displacement_force, motion_force)
    }
}

impl Default for SlidingMode {
    /// On the identified table, for the specimen of Appendix A, with lambda and K by the rule.
    fn default() -> Self {
        Self::new(
            Table::default(),
            LinearSpecimen::appendix_a().mass,
            IDENTIFIED_RATE,
            IDENTIFIED_RATE,
        )
    }
}

impl Controller for SlidingMode {
    type Input = SlidingModeInput;
    type Output = LowLevelReferences;

    fn validate(&self) -> Result<(), ModelError> {
        self.table.validate()?;
        self.check()?;
        self.prediction
            .as_ref()
            .map_or(Ok(()), PredictionOverDelay::validate)
    }

    fn step(&mut self, input: &SlidingModeInput, period: f64) -> LowLevelReferences {
        let Some(mut prediction) = self.prediction else {
            let (displacement, motion) = self.forces(
                &input.reference,
                &input.measured,
                input.specimen_acceleration,
            );
            return LowLevelReferences {
                displacement: displacement / self.table.stiffness,
                force: displacement + motion,
            };
        };
        let foreseen = prediction.foresee(input, self.specimen_mass, period);
        let at = foreseen.action;
        let (displacement, motion) =
            self.forces(&foreseen.reference, &at.motion, at.specimen_acceleration);
        // The low-level loops subtract what they measure when the references reach them: what is
        // predicted to be different when the valve moves is added here.
        let references = LowLevelReferences {
            displacement: displacement / self.table.stiffness - at.motion.displacement
                + foreseen.low_level.motion.displacement,
            force: displacement + motion - at.force + foreseen.low_level.force,
        };
        prediction.remember(&references, input, period);
        self.prediction = Some(prediction);
        references
    }

    fn reset(&mut self) {
        if let Some(prediction) = &mut self.prediction {
            prediction.reset();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law() -> SlidingMode {
        SlidingMode {
            switching_gain: 0.8,
            boundary_layer: 0.05,
            ..SlidingMode::new(Table::default(), 150.0, 40.0, 70.0)
        }
    }

    /// Motions on both sides of the surface, within the boundary layer and outside of it.
    fn motions() -> Vec<(Motion, Motion, f64)> {
        let reference = Motion {
            displacement: 0.01,
            velocity: -0.2,
            acceleration: 1.5,
        };
        [
            [0.0098, -0.19, 0.7],
            [0.0103, -0.2, 1.0],
            [0.03, 0.4, -2.0],
            [-0.02, -0.6, 3.0],
        ]
        .into_iter()
        .map(|[displacement, velocity, specimen_acceleration]| {
            let measured = Motion {
                displacement,
                velocity,
                acceleration: 0.0,
            };
            (reference, measured, specimen_acceleration)
        })
        .collect()
    }

    #[test]
    fn under_the_law_the_surface_decays_as_it_says() {
        let law = law();
        let mut within = 0;
        for (reference, measured, specimen_acceleration) in motions() {
            let (displacement, motion) = law.forces(&reference, &measured, specimen_acceleration);
            // Newton on the table (Eq 4-15): spring, damper and specimen pull back.
            let acceleration = (displacement + motion
                - law.table.stiffness * measured.displacement
                - law.table.damping * measured.velocity
                - law.specimen_mass * specimen_acceleration)
                / law.table.mass;
            let rate = acceleration - reference.acceleration
                + law.surface_rate * (measured.velocity - reference.velocity);
            let surface = law.surface(&reference, &measured);
            let saturated = if surface.abs() < law.boundary_layer {
                within += 1;
                surface / law.boundary_layer
            } else {
                surface.signum()
            };
            let expected = -law.reaching_rate * surface - law.switching_gain * saturated;
            assert!(
                (rate - expected).abs() < 1e-9 * (1.0 + expected.abs()),
                "S = {surface}: {rate} {expected}"
            );
        }
        assert_eq!(within, 2);
    }

    #[test]
    fn error_gains_are_the_slopes_of_the_force_within_the_boundary_layer() {
        let law = law();
        let (reference, measured, specimen_acceleration) = motions()[0];
        let force = |change: [f64; 3]| {
            let reference = Motion {
                displacement: reference.displacement + change[0],
                velocity: reference.velocity + change[1],
                acceleration: reference.acceleration + change[2],
            };
            let (a, b) = law.forces(&reference, &measured, specimen_acceleration);
            a + b
        };
        for (i, gain) in law.error_gains().into_iter().enumerate() {
            let mut change = [0.0; 3];
            change[i] = 1e-6;
            let slope = (force(change) - force([0.0; 3])) / 1e-6;
            assert!((slope / gain - 1.0).abs() < 1e-5, "{i}: {slope} {gain}");
        }
    }

    #[test]
    fn the_displacement_loop_gets_its_force_over_the_stiffness_and_the_force_loop_all() {
        let mut law = law();
        for (reference, measured, specimen_acceleration) in motions() {
            let input = SlidingModeInput {
                reference,
                measured,
                specimen_acceleration,
                ..SlidingModeInput::default()
            };
            let (displacement, motion) = law.forces(&reference, &measured, specimen_acceleration);
            let got = law.step(&input, 0.002);
            assert!((got.displacement * law.table.stiffness - displacement).abs() < 1e-9);
            assert!((got.force - displacement - motion).abs() < 1e-9);
        }
    }
}

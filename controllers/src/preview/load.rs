//! Forces on the table that follow from the wanted motion: dry friction of the seals and the
//! specimen's reaction.

use plant::identified::seal_shape::SealShape;
use plant::specimens::{YieldingSpecimen, YieldingState};

use units::Parameters;

use crate::aids::friction::FrictionCompensation;
use crate::{ModelError, Motion};

/// What acts on the table beside the actuator's oil, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct KnownLoad {
    /// Coulomb friction of the seals; 0: no compensation, N.
    #[parameter("N" => "lbf", name = FrictionCompensation::SEAL_FRICTION, min = 0.0, non_negative)]
    pub friction: f64,
    /// Its shape.
    #[parameters]
    pub shape: SealShape,
    /// The specimen, if one stands on the table.
    pub specimen: Option<YieldingSpecimen>,
}

/// What the load remembers along the wanted motion.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct LoadState {
    /// Deflection of the seals over that at which they slide.
    seal: f64,
    specimen: YieldingState,
}

impl KnownLoad {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_non_negative(FrictionCompensation::SEAL_FRICTION, self.friction)?;
        if self.friction > 0.0 {
            self.shape.validate()?;
        }
        self.specimen
            .as_ref()
            .map_or(Ok(()), YieldingSpecimen::validate)
    }

    /// Force on the table (N) while it moves as `motion`.
    pub fn force(&self, state: &LoadState, motion: &Motion) -> f64 {
        let mut force = 0.0;
        if self.friction > 0.0 {
            force -= self.friction * self.shape.force(state.seal, motion.velocity);
        }
        if let Some(specimen) = &self.specimen {
            force += specimen.force(&state.specimen);
        }
        force
    }

    /// The state after the table went from one motion to the other in `period` s.
    pub fn advance(&self, state: &LoadState, [from, to]: [&Motion; 2], period: f64) -> LoadState {
        let mut next = *state;
        if self.friction > 0.0 {
            let velocities = [from.velocity, to.velocity];
            next.seal = self.shape.follow(state.seal, velocities, period);
        }
        if let Some(specimen) = &self.specimen {
            let mean = 0.5 * (from.acceleration + to.acceleration);
            next.specimen = specimen.advance(&state.specimen, mean, period);
        }
        next
    }
}

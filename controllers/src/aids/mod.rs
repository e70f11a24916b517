//! What operators switch on between a controller and the valve, whatever the controller is.
//!
//! ```text
//! u = h⁻¹(u_c + friction + specimen + harmonics - pressure),   |u| <= limit
//! ```
//!
//! Each is a law of its own on what is known of valve, oil and table ([`rig`]).

pub mod delta_pressure;
pub mod friction;
pub mod harmonics;
pub mod lag;
pub mod rig;
pub mod specimen_force;
pub mod valve;

use self::delta_pressure::DeltaPressure;
use self::friction::{FrictionCompensation, FrictionMemory};
use self::harmonics::{HarmonicControl, HarmonicMemory};
use self::lag::Lag;
use self::rig::KnownRig;
use self::specimen_force::SpecimenForceCompensation;
use self::valve::{Spools, ValveCompensation};
use crate::pid::VALVE_LIMIT;
use crate::{Controller, ModelError, Motion};
use units::{Parameters, vocabulary};

/// Which aids are on.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize, Parameters,
)]
pub struct Switches {
    /// Whether dry friction along the wanted motion is compensated.
    ///
    /// See [`FrictionCompensation`].
    #[parameter(name = vocabulary::FRICTION_COMPENSATION)]
    pub friction: bool,
    /// Whether the specimen's measured force is compensated.
    ///
    /// See [`SpecimenForceCompensation`].
    #[parameter(name = vocabulary::SPECIMEN_COMPENSATION)]
    pub specimen: bool,
    /// Whether the actuator's force makes the valve yield.
    ///
    /// See [`DeltaPressure`].
    #[parameter(name = vocabulary::PRESSURE_STABILISATION)]
    pub pressure: bool,
    /// Whether the valve's curve is compensated.
    ///
    /// See [`ValveCompensation`].
    #[parameter(name = "valve_compensation")]
    pub valve: bool,
}

/// The aids.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct OperatorAids {
    /// Which are on; harmonics say so themselves.
    pub on: Switches,
    /// What is known of the rig.
    pub rig: KnownRig,
    /// Compensation of dry friction.
    pub friction: FrictionCompensation,
    /// Compensation of the specimen's force.
    pub specimen: SpecimenForceCompensation,
    /// Differential-pressure stabilisation.
    pub pressure: DeltaPressure,
    /// Compensation of the valve's curve.
    pub valve: ValveCompensation,
    /// Amplitude and phase control, harmonic cancellation.
    pub harmonics: HarmonicControl,
    /// Largest magnitude of the valve command, V.
    pub limit: f64,
    /// Whether the command before met its limit.
    pub saturated: bool,
}

impl Default for OperatorAids {
    /// Everything off.
    fn default() -> Self {
        Self {
            on: Switches::default(),
            rig: KnownRig::default(),
            friction: FrictionCompensation::default(),
            specimen: SpecimenForceCompensation::default(),
            pressure: DeltaPressure::default(),
            valve: ValveCompensation::default(),
            harmonics: HarmonicControl::default(),
            limit: VALVE_LIMIT,
            saturated: false,
        }
    }
}

/// What the aids are told.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct AidsInput {
    /// The controller's command, V.
    pub command: f64,
    /// Wanted motion.
    pub reference: Motion,
    /// Measured motion.
    pub measured: Motion,
    /// Measured force of the actuator, N.
    pub force: f64,
}

impl Controller for OperatorAids {
    type Input = AidsInput;
    /// Valve command, V.
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.rig.validate()?;
        self.friction.validate()?;
        self.specimen.validate()?;
        self.pressure.validate()?;
        self.valve.validate()?;
        self.harmonics.validate()?;
        ModelError::require_positive(vocabulary::VALVE_LIMIT, self.limit)
    }

    fn step(&mut self, input: &AidsInput, period: f64) -> f64 {
        let (rig, on) = (&self.rig, &self.on);
        let (reference, measured) = (&input.reference, &input.measured);
        let mut command = input.command;
        if self.harmonics.is_on() {
            let acceleration = measured.acceleration;
            let saturated = self.saturated;
            command += self
                .harmonics
                .step(reference, acceleration, saturated, rig, period);
        }
        if on.friction {
            command += self.friction.step(reference, rig, period);
        }
        if on.specimen {
            command += self.specimen.step(measured, input.force, rig, period);
        }
        if on.pressure {
            command += self.pressure.step(input.force, period);
        }
        if on.valve {
            let hydraulics = &self.rig.hydraulics;
            command = self.valve.step(command, hydraulics, self.limit, period);
        }
        let sent = command.clamp(-self.limit, self.limit);
        self.saturated = sent != command;
        sent
    }

    fn reset(&mut self) {
        self.friction.memory = FrictionMemory::default();
        self.specimen.memory = Lag::default();
        self.pressure.slow = 0.0;
        self.harmonics.memory = HarmonicMemory::default();
        self.valve.memory = Spools::default();
        self.saturated = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aids_that_are_off_leave_the_command_as_it_is_within_the_limit() {
        let mut aids = OperatorAids::default();
        aids.friction.friction = 13.0;
        let mut step = |command| {
            let input = AidsInput {
                command,
                reference: Motion {
                    velocity: 0.3,
                    ..Motion::default()
                },
                force: 100.0,
                ..AidsInput::default()
            };
            aids.step(&input, 0.002)
        };
        assert_eq!(
            [step(3.25), step(40.0), step(-40.0)],
            [3.25, VALVE_LIMIT, -VALVE_LIMIT]
        );
    }
}

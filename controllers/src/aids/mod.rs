//! What operators switch on between a controller and the valve, whatever the controller is.
//!
//! ```text
//! u = notch(u_c) + friction + specimen + harmonics - observer - pressure,   |u| <= limit
//! ```
//!
//! Each is a law of its own on what is known of valve, oil and table ([`rig`]). The observer is told the
//! command less what friction and specimen got, so that it finds only what those two leave.

pub mod delta_pressure;
pub mod disturbance_observer;
pub mod friction;
pub mod harmonics;
pub mod lag;
pub mod notch;
pub mod rig;
pub mod specimen_force;

use self::delta_pressure::DeltaPressure;
use self::disturbance_observer::{DisturbanceObserver, ObserverMemory};
use self::friction::{FrictionCompensation, FrictionMemory};
use self::harmonics::{HarmonicControl, HarmonicMemory};
use self::lag::Lag;
use self::notch::Notch;
use self::rig::KnownRig;
use self::specimen_force::SpecimenForceCompensation;
use crate::pid::VALVE_LIMIT;
use crate::{Controller, ModelError, Motion};

/// Which aids are on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct Switches {
    /// [`FrictionCompensation`].
    pub friction: bool,
    /// [`SpecimenForceCompensation`].
    pub specimen: bool,
    /// [`DisturbanceObserver`].
    pub observer: bool,
    /// [`DeltaPressure`].
    pub pressure: bool,
    /// [`Notch`].
    pub notch: bool,
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
    /// Disturbance observer.
    pub observer: DisturbanceObserver,
    /// Differential-pressure stabilisation.
    pub pressure: DeltaPressure,
    /// Notch.
    pub notch: Notch,
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
            observer: DisturbanceObserver::default(),
            pressure: DeltaPressure::default(),
            notch: Notch::default(),
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
        self.observer.validate()?;
        self.pressure.validate()?;
        self.notch.validate()?;
        self.harmonics.validate()?;
        ModelError::require_positive("valve_limit", self.limit)
    }

    fn step(&mut self, input: &AidsInput, period: f64) -> f64 {
        let (rig, on) = (&self.rig, &self.on);
        let (reference, measured) = (&input.reference, &input.measured);
        let mut command = input.command;
        if on.notch {
            command = self.notch.step(command, period);
        }
        if self.harmonics.is_on() {
            let acceleration = measured.acceleration;
            let saturated = self.saturated;
            command += self
                .harmonics
                .step(reference, acceleration, saturated, rig, period);
        }
        let mut known = 0.0;
        if on.friction {
            known += self.friction.step(reference, rig, period);
        }
        if on.specimen {
            known += self.specimen.step(measured, input.force, rig, period);
        }
        command += known;
        if on.observer {
            command += self.observer.step(measured, rig, period);
        }
        if on.pressure {
            command += self.pressure.step(input.force, period);
        }
        let sent = command.clamp(-self.limit, self.limit);
        self.saturated = sent != command;
        if on.observer {
            self.observer.sent(sent - known, rig, period);
        }
        sent
    }

    fn reset(&mut self) {
        self.friction.memory = FrictionMemory::default();
        self.specimen.memory = Lag::default();
        self.observer.memory = ObserverMemory::default();
        self.pressure.slow = 0.0;
        self.notch.memory = [0.0; 2];
        self.harmonics.memory = HarmonicMemory::default();
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

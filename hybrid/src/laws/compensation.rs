//! A tracking law on a transfer system whose delay, valve and specimen are known to differ from the
//! linear equations that the law was designed on.

use crate::vrths::{TransferSystemEffects, TransferSystemParameters};

use super::TrackingInput;
use super::extrapolation::Extrapolation;
use controllers::{Controller, ModelError};

/// Any tracking law.
pub type AnyTrackingLaw = dyn Controller<Input = TrackingInput, Output = f64> + Send;

/// Compression that is undone at most: the drive grows no more than tenfold.
const MOST_COMPRESSION: f64 = 0.9;
/// Share of the play by which the drive must turn back before the play is crossed: less is noise.
const TURN: f64 = 0.25;
/// Velocity over which friction changes its side, m/s, as in the plant's equations.
const FRICTION_VELOCITY: f64 = 5.0e-3;

/// Undoes [`TransferSystemEffects`] around a law that knows nothing of them.
///
/// - A late command: the law is given the desired displacement as it will be when its command acts,
///   and the measured one as if it had moved along by as much, so that its feedback sees the error it
///   would see without the delay.
/// - The valve: with `x` close to the desired displacement, the drive that the law means is
///   `e = gain u - x_d`; the command is moved so that play, dead band and compression leave `e`.
/// - Friction and hardening of the specimen: the force `R` that they add asks for the flow
///   `R' + a3 R`, hence for `beta2 (R' + a3 R) / (gain a1b0)` of command at low frequency.
pub struct Compensated {
    law: Box<AnyTrackingLaw>,
    parameters: TransferSystemParameters,
    effects: TransferSystemEffects,
    ahead: Extrapolation,
    memory: Memory,
}

#[derive(Debug, Clone, Copy, Default)]
struct Memory {
    /// Side of the play that the drive pushes, -1 or 1; 0 before it moved.
    side: f64,
    /// Where the drive was farthest on that side, m.
    farthest: f64,
    /// Resistance at the last sample, N.
    resistance: f64,
}

impl Compensated {
    /// `law`, sampled every `period` (s), on a plant of these parameters with these effects.
    ///
    /// # Errors
    /// Parameters and effects that make no plant.
    pub fn new(
        law: Box<AnyTrackingLaw>,
        parameters: TransferSystemParameters,
        effects: TransferSystemEffects,
        period: f64,
    ) -> Result<Self, ModelError> {
        parameters.validate()?;
        effects.validate()?;
        ModelError::require_positive("period", period)?;
        let lead = effects.delay / period;
        // The longer the lead, the more of the past tells it.
        let window = if lead > 2.0 { 24 } else { 12 };
        Ok(Self {
            law,
            parameters,
            effects,
            ahead: Extrapolation::new(3, window, lead)?,
            memory: Memory::default(),
        })
    }

    /// The drive before the play that leaves `drive` behind it.
    fn before_play(&mut self, drive: f64) -> f64 {
        let play = self.effects.valve_play;
        let memory = &mut self.memory;
        if play == 0.0 {
            return drive;
        }
        let moved = drive - memory.farthest;
        if memory.side == 0.0 {
            if moved.abs() > TURN * play {
                memory.side = moved.signum();
            }
        } else if moved * memory.side > 0.0 {
            memory.farthest = drive;
        } else if moved.abs() > TURN * play {
            memory.side = -memory.side;
            memory.farthest = drive;
        }
        drive + 0.5 * play * memory.side
    }

    /// The drive that leaves `opening` behind dead band and compression.
    fn before_valve(&self, opening: f64) -> f64 {
        let size = opening.abs();
        if size == 0.0 {
            return 0.0;
        }
        let compressed = (self.effects.valve_compression * size).min(MOST_COMPRESSION);
        let open = size / (1.0 - compressed);
        // Within a twentieth of the dead band from rest it is crossed in proportion.
        let band = self.effects.valve_dead_band;
        let crossed = if band > 0.0 {
            band * (20.0 * size / band).min(1.0)
        } else {
            0.0
        };
        (open + crossed).copysign(opening)
    }

    /// Command for what the specimen resists beyond its linear equation.
    fn against_resistance(&mut self, displacement: f64, velocity: f64, period: f64) -> f64 {
        let (p, effects) = (&self.parameters, &self.effects);
        if effects.specimen_friction == 0.0 && effects.specimen_hardening == 0.0 {
            return 0.0;
        }
        let resistance = effects.specimen_friction * (velocity / FRICTION_VELOCITY).tanh()
            + p.specimen_stiffness * effects.specimen_hardening * displacement.powi(3);
        let rate = (resistance - self.memory.resistance) / period;
        self.memory.resistance = resistance;
        p.valve_beta2 * (rate + p.actuator_a3 * resistance) / (p.command_gain * p.valve_gain)
    }
}

impl Controller for Compensated {
    type Input = TrackingInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.law.validate()
    }

    fn step(&mut self, input: &TrackingInput, period: f64) -> f64 {
        let [displacement, velocity, ..] = self.ahead.step(input.desired, period);
        let (desired, shift) = if self.effects.delay > 0.0 {
            (displacement, displacement - input.desired)
        } else {
            (input.desired, 0.0)
        };
        let command = self.law.step(
            &TrackingInput {
                desired,
                measured: input.measured + shift,
                force: input.force,
            },
            period,
        );
        let command = command + self.against_resistance(desired, velocity, period);
        let gain = self.parameters.command_gain;
        let opening = gain * command - desired;
        let drive = self.before_valve(opening);
        (self.before_play(drive) + desired) / gain
    }

    fn reset(&mut self) {
        self.law.reset();
        self.ahead.reset();
        self.memory = Memory::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::model_inverse::ModelInverse;
    use crate::vrths::{ExtendedTransferSystem, PERIOD};

    fn wanted(t: f64) -> f64 {
        let ramp = (t / 2.0).min(1.0).powi(3);
        [(1.1, 2e-3), (3.6, 1e-3), (9.0, 1e-4)]
            .iter()
            .map(|(hertz, peak)| ramp * peak * (std::f64::consts::TAU * hertz * t).sin())
            .sum()
    }

    /// Rms error over rms of the desired displacement, with the law as it is and compensated.
    fn errors(effects: TransferSystemEffects) -> [f64; 2] {
        let parameters = TransferSystemParameters::default();
        let inverse = || ModelInverse {
            desired: Extrapolation::new(5, 16, 0.5).unwrap(),
            ..ModelInverse::of(&parameters, 5).unwrap()
        };
        let known = Compensated::new(Box::new(inverse()), parameters, effects, PERIOD).unwrap();
        let laws: [Box<AnyTrackingLaw>; 2] = [Box::new(inverse()), Box::new(known)];
        laws.map(|mut law| {
            let mut plant = ExtendedTransferSystem::new(parameters, effects, PERIOD).unwrap();
            let (mut error, mut size) = (0.0, 0.0);
            for k in 0..8 * 4096 {
                let desired = wanted(k as f64 * PERIOD);
                error += (plant.state.displacement - desired).powi(2);
                size += desired * desired;
                let input = TrackingInput {
                    desired,
                    measured: plant.state.displacement,
                    force: plant.force(),
                };
                plant.step(law.step(&input, PERIOD));
            }
            (error / size).sqrt()
        })
    }

    #[test]
    fn what_is_known_of_the_plant_is_taken_out() {
        let off = TransferSystemEffects::default();
        for (effects, share) in [
            (TransferSystemEffects { delay: 2e-3, ..off }, 0.1),
            (
                TransferSystemEffects {
                    valve_play: 3e-4,
                    ..off
                },
                0.5,
            ),
            (
                TransferSystemEffects {
                    valve_dead_band: 2e-4,
                    ..off
                },
                0.5,
            ),
            (
                TransferSystemEffects {
                    valve_compression: 300.0,
                    ..off
                },
                0.2,
            ),
            (
                TransferSystemEffects {
                    specimen_hardening: 2e4,
                    ..off
                },
                0.5,
            ),
        ] {
            let [plain, known] = errors(effects);
            assert!(known < share * plain, "{effects:?}: {plain} {known}");
        }
        let [plain, known] = errors(off);
        assert!((plain - known).abs() < 1e-12);
    }
}

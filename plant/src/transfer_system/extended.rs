//! The transfer system with what a laboratory's has besides its linear equations: a late command,
//! imperfections of the valve's drive, friction and hardening of the specimen.

use crate::ModelError;

use super::{TransferSystemParameters, TransferSystemState};

/// What the linear equations leave out; zero is off.
///
/// The drive of the valve, `e = gain u(t - delay) - x`, passes play, dead band and compression, in
/// this order, before it moves the spool.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct TransferSystemEffects {
    /// Delay of the command, s: conversion, computation, transport.
    pub delay: f64,
    /// Width of the play between drive and spool, m of drive.
    pub valve_play: f64,
    /// Half width of the overlap within which the valve stays shut, m of drive.
    pub valve_dead_band: f64,
    /// `c` of `e / (1 + c |e|)`, 1/m: the flow saturates as the drive grows.
    pub valve_compression: f64,
    /// Coulomb friction of the specimen's guide, N.
    pub specimen_friction: f64,
    /// `a` of the spring's force `k x (1 + a x²)`, 1/m².
    pub specimen_hardening: f64,
}

/// Velocity over which friction builds up, m/s (`tanh(x'/v)`).
const FRICTION_VELOCITY: f64 = 5.0e-3;
/// Shortest part of a step that is taken by itself, as a share of it.
const SHORTEST: f64 = 1e-9;

impl TransferSystemEffects {
    /// All off.
    pub const NONE: Self = Self {
        delay: 0.0,
        valve_play: 0.0,
        valve_dead_band: 0.0,
        valve_compression: 0.0,
        specimen_friction: 0.0,
        specimen_hardening: 0.0,
    };

    /// Whether any is on.
    pub fn is_active(&self) -> bool {
        *self != Self::NONE
    }

    /// Refuses values that make no plant.
    ///
    /// # Errors
    /// Names the first value that is negative or not a finite number.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_non_negative("delay", self.delay)?;
        ModelError::require_non_negative("valve_play", self.valve_play)?;
        ModelError::require_non_negative("valve_dead_band", self.valve_dead_band)?;
        ModelError::require_non_negative("valve_compression", self.valve_compression)?;
        ModelError::require_non_negative("specimen_friction", self.specimen_friction)?;
        ModelError::require_finite("specimen_hardening", self.specimen_hardening)
    }

    /// Where the far side of the play is, for a drive of `error` and a side that was at `before`.
    fn play(&self, error: f64, before: f64) -> f64 {
        let half = 0.5 * self.valve_play;
        before.clamp(error - half, error + half)
    }

    /// What of a drive behind the play moves the spool.
    fn opening(&self, drive: f64) -> f64 {
        let open = (drive.abs() - self.valve_dead_band).max(0.0);
        (open / (1.0 + self.valve_compression * open)).copysign(drive)
    }
}

/// The transfer system with [`TransferSystemEffects`], integrated by the classical Runge-Kutta
/// method of order 4 with the command held over each step; where the command changes within a step
/// by its delay, the step is taken in two.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtendedTransferSystem {
    parameters: TransferSystemParameters,
    effects: TransferSystemEffects,
    period: f64,
    /// What the linear part remembers.
    pub state: TransferSystemState,
    /// Far side of the play, m.
    drive: f64,
    /// Commands, the latest last; the first is the one that acts at a step's begin.
    waiting: Vec<f64>,
    /// Part of a step after which the next command acts, s.
    change: f64,
}

impl ExtendedTransferSystem {
    /// A plant at rest that is stepped by `period` (s).
    ///
    /// # Errors
    /// Refuses parameters and effects that make no plant, and periods that are not positive.
    pub fn new(
        parameters: TransferSystemParameters,
        effects: TransferSystemEffects,
        period: f64,
    ) -> Result<Self, ModelError> {
        parameters.validate()?;
        effects.validate()?;
        ModelError::require_positive("period", period)?;
        let whole = (effects.delay / period).floor();
        Ok(Self {
            parameters,
            effects,
            period,
            state: TransferSystemState::default(),
            drive: 0.0,
            waiting: vec![0.0; whole as usize + 2],
            change: effects.delay - whole * period,
        })
    }

    /// Force of the actuator, which the load cell sees, N.
    pub fn force(&self) -> f64 {
        self.state.actuator_force
    }

    /// Advances one period with `command` (m) held.
    pub fn step(&mut self, command: f64) {
        self.waiting.rotate_left(1);
        if let Some(last) = self.waiting.last_mut() {
            *last = command;
        }
        let (before, after) = (self.waiting[0], self.waiting[1]);
        let one = self.state.displacement;
        if self.change > SHORTEST * self.period {
            self.advance(before, self.change);
        }
        if self.period - self.change > SHORTEST * self.period {
            self.advance(after, self.period - self.change);
        }
        self.state.earlier = [one, self.state.earlier[0]];
    }

    fn advance(&mut self, command: f64, h: f64) {
        let s = &self.state;
        let x = [
            s.flow,
            s.flow_rate,
            s.actuator_force,
            s.displacement,
            s.velocity,
        ];
        let (p, effects, before) = (self.parameters, self.effects, self.drive);
        let (damping, wanted) = (p.specimen_damping(), p.command_gain * command);
        let slope = |x: &[f64; 5]| {
            let [flow, flow_rate, force, displacement, velocity] = *x;
            let opening = effects.opening(effects.play(wanted - displacement, before));
            let hardening = 1.0 + effects.specimen_hardening * displacement * displacement;
            let mut resistance =
                damping * velocity + p.specimen_stiffness * hardening * displacement;
            if effects.specimen_friction != 0.0 {
                resistance += effects.specimen_friction * (velocity / FRICTION_VELOCITY).tanh();
            }
            [
                flow_rate,
                p.valve_gain * opening - p.valve_beta1 * flow_rate - p.valve_beta2 * flow,
                flow - p.actuator_a2 * velocity - p.actuator_a3 * force,
                velocity,
                (force - resistance) / p.specimen_mass,
            ]
        };
        let next = crate::integration::runge_kutta_4(&x, h, slope);
        self.drive = effects.play(wanted - next[3], before);
        self.state = TransferSystemState {
            flow: next[0],
            flow_rate: next[1],
            actuator_force: next[2],
            displacement: next[3],
            velocity: next[4],
            earlier: s.earlier,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer_system::{InteractionForm, PERIOD, TransferSystem};

    fn command(k: usize) -> f64 {
        let t = k as f64 * PERIOD;
        4e-3 * (20.0 * t).sin() + 1e-3 * (71.0 * t).sin()
    }

    fn run(effects: TransferSystemEffects, samples: usize) -> Vec<[f64; 2]> {
        let parameters = TransferSystemParameters::default();
        let mut plant = ExtendedTransferSystem::new(parameters, effects, PERIOD).unwrap();
        (0..samples)
            .map(|k| {
                plant.step(command(k));
                [plant.state.displacement, plant.force()]
            })
            .collect()
    }

    #[test]
    fn without_effects_it_is_the_linear_plant() {
        let mut linear = TransferSystem::new(
            TransferSystemParameters::default(),
            InteractionForm::TransferFunction,
            PERIOD,
        )
        .unwrap();
        for (k, [x, force]) in run(TransferSystemEffects::default(), 8192)
            .into_iter()
            .enumerate()
        {
            linear.step(command(k));
            assert!((x - linear.state.displacement).abs() < 1e-12, "{k}");
            assert!((force - linear.force()).abs() < 1e-6, "{k}");
        }
    }

    #[test]
    fn a_late_command_moves_the_response_by_its_delay() {
        let plain = run(TransferSystemEffects::default(), 8192);
        let samples = 7;
        let delay = samples as f64 * PERIOD;
        let late = run(
            TransferSystemEffects {
                delay,
                ..TransferSystemEffects::default()
            },
            8192,
        );
        for k in samples..8192 {
            assert!((late[k][0] - plain[k - samples][0]).abs() < 1e-12, "{k}");
        }
        // Between two whole delays the response lies between theirs.
        let part = run(
            TransferSystemEffects {
                delay: delay - 0.5 * PERIOD,
                ..TransferSystemEffects::default()
            },
            8192,
        );
        for k in 4096..8192 {
            let between = 0.5 * (plain[k - samples][0] + plain[k - samples + 1][0]);
            assert!((part[k][0] - between).abs() < 1e-7, "{k}");
        }
    }

    #[test]
    fn static_ends_are_those_of_the_equations() {
        // Held command: the loop rests where the valve's flow equals the leakage; with the leakage
        // gone, inside the dead band or the play.
        let parameters = TransferSystemParameters {
            actuator_a3: 0.0,
            ..TransferSystemParameters::default()
        };
        for (effects, within) in [
            (
                TransferSystemEffects {
                    valve_dead_band: 2e-4,
                    ..TransferSystemEffects::default()
                },
                2e-4,
            ),
            (
                TransferSystemEffects {
                    valve_compression: 300.0,
                    ..TransferSystemEffects::default()
                },
                1e-9,
            ),
        ] {
            let mut plant = ExtendedTransferSystem::new(parameters, effects, PERIOD).unwrap();
            for _ in 0..60_000 {
                plant.step(3e-3);
            }
            let error = 3e-3 * parameters.command_gain - plant.state.displacement;
            assert!(error.abs() <= within * 1.001, "{error:e} {effects:?}");
            let force = parameters.specimen_stiffness * plant.state.displacement;
            assert!((plant.force() - force).abs() < 1.0);
        }
        let wrong = TransferSystemEffects {
            delay: -1.0,
            ..TransferSystemEffects::default()
        };
        assert!(ExtendedTransferSystem::new(parameters, wrong, PERIOD).is_err());
    }

    #[test]
    fn any_effect_alone_makes_them_active_and_none_does_not() {
        type Turn = fn(&mut TransferSystemEffects) -> &mut f64;
        let turns: [Turn; 6] = [
            |e| &mut e.delay,
            |e| &mut e.valve_play,
            |e| &mut e.valve_dead_band,
            |e| &mut e.valve_compression,
            |e| &mut e.specimen_friction,
            |e| &mut e.specimen_hardening,
        ];
        assert!(!TransferSystemEffects::NONE.is_active());
        for turn in turns {
            let mut effects = TransferSystemEffects::NONE;
            *turn(&mut effects) = 1e-3;
            assert!(effects.is_active());
        }
    }
}

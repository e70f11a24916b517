//! The physical rig with those effects of the catalogue that it has not by nature: a late command,
//! play before the spool, and a foundation that gives way.

use super::{Driven, STATES, ServoHydraulicInput, ServoHydraulicState, ServoHydraulicTable};
use crate::ModelError;
use crate::identified::effects::valve::{CommandPath, ValveEffects};
use crate::identified::effects::{Family, FoundationEffects};
use crate::integration::{self, Dynamics};

/// [`ServoHydraulicTable`] behind a command path and on a foundation; each effect is off at zero.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ExtendedServoHydraulicTable {
    /// The rig.
    pub table: ServoHydraulicTable,
    /// Pure delay of the command, s.
    pub command_delay: f64,
    /// Half width of the play between command and spool, V.
    pub hysteresis: f64,
    /// The reaction mass; its mass ratio counts masses of the bare table.
    pub foundation: FoundationEffects,
}

/// State of [`ExtendedServoHydraulicTable`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ExtendedServoHydraulicState {
    /// The rig's; displacement and velocity are relative to the foundation.
    pub table: ServoHydraulicState,
    /// Delay and play.
    pub path: CommandPath,
    /// Displacement (m) and velocity (m/s) of the foundation.
    pub foundation: [f64; 2],
}

/// States of the rig and of the foundation.
const ALL: usize = STATES + 2;

impl ExtendedServoHydraulicTable {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.table.validate()?;
        self.valve().validate()?;
        self.foundation.validate()
    }

    /// Checks the delay of the command at steps of `period` s.
    ///
    /// # Errors
    /// A delay that is longer than the memory.
    pub fn validate_delay(&self, period: f64) -> Result<(), ModelError> {
        self.valve().validate_delay(period)
    }

    fn valve(&self) -> ValveEffects {
        ValveEffects {
            command_delay: self.command_delay,
            hysteresis: self.hysteresis,
            ..ValveEffects::default()
        }
    }

    /// Name of an effect that is on and that the rig's own states do not tell all of.
    pub fn active_effect(&self) -> Option<&'static str> {
        [
            ("command_delay", self.command_delay),
            ("valve_hysteresis", self.hysteresis),
            ("foundation_compliance", self.foundation.frequency),
        ]
        .into_iter()
        .find_map(|(name, size)| (size != 0.0).then_some(name))
    }

    /// The rig at rest.
    pub fn rest(&self) -> ExtendedServoHydraulicState {
        ExtendedServoHydraulicState {
            table: self.table.rest(),
            ..ExtendedServoHydraulicState::default()
        }
    }

    /// Moves `state` on by `duration` seconds with `input` held.
    pub fn advance(
        &self,
        state: &mut ExtendedServoHydraulicState,
        input: &ServoHydraulicInput,
        duration: f64,
    ) {
        let pieces = state
            .path
            .advance(&self.valve(), input.valve_command, duration);
        for (valve_command, length) in pieces {
            if length <= 0.0 {
                continue;
            }
            let input = ServoHydraulicInput {
                valve_command,
                ..*input
            };
            if self.foundation.frequency == 0.0 {
                state.table = self.table.advance(&state.table, &input, length);
                continue;
            }
            let driven = OnFoundation {
                rig: Driven {
                    table: &self.table,
                    input: &input,
                },
                foundation: &self.foundation,
            };
            let mut x = [0.0; ALL];
            x[..STATES].copy_from_slice(&<[f64; STATES]>::from(state.table));
            x[STATES..].copy_from_slice(&state.foundation);
            let x = integration::advance(&driven, &x, length, self.table.inner_step());
            state.table = table_states(&x).into();
            state.foundation.copy_from_slice(&x[STATES..]);
        }
    }
}

fn table_states(x: &[f64; ALL]) -> [f64; STATES] {
    std::array::from_fn(|i| x[i])
}

struct OnFoundation<'a> {
    rig: Driven<'a>,
    foundation: &'a FoundationEffects,
}

impl Dynamics<ALL> for OnFoundation<'_> {
    fn derivatives(&self, x: &[f64; ALL]) -> [f64; ALL] {
        let of_table = self.rig.derivatives(&table_states(x));
        let table = self.rig.table;
        // What does not come from the specimen comes from the foundation, which feels the reverse.
        let from_foundation = table.mass() * of_table[5] - self.rig.input.specimen_force;
        let [displacement, velocity] = [x[STATES], x[STATES + 1]];
        let acceleration =
            self.foundation
                .acceleration(table.table.mass, from_foundation, displacement, velocity);
        let mut rates = [0.0; ALL];
        rates[..STATES].copy_from_slice(&of_table);
        rates[5] -= acceleration;
        rates[STATES] = velocity;
        rates[STATES + 1] = acceleration;
        rates
    }

    fn stiff_diagonal(&self, x: &[f64; ALL]) -> [f64; ALL] {
        let mut diagonal = [0.0; ALL];
        diagonal[..STATES].copy_from_slice(&self.rig.stiff_diagonal(&table_states(x)));
        diagonal
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::servo_hydraulic::SealFriction;
    use units::constants::{INCH, SAMPLING_PERIOD as PERIOD};

    fn input(valve_command: f64) -> ServoHydraulicInput {
        ServoHydraulicInput {
            valve_command,
            ..ServoHydraulicInput::default()
        }
    }

    fn command(k: u32) -> f64 {
        1.5 * (TAU * 3.0 * PERIOD * f64::from(k)).sin() + 0.4
    }

    /// States at each sample under commands of each sample.
    fn play(
        rig: &ExtendedServoHydraulicTable,
        samples: u32,
        command: impl Fn(u32) -> f64,
    ) -> Vec<ExtendedServoHydraulicState> {
        rig.validate().unwrap();
        let mut state = rig.rest();
        (0..samples)
            .map(|k| {
                rig.advance(&mut state, &input(command(k)), PERIOD);
                state
            })
            .collect()
    }

    #[test]
    fn without_effects_it_is_the_rig_to_the_bit() {
        let rig = ExtendedServoHydraulicTable::default();
        assert_eq!(rig.active_effect(), None);
        let mut plain = rig.table.rest();
        for (k, state) in play(&rig, 300, command).into_iter().enumerate() {
            plain = rig.table.advance(&plain, &input(command(k as u32)), PERIOD);
            assert_eq!(state.table, plain);
        }
    }

    #[test]
    fn a_delay_of_whole_samples_shifts_the_answer_to_the_bit_and_a_part_splits_the_step() {
        let late = |delay: f64| ExtendedServoHydraulicTable {
            command_delay: delay,
            ..ExtendedServoHydraulicTable::default()
        };
        let prompt = late(0.0);
        let shifted = play(&prompt, 300, |k| k.checked_sub(4).map_or(0.0, command));
        for (a, b) in play(&late(4.0 * PERIOD), 300, command).iter().zip(&shifted) {
            assert_eq!(a.table, b.table);
        }
        // 2.5 samples: a rig stepped at half the period, with every command from 5 halves before.
        let mut state = prompt.table.rest();
        for (k, got) in play(&late(2.5 * PERIOD), 300, command).iter().enumerate() {
            for half in 0..2 {
                let held = (2 * k + half).checked_sub(5);
                let u = held.map_or(0.0, |held| command(held as u32 / 2));
                state = prompt.table.advance(&state, &input(u), 0.5 * PERIOD);
            }
            assert!((state.displacement - got.table.displacement).abs() < 1e-15);
        }
    }

    #[test]
    fn play_takes_its_half_width_off_a_slow_spool_and_turns_late() {
        let rig = ExtendedServoHydraulicTable {
            hysteresis: 0.2,
            ..ExtendedServoHydraulicTable::default()
        };
        let frequency = 0.25;
        let run = play(&rig, 4000, |k| {
            (TAU * frequency * PERIOD * f64::from(k)).sin()
        });
        // The loop of command and spool: a parallelogram 2 w wide and 2 (A - w) high.
        let last = &run[2000..];
        let mut area = 0.0;
        for (k, pair) in last.windows(2).enumerate() {
            let t = PERIOD * (2001 + k) as f64;
            area += (TAU * frequency * t).sin() * (pair[1].table.spool - pair[0].table.spool);
        }
        let largest = last.iter().fold(0.0, |m: f64, s| m.max(s.table.spool));
        assert!((largest - 0.8).abs() < 1e-3, "{largest}");
        // The spool's own lag of 2 D / w adds pi A² 2 D Omega / w.
        let lag = 0.8 * 0.8 * std::f64::consts::PI * 1.8 * frequency / 60.0;
        let expected = 2.0 * 0.2 * 2.0 * 0.8 + lag;
        assert!(
            (area.abs() / expected - 1.0).abs() < 0.02,
            "{area} {expected}"
        );
    }

    #[test]
    fn a_foundation_without_springs_keeps_the_momentum() {
        let mut rig = ExtendedServoHydraulicTable::default();
        rig.foundation.frequency = 1e-6;
        rig.foundation.damping_ratio = 0.0;
        let wall = 12.0 * rig.table.table.mass;
        let mut largest: f64 = 0.0;
        for state in play(&rig, 500, command) {
            let [_, v] = state.foundation;
            let total = wall * v + rig.table.mass() * (v + state.table.velocity);
            largest = largest.max((wall * v).abs());
            assert!(total.abs() < 1e-9 * largest.max(1e-3), "{total:e} N s");
        }
        assert!(largest > 0.5, "{largest} N s");
    }

    #[test]
    fn a_foundation_alone_swings_as_its_closed_form() {
        // Neither oil, seals nor springs couple the table to it.
        let mut rig = ExtendedServoHydraulicTable::default();
        rig.foundation.frequency = 8.0;
        rig.table.friction = SealFriction::viscous_only(0.0);
        rig.table.table.stiffness = 1e-12;
        rig.table.table.damping = 0.0;
        rig.table.cylinder.area *= 1e-3;
        let mut state = rig.rest();
        state.foundation = [0.01 * INCH, 0.0];
        let (w, zeta) = (TAU * 8.0, 0.05_f64);
        let damped = w * (1.0 - zeta * zeta).sqrt();
        for k in 1..=100 {
            rig.advance(&mut state, &input(0.0), PERIOD);
            let t = PERIOD * f64::from(k);
            let swing = (damped * t).cos() + zeta * w / damped * (damped * t).sin();
            let expected = 0.01 * INCH * (-zeta * w * t).exp() * swing;
            assert!(
                (state.foundation[0] - expected).abs() < 1e-3 * 0.01 * INCH,
                "{k}: {} {expected}",
                state.foundation[0]
            );
        }
    }
}

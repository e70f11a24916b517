//! Actuator and table with the catalogue's effects on them, the specimen's force given.

use std::f64::consts::TAU;

use crate::ModelError;
use crate::identified::effects::valve::CommandPath;
use crate::identified::effects::{Effects, Memory, TableMotion};
use crate::identified::shake_table::{ShakeTable, ShakeTableState};
use crate::integration::{inner_steps, runge_kutta_4};

/// Number of continuous states of [`ExtendedTable`]: the actuator's three, displacement and
/// velocity (relative to the foundation), spool (2), mean demand, foundation (2).
pub const STATES: usize = 10;
const SPOOL: usize = 5;
const DEMAND: usize = 7;
const FOUNDATION: usize = 8;

/// Longest inner step, s. The fastest that the catalogue's ranges hold is friction's change of
/// sign, of the order of 1000 1/s.
const LONGEST_STEP: f64 = 2.5e-4;

/// The identified table (Eq 2-13, 2-14, 2-28) with effects, ready to compute its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtendedTable {
    effects: Effects,
    actuator: [f64; 9],
    mass: f64,
    damping: f64,
    stiffness: f64,
    foundation: [f64; 3],
    has_spool: bool,
    has_droop: bool,
    has_foundation: bool,
}

/// State of [`ExtendedTable`] between samples.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ExtendedTableState {
    /// Actuator, displacement and velocity.
    pub table: ShakeTableState,
    /// Spool (V, V/s), mean demand (V), foundation (m, m/s).
    pub added: [f64; 5],
    /// Delay and play.
    pub path: CommandPath,
    /// What the effects remember.
    pub memory: Memory,
}

impl ExtendedTableState {
    /// The continuous states in the order of [`STATES`].
    fn continuous(&self) -> [f64; STATES] {
        let ShakeTableState {
            actuator: [z1, z2, z3],
            displacement,
            velocity,
        } = self.table;
        let [a, b, c, d, e] = self.added;
        [z1, z2, z3, displacement, velocity, a, b, c, d, e]
    }

    fn set_continuous(&mut self, s: &[f64; STATES]) {
        self.table = ShakeTableState {
            actuator: [s[0], s[1], s[2]],
            displacement: s[3],
            velocity: s[4],
        };
        self.added.copy_from_slice(&s[SPOOL..]);
    }
}

#[inline]
fn motion(s: &[f64; STATES]) -> TableMotion {
    TableMotion {
        displacement: s[3],
        velocity: s[4],
    }
}

impl ExtendedTable {
    /// Prepares `shake_table` with those of `effects` that act on it.
    pub fn new(shake_table: &ShakeTable, effects: &Effects) -> Self {
        let a = shake_table.actuator;
        let [d, b, e] = [a.denominator, a.voltage_to_force, a.velocity_to_force];
        let wall = TAU * effects.foundation.frequency;
        Self {
            effects: *effects,
            actuator: [d[0], d[1], d[2], b[0], b[1], b[2], e[0], e[1], e[2]],
            mass: shake_table.table.mass + effects.table.added_mass,
            damping: shake_table.table.damping + effects.table.viscous_damping,
            stiffness: shake_table.table.stiffness,
            foundation: [
                1.0 / (effects.foundation.mass_ratio * shake_table.table.mass),
                2.0 * effects.foundation.damping_ratio * wall,
                wall * wall,
            ],
            has_spool: effects.valve.spool_frequency > 0.0,
            has_droop: effects.hydraulics.droop_loss != 0.0,
            has_foundation: wall > 0.0,
        }
    }

    /// Checks effects on a table of `mass` (kg).
    ///
    /// # Errors
    /// Names the first parameter with which they cannot be simulated.
    pub fn validate(effects: &Effects, mass: f64) -> Result<(), ModelError> {
        effects.validate()?;
        if effects.hydraulics.droop_form == 0.0 {
            return Err(ModelError::Parameter {
                name: "droop_form",
                value: 0.0,
                expected: "a number other than zero",
            });
        }
        ModelError::require_positive(
            "mass of table and added_mass",
            mass + effects.table.added_mass,
        )
    }

    /// Force of actuator, guide, damper and spring on the table, N.
    #[inline]
    fn wall_force(&self, s: &[f64; STATES], memory: &Memory) -> f64 {
        let motion = motion(s);
        let (x, v) = (motion.displacement, motion.velocity);
        s[0] - self.effects.resisting_force(&motion, memory) - self.damping * v - self.stiffness * x
    }

    /// Absolute acceleration of the table under `specimen_force` (N), m/s².
    #[inline]
    pub fn acceleration(&self, s: &[f64; STATES], memory: &Memory, specimen_force: f64) -> f64 {
        (self.wall_force(s, memory) + specimen_force) / self.mass
    }

    /// Takes in where the table has come to after an inner step.
    #[inline]
    pub fn remember(&self, memory: &mut Memory, s: &[f64; STATES]) {
        self.effects.remember(memory, &motion(s));
    }

    /// Rates of the states and the absolute acceleration (m/s²), with `drive` (V) at the spool.
    #[inline]
    pub fn rates(
        &self,
        s: &[f64; STATES],
        memory: &Memory,
        drive: f64,
        specimen_force: f64,
    ) -> ([f64; STATES], f64) {
        let effects = &self.effects;
        let [a2, a1, a0, b2, b1, b0, e2, e1, e0] = self.actuator;
        let mut rate = [0.0; STATES];
        let mut spool = drive;
        if self.has_spool {
            spool = s[SPOOL];
            rate[SPOOL] = s[SPOOL + 1];
            rate[SPOOL + 1] = effects
                .valve
                .spool_acceleration(s[SPOOL], s[SPOOL + 1], drive);
        }
        let opening = effects.valve.flow(spool);
        if self.has_droop {
            rate[DEMAND] = (opening.abs() - s[DEMAND]) / effects.hydraulics.droop_time;
        }
        let mut flow = effects.hydraulics.available_flow(opening, s[0], s[DEMAND]);
        let v = s[4];
        let mut force_rate = s[1] - a2 * s[0] + b2 * flow + e2 * v;
        if effects.hydraulics.compliance != 0.0 {
            // dF/dt stands on both sides.
            force_rate /= 1.0 + b2 * effects.hydraulics.compliance;
            flow -= effects.hydraulics.compliance * force_rate;
        }
        rate[0] = force_rate;
        rate[1] = s[2] - a1 * s[0] + b1 * flow + e1 * v;
        rate[2] = -a0 * s[0] + b0 * flow + e0 * v;

        let wall_force = self.wall_force(s, memory);
        let acceleration = (wall_force + specimen_force) / self.mass;
        rate[3] = v;
        rate[4] = acceleration;
        if self.has_foundation {
            let [per_mass, damping, stiffness] = self.foundation;
            rate[FOUNDATION] = s[FOUNDATION + 1];
            rate[FOUNDATION + 1] =
                -wall_force * per_mass - damping * s[FOUNDATION + 1] - stiffness * s[FOUNDATION];
            rate[4] -= rate[FOUNDATION + 1];
        }
        (rate, acceleration)
    }

    /// Absolute acceleration (m/s²) and the rates of the actuator's states under `valve_command`
    /// (V) and `specimen_force` (N).
    pub fn outputs(
        &self,
        state: &ExtendedTableState,
        valve_command: f64,
        specimen_force: f64,
    ) -> (f64, [f64; 3]) {
        let valve = &self.effects.valve;
        let drive = if valve.command_delay > 0.0 {
            state.path.play
        } else {
            valve.play(state.path.play, valve_command)
        };
        let (rate, acceleration) =
            self.rates(&state.continuous(), &state.memory, drive, specimen_force);
        (acceleration, [rate[0], rate[1], rate[2]])
    }

    /// Moves `state` on by `step` (s) with both inputs held, in equal Runge-Kutta steps.
    pub fn advance(
        &self,
        state: &mut ExtendedTableState,
        valve_command: f64,
        specimen_force: f64,
        step: f64,
    ) {
        let mut s = state.continuous();
        for (drive, duration) in state.path.advance(&self.effects.valve, valve_command, step) {
            if duration <= 0.0 {
                continue;
            }
            let count = inner_steps(duration, LONGEST_STEP);
            let inner = duration / f64::from(count);
            for _ in 0..count {
                let memory = state.memory;
                s = runge_kutta_4(&s, inner, |s| {
                    self.rates(s, &memory, drive, specimen_force).0
                });
                self.remember(&mut state.memory, &s);
            }
        }
        state.set_continuous(&s);
    }
}

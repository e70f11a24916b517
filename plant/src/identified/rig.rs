//! The identified rig with every catalogue effect: what "extend the model" turns on.

use std::f64::consts::TAU;

use crate::ModelError;
use crate::delay_line::{DelayLine, require_delay};
use crate::identified::effects::valve::CommandPath;
use crate::identified::effects::{self, Effects, Memory};
use crate::identified::extended_table::{self, ExtendedTable};
use crate::identified::shake_table::ShakeTable;
use crate::integration::runge_kutta_4;
use crate::sensors::instrumentation::Instrumentation;
use crate::specimens::extended::{self as extended_specimen, ExtendedSpecimen};
use crate::specimens::linear::LinearSpecimen;
use units::constants::G;

/// Actuator, table and specimen of the thesis with effects and sensors (Eq 2-13, 2-14, A-3).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct IdentifiedRig {
    /// Actuator and table.
    pub shake_table: ShakeTable,
    /// The specimen, if one stands on the table.
    pub specimen: Option<LinearSpecimen>,
    /// What the linear model lacks.
    pub effects: Effects,
    /// What the sensors do to the channels; the velocity, noise, ranges and faults are not of
    /// this rig.
    pub sensors: Instrumentation,
}

/// Number of continuous states of [`IdentifiedRig`].
pub const STATES: usize = 16;
const SPOOL: usize = 7;
const FOUNDATION: usize = 10;
const SECOND_MODE: usize = 12;
const HYSTERETIC: usize = 14;
const LAGGED: usize = 15;

/// State of [`IdentifiedRig`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct IdentifiedRigState {
    /// The actuator's three, displacement and velocity (relative to the foundation), drift and
    /// drift velocity; then spool (2), mean demand, foundation (2), second mode (2), hysteretic
    /// deformation, lagged displacement.
    pub continuous: [f64; STATES],
    /// Delay and play of the command.
    pub path: CommandPath,
    /// Largest drift so far, m.
    pub peak_drift: f64,
    /// What the effects remember of the table's motion.
    pub memory: Memory,
    /// Past accelerations, m/s².
    accelerations: DelayLine,
    disturbance: f64,
}

/// What the rig does, without sensors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RigMotion {
    /// Displacement of the table relative to the foundation, m.
    pub displacement: f64,
    /// Absolute acceleration of the table, m/s².
    pub acceleration: f64,
    /// Force of the actuator, N.
    pub actuator_force: f64,
    /// Absolute acceleration of the specimen's mass, m/s².
    pub specimen_acceleration: f64,
}

impl IdentifiedRig {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first of table, specimen, effects or sensors that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.shake_table.validate()?;
        if let Some(specimen) = &self.specimen {
            specimen.validate()?;
        }
        self.effects.validate()?;
        self.sensors.validate_values()
    }

    /// The rig without what is not linear about rest: offsets, thresholds, friction, yielding.
    pub fn linear_part(&self) -> Self {
        let mut rig = *self;
        for effect in effects::all().filter(|effect| !effect.is_linear) {
            effect.turn_off(&mut rig.effects, &mut rig.sensors);
        }
        rig
    }

    /// True when an effect is on that needs finer steps than the rig without it.
    pub fn is_fast(&self) -> bool {
        effects::all().any(|effect| effect.is_fast && effect.is_on(&self.effects, &self.sensors))
    }

    /// Indices into [`IdentifiedRigState::continuous`] of the states that move in the linear part.
    pub fn active_states(&self) -> Vec<usize> {
        let mut active = vec![0, 1, 2, 3, 4];
        if self.has_specimen() {
            active.extend([5, 6]);
        }
        if self.effects.valve.spool_frequency > 0.0 {
            active.extend([SPOOL, SPOOL + 1]);
        }
        if self.effects.foundation.frequency > 0.0 {
            active.extend([FOUNDATION, FOUNDATION + 1]);
        }
        if self.has_specimen() && self.effects.specimen.second_mode_frequency > 0.0 {
            active.extend([SECOND_MODE, SECOND_MODE + 1]);
        }
        if self.sensors.displacement.corner > 0.0 {
            active.push(LAGGED);
        }
        active
    }

    /// Index of the state that follows the drift as long as nothing yields.
    pub fn follower(&self) -> Option<usize> {
        self.has_specimen().then_some(HYSTERETIC)
    }

    /// True when a specimen stands on the table.
    pub fn has_specimen(&self) -> bool {
        self.specimen.is_some() && !self.effects.specimen.is_absent()
    }

    /// The rig ready to step with `period` s between samples, each in `substeps` Runge-Kutta
    /// steps of fourth order.
    ///
    /// # Errors
    /// What [`Self::validate`] refuses, and delays longer than
    /// [`MAX_DELAY_SAMPLES`](crate::delay_line::MAX_DELAY_SAMPLES) periods.
    pub fn sample(&self, period: f64, substeps: usize) -> Result<SampledRig, ModelError> {
        self.validate()?;
        ModelError::require_positive("period", period)?;
        self.effects.valve.validate_delay(period)?;
        require_delay(
            "accelerometer_delay",
            self.sensors.acceleration.delay,
            period,
        )?;
        Ok(SampledRig::new(*self, period, substeps.max(1)))
    }
}

/// [`IdentifiedRig`] prepared for one sampling period.
#[derive(Debug, Clone, Copy)]
pub struct SampledRig {
    rig: IdentifiedRig,
    period: f64,
    substeps: usize,
    table: ExtendedTable,
    specimen: ExtendedSpecimen,
    lag_rate: f64,
}

/// The states of the table in those of the rig.
#[inline]
fn of_table(s: &[f64; STATES]) -> [f64; extended_table::STATES] {
    [s[0], s[1], s[2], s[3], s[4], s[7], s[8], s[9], s[10], s[11]]
}

/// The states of the specimen in those of the rig.
#[inline]
fn of_specimen(s: &[f64; STATES]) -> [f64; extended_specimen::STATES] {
    [
        s[5],
        s[6],
        s[SECOND_MODE],
        s[SECOND_MODE + 1],
        s[HYSTERETIC],
    ]
}

impl SampledRig {
    fn new(rig: IdentifiedRig, period: f64, substeps: usize) -> Self {
        Self {
            rig,
            period,
            substeps,
            table: ExtendedTable::new(&rig.shake_table, &rig.effects),
            specimen: ExtendedSpecimen::new(rig.specimen, &rig.effects.specimen),
            lag_rate: TAU * rig.sensors.displacement.corner,
        }
    }

    #[inline]
    fn derivative(
        &self,
        s: &[f64; STATES],
        memory: &Memory,
        peak: f64,
        command: f64,
    ) -> [f64; STATES] {
        let (table, specimen) = (of_table(s), of_specimen(s));
        let force = self.specimen.force(&specimen, peak);
        let (t, acceleration) = self.table.rates(&table, memory, command, force);
        let d = self.specimen.rates(&specimen, force, acceleration);
        let mut rate = [
            t[0], t[1], t[2], t[3], t[4], d[0], d[1], t[5], t[6], t[7], t[8], t[9], d[2], d[3],
            d[4], 0.0,
        ];
        if self.lag_rate > 0.0 {
            rate[LAGGED] = self.lag_rate * (s[3] - s[LAGGED]);
        }
        rate
    }

    #[inline]
    fn runge_kutta(&self, state: &mut IdentifiedRigState, command: f64, h: f64) {
        let (memory, peak) = (state.memory, state.peak_drift);
        state.continuous = runge_kutta_4(&state.continuous, h, |s| {
            self.derivative(s, &memory, peak, command)
        });
        self.table
            .remember(&mut state.memory, &of_table(&state.continuous));
        state.peak_drift = peak.max(state.continuous[5].abs());
    }

    /// One sampling period under a held `command` (V).
    #[inline]
    pub fn step(&self, state: &mut IdentifiedRigState, command: f64) {
        let valve = &self.rig.effects.valve;
        let w = state.disturbance;
        for (drive, duration) in state.path.advance(valve, command, self.period) {
            if duration > 0.0 {
                for _ in 0..self.substeps {
                    self.runge_kutta(state, drive + w, duration / self.substeps as f64);
                }
            }
        }
    }

    /// [`Self::step`] with `disturbance` (V) added behind delay and play.
    #[inline]
    pub fn step_disturbed(&self, state: &mut IdentifiedRigState, command: f64, disturbance: f64) {
        state.disturbance = disturbance;
        self.step(state, command);
        state.disturbance = 0.0;
    }

    /// Adds `correction` (m/s²) to the acceleration kept from `age` samples ago.
    #[inline]
    pub fn correct_past(&self, state: &mut IdentifiedRigState, age: usize, correction: f64) {
        state.accelerations.correct(age, correction);
    }

    /// What the rig does in `state`.
    #[inline]
    pub fn motion(&self, state: &IdentifiedRigState) -> RigMotion {
        let s = &state.continuous;
        let specimen = of_specimen(s);
        let force = self.specimen.force(&specimen, state.peak_drift);
        let acceleration = self.table.acceleration(&of_table(s), &state.memory, force);
        RigMotion {
            displacement: s[3],
            acceleration,
            actuator_force: s[0],
            specimen_acceleration: self.specimen.acceleration(&specimen, force, acceleration),
        }
    }

    /// What the sensors show of `state` at `time` s, without noise: displacement, acceleration,
    /// actuator force, specimen acceleration. Call it once a sample: it keeps the past that a
    /// late channel needs.
    #[inline]
    pub fn measure(&self, state: &mut IdentifiedRigState, time: f64) -> [f64; 4] {
        let sensors = &self.rig.sensors;
        let motion = self.motion(state);
        let mut acceleration = motion.acceleration;
        if sensors.acceleration.delay > 0.0 {
            state.accelerations.push(acceleration);
            let late = sensors.acceleration.delay / self.period;
            acceleration = state.accelerations.behind(late);
        }
        acceleration = sensors.acceleration.scaled(acceleration)
            + G * sensors.accelerometer_tilt * motion.displacement
            + sensors.acceleration.hum(time);
        let displacement = if self.lag_rate > 0.0 {
            state.continuous[LAGGED]
        } else {
            motion.displacement
        };
        [
            sensors.displacement.scaled(displacement),
            acceleration,
            sensors.actuator_force.scaled(motion.actuator_force),
            motion.specimen_acceleration,
        ]
    }
}

//! The identified rig with every catalogue effect: what "extend the model" turns on.

use std::f64::consts::TAU;

use crate::ModelError;
use crate::effects::valve::MAX_DELAY_SAMPLES;
use crate::effects::{Effects, SensorEffects};
use crate::shake_table::ShakeTable;
use crate::specimen::LinearSpecimen;
use crate::units::G;

/// Actuator, table and specimen of the thesis with effects and sensors (Eq 2-13, 2-14, A-3).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct IdentifiedRig {
    /// Actuator and table.
    pub shake_table: ShakeTable,
    /// The specimen, if one stands on the table.
    pub specimen: Option<LinearSpecimen>,
    /// What the linear model lacks.
    pub effects: Effects,
    /// What the sensors do to the channels.
    pub sensors: SensorEffects,
}

/// Number of continuous states of [`IdentifiedRig`].
pub const STATES: usize = 16;
const SPOOL: usize = 7;
const DEMAND: usize = 9;
const FOUNDATION: usize = 10;
const SECOND_MODE: usize = 12;
const HYSTERETIC: usize = 14;
const LAGGED: usize = 15;

/// State of [`IdentifiedRig`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdentifiedRigState {
    /// The actuator's three, displacement and velocity (relative to the foundation), drift and
    /// drift velocity; then spool (2), mean demand, foundation (2), second mode (2), hysteretic
    /// deformation, lagged displacement.
    pub continuous: [f64; STATES],
    /// Spool behind its play, V.
    pub play: f64,
    /// Largest drift so far, m.
    pub peak_drift: f64,
    /// Past commands, V, a ring.
    commands: [f64; MAX_DELAY_SAMPLES + 2],
    /// Past accelerations, m/s², a ring.
    accelerations: [f64; MAX_DELAY_SAMPLES + 2],
    at: usize,
    disturbance: f64,
}

impl Default for IdentifiedRigState {
    fn default() -> Self {
        Self {
            continuous: [0.0; STATES],
            play: 0.0,
            peak_drift: 0.0,
            commands: [0.0; MAX_DELAY_SAMPLES + 2],
            accelerations: [0.0; MAX_DELAY_SAMPLES + 2],
            at: 0,
            disturbance: 0.0,
        }
    }
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
    /// Refuses parameters that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.shake_table.validate()?;
        if let Some(specimen) = &self.specimen {
            specimen.validate()?;
        }
        self.effects.validate()?;
        self.sensors.validate()
    }

    /// The rig without what is not linear about rest: offsets, thresholds, friction, yielding.
    pub fn linear_part(&self) -> Self {
        let mut rig = *self;
        let Effects {
            valve,
            hydraulics,
            friction,
            table,
            specimen,
            ..
        } = &mut rig.effects;
        valve.null_bias = 0.0;
        valve.dead_band = 0.0;
        valve.asymmetry = 0.0;
        valve.spool_limit = 0.0;
        valve.hysteresis = 0.0;
        hydraulics.stall_force = 0.0;
        hydraulics.droop_loss = 0.0;
        friction.coulomb_force = 0.0;
        friction.stribeck_force = 0.0;
        table.cubic_stiffness = 0.0;
        specimen.yield_displacement = 0.0;
        specimen.degradation_loss = 0.0;
        specimen.uplift_displacement = 0.0;
        rig.sensors.accelerometer_bias = 0.0;
        rig.sensors.load_cell_bias = 0.0;
        rig.sensors.hum_amplitude = 0.0;
        rig
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
        if self.sensors.displacement_lag > 0.0 {
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
        self.specimen.is_some() && !self.effects.specimen.absent
    }

    /// The rig ready to step with `period` s between samples, each in `substeps` Runge-Kutta
    /// steps of fourth order.
    ///
    /// Refuses what [`Self::validate`] refuses and delays longer than
    /// [`MAX_DELAY_SAMPLES`] periods.
    pub fn sample(&self, period: f64, substeps: usize) -> Result<SampledRig, ModelError> {
        self.validate()?;
        ModelError::require_positive("period", period)?;
        let longest = MAX_DELAY_SAMPLES as f64 * period;
        for (name, delay) in [
            ("command_delay", self.effects.valve.command_delay),
            ("accelerometer_delay", self.sensors.accelerometer_delay),
        ] {
            if delay > longest {
                return Err(ModelError::Parameter {
                    name,
                    value: delay,
                    expected: "at most thirty sampling periods",
                });
            }
        }
        Ok(SampledRig::new(*self, period, substeps.max(1)))
    }
}

/// [`IdentifiedRig`] prepared for one sampling period.
#[derive(Debug, Clone, Copy)]
pub struct SampledRig {
    rig: IdentifiedRig,
    period: f64,
    substeps: usize,
    actuator: [f64; 9],
    mass: f64,
    damping: f64,
    stiffness: f64,
    specimen: LinearSpecimen,
    has_specimen: bool,
    foundation: [f64; 3],
    second_mode: [f64; 3],
    lag_rate: f64,
    has_spool: bool,
    has_droop: bool,
    has_foundation: bool,
    has_second_mode: bool,
    yields: bool,
}

impl SampledRig {
    fn new(rig: IdentifiedRig, period: f64, substeps: usize) -> Self {
        let IdentifiedRig {
            shake_table,
            specimen,
            effects,
            sensors,
        } = rig;
        let a = shake_table.actuator;
        let [d, b, e] = [a.denominator, a.voltage_to_force, a.velocity_to_force];
        let mass = shake_table.table.mass + effects.table.added_mass;
        let wall = TAU * effects.foundation.frequency;
        let has_specimen = specimen.is_some() && !effects.specimen.absent;
        let mut specimen = specimen.unwrap_or_default();
        specimen.damping *= 1.0 + effects.specimen.damping_change;
        let upper = specimen.mass * effects.specimen.second_mode_mass_share;
        let omega = TAU * effects.specimen.second_mode_frequency;
        let has_second_mode = has_specimen && omega > 0.0;
        if has_second_mode {
            specimen.mass -= upper;
        }
        Self {
            rig,
            period,
            substeps,
            actuator: [d[0], d[1], d[2], b[0], b[1], b[2], e[0], e[1], e[2]],
            mass,
            damping: shake_table.table.damping + effects.table.viscous_damping,
            stiffness: shake_table.table.stiffness,
            specimen,
            has_specimen,
            foundation: [
                1.0 / (effects.foundation.mass_ratio * shake_table.table.mass),
                2.0 * effects.foundation.damping_ratio * wall,
                wall * wall,
            ],
            second_mode: [
                upper,
                2.0 * effects.specimen.second_mode_damping_ratio * omega * upper,
                omega * omega * upper,
            ],
            lag_rate: TAU * sensors.displacement_lag,
            has_spool: effects.valve.spool_frequency > 0.0,
            has_droop: effects.hydraulics.droop_loss != 0.0,
            has_foundation: wall > 0.0,
            has_second_mode,
            yields: has_specimen && effects.specimen.yield_displacement > 0.0,
        }
    }

    /// Force of the specimen on the table, N.
    #[inline]
    fn specimen_force(&self, s: &[f64; STATES], peak: f64) -> f64 {
        if !self.has_specimen {
            return 0.0;
        }
        let effects = &self.rig.effects.specimen;
        self.specimen.stiffness * effects.deformation(s[5], s[HYSTERETIC], peak)
            + self.specimen.damping * s[6]
    }

    /// Force of actuator, guide, damper and spring on the table, N.
    #[inline]
    fn wall_force(&self, s: &[f64; STATES]) -> f64 {
        let effects = &self.rig.effects;
        let (x, v) = (s[3], s[4]);
        s[0] - effects.friction.force(v)
            - self.damping * v
            - self.stiffness * x
            - effects.table.cubic_stiffness * x * x * x
    }

    /// Absolute accelerations of table and specimen, m/s².
    #[inline]
    fn accelerations(&self, s: &[f64; STATES], peak: f64) -> (f64, f64) {
        let specimen_force = self.specimen_force(s, peak);
        let table = (self.wall_force(s) + specimen_force) / self.mass;
        if !self.has_specimen {
            return (table, self.rig.effects.specimen.absent_sensor_share * table);
        }
        let mut on_mass = -specimen_force;
        if self.has_second_mode {
            on_mass +=
                self.second_mode[2] * s[SECOND_MODE] + self.second_mode[1] * s[SECOND_MODE + 1];
        }
        (table, on_mass / self.specimen.mass)
    }

    #[inline]
    fn derivative(&self, s: &[f64; STATES], command: f64, peak: f64) -> [f64; STATES] {
        let effects = &self.rig.effects;
        let [a2, a1, a0, b2, b1, b0, e2, e1, e0] = self.actuator;
        let mut rate = [0.0; STATES];
        let mut spool = command;
        if self.has_spool {
            spool = s[SPOOL];
            rate[SPOOL] = s[SPOOL + 1];
            rate[SPOOL + 1] = effects
                .valve
                .spool_acceleration(s[SPOOL], s[SPOOL + 1], command);
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

        let specimen_force = self.specimen_force(s, peak);
        let wall_force = self.wall_force(s);
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
        if self.has_specimen {
            rate[5] = s[6];
            let mut on_mass = -specimen_force;
            if self.has_second_mode {
                let [upper, damping, stiffness] = self.second_mode;
                let between = stiffness * s[SECOND_MODE] + damping * s[SECOND_MODE + 1];
                on_mass += between;
                rate[SECOND_MODE] = s[SECOND_MODE + 1];
                rate[SECOND_MODE + 1] = -on_mass / self.specimen.mass - between / upper;
            }
            rate[6] = on_mass / self.specimen.mass - acceleration;
            if self.yields {
                rate[HYSTERETIC] = effects.specimen.hysteretic_rate(s[HYSTERETIC], s[6]);
            }
        }
        if self.lag_rate > 0.0 {
            rate[LAGGED] = self.lag_rate * (s[3] - s[LAGGED]);
        }
        rate
    }

    #[inline]
    fn runge_kutta(&self, state: &mut IdentifiedRigState, command: f64, h: f64) {
        let s = state.continuous;
        let peak = state.peak_drift;
        let along = |k: &[f64; STATES], h: f64| {
            let mut to = s;
            for i in 0..STATES {
                to[i] += h * k[i];
            }
            to
        };
        let k1 = self.derivative(&s, command, peak);
        let k2 = self.derivative(&along(&k1, 0.5 * h), command, peak);
        let k3 = self.derivative(&along(&k2, 0.5 * h), command, peak);
        let k4 = self.derivative(&along(&k3, h), command, peak);
        for i in 0..STATES {
            state.continuous[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
        state.peak_drift = peak.max(state.continuous[5].abs());
    }

    /// One sampling period under a held `command` (V).
    #[inline]
    pub fn step(&self, state: &mut IdentifiedRigState, command: f64) {
        let valve = &self.rig.effects.valve;
        let ring = MAX_DELAY_SAMPLES + 2;
        state.at = if state.at + 1 == ring {
            0
        } else {
            state.at + 1
        };
        let behind = |n: usize| (state.at + ring - n) % ring;
        state.commands[state.at] = command;
        let h = self.period / self.substeps as f64;
        let w = state.disturbance;
        if valve.command_delay > 0.0 {
            let samples = valve.command_delay / self.period;
            let whole = (samples as usize).min(MAX_DELAY_SAMPLES);
            let split = (samples - whole as f64) * self.period;
            let earlier = state.commands[behind(whole + 1)];
            let later = state.commands[behind(whole)];
            state.play = valve.play(state.play, earlier);
            if split > 0.0 {
                for _ in 0..self.substeps {
                    self.runge_kutta(state, state.play + w, split / self.substeps as f64);
                }
            }
            state.play = valve.play(state.play, later);
            let rest = (self.period - split) / self.substeps as f64;
            for _ in 0..self.substeps {
                self.runge_kutta(state, state.play + w, rest);
            }
        } else {
            state.play = valve.play(state.play, command);
            for _ in 0..self.substeps {
                self.runge_kutta(state, state.play + w, h);
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
        let ring = MAX_DELAY_SAMPLES + 2;
        state.accelerations[(state.at + ring - age % ring) % ring] += correction;
    }

    /// What the rig does in `state`.
    #[inline]
    pub fn motion(&self, state: &IdentifiedRigState) -> RigMotion {
        let s = &state.continuous;
        let (acceleration, specimen_acceleration) = self.accelerations(s, state.peak_drift);
        RigMotion {
            displacement: s[3],
            acceleration,
            actuator_force: s[0],
            specimen_acceleration,
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
        if sensors.accelerometer_delay > 0.0 {
            let ring = MAX_DELAY_SAMPLES + 2;
            state.accelerations[state.at] = acceleration;
            let samples = sensors.accelerometer_delay / self.period;
            let whole = (samples as usize).min(MAX_DELAY_SAMPLES);
            let fraction = samples - whole as f64;
            let past = |n: usize| state.accelerations[(state.at + ring - n) % ring];
            acceleration = past(whole) + fraction * (past(whole + 1) - past(whole));
        }
        acceleration = (1.0 + sensors.accelerometer_scale) * acceleration
            + sensors.accelerometer_bias
            + G * sensors.accelerometer_tilt * motion.displacement;
        if sensors.hum_amplitude != 0.0 {
            acceleration += sensors.hum_amplitude
                * (TAU * sensors.hum_frequency * time + sensors.hum_phase).sin();
        }
        let displacement = if self.lag_rate > 0.0 {
            state.continuous[LAGGED]
        } else {
            motion.displacement
        };
        [
            (1.0 + sensors.displacement_scale) * displacement,
            acceleration,
            (1.0 + sensors.load_cell_scale) * motion.actuator_force + sensors.load_cell_bias,
            motion.specimen_acceleration,
        ]
    }
}

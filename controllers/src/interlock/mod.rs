//! The interlock between controller and valve.
//!
//! **It protects no people.** It is software in the control computer and fails with it. It keeps a
//! model, a specimen or an actuator from needless damage; whoever works at a rig is protected by
//! the emergency stop, the pressure-off valve and the fence, none of which may depend on it.

mod load;
mod stop;
#[cfg(test)]
mod tests;
mod trip;

use units::Parameters;
use units::constants::{G, INCH, LBF, STROKE};

use crate::pid::VALVE_LIMIT;
use crate::{Controller, ModelError, Motion};
use load::Load;
use stop::SoftStop;
pub use trip::Trip;

/// Limits and timings of the interlock, and its memory.
///
/// On a trip the command of the table's velocity falls to zero along half a cosine, so long that the
/// table decelerates by no more than the motion has asked for, within
/// [`stop_time`](Self::stop_time) and the stroke; the rest of the last command falls within
/// [`ramp_time`](Self::ramp_time). Cause and time are latched until a reset, after which the
/// controller's command is faded in over the ramp time. A trip at sample k means a valve at null
/// from sample k + stop_time/h on.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct Interlock {
    /// Largest displacement, measured or predicted, m.
    #[parameter("m" => "in", positive)]
    pub displacement_limit: f64,
    /// Largest velocity, m/s.
    #[parameter("m/s" => "in/s", positive)]
    pub velocity_limit: f64,
    /// Largest acceleration, m/s2.
    #[parameter("m/s2" => "g", positive)]
    pub acceleration_limit: f64,
    /// Largest force, N.
    #[parameter("N" => "lbf", positive)]
    pub force_limit: f64,
    /// Largest distance of the measured displacement from what the reference lately was, m.
    #[parameter("m" => "in", positive)]
    pub tracking_limit: f64,
    /// How lately: time constant of the reference's range, s.
    ///
    /// Both ends of the range return to the present value with it, so that a table that follows late
    /// is not taken for one that does not follow.
    #[parameter("s", positive)]
    pub tracking_time: f64,
    /// Largest way that the controller's command, as a mean of four samples, goes per second, to and
    /// fro, V/s, as a mean over [`activity_time`](Self::activity_time): an oscillating loop. The
    /// mean of four samples takes three quarters of white noise out; the command itself may go four
    /// times as far: one that changes sign from sample to sample.
    #[parameter(
        "V/s",
        about = "Largest way of the controller's command, as a mean of four samples, per second, to and fro; four times as much for the command itself",
        positive
    )]
    pub activity_limit: f64,
    /// Time constant of that mean, s.
    #[parameter("s", positive)]
    pub activity_time: f64,
    /// Commands from here on count as saturated, V.
    #[parameter("V", positive)]
    pub saturation_level: f64,
    /// Longest time in saturation, s.
    #[parameter("s", positive)]
    pub saturation_time: f64,
    /// Shortest time from a trip to the valve at null, s.
    #[parameter("s", positive)]
    pub ramp_time: f64,
    /// Longest time from a trip to the valve at null, s.
    #[parameter("s", positive)]
    pub stop_time: f64,
    /// Largest deceleration of a stop where the time allows, m/s2.
    ///
    /// Less while the reference has asked for less.
    #[parameter("m/s2" => "g", positive)]
    pub stop_acceleration: f64,
    /// Share of a limit from which on there is a warning, 0 for none.
    #[parameter(min = 0.0, max = 1.0, non_negative)]
    pub warning_level: f64,
    /// Rigid mass that moves, without a specimen whose acceleration is measured, 0 for no check, kg.
    #[parameter("kg" => "lbf.s2/in", min = 0.0, non_negative)]
    pub moving_mass: f64,
    /// How much the measured mass may exceed the stated one, as its share.
    #[parameter(positive)]
    pub mass_tolerance: f64,
    /// Time until the valve answers, allowed for in the stopping distance, s.
    #[parameter("s", non_negative)]
    pub reaction_time: f64,
    /// Repetitions that make a channel stale ....
    ///
    /// Repetitions to the bit.
    #[parameter(min = 1.0)]
    pub stale_samples: usize,
    /// ... while the reference travels this far, m.
    #[parameter("m" => "in", positive)]
    pub stale_travel: f64,
    /// Samples after which the heartbeat must have changed, 0 without one.
    #[parameter(min = 0.0)]
    pub heartbeat_samples: usize,
    /// The specimen is silent below this acceleration, 0 for no check, m/s2.
    #[parameter("m/s2" => "g", non_negative)]
    pub specimen_silence: f64,
    /// The table moves above this acceleration ..., m/s2.
    #[parameter("m/s2" => "g", positive)]
    pub specimen_table_motion: f64,
    /// ... and its mean speed this one, m/s.
    ///
    /// A mean over [`activity_time`](Self::activity_time): a chattering table accelerates without
    /// moving its specimen.
    #[parameter("m/s" => "in/s", positive)]
    pub specimen_table_velocity: f64,
    /// Least pressure of the supply, 0 for no check, Pa.
    #[parameter("Pa" => "psi", min = 0.0, non_negative)]
    pub pressure_limit: f64,
    /// Largest mean flow out of the supply, 0 for no check, m3/s.
    ///
    /// What the pump can give for long. Short peaks come out of the accumulator.
    #[parameter("m3/s" => "in3/s", min = 0.0, non_negative)]
    pub flow_limit: f64,
    /// Time constant of that mean, s.
    #[parameter("s", positive)]
    pub flow_time: f64,
    /// Time of the moving table in which a specimen must not be silent, s.
    ///
    /// Counted without interruption, for a specimen that answered before.
    #[parameter("s", positive)]
    pub specimen_silence_time: f64,
    /// What the interlock remembers.
    pub memory: InterlockMemory,
}

/// Samples over which the command is smoothed before its way is measured.
const SMOOTHED: usize = 4;

/// A specimen has answered when its acceleration reached this many times the silence: noise that
/// comes over the silence now and then is not an answer.
const ANSWER: f64 = 3.0;

/// Memory of [`Interlock`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct InterlockMemory {
    /// Time of the present sample since the start or the last forgetting, s.
    pub time: f64,
    /// The latched cause.
    pub trip: Trip,
    /// When it tripped, s.
    pub trip_time: f64,
    /// What goes to the valve, V.
    pub command: f64,
    /// What is near its limit now, or was noticed and did not trip.
    pub warning: Trip,
    stop: SoftStop,
    load: Load,
    /// Weight of the controller's command, 0 after a reset and 1 in service.
    fade: f64,
    /// Whether there was a sample.
    started: bool,
    saturated: f64,
    /// Mean magnitude of the rate of the command, and of its mean of four samples, V/s.
    activity: [f64; 2],
    /// The latest commands, the latest first.
    requests: [f64; SMOOTHED],
    /// What the reference lately was, least and largest, m.
    range: [f64; 2],
    last: [f64; 5],
    last_reference: f64,
    repeats: [usize; 5],
    travel: [f64; 5],
    /// Mean speed of the table, m/s.
    speed: f64,
    /// Mean flow out of the supply, m³/s.
    flow: f64,
    specimen_answered: bool,
    silent: f64,
    heartbeat: i32,
    beats_missed: usize,
    reset_was_held: bool,
}

/// What the interlock is told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct InterlockInput {
    /// The controller's command, V.
    pub valve_command: f64,
    /// Wanted displacement, m.
    pub reference_displacement: f64,
    /// Measured motion.
    pub measured: Motion,
    /// Measured force of the actuator, N.
    pub measured_force: f64,
    /// Measured absolute acceleration of the specimen; zero without one.
    pub specimen_acceleration: f64,
    /// Pressure of the supply, Pa; unused without a limit of it.
    pub supply_pressure: f64,
    /// Flow out of the supply, m³/s; unused without a limit of it.
    pub supply_flow: f64,
    /// A number that the controller changes at every sample.
    pub heartbeat: i32,
    /// Whether the accelerometer and the displacement contradict each other.
    pub sensors_disagree: bool,
    /// Whether the displacement jumped where the acceleration did not.
    pub displacement_jumped: bool,
    /// The operator's stop.
    pub stop: bool,
    /// A rising edge ends a trip whose cause is gone.
    pub reset: bool,
}

impl Interlock {
    /// Limits for the laboratory's rig, assumed except for the stroke (±1.5 in), the valve's range
    /// (10 V) and the capacity of the actuator (1.1 kip, Section 2.3.1).
    ///
    /// The table may be a tenth of its stroke away from what the reference was within about 0.1 s,
    /// three times the lag of the slowest displacement loop. The command may go as far in a second as
    /// that of a sine of 20 Hz, the upper edge of the band of the motions, with 3.1 V: 250 V.
    pub fn laboratory() -> Self {
        Self {
            displacement_limit: STROKE - 0.1 * INCH,
            velocity_limit: 40.0 * INCH,
            acceleration_limit: 3.5 * G,
            force_limit: 1000.0 * LBF,
            tracking_limit: 0.1 * STROKE,
            tracking_time: 0.1,
            activity_limit: 250.0,
            activity_time: 0.1,
            saturation_level: 0.99 * VALVE_LIMIT,
            saturation_time: 0.1,
            ramp_time: 0.02,
            stop_time: 0.3,
            stop_acceleration: 0.25 * G,
            warning_level: 0.9,
            moving_mass: 0.0,
            mass_tolerance: 1.5,
            reaction_time: 0.008,
            stale_samples: 10,
            stale_travel: 0.02 * INCH,
            heartbeat_samples: 0,
            specimen_silence: 0.0,
            specimen_table_motion: 0.05 * G,
            specimen_table_velocity: 1.0 * INCH,
            specimen_silence_time: 0.1,
            pressure_limit: 0.0,
            flow_limit: 0.0,
            flow_time: 1.0,
            memory: InterlockMemory {
                fade: 1.0,
                ..InterlockMemory::default()
            },
        }
    }

    /// Where the table would come to rest if the interlock tripped now (m): through the reaction
    /// time at full velocity, then with the flow going to zero within the ramp time.
    pub fn stopping_position(&self, motion: &Motion) -> f64 {
        motion.displacement + motion.velocity * (self.reaction_time + 0.5 * self.ramp_time)
    }

    fn counts_stale(&mut self, input: &InterlockInput) -> bool {
        let y = &input.measured;
        let now = [
            y.displacement,
            y.velocity,
            y.acceleration,
            input.measured_force,
            input.specimen_acceleration,
        ];
        let m = &mut self.memory;
        let travelled = (input.reference_displacement - m.last_reference).abs();
        m.last_reference = input.reference_displacement;
        let mut stale = false;
        for i in 0..5 {
            // A channel that was never anything but zero is not connected.
            if m.started && now[i] == m.last[i] && now[i] != 0.0 {
                m.repeats[i] = m.repeats[i].saturating_add(1);
                m.travel[i] += travelled;
                stale |= m.repeats[i] >= self.stale_samples && m.travel[i] >= self.stale_travel;
            } else {
                (m.repeats[i], m.travel[i]) = (0, 0.0);
            }
            m.last[i] = now[i];
        }
        stale
    }

    /// Whether a specimen that answered before has been silent while the table moved. One that stands
    /// on its columns answers a moving table within a fraction of its period, and rings on after it.
    fn misses_the_specimen(&mut self, input: &InterlockInput, period: f64) -> bool {
        let m = &mut self.memory;
        let speed = input.measured.velocity.abs();
        if self.specimen_silence == 0.0 || !speed.is_finite() {
            return false;
        }
        m.speed += period / (period + self.activity_time) * (speed - m.speed);
        let answer = input.specimen_acceleration.abs();
        if answer >= self.specimen_silence {
            m.specimen_answered |= answer >= ANSWER * self.specimen_silence;
            m.silent = 0.0;
        } else if input.measured.acceleration.abs() >= self.specimen_table_motion
            && m.speed >= self.specimen_table_velocity
        {
            m.silent += period;
        }
        m.specimen_answered && m.silent >= self.specimen_silence_time - 1e-9
    }

    /// Distance of the measured displacement from the range in which the reference lately was, m.
    fn tracking_error(&mut self, input: &InterlockInput, period: f64) -> f64 {
        let (x, wanted) = (input.measured.displacement, input.reference_displacement);
        let weight = period / (period + self.tracking_time);
        let m = &mut self.memory;
        if !wanted.is_finite() {
            return 0.0;
        }
        if !m.started {
            m.range = [wanted; 2];
        }
        let [least, largest] = m.range.map(|end| end + weight * (wanted - end));
        m.range = [least.min(wanted), largest.max(wanted)];
        (m.range[0] - x).max(x - m.range[1])
    }

    /// How fast the controller's command changes, as a share of the limit.
    fn activity(&mut self, request: f64, period: f64) -> f64 {
        let m = &mut self.memory;
        if !request.is_finite() {
            return 0.0;
        }
        if !m.started {
            m.requests = [request; SMOOTHED];
        }
        let [last, .., oldest] = m.requests;
        m.requests.rotate_right(1);
        m.requests[0] = request;
        let weight = period / (period + self.activity_time);
        let ways = [request - last, (request - oldest) / SMOOTHED as f64];
        for (mean, way) in m.activity.iter_mut().zip(ways) {
            *mean += weight * (way.abs() / period - *mean);
        }
        let [itself, smoothed] = m.activity;
        smoothed.max(itself / SMOOTHED as f64) / self.activity_limit
    }

    /// What has flowed out of the supply for a while, as a share of what the pump can give for long.
    fn mean_flow(&mut self, flow: f64, period: f64) -> f64 {
        if self.flow_limit == 0.0 || !flow.is_finite() {
            return 0.0;
        }
        let m = &mut self.memory;
        m.flow += period / (period + self.flow_time) * (flow - m.flow);
        m.flow / self.flow_limit
    }

    fn misses_beats(&mut self, heartbeat: i32) -> bool {
        let m = &mut self.memory;
        if self.heartbeat_samples == 0 {
            return false;
        }
        if !m.started || heartbeat != m.heartbeat {
            m.beats_missed = 0;
        } else {
            m.beats_missed = m.beats_missed.saturating_add(1);
        }
        m.heartbeat = heartbeat;
        m.beats_missed >= self.heartbeat_samples
    }

    /// The checks of this sample in their order: how much of each limit is used, 1 being all of it.
    fn checks(&mut self, input: &InterlockInput, period: f64) -> [(f64, Trip); 18] {
        let y = &input.measured;
        let numbers = [
            input.valve_command,
            input.reference_displacement,
            y.displacement,
            y.velocity,
            y.acceleration,
            input.measured_force,
            input.specimen_acceleration,
            input.supply_pressure,
            input.supply_flow,
        ];
        let whole = |holds: bool| if holds { f64::INFINITY } else { 0.0 };
        // Each check keeps a count, so all run at every sample.
        let stale = self.counts_stale(input);
        let silent = self.misses_beats(input.heartbeat);
        let lost = self.misses_the_specimen(input, period);
        let error = self.tracking_error(input, period);
        let activity = self.activity(input.valve_command, period);
        let flow = self.mean_flow(input.supply_flow, period);
        let (stated, tolerance) = (self.moving_mass, self.mass_tolerance);
        let m = &mut self.memory;
        let heavy = stated > 0.0 && m.load.exceeds(input, stated, tolerance);
        if input.valve_command.abs() >= self.saturation_level {
            m.saturated += period;
        } else {
            m.saturated = 0.0;
        }
        let saturated = m.saturated / (self.saturation_time + 1e-9);
        m.started = true;
        let pressure = match self.pressure_limit > 0.0 {
            true => self.pressure_limit / input.supply_pressure.max(f64::MIN_POSITIVE),
            false => 0.0,
        };
        [
            (
                whole(numbers.iter().any(|n| !n.is_finite())),
                Trip::NotFinite,
            ),
            (whole(input.stop), Trip::Stop),
            (whole(stale), Trip::Stale),
            (whole(silent), Trip::Heartbeat),
            (whole(input.displacement_jumped), Trip::DisplacementJump),
            (whole(input.sensors_disagree), Trip::SensorsDisagree),
            (pressure, Trip::Pressure),
            (flow, Trip::Flow),
            (
                y.displacement.abs() / self.displacement_limit,
                Trip::Displacement,
            ),
            (
                self.stopping_position(y).abs() / self.displacement_limit,
                Trip::StoppingDistance,
            ),
            (y.velocity.abs() / self.velocity_limit, Trip::Velocity),
            (
                y.acceleration.abs() / self.acceleration_limit,
                Trip::Acceleration,
            ),
            (input.measured_force.abs() / self.force_limit, Trip::Force),
            (whole(heavy), Trip::Mass),
            (activity, Trip::Activity),
            (error / self.tracking_limit, Trip::TrackingError),
            (saturated, Trip::Saturation),
            (whole(lost), Trip::SpecimenLost),
        ]
    }

    /// The cause to trip, and what is near its limit.
    fn cause(&mut self, input: &InterlockInput, period: f64) -> (Trip, Trip) {
        let checks = self.checks(input, period);
        let over = |level: f64| {
            let mut found = checks.iter();
            found.find_map(|(used, trip)| (*used > level).then_some(*trip))
        };
        let near = match self.warning_level > 0.0 {
            true => over(self.warning_level),
            false => None,
        };
        (over(1.0).unwrap_or_default(), near.unwrap_or_default())
    }
}

impl Default for Interlock {
    fn default() -> Self {
        Self::laboratory()
    }
}

impl Controller for Interlock {
    type Input = InterlockInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        ModelError::require_positive(Self::STALE_SAMPLES, self.stale_samples as f64)
    }

    fn step(&mut self, input: &InterlockInput, period: f64) -> f64 {
        let (cause, near) = self.cause(input, period);
        let limits = *self;
        let pressed = input.reset && !self.memory.reset_was_held;
        let ramp_time = self.ramp_time.max(period);
        let m = &mut self.memory;
        m.reset_was_held = input.reset;
        m.warning = near;
        if m.trip != Trip::None && pressed && cause == Trip::None && m.command == 0.0 {
            (m.trip, m.trip_time, m.fade) = (Trip::None, 0.0, 0.0);
        }
        if m.trip == Trip::None && cause != Trip::None {
            (m.trip, m.trip_time) = (cause, m.time);
            m.stop.begin(m.command, &limits, period);
        }
        if m.trip == Trip::None {
            m.stop.learn(input, m.command, period);
            m.command = m.fade * input.valve_command;
            m.fade = (m.fade + period / ramp_time).min(1.0);
        } else {
            m.command = m.stop.command(ramp_time, period);
        }
        m.time += period;
        m.command
    }

    fn reset(&mut self) {
        self.memory = InterlockMemory {
            fade: 1.0,
            ..InterlockMemory::default()
        };
    }
}

//! The sensors of the rig and what the acquisition makes of them.
//!
//! A sampled component: it is given the true motion at a sample and gives what the controllers are
//! told. All effects are off by default; [`Instrumentation::laboratory`] is a plausible set.

use crate::ModelError;
use crate::linear::discrete_riccati;
use crate::sensors::channel::{Channel, ChannelState, Noise};
use units::constants::{G, INCH, LBF, STROKE};
use units::vocabulary;

/// The true motion at a sample, SI.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct TrueMotion {
    /// Displacement of the table, m.
    pub displacement: f64,
    /// Velocity of the table, m/s.
    pub velocity: f64,
    /// Acceleration of the table, m/s².
    pub acceleration: f64,
    /// Force of the actuator, N.
    pub actuator_force: f64,
    /// Absolute acceleration of the specimen, m/s².
    pub specimen_acceleration: f64,
}

/// What the controllers are told, SI.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Measured {
    /// Displacement of the table, m.
    pub displacement: f64,
    /// Velocity of the table, m/s, from the other channels.
    pub velocity: f64,
    /// Acceleration of the table, m/s².
    pub acceleration: f64,
    /// Force of the actuator, N.
    pub actuator_force: f64,
    /// Absolute acceleration of the specimen, m/s².
    pub specimen_acceleration: f64,
}

/// Where the velocity comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VelocityEstimate {
    /// Filtered differences of the displacement (Section 2.3.1: there is no velocity sensor).
    #[default]
    Differentiated,
    /// A Kalman filter over displacement and acceleration.
    Kalman,
    /// The true velocity.
    True,
}

/// How a sensor fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SensorFault {
    /// It does not.
    #[default]
    None,
    /// It repeats its last reading.
    Frozen,
    /// It gives no number.
    NotANumber,
    /// Its reading has another sign.
    Reversed,
    /// Its reading is off by the fault's size: for the duration of a sample a spike, else an offset.
    Offset,
    /// All channels repeat their last reading at a share of the samples, drawn from the seed.
    Dropped,
}

/// The channels of the rig, in the order of their faults' numbers.
pub const CHANNELS: [&str; 4] = [
    "displacement",
    "acceleration",
    vocabulary::ACTUATOR_FORCE,
    vocabulary::SPECIMEN_ACCELERATION,
];

/// Sensors and estimates; all times in s.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Instrumentation {
    /// Displacement (LVDT).
    pub displacement: Channel,
    /// Acceleration of the table.
    pub acceleration: Channel,
    /// Load cell.
    pub actuator_force: Channel,
    /// Acceleration of the specimen.
    pub specimen_acceleration: Channel,
    /// Pitch of the table per displacement, rad/m: the accelerometer reads `g tilt x` besides,
    /// neither scaled nor late by its own channel.
    pub accelerometer_tilt: f64,
    /// Lateness of all channels together, s.
    pub delay: f64,
    /// Source of the velocity.
    pub velocity_estimate: VelocityEstimate,
    /// `T` of the differentiated velocity, s:
    /// `v_k = v_(k-1) + h/(h + T) ((x_k - x_(k-1))/h - v_(k-1))`, 0 for plain differences.
    pub velocity_lag: f64,
    /// Seed of the noise.
    pub seed: u64,
    /// What fails.
    pub fault: SensorFault,
    /// Index of the failing channel in [`CHANNELS`].
    pub fault_channel: usize,
    /// When it fails, s.
    pub fault_time: f64,
    /// How long it fails, 0 for good, s.
    pub fault_duration: f64,
    /// Size of an offset, in the channel's SI unit; share of dropped samples.
    pub fault_size: f64,
}

impl Default for Instrumentation {
    fn default() -> Self {
        Self {
            displacement: Channel::default(),
            acceleration: Channel::default(),
            actuator_force: Channel::default(),
            specimen_acceleration: Channel::default(),
            accelerometer_tilt: 0.0,
            delay: 0.0,
            velocity_estimate: VelocityEstimate::default(),
            velocity_lag: 0.0,
            seed: 1,
            fault: SensorFault::None,
            fault_channel: 0,
            fault_time: 0.0,
            fault_duration: 0.0,
            fault_size: 0.0,
        }
    }
}

/// What the instrumentation remembers.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct InstrumentationState {
    channel: [ChannelState; 4],
    /// Displacement, velocity, bias of the accelerometer.
    estimate: [f64; 3],
    /// Measured displacement and acceleration at the previous sample.
    previous: [f64; 2],
    /// Last readings, repeated by a frozen sensor.
    reading: [f64; 4],
    velocity_delay: ChannelState,
    tilt_delay: ChannelState,
    samples: u64,
}

/// Steady gains of the velocity's Kalman filter for one sampling period.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct VelocityFilter {
    gain: [f64; 3],
}

impl Instrumentation {
    /// Noise and resolution of a plausible laboratory, assumed: LVDT 5e-4 in at 300 Hz,
    /// accelerometers 1.5 and 1 in/s² over ±4 g at 200 Hz, load cell 0.3 lbf over ±1.1 kip
    /// (Section 2.3.1), 16 bit each; velocity by a Kalman filter.
    pub fn laboratory(seed: u64) -> Self {
        let sensor = |noise: f64, range: f64, corner: f64| Channel {
            noise,
            range,
            resolution: 2.0 * range / 65536.0,
            corner,
            ..Channel::default()
        };
        Self {
            displacement: sensor(5e-4 * INCH, 1.1 * STROKE, 300.0),
            acceleration: sensor(1.5 * INCH, 4.0 * G, 200.0),
            actuator_force: sensor(0.3 * LBF, 1100.0 * LBF, 500.0),
            specimen_acceleration: sensor(1.0 * INCH, 4.0 * G, 200.0),
            velocity_estimate: VelocityEstimate::Kalman,
            seed,
            ..Self::default()
        }
    }

    /// The four channels in the order of [`CHANNELS`].
    fn channels(&self) -> [&Channel; 4] {
        [
            &self.displacement,
            &self.acceleration,
            &self.actuator_force,
            &self.specimen_acceleration,
        ]
    }

    /// Checks the values.
    ///
    /// # Errors
    /// Names the first without meaning.
    pub fn validate_values(&self) -> Result<(), ModelError> {
        for channel in self.channels() {
            channel.validate()?;
        }
        ModelError::require_finite("accelerometer_tilt", self.accelerometer_tilt)?;
        ModelError::require_non_negative("delay", self.delay)?;
        ModelError::require_finite("fault_time", self.fault_time)?;
        ModelError::require_non_negative("fault_duration", self.fault_duration)?;
        ModelError::require_finite("fault_size", self.fault_size)?;
        if self.fault_channel >= CHANNELS.len() {
            return Err(ModelError::Parameter {
                name: "fault_channel",
                value: self.fault_channel as f64,
                expected: "the index of a channel",
            });
        }
        ModelError::require_non_negative(vocabulary::VELOCITY_LAG, self.velocity_lag)
    }

    /// Checks the parameters at the sampling `period` (s).
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self, period: f64) -> Result<(), ModelError> {
        ModelError::require_positive("period", period)?;
        self.validate_values()?;
        for channel in self.channels() {
            channel.validate_delay(self.delay, period)?;
        }
        Ok(())
    }

    /// Solves for the gains of the velocity's Kalman filter at the sampling `period` (s). The
    /// noises are those of the two channels, but never below 1e-4 in and 0.01 g, since sensors are
    /// late and tilted besides being noisy; the accelerometer's bias may wander by 0.01 g in 10 s.
    ///
    /// # Errors
    /// No stabilising solution of the Riccati equation.
    pub fn velocity_filter(&self, period: f64) -> Result<VelocityFilter, ModelError> {
        let h = period;
        let displacement = self.displacement.noise.max(1e-4 * INCH);
        let acceleration = self.acceleration.noise.max(0.01 * G);
        let a = nalgebra::dmatrix![1.0, h, -0.5 * h * h; 0.0, 1.0, -h; 0.0, 0.0, 1.0];
        let input = nalgebra::dvector![0.5 * h * h, h, 0.0] * acceleration;
        let mut process = &input * input.transpose();
        process[(2, 2)] += (0.01 * G).powi(2) / 10.0 * h;
        let c = nalgebra::dmatrix![1.0, 0.0, 0.0];
        let noise = nalgebra::dmatrix![displacement * displacement];
        let p = discrete_riccati(&a.transpose(), &c.transpose(), &process, &noise)?;
        let innovation = p[(0, 0)] + displacement * displacement;
        Ok(VelocityFilter {
            gain: std::array::from_fn(|i| p[(i, 0)] / innovation),
        })
    }

    /// Takes the true motion at a sample, `period` (s) after the previous one, and gives what is
    /// measured of it.
    pub fn sample(
        &self,
        state: &mut InstrumentationState,
        filter: &VelocityFilter,
        motion: &TrueMotion,
        period: f64,
    ) -> Measured {
        let time = state.samples as f64 * period;
        let late = state
            .tilt_delay
            .delayed(motion.displacement, self.delay / period);
        let truth = [
            motion.displacement,
            motion.acceleration,
            motion.actuator_force,
            motion.specimen_acceleration,
        ];
        let first = state.samples == 0;
        let mut accelerometer = self.acceleration;
        accelerometer.bias += G * self.accelerometer_tilt * late;
        let channels = [
            &self.displacement,
            &accelerometer,
            &self.actuator_force,
            &self.specimen_acceleration,
        ];
        let since = time - self.fault_time + 1e-9;
        let fails = since >= 0.0 && (self.fault_duration == 0.0 || since < self.fault_duration);
        let lost = Noise {
            seed: self.seed,
            channel: CHANNELS.len() as u64,
            sample: state.samples,
        };
        let drops = fails && lost.uniform() < self.fault_size;
        for (i, channel) in channels.into_iter().enumerate() {
            let failed = i == self.fault_channel && fails;
            let noise = Noise {
                seed: self.seed,
                channel: i as u64,
                sample: state.samples,
            };
            let reading = channel.sample(
                &mut state.channel[i],
                truth[i],
                self.delay,
                period,
                time,
                &noise,
            );
            state.reading[i] = match self.fault {
                SensorFault::Frozen if failed && !first => state.reading[i],
                SensorFault::NotANumber if failed => f64::NAN,
                SensorFault::Reversed if failed => -reading,
                SensorFault::Offset if failed => reading + self.fault_size,
                SensorFault::Dropped if drops && !first => state.reading[i],
                _ => reading,
            };
        }
        let [x, a, force, specimen] = state.reading;
        // Readings that are not numbers do not reach the estimate of the velocity for good.
        let [last_x, last_a] = state.previous;
        let (known_x, known_a) = (
            if x.is_finite() { x } else { last_x },
            if a.is_finite() { a } else { last_a },
        );
        if first {
            state.estimate = [known_x, 0.0, 0.0];
            state.previous = [known_x, known_a];
        }
        let velocity = match self.velocity_estimate {
            VelocityEstimate::Differentiated => {
                let rate = (known_x - state.previous[0]) / period;
                let weight = period / (period + self.velocity_lag);
                state.estimate[1] += weight * (rate - state.estimate[1]);
                state.estimate[1]
            }
            VelocityEstimate::Kalman => {
                let [at, v, bias] = state.estimate;
                let mean = 0.5 * (known_a + state.previous[1]) - bias;
                let moved = if first { 0.0 } else { period };
                let predicted = at + moved * v + 0.5 * moved * moved * mean;
                let off = if x.is_finite() { x - predicted } else { 0.0 };
                let [g0, g1, g2] = filter.gain;
                state.estimate = [
                    predicted + g0 * off,
                    v + moved * mean + g1 * off,
                    bias + g2 * off,
                ];
                state.estimate[1]
            }
            VelocityEstimate::True => state
                .velocity_delay
                .delayed(motion.velocity, self.delay / period),
        };
        state.previous = [known_x, known_a];
        state.samples += 1;
        Measured {
            displacement: x,
            velocity,
            acceleration: a,
            actuator_force: force,
            specimen_acceleration: specimen,
        }
    }
}

#[cfg(test)]
#[path = "instrumentation_tests.rs"]
mod tests;

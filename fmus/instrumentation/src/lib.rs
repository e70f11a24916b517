#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Sensors of the rig as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Enumeration, Item, Variable};
use plant::sensors::instrumentation::{
    Instrumentation as Sensors, InstrumentationState, Measured, SensorFault, TrueMotion,
    VelocityEstimate, VelocityFilter,
};
use serde::{Deserialize, Serialize};

/// Between the true motion and what the controllers are told of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Instrumentation {
    sensors: Sensors,
    state: InstrumentationState,
    filter: VelocityFilter,
    period: f64,
    motion: TrueMotion,
    measured: Measured,
    valid: bool,
    velocity_estimate: i32,
    fault: i32,
    fault_channel: i32,
    seed: i32,
}

const fn item(name: &'static str, value: i32, description: &'static str) -> Item {
    Item {
        name,
        value,
        description,
    }
}

const ESTIMATES: Enumeration = Enumeration {
    name: "VelocityEstimate",
    items: &[
        item(
            "differentiated",
            0,
            "Filtered differences of the displacement",
        ),
        item(
            "kalman",
            1,
            "Kalman filter over displacement and acceleration",
        ),
        item("true", 2, "The true velocity"),
    ],
};

const FAULTS: Enumeration = Enumeration {
    name: "SensorFault",
    items: &[
        item("none", 0, "No fault"),
        item("frozen", 1, "The sensor repeats its last reading"),
        item("not_a_number", 2, "The sensor gives no number"),
    ],
};

const FAULTY_CHANNELS: Enumeration = Enumeration {
    name: "Channel",
    items: &[
        item("displacement", 0, "Displacement of the table"),
        item("acceleration", 1, "Acceleration of the table"),
        item("actuator_force", 2, "Force of the actuator"),
        item("specimen_acceleration", 3, "Acceleration of the specimen"),
    ],
};

impl Default for Instrumentation {
    fn default() -> Self {
        Self {
            sensors: Sensors::default(),
            state: InstrumentationState::default(),
            filter: VelocityFilter::default(),
            period: 0.0,
            motion: TrueMotion::default(),
            measured: Measured::default(),
            valid: true,
            velocity_estimate: 0,
            fault: 0,
            fault_channel: 0,
            seed: 1,
        }
    }
}

impl Instrumentation {
    /// Solves for the velocity's filter, which belongs to one sampling period.
    fn prepare(&mut self, period: f64) -> ComponentResult {
        self.sensors.validate(period)?;
        self.filter = self.sensors.velocity_filter(period)?;
        self.period = period;
        Ok(())
    }
}

impl Component for Instrumentation {
    const NAME: &'static str = "Instrumentation";
    const DESCRIPTION: &'static str = "Sensors of a shake table and an estimate of its velocity";
    const DOCUMENTATION: &'static str = include_str!("../README.md");

    fn variables() -> Vec<Variable<Self>> {
        let mut variables = fmu_kit::table! { Self, s:
            input("displacement", s.motion.displacement, "Displacement of the table", "m" => "in").nominal(0.0381);
            input("velocity", s.motion.velocity, "Velocity of the table", "m/s" => "in/s").nominal(0.5);
            input("acceleration", s.motion.acceleration, "Absolute acceleration of the table", "m/s2" => "g").nominal(10.0);
            input("actuator_force", s.motion.actuator_force, "Force of the actuator", "N" => "lbf").nominal(400.0);
            input("specimen_acceleration", s.motion.specimen_acceleration, "Absolute acceleration of the specimen", "m/s2" => "g").nominal(10.0);
            output("measured_displacement", s.measured.displacement, "Displacement of the table, as measured", "m" => "in")
                .discrete().nominal(0.0381).depends_on(&["displacement"], Dependent);
            output("measured_velocity", s.measured.velocity, "Velocity of the table, as measured", "m/s" => "in/s")
                .discrete().nominal(0.5).depends_on(&["displacement", "velocity", "acceleration"], Dependent);
            output("measured_acceleration", s.measured.acceleration, "Absolute acceleration of the table, as measured", "m/s2" => "g")
                .discrete().nominal(10.0).depends_on(&["displacement", "acceleration"], Dependent);
            output("measured_force", s.measured.actuator_force, "Force of the actuator, as measured", "N" => "lbf")
                .discrete().nominal(400.0).depends_on(&["actuator_force"], Dependent);
            output("measured_specimen_acceleration", s.measured.specimen_acceleration, "Absolute acceleration of the specimen, as measured", "m/s2" => "g")
                .discrete().nominal(10.0).depends_on(&["specimen_acceleration"], Dependent);
            output("measurement_valid", s.valid, "Whether all readings are numbers; those that are not keep their last value");
            parameter("displacement_lag.frequency", s.sensors.displacement.corner, "Displacement: corner of the first-order lag, 0 without one", "Hz").min(0.0);
            parameter("displacement_delay", s.sensors.displacement.delay, "Displacement: lateness", "s").min(0.0);
            parameter("displacement_scale.relative_change", s.sensors.displacement.scale_error, "Displacement: relative error of the scale");
            parameter("displacement_bias", s.sensors.displacement.bias, "Displacement: offset", "m" => "in");
            parameter("displacement_hum_amplitude", s.sensors.displacement.hum_amplitude, "Displacement: amplitude of the mains", "m" => "in");
            parameter("displacement_hum_frequency", s.sensors.displacement.hum_frequency, "Displacement: frequency of the mains", "Hz").min(0.0);
            parameter("displacement_noise", s.sensors.displacement.noise, "Displacement: white noise, one standard deviation", "m" => "in").min(0.0);
            parameter("displacement_range", s.sensors.displacement.range, "Displacement: largest magnitude that is read, 0 for any", "m" => "in").min(0.0);
            parameter("displacement_resolution", s.sensors.displacement.resolution, "Displacement: step of the converter, 0 for none", "m" => "in").min(0.0);
            parameter("acceleration_corner", s.sensors.acceleration.corner, "Table's accelerometer: corner of the first-order lag, 0 without one", "Hz").min(0.0);
            parameter("accelerometer_delay.delay", s.sensors.acceleration.delay, "Table's accelerometer: lateness", "s").min(0.0);
            parameter("accelerometer_scale.relative_change", s.sensors.acceleration.scale_error, "Table's accelerometer: relative error of the scale");
            parameter("accelerometer_bias.offset", s.sensors.acceleration.bias, "Table's accelerometer: offset", "m/s2" => "in/s2");
            parameter("mains_hum.amplitude", s.sensors.acceleration.hum_amplitude, "Table's accelerometer: amplitude of the mains", "m/s2" => "in/s2");
            parameter("mains_hum.frequency", s.sensors.acceleration.hum_frequency, "Table's accelerometer: frequency of the mains", "Hz").min(0.0);
            parameter("mains_hum.phase", s.sensors.acceleration.hum_phase, "Table's accelerometer: phase of the mains at time zero", "rad" => "deg");
            parameter("acceleration_noise", s.sensors.acceleration.noise, "Table's accelerometer: white noise, one standard deviation", "m/s2" => "in/s2").min(0.0);
            parameter("acceleration_range", s.sensors.acceleration.range, "Table's accelerometer: largest magnitude that is read, 0 for any", "m/s2" => "in/s2").min(0.0);
            parameter("acceleration_resolution", s.sensors.acceleration.resolution, "Table's accelerometer: step of the converter, 0 for none", "m/s2" => "in/s2").min(0.0);
            parameter("actuator_force_corner", s.sensors.actuator_force.corner, "Load cell: corner of the first-order lag, 0 without one", "Hz").min(0.0);
            parameter("actuator_force_delay", s.sensors.actuator_force.delay, "Load cell: lateness", "s").min(0.0);
            parameter("load_cell_scale.relative_change", s.sensors.actuator_force.scale_error, "Load cell: relative error of the scale");
            parameter("load_cell_bias.offset", s.sensors.actuator_force.bias, "Load cell: offset", "N" => "lbf");
            parameter("actuator_force_hum_amplitude", s.sensors.actuator_force.hum_amplitude, "Load cell: amplitude of the mains", "N" => "lbf");
            parameter("actuator_force_hum_frequency", s.sensors.actuator_force.hum_frequency, "Load cell: frequency of the mains", "Hz").min(0.0);
            parameter("actuator_force_noise", s.sensors.actuator_force.noise, "Load cell: white noise, one standard deviation", "N" => "lbf").min(0.0);
            parameter("actuator_force_range", s.sensors.actuator_force.range, "Load cell: largest magnitude that is read, 0 for any", "N" => "lbf").min(0.0);
            parameter("actuator_force_resolution", s.sensors.actuator_force.resolution, "Load cell: step of the converter, 0 for none", "N" => "lbf").min(0.0);
            parameter("specimen_acceleration_corner", s.sensors.specimen_acceleration.corner, "Specimen's accelerometer: corner of the first-order lag, 0 without one", "Hz").min(0.0);
            parameter("specimen_acceleration_delay", s.sensors.specimen_acceleration.delay, "Specimen's accelerometer: lateness", "s").min(0.0);
            parameter("specimen_acceleration_scale_error", s.sensors.specimen_acceleration.scale_error, "Specimen's accelerometer: relative error of the scale");
            parameter("specimen_acceleration_bias", s.sensors.specimen_acceleration.bias, "Specimen's accelerometer: offset", "m/s2" => "in/s2");
            parameter("specimen_acceleration_hum_amplitude", s.sensors.specimen_acceleration.hum_amplitude, "Specimen's accelerometer: amplitude of the mains", "m/s2" => "in/s2");
            parameter("specimen_acceleration_hum_frequency", s.sensors.specimen_acceleration.hum_frequency, "Specimen's accelerometer: frequency of the mains", "Hz").min(0.0);
            parameter("specimen_acceleration_noise", s.sensors.specimen_acceleration.noise, "Specimen's accelerometer: white noise, one standard deviation", "m/s2" => "in/s2").min(0.0);
            parameter("specimen_acceleration_range", s.sensors.specimen_acceleration.range, "Specimen's accelerometer: largest magnitude that is read, 0 for any", "m/s2" => "in/s2").min(0.0);
            parameter("specimen_acceleration_resolution", s.sensors.specimen_acceleration.resolution, "Specimen's accelerometer: step of the converter, 0 for none", "m/s2" => "in/s2").min(0.0);
            parameter("accelerometer_tilt.tilt", s.sensors.accelerometer_tilt, "Pitch of the table per displacement", "rad/m" => "rad/in");
            parameter("delay", s.sensors.delay, "Lateness of all channels together", "s").min(0.0);
            parameter("velocity_lag", s.sensors.velocity_lag, "Lag of the differentiated velocity", "s").min(0.0);
            parameter("seed", s.seed, "Seed of the noise").min(0.0);
            parameter("fault_time", s.sensors.fault_time, "When the fault occurs", "s");
        };
        variables.extend([
            Variable::choice("velocity_estimate", ESTIMATES, |s: &mut Self| {
                &mut s.velocity_estimate
            })
            .about("Source of the measured velocity"),
            Variable::choice("fault", FAULTS, |s: &mut Self| &mut s.fault)
                .about("Fault of a sensor"),
            Variable::choice("fault_channel", FAULTY_CHANNELS, |s: &mut Self| {
                &mut s.fault_channel
            })
            .about("The sensor that fails"),
        ]);
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        self.sensors.velocity_estimate = match self.velocity_estimate {
            0 => VelocityEstimate::Differentiated,
            1 => VelocityEstimate::Kalman,
            _ => VelocityEstimate::True,
        };
        self.sensors.fault = match self.fault {
            0 => SensorFault::None,
            1 => SensorFault::Frozen,
            _ => SensorFault::NotANumber,
        };
        self.sensors.fault_channel = self.fault_channel.unsigned_abs() as usize;
        self.sensors.seed = u64::from(self.seed.cast_unsigned());
        self.prepare(Self::STEP_SIZE)?;
        self.state = InstrumentationState::default();
        self.measured = Measured::default();
        self.valid = true;
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        if step_size != self.period {
            self.prepare(step_size)?;
        }
        let reading = self
            .sensors
            .sample(&mut self.state, &self.filter, &self.motion, self.period);
        // FMI carries no number that is none: the last one stays and is marked.
        let held = self.measured;
        let mut valid = true;
        let mut keep = |now: f64, before: f64| {
            valid &= now.is_finite();
            if now.is_finite() { now } else { before }
        };
        self.measured = Measured {
            displacement: keep(reading.displacement, held.displacement),
            velocity: keep(reading.velocity, held.velocity),
            acceleration: keep(reading.acceleration, held.acceleration),
            actuator_force: keep(reading.actuator_force, held.actuator_force),
            specimen_acceleration: keep(reading.specimen_acceleration, held.specimen_acceleration),
        };
        self.valid = valid;
        Ok(())
    }
}

fmu_kit::export!(Instrumentation);

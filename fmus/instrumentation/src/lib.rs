#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Sensors of the rig as an FMU.

use controllers::sensor_vote::{Doubt, SensorVote, VoteInput, Voted};
use controllers::{Controller, Motion};
use fmu_kit::{
    Component, ComponentResult, Dependency::Dependent, Enumeration, Item, Terminal, Variable,
};
use plant::identified::effects::{self, Component as Part, Field};
use plant::sensors::channel::Channel;
use plant::sensors::instrumentation::{
    Instrumentation as Sensors, InstrumentationState, Measured, SensorFault, TrueMotion,
    VelocityEstimate, VelocityFilter,
};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// What is in doubt, by the numbers of [`Doubt`].
const DOUBTS: Enumeration = Enumeration {
    name: "SensorDoubt",
    items: &{
        let mut items = [Item {
            name: "",
            value: 0,
            description: "",
        }; Doubt::ALL.len()];
        let mut i = 0;
        while i < items.len() {
            let doubt = Doubt::ALL[i];
            items[i] = Item {
                name: doubt.name(),
                value: doubt as i32,
                description: doubt.words(),
            };
            i += 1;
        }
        items
    },
};

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
    votes: bool,
    vote: SensorVote,
    voted: Voted,
    doubt: i32,
    replaced_samples: i32,
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
        item("reversed", 3, "The sensor's reading has another sign"),
        item(
            "offset",
            4,
            "The sensor's reading is off by fault_size; for one sample, a spike",
        ),
        item(
            "dropped",
            5,
            "All sensors repeat their last reading at a share fault_size of the samples",
        ),
    ],
};

const FAULTY_CHANNELS: Enumeration = Enumeration {
    name: "Channel",
    items: &[
        item("displacement", 0, "Displacement of the table"),
        item("acceleration", 1, "Acceleration of the table"),
        item(vocabulary::ACTUATOR_FORCE, 2, "Force of the actuator"),
        item(
            vocabulary::SPECIMEN_ACCELERATION,
            3,
            "Acceleration of the specimen",
        ),
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
            votes: false,
            vote: SensorVote::default(),
            voted: Voted::default(),
            doubt: 0,
            replaced_samples: 0,
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

/// A channel as its parameters tell of it.
struct Described {
    name: &'static str,
    sensor: &'static str,
    unit: &'static str,
    shown: &'static str,
    of: fn(&mut Sensors) -> &mut Channel,
}

const CHANNELS: [Described; 4] = [
    Described {
        name: "displacement",
        sensor: "Displacement",
        unit: "m",
        shown: "in",
        of: |s| &mut s.displacement,
    },
    Described {
        name: "acceleration",
        sensor: "Table's accelerometer",
        unit: "m/s2",
        shown: "in/s2",
        of: |s| &mut s.acceleration,
    },
    Described {
        name: vocabulary::ACTUATOR_FORCE,
        sensor: "Load cell",
        unit: "N",
        shown: "lbf",
        of: |s| &mut s.actuator_force,
    },
    Described {
        name: vocabulary::SPECIMEN_ACCELERATION,
        sensor: "Specimen's accelerometer",
        unit: "m/s2",
        shown: "in/s2",
        of: |s| &mut s.specimen_acceleration,
    },
];

/// What a parameter of a channel is counted in.
#[derive(Clone, Copy)]
enum Unit {
    Channel,
    Own(&'static str),
    Angle,
    None,
}

/// A parameter that every channel has.
struct Quantity {
    name: &'static str,
    about: &'static str,
    unit: Unit,
    min: Option<f64>,
    of: fn(&mut Channel) -> &mut f64,
}

const QUANTITIES: [Quantity; 10] = [
    Quantity {
        name: "corner",
        about: "corner of the first-order lag, 0 without one",
        unit: Unit::Own("Hz"),
        min: Some(0.0),
        of: |c| &mut c.corner,
    },
    Quantity {
        name: "delay",
        about: "lateness",
        unit: Unit::Own("s"),
        min: Some(0.0),
        of: |c| &mut c.delay,
    },
    Quantity {
        name: "scale_error",
        about: "relative error of the scale",
        unit: Unit::None,
        min: None,
        of: |c| &mut c.scale_error,
    },
    Quantity {
        name: "bias",
        about: "offset",
        unit: Unit::Channel,
        min: None,
        of: |c| &mut c.bias,
    },
    Quantity {
        name: "hum_amplitude",
        about: "amplitude of the mains",
        unit: Unit::Channel,
        min: None,
        of: |c| &mut c.hum_amplitude,
    },
    Quantity {
        name: "hum_frequency",
        about: "frequency of the mains",
        unit: Unit::Own("Hz"),
        min: Some(0.0),
        of: |c| &mut c.hum_frequency,
    },
    Quantity {
        name: "hum_phase",
        about: "phase of the mains at time zero",
        unit: Unit::Angle,
        min: None,
        of: |c| &mut c.hum_phase,
    },
    Quantity {
        name: "noise",
        about: "white noise, one standard deviation",
        unit: Unit::Channel,
        min: Some(0.0),
        of: |c| &mut c.noise,
    },
    Quantity {
        name: "range",
        about: "largest magnitude that is read, 0 for any",
        unit: Unit::Channel,
        min: Some(0.0),
        of: |c| &mut c.range,
    },
    Quantity {
        name: "resolution",
        about: "step of the converter, 0 for none",
        unit: Unit::Channel,
        min: Some(0.0),
        of: |c| &mut c.resolution,
    },
];

/// The variable of the catalogue's effect on the sensors whose parameter is found at `place`.
fn effect_at(place: impl Fn(&mut Sensors) -> &mut f64) -> Option<String> {
    let mut sensors = Sensors::default();
    let wanted: *const f64 = place(&mut sensors);
    effects::variables(Part::Instrumentation).find_map(|(name, parameter)| match parameter.field {
        Some(Field::Sensors(field)) if std::ptr::eq(field(&mut sensors), wanted) => Some(name),
        _ => None,
    })
}

impl Described {
    /// The channel's parameters as variables; one that an effect has bears the effect's name.
    fn parameters(&self) -> impl Iterator<Item = Variable<Instrumentation>> {
        let channel = self.of;
        QUANTITIES.iter().filter_map(move |quantity| {
            let field = quantity.of;
            let name = match (effect_at(|s| field(channel(s))), quantity.unit) {
                (Some(effect), _) => effect,
                (None, Unit::Angle) => return None,
                (None, _) => format!("{}_{}", self.name, quantity.name),
            };
            let variable = Variable::parameter_within(name, move |s: &mut Instrumentation| {
                field(channel(&mut s.sensors))
            })
            .about(&format!("{}: {}", self.sensor, quantity.about))
            .between(quantity.min, None);
            Some(match quantity.unit {
                Unit::Channel => variable.measured_in(self.unit, Some(self.shown)),
                Unit::Own(unit) => variable.unit(unit),
                Unit::Angle => variable.measured_in("rad", Some("deg")),
                Unit::None => variable,
            })
        })
    }
}

/// The parameters of effects on the sensors that belong to no channel.
fn effect_parameters() -> impl Iterator<Item = Variable<Instrumentation>> {
    let of_channels: Vec<String> = CHANNELS
        .iter()
        .flat_map(|channel| {
            channel
                .parameters()
                .map(|variable| variable.declaration.name)
        })
        .collect();
    effects::variables(Part::Instrumentation).filter_map(move |(name, parameter)| {
        let Some(Field::Sensors(field)) = parameter.field else {
            return None;
        };
        if of_channels.contains(&name) {
            return None;
        }
        let variable =
            Variable::parameter_within(name, move |s: &mut Instrumentation| field(&mut s.sensors));
        Some(
            variable
                .about(parameter.about)
                .measured_in(parameter.quantity.fmi, parameter.quantity.fmi_display)
                .between(parameter.min, parameter.max),
        )
    })
}

impl Component for Instrumentation {
    const NAME: &'static str = "Instrumentation";
    const DESCRIPTION: &'static str = "Sensors of a shake table and an estimate of its velocity";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::bus(
            "rig",
            "motion",
            &[
                ("displacement", "displacement"),
                ("velocity", "velocity"),
                ("acceleration", "acceleration"),
                ("force", vocabulary::ACTUATOR_FORCE),
            ],
        ),
        Terminal::plug(
            "specimen",
            "specimen-motion",
            &[("acceleration", vocabulary::SPECIMEN_ACCELERATION)],
        ),
        Terminal::bus(
            "measured",
            "motion",
            &[
                ("displacement", vocabulary::MEASURED_DISPLACEMENT),
                ("velocity", vocabulary::MEASURED_VELOCITY),
                ("acceleration", vocabulary::MEASURED_ACCELERATION),
                ("force", vocabulary::MEASURED_FORCE),
                ("valid", "measurement_valid"),
            ],
        ),
        Terminal::plug(
            "measured_specimen",
            "specimen-motion",
            &[("acceleration", vocabulary::MEASURED_SPECIMEN_ACCELERATION)],
        ),
    ];

    fn variables() -> Vec<Variable<Self>> {
        let mut variables = fmu_kit::table! { Self, s:
            input("displacement", s.motion.displacement, "Displacement of the table", "m" => "in").nominal(0.0381);
            input("velocity", s.motion.velocity, "Velocity of the table", "m/s" => "in/s").nominal(0.5);
            input("acceleration", s.motion.acceleration, "Absolute acceleration of the table", "m/s2" => "g").nominal(10.0);
            input(vocabulary::ACTUATOR_FORCE, s.motion.actuator_force, "Force of the actuator", "N" => "lbf").nominal(400.0);
            input(vocabulary::SPECIMEN_ACCELERATION, s.motion.specimen_acceleration, "Absolute acceleration of the specimen", "m/s2" => "g").nominal(10.0);
            output(vocabulary::MEASURED_DISPLACEMENT, s.measured.displacement, "Displacement of the table, as measured", "m" => "in")
                .discrete().nominal(0.0381).depends_on(&["displacement", "acceleration"], Dependent);
            output(vocabulary::MEASURED_VELOCITY, s.measured.velocity, "Velocity of the table, as measured", "m/s" => "in/s")
                .discrete().nominal(0.5).depends_on(&["displacement", "velocity", "acceleration"], Dependent);
            output(vocabulary::MEASURED_ACCELERATION, s.measured.acceleration, "Absolute acceleration of the table, as measured", "m/s2" => "g")
                .discrete().nominal(10.0).depends_on(&["displacement", "acceleration"], Dependent);
            output(vocabulary::MEASURED_FORCE, s.measured.actuator_force, "Force of the actuator, as measured", "N" => "lbf")
                .discrete().nominal(400.0).depends_on(&[vocabulary::ACTUATOR_FORCE], Dependent);
            output(vocabulary::MEASURED_SPECIMEN_ACCELERATION, s.measured.specimen_acceleration, "Absolute acceleration of the specimen, as measured", "m/s2" => "g")
                .discrete().nominal(10.0).depends_on(&[vocabulary::SPECIMEN_ACCELERATION], Dependent);
            output("measurement_valid", s.valid, "Whether all readings are numbers; those that are not keep their last value");
            output("sensors_disagree", s.voted.disagree, "Whether accelerometer and displacement contradict each other; by the vote");
            output("displacement_jumped", s.voted.jumped, "Whether the displacement jumped for longer than the bridge time; by the vote");
            output("warning", s.doubt, "What is in doubt now; by the vote").choices(DOUBTS);
            output("replaced_samples", s.replaced_samples, "Samples that the vote replaced");
        };
        for channel in CHANNELS {
            variables.extend(channel.parameters());
        }
        variables.extend(effect_parameters());
        variables.extend(fmu_kit::table! { Self, s:
            parameter("delay", s.sensors.delay, "Lateness of all channels together", "s").min(0.0);
            parameter(vocabulary::VELOCITY_LAG, s.sensors.velocity_lag, "Lag of the differentiated velocity", "s").min(0.0);
            parameter("seed", s.seed, "Seed of the noise").min(0.0);
            parameter("fault_time", s.sensors.fault_time, "When the fault occurs", "s");
            parameter("fault_duration", s.sensors.fault_duration, "How long the fault lasts, 0 for good", "s").min(0.0);
            parameter("fault_size", s.sensors.fault_size, "Size of an offset in the channel's SI unit, or share of dropped samples");
        });
        variables.extend(fmu_kit::table! { Self, s:
            parameter("voting", s.votes, "Whether displacement and acceleration are compared and wrong samples replaced");
            group(s.vote).prefixed("vote.");
        });
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
            2 => SensorFault::NotANumber,
            3 => SensorFault::Reversed,
            4 => SensorFault::Offset,
            _ => SensorFault::Dropped,
        };
        self.sensors.fault_channel = self.fault_channel.unsigned_abs() as usize;
        self.sensors.seed = u64::from(self.seed.cast_unsigned());
        self.prepare(Self::STEP_SIZE)?;
        self.state = InstrumentationState::default();
        self.measured = Measured::default();
        self.valid = true;
        self.vote.validate()?;
        self.vote.reset();
        self.voted = Voted::default();
        (self.doubt, self.replaced_samples) = (0, 0);
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
        if self.votes {
            self.voted = self.vote.step(
                &VoteInput {
                    measured: Motion {
                        displacement: self.measured.displacement,
                        velocity: self.measured.velocity,
                        acceleration: self.measured.acceleration,
                    },
                    measured_force: self.measured.actuator_force,
                    valid,
                },
                step_size,
            );
            self.measured.displacement = self.voted.motion.displacement;
            self.measured.velocity = self.voted.motion.velocity;
            self.measured.acceleration = self.voted.motion.acceleration;
            self.measured.actuator_force = self.voted.force;
            self.valid = self.voted.valid;
            self.doubt = self.voted.doubt as i32;
            if !matches!(self.voted.doubt, Doubt::None | Doubt::Disagreement) {
                self.replaced_samples = self.replaced_samples.saturating_add(1);
            }
        }
        Ok(())
    }
}

fmu_kit::export!(Instrumentation);

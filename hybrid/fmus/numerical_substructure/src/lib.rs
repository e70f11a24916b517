#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! The numerical substructure of hybrid simulation as an FMU.

mod matrix;

use fmu_kit::{Causality, Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use hybrid::vrths::{BenchmarkCase, Frame, NumericalSubstructure as Part, PERIOD};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Inputs that accelerations follow at once.
const ACCELERATING: [&str; 3] = [
    vocabulary::MEASURED_FORCE,
    "ground_acceleration",
    "payload_acceleration",
];
/// Largest number of degrees of freedom.
const MOST: usize = 8;

/// A frame less its specimen, under the ground and the measured force.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct NumericalSubstructure {
    case: i32,
    mass: String,
    damping: String,
    stiffness: String,
    specimen: [f64; 3],
    interface: i32,
    force_delay: i32,
    part: Option<Part>,
    payload_mass: f64,
    force: f64,
    payload_acceleration: f64,
    ground: f64,
    ground_next: f64,
    ground_displacement: f64,
    ground_velocity: f64,
    lead: f64,
    table: Motion,
    displacement: [f64; MOST],
    velocity: [f64; MOST],
    acceleration: [f64; MOST],
}

/// Absolute motion of the degree of freedom that the specimen belongs to.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Motion {
    displacement: f64,
    velocity: f64,
    acceleration: f64,
}

impl Default for NumericalSubstructure {
    fn default() -> Self {
        let plant = hybrid::vrths::TransferSystemParameters::default();
        Self {
            case: 1,
            mass: String::new(),
            damping: String::new(),
            stiffness: String::new(),
            specimen: [
                plant.specimen_mass,
                plant.specimen_damping(),
                plant.specimen_stiffness,
            ],
            interface: 1,
            force_delay: 1,
            part: None,
            payload_mass: 0.0,
            force: 0.0,
            payload_acceleration: 0.0,
            ground: 0.0,
            ground_next: 0.0,
            ground_displacement: 0.0,
            ground_velocity: 0.0,
            lead: 0.0,
            table: Motion::default(),
            displacement: [0.0; MOST],
            velocity: [0.0; MOST],
            acceleration: [0.0; MOST],
        }
    }
}

impl NumericalSubstructure {
    fn frame(&self) -> Result<Frame, Box<dyn std::error::Error>> {
        if self.mass.is_empty() && self.damping.is_empty() && self.stiffness.is_empty() {
            let number = u8::try_from(self.case).unwrap_or_default();
            return Ok(BenchmarkCase::new(number)?.frame());
        }
        Ok(Frame {
            mass: matrix::read("mass", &self.mass)?,
            damping: matrix::read("damping", &self.damping)?,
            stiffness: matrix::read("stiffness", &self.stiffness)?,
        })
    }
}

impl NumericalSubstructure {
    /// The place of the degree of freedom that the specimen belongs to, from 0.
    fn interface(&self) -> usize {
        usize::try_from(self.interface - 1).unwrap_or(usize::MAX)
    }

    /// What the specimen takes from the structure, N.
    fn specimen_force(&self) -> f64 {
        self.force + self.payload_mass * self.payload_acceleration
    }

    fn part(&self, period: f64) -> Result<Part, Box<dyn std::error::Error>> {
        let frame = self.frame()?;
        if frame.order() > MOST {
            return Err(format!(
                "the frame has {} degrees of freedom, at most {MOST} are possible",
                frame.order()
            )
            .into());
        }
        let delay = usize::try_from(self.force_delay).unwrap_or_default();
        Ok(Part::new(
            &frame,
            self.specimen,
            self.interface(),
            delay,
            period,
        )?)
    }
}

impl Component for NumericalSubstructure {
    const NAME: &'static str = "NumericalSubstructure";
    const DESCRIPTION: &'static str = "The computed part of a structure in hybrid simulation";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[Terminal::bus(
        "measured",
        "motion",
        &[("force", vocabulary::MEASURED_FORCE)],
    )];
    const STEP_SIZE: f64 = PERIOD;

    fn variables() -> Vec<Variable<Self>> {
        let mut variables = fmu_kit::table! { Self, s:
            input(vocabulary::MEASURED_FORCE, s.force, "Force of the specimen, as measured", "N" => "kN").nominal(5e3);
            input("ground_acceleration", s.ground, "Acceleration of the ground", "m/s2" => "g").nominal(3.0);
            input("ground_acceleration_next", s.ground_next, "The same one sample later", "m/s2" => "g").nominal(3.0);
            parameter("case", s.case, "Case of the benchmark, where no matrices are given").min(1.0).max(4.0);
            parameter("mass", s.mass, "Mass of the whole frame in kg, rows separated by semicolons");
            parameter("damping", s.damping, "Damping of the whole frame in N.s/m, likewise");
            parameter("stiffness", s.stiffness, "Stiffness of the whole frame in N/m, likewise");
            parameter(vocabulary::SPECIMEN_MASS, s.specimen[0], "Mass that the specimen takes off", "kg");
            parameter(vocabulary::SPECIMEN_DAMPING, s.specimen[1], "Damping that the specimen takes off", "N.s/m");
            parameter(vocabulary::SPECIMEN_STIFFNESS, s.specimen[2], "Stiffness that the specimen takes off", "N/m");
            parameter("interface", s.interface, "Degree of freedom that the specimen belongs to, from 1").min(1.0).max(8.0);
            parameter("force_delay_samples", s.force_delay, "Samples by which the force is fed late").min(0.0).max(64.0);
        };
        let outputs = |name, about: &str, unit, nominal, field| {
            let elements = Variable::<Self>::array(name, Causality::Output, MOST, field);
            elements
                .into_iter()
                .enumerate()
                .map(move |(i, element)| {
                    element
                        .about(&format!("{about} of degree of freedom {}", i + 1))
                        .unit(unit)
                        .nominal(nominal)
                })
                .collect::<Vec<_>>()
        };
        variables.extend(outputs("displacement", "Displacement", "m", 5e-3, |s| {
            &mut s.displacement
        }));
        variables.extend(outputs("velocity", "Velocity", "m/s", 0.1, |s| {
            &mut s.velocity
        }));
        let accelerations = outputs("acceleration", "Total acceleration", "m/s2", 3.0, |s| {
            &mut s.acceleration
        });
        variables.extend(accelerations.into_iter().map(|element| {
            element
                .depends_on(&ACCELERATING, Dependent)
                .initially_depends_on(&ACCELERATING)
                .initially_depends_on(&[vocabulary::SPECIMEN_MASS, "payload_mass"])
        }));
        variables.extend(fmu_kit::table! { Self, s:
            input("payload_acceleration", s.payload_acceleration, "Measured absolute acceleration of a storey that is tested", "m/s2" => "g").nominal(3.0);
            input("ground_displacement", s.ground_displacement, "Displacement of the ground", "m" => "in").nominal(0.02);
            input("ground_velocity", s.ground_velocity, "Velocity of the ground", "m/s" => "in/s").nominal(0.2);
            parameter("payload_mass", s.payload_mass, "Mass of that storey: times its acceleration it is a force taken from the structure", "kg").min(0.0);
            parameter("lead", s.lead, "Time by which the table's motion is asked for ahead: how late the table is", "s" => "ms").min(0.0).max(0.05);
            output(vocabulary::TABLE_DISPLACEMENT, s.table.displacement, "Absolute displacement of the degree of freedom `interface`: what a table under the specimen is asked for", "m" => "in")
                .nominal(0.02).depends_on(&["ground_displacement", "ground_velocity"], Dependent).depends_on(&ACCELERATING, Dependent)
                .initially_depends_on(&["ground_displacement", "ground_velocity", "lead"]).initially_depends_on(&ACCELERATING)
                .initially_depends_on(&[vocabulary::SPECIMEN_MASS, "payload_mass"]);
            output(vocabulary::TABLE_VELOCITY, s.table.velocity, "Absolute velocity of the same", "m/s" => "in/s")
                .nominal(0.2).depends_on(&["ground_velocity"], Dependent).depends_on(&ACCELERATING, Dependent)
                .initially_depends_on(&["ground_velocity", "lead"]).initially_depends_on(&ACCELERATING)
                .initially_depends_on(&[vocabulary::SPECIMEN_MASS, "payload_mass"]);
            output(vocabulary::TABLE_ACCELERATION, s.table.acceleration, "Absolute acceleration of the same", "m/s2" => "g")
                .nominal(3.0).depends_on(&ACCELERATING, Dependent).initially_depends_on(&ACCELERATING)
                .initially_depends_on(&[vocabulary::SPECIMEN_MASS, "payload_mass"]);
        });
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        self.part = Some(self.part(Self::STEP_SIZE)?);
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        let (force, interface) = (self.specimen_force(), self.interface());
        let Some(part) = &self.part else { return };
        let n = part.order();
        self.displacement[..n].copy_from_slice(part.displacements());
        self.velocity[..n].copy_from_slice(part.velocities());
        for (i, acceleration) in self.acceleration[..n].iter_mut().enumerate() {
            *acceleration = part.total_acceleration(i, force, self.ground);
        }
        if interface < n {
            let (displacement, velocity) = (
                self.ground_displacement + self.displacement[interface],
                self.ground_velocity + self.velocity[interface],
            );
            let (acceleration, lead) = (self.acceleration[interface], self.lead);
            self.table = Motion {
                displacement: displacement + lead * (velocity + 0.5 * lead * acceleration),
                velocity: velocity + lead * acceleration,
                acceleration,
            };
        }
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        let force = self.specimen_force();
        if self
            .part
            .as_ref()
            .is_some_and(|part| part.period() != step_size)
        {
            let mut part = self.part(step_size)?;
            if let Some(before) = &self.part {
                part.resume(before);
            }
            self.part = Some(part);
        }
        if let Some(part) = &mut self.part {
            let middle = 0.5 * (self.ground + self.ground_next);
            part.step(force, [self.ground, middle, self.ground_next]);
        }
        Ok(())
    }
}

fmu_kit::export!(NumericalSubstructure);

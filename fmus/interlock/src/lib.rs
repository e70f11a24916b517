#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Interlock between controller and valve as an FMU.

use controllers::Controller;
use controllers::interlock::{Interlock as Law, InterlockInput, Trip};
use fmu_kit::{
    Component, ComponentResult, Dependency::Dependent, Enumeration, Item, Terminal, Variable,
};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Causes by the numbers of [`Trip`], in the words of a trip or of a warning.
const fn causes(warn: bool) -> [Item; Trip::ALL.len()] {
    let mut items = [Item {
        name: "",
        value: 0,
        description: "",
    }; Trip::ALL.len()];
    let mut i = 0;
    while i < items.len() {
        let cause = Trip::ALL[i];
        items[i] = Item {
            name: cause.name(),
            value: cause as i32,
            description: if warn { cause.warning() } else { cause.words() },
        };
        i += 1;
    }
    items
}

/// Why it tripped.
const CAUSES: Enumeration = Enumeration {
    name: "TripCause",
    items: &causes(false),
};

/// What it warns of.
const WARNINGS: Enumeration = Enumeration {
    name: "TripWarning",
    items: &causes(true),
};

/// Passes the controller's command on to the valve, or stops the table softly.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Interlock {
    law: Law,
    controller_command: f64,
    reference_displacement: f64,
    measured: controllers::Motion,
    measured_force: f64,
    specimen_acceleration: f64,
    supply_pressure: f64,
    supply_flow: f64,
    measurement_valid: bool,
    sensors_disagree: bool,
    displacement_jumped: bool,
    heartbeat: i32,
    stop: bool,
    reset: bool,
    tripped: bool,
    trip_cause: i32,
    warning: i32,
}

impl Default for Interlock {
    fn default() -> Self {
        Self {
            law: Law::default(),
            controller_command: 0.0,
            reference_displacement: 0.0,
            measured: controllers::Motion::default(),
            measured_force: 0.0,
            specimen_acceleration: 0.0,
            supply_pressure: 0.0,
            supply_flow: 0.0,
            measurement_valid: true,
            sensors_disagree: false,
            displacement_jumped: false,
            heartbeat: 0,
            stop: false,
            reset: false,
            tripped: false,
            trip_cause: 0,
            warning: 0,
        }
    }
}

impl Component for Interlock {
    const NAME: &'static str = "Interlock";
    const DESCRIPTION: &'static str =
        "Interlock between controller and valve; it protects no people";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::bus(
            "reference",
            "reference",
            &[("displacement", vocabulary::REFERENCE_DISPLACEMENT)],
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
            "specimen",
            "specimen-motion",
            &[("acceleration", vocabulary::SPECIMEN_ACCELERATION)],
        ),
        Terminal::CONTROLLER,
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input(vocabulary::CONTROLLER_COMMAND, s.controller_command, "Command of the controller", "V").nominal(10.0);
            input(vocabulary::REFERENCE_DISPLACEMENT, s.reference_displacement, "Wanted displacement", "m" => "in").nominal(0.0381);
            input(vocabulary::MEASURED_DISPLACEMENT, s.measured.displacement, "Measured displacement", "m" => "in").nominal(0.0381);
            input(vocabulary::MEASURED_VELOCITY, s.measured.velocity, "Measured velocity", "m/s" => "in/s").nominal(0.5);
            input(vocabulary::MEASURED_ACCELERATION, s.measured.acceleration, "Measured acceleration", "m/s2" => "g").nominal(10.0);
            input(vocabulary::MEASURED_FORCE, s.measured_force, "Measured force of the actuator", "N" => "lbf").nominal(400.0);
            input(vocabulary::SPECIMEN_ACCELERATION, s.specimen_acceleration, "Measured absolute acceleration of the specimen", "m/s2" => "g").nominal(10.0);
            input("supply_pressure", s.supply_pressure, "Pressure of the supply; unused without a limit of it", "Pa" => "psi").nominal(2e7);
            input("supply_flow", s.supply_flow, "Flow out of the supply; unused without a limit of it", "m3/s" => "in3/s").nominal(2e-4);
            input("measurement_valid", s.measurement_valid, "Whether all measurements are numbers");
            input("sensors_disagree", s.sensors_disagree, "Whether accelerometer and displacement contradict each other");
            input("displacement_jumped", s.displacement_jumped, "Whether the displacement jumped where the acceleration did not");
            input("heartbeat", s.heartbeat, "A number that the controller changes at every sample");
            input("stop", s.stop, "The operator's stop");
            input("reset", s.reset, "A rising edge ends a trip whose cause is gone");
            output(vocabulary::VALVE_COMMAND, s.law.memory.command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            output("tripped", s.tripped, "Whether the interlock has tripped");
            output("trip_cause", s.trip_cause, "Why it tripped").choices(CAUSES);
            output("warning", s.warning, "What is near its limit now").choices(WARNINGS);
            output("trip_time", s.law.memory.trip_time, "When it tripped, 0 if it did not", "s").discrete();
            group(s.law);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.law.validate()?;
        self.law.reset();
        (self.tripped, self.trip_cause, self.warning) = (false, 0, 0);
        Ok(())
    }

    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult {
        self.law.memory.time = time;
        self.law.step(
            &InterlockInput {
                valve_command: self.controller_command,
                reference_displacement: self.reference_displacement,
                measured: self.measured,
                // FMI carries no number that is none.
                measured_force: if self.measurement_valid {
                    self.measured_force
                } else {
                    f64::NAN
                },
                specimen_acceleration: self.specimen_acceleration,
                supply_pressure: self.supply_pressure,
                supply_flow: self.supply_flow,
                sensors_disagree: self.sensors_disagree,
                displacement_jumped: self.displacement_jumped,
                heartbeat: self.heartbeat,
                stop: self.stop,
                reset: self.reset,
            },
            step_size,
        );
        self.tripped = self.law.memory.trip != Trip::None;
        self.trip_cause = self.law.memory.trip as i32;
        self.warning = self.law.memory.warning as i32;
        Ok(())
    }
}

fmu_kit::export!(Interlock);

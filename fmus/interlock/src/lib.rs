#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Interlock between controller and valve as an FMU.

use controllers::Controller;
use controllers::interlock::{Interlock as Law, InterlockInput, Trip};
use fmu_kit::{
    Component, ComponentResult, Dependency::Dependent, Enumeration, Item, Terminal, Variable,
};
use serde::{Deserialize, Serialize};

/// Why it tripped, by the numbers of [`Trip`].
const CAUSES: Enumeration = Enumeration {
    name: "TripCause",
    items: &{
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
                description: cause.words(),
            };
            i += 1;
        }
        items
    },
};

/// Passes the controller's command on to the valve, or brings the valve to null.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Interlock {
    law: Law,
    stale_samples: i32,
    heartbeat_samples: i32,
    controller_command: f64,
    reference_displacement: f64,
    measured: controllers::Motion,
    measured_force: f64,
    specimen_acceleration: f64,
    supply_pressure: f64,
    supply_flow: f64,
    measurement_valid: bool,
    heartbeat: i32,
    stop: bool,
    reset: bool,
    tripped: bool,
    trip_cause: i32,
}

impl Default for Interlock {
    fn default() -> Self {
        let law = Law::default();
        Self {
            law,
            stale_samples: law.stale_samples as i32,
            heartbeat_samples: law.heartbeat_samples as i32,
            controller_command: 0.0,
            reference_displacement: 0.0,
            measured: controllers::Motion::default(),
            measured_force: 0.0,
            specimen_acceleration: 0.0,
            supply_pressure: 0.0,
            supply_flow: 0.0,
            measurement_valid: true,
            heartbeat: 0,
            stop: false,
            reset: false,
            tripped: false,
            trip_cause: 0,
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
            &[("displacement", "reference_displacement")],
        ),
        Terminal::bus(
            "measured",
            "motion",
            &[
                ("displacement", "measured_displacement"),
                ("velocity", "measured_velocity"),
                ("acceleration", "measured_acceleration"),
                ("force", "measured_force"),
                ("valid", "measurement_valid"),
            ],
        ),
        Terminal::plug(
            "specimen",
            "specimen-motion",
            &[("acceleration", "specimen_acceleration")],
        ),
        Terminal::CONTROLLER,
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        const INPUTS: [&str; 9] = [
            "controller_command",
            "reference_displacement",
            "measured_displacement",
            "measured_velocity",
            "measured_acceleration",
            "measured_force",
            "specimen_acceleration",
            "supply_pressure",
            "supply_flow",
        ];
        fmu_kit::table! { Self, s:
            input("controller_command", s.controller_command, "Command of the controller", "V").nominal(10.0);
            input("reference_displacement", s.reference_displacement, "Wanted displacement", "m" => "in").nominal(0.0381);
            input("measured_displacement", s.measured.displacement, "Measured displacement", "m" => "in").nominal(0.0381);
            input("measured_velocity", s.measured.velocity, "Measured velocity", "m/s" => "in/s").nominal(0.5);
            input("measured_acceleration", s.measured.acceleration, "Measured acceleration", "m/s2" => "g").nominal(10.0);
            input("measured_force", s.measured_force, "Measured force of the actuator", "N" => "lbf").nominal(400.0);
            input("specimen_acceleration", s.specimen_acceleration, "Measured absolute acceleration of the specimen", "m/s2" => "g").nominal(10.0);
            input("supply_pressure", s.supply_pressure, "Pressure of the supply; unused without a limit of it", "Pa" => "psi").nominal(2e7);
            input("supply_flow", s.supply_flow, "Flow out of the supply; unused without a limit of it", "m3/s" => "in3/s").nominal(2e-4);
            input("measurement_valid", s.measurement_valid, "Whether all measurements are numbers");
            input("heartbeat", s.heartbeat, "A number that the controller changes at every sample");
            input("stop", s.stop, "The operator's stop");
            input("reset", s.reset, "A rising edge ends a trip whose cause is gone");
            output("valve_command", s.law.memory.command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on(&INPUTS, Dependent)
                .depends_on(&["measurement_valid", "heartbeat", "stop", "reset"], Dependent);
            output("tripped", s.tripped, "Whether the interlock has tripped");
            output("trip_cause", s.trip_cause, "Why it tripped").choices(CAUSES);
            output("trip_time", s.law.memory.trip_time, "When it tripped, 0 if it did not", "s").discrete();
            parameter("displacement_limit", s.law.displacement_limit, "Largest displacement, measured or predicted", "m" => "in");
            parameter("velocity_limit", s.law.velocity_limit, "Largest velocity", "m/s" => "in/s");
            parameter("acceleration_limit", s.law.acceleration_limit, "Largest acceleration", "m/s2" => "g");
            parameter("force_limit", s.law.force_limit, "Largest force", "N" => "lbf");
            parameter("tracking_limit", s.law.tracking_limit, "Largest distance of the measured displacement from what the reference lately was", "m" => "in");
            parameter("tracking_time", s.law.tracking_time, "How lately: time constant of the reference's range", "s");
            parameter("activity_limit", s.law.activity_limit, "Largest way of the controller's command, as a mean of four samples, per second, to and fro; four times as much for the command itself", "V/s");
            parameter("activity_time", s.law.activity_time, "Time constant of that mean", "s");
            parameter("saturation_level", s.law.saturation_level, "Commands from here on count as saturated", "V");
            parameter("saturation_time", s.law.saturation_time, "Longest time in saturation", "s");
            parameter("ramp_time", s.law.ramp_time, "Time from a trip to the valve at null", "s");
            parameter("reaction_time", s.law.reaction_time, "Time until the valve answers, allowed for in the stopping distance", "s");
            parameter("stale_samples", s.stale_samples, "Repetitions that make a channel stale ...").min(1.0);
            parameter("stale_travel", s.law.stale_travel, "... while the reference travels this far", "m" => "in");
            parameter("heartbeat_samples", s.heartbeat_samples, "Samples after which the heartbeat must have changed, 0 without one").min(0.0);
            parameter("specimen_silence", s.law.specimen_silence, "The specimen is silent below this acceleration, 0 for no check", "m/s2" => "g");
            parameter("specimen_table_motion", s.law.specimen_table_motion, "The table moves above this acceleration ...", "m/s2" => "g");
            parameter("specimen_table_velocity", s.law.specimen_table_velocity, "... and its mean speed this one", "m/s" => "in/s");
            parameter("pressure_limit", s.law.pressure_limit, "Least pressure of the supply, 0 for no check", "Pa" => "psi").min(0.0);
            parameter("flow_limit", s.law.flow_limit, "Largest mean flow out of the supply, 0 for no check", "m3/s" => "in3/s").min(0.0);
            parameter("flow_time", s.law.flow_time, "Time constant of that mean", "s");
            parameter("specimen_silence_time", s.law.specimen_silence_time, "Time of the moving table in which a specimen must not be silent", "s");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.law.stale_samples = self.stale_samples.unsigned_abs();
        self.law.heartbeat_samples = self.heartbeat_samples.unsigned_abs();
        self.law.validate()?;
        self.law.reset();
        (self.tripped, self.trip_cause) = (false, 0);
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
                heartbeat: self.heartbeat,
                stop: self.stop,
                reset: self.reset,
            },
            step_size,
        );
        self.tripped = self.law.memory.trip != Trip::None;
        self.trip_cause = self.law.memory.trip as i32;
        Ok(())
    }
}

fmu_kit::export!(Interlock);

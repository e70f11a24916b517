#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Acceleration trajectory tracking and the dual loop as an FMU.

use controllers::Controller;
use controllers::acceleration_tracking::{
    AccelerationLoop, AccelerationTracking as Law, AccelerationTrackingInput as Input,
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Acceleration tracking from motion and force to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct AccelerationTracking {
    law: Law,
    input: Input,
    valve_command: f64,
}

impl Component for AccelerationTracking {
    const NAME: &'static str = "AccelerationTracking";
    const DESCRIPTION: &'static str =
        "Acceleration trajectory tracking and dual loop of acceleration and force";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::REFERENCE,
        Terminal::bus(
            "measured",
            "motion",
            &[
                ("displacement", vocabulary::MEASURED_DISPLACEMENT),
                ("acceleration", vocabulary::MEASURED_ACCELERATION),
                ("force", vocabulary::MEASURED_FORCE),
            ],
        ),
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("ahead_displacement", s.input.ahead.displacement, "Wanted displacement, ahead by what the rig is late", "m" => "in").nominal(0.0381);
            input("ahead_velocity", s.input.ahead.velocity, "Wanted velocity, ahead", "m/s" => "in/s").nominal(0.5);
            input("ahead_acceleration", s.input.ahead.acceleration, "Wanted acceleration, ahead", "m/s2" => "g").nominal(10.0);
            input(vocabulary::REFERENCE_DISPLACEMENT, s.input.reference.displacement, "Wanted displacement at the time that is measured", "m" => "in").nominal(0.0381);
            input(vocabulary::REFERENCE_VELOCITY, s.input.reference.velocity, "Wanted velocity at that time", "m/s" => "in/s").nominal(0.5);
            input(vocabulary::REFERENCE_ACCELERATION, s.input.reference.acceleration, "Wanted acceleration at that time", "m/s2" => "g").nominal(10.0);
            input(vocabulary::MEASURED_DISPLACEMENT, s.input.measured.displacement, "Displacement of the table", "m" => "in").nominal(0.0381);
            input(vocabulary::MEASURED_ACCELERATION, s.input.measured.acceleration, "Acceleration of the table", "m/s2" => "g").nominal(10.0);
            input(vocabulary::MEASURED_FORCE, s.input.force, "Force of the actuator", "N" => "lbf").nominal(200.0);
            output(vocabulary::VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            group(s.law).tunable(&[
                Law::DISPLACEMENT_GAIN,
                AccelerationLoop::ACCELERATION_GAIN,
                AccelerationLoop::ACCELERATION_INTEGRAL_GAIN,
                AccelerationLoop::ACCELERATION_DOUBLE_INTEGRAL_GAIN,
                vocabulary::FORCE_GAIN,
            ]);
            parameter(vocabulary::VALVE_LIMIT, s.law.limit, "Largest magnitude of the valve command", "V");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.law.validate()?;
        self.law.reset();
        self.valve_command = 0.0;
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        self.valve_command = self.law.step(&self.input, step_size);
        Ok(())
    }
}

fmu_kit::export!(AccelerationTracking);

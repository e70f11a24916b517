#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Minimal control synthesis as an FMU.

use controllers::Controller;
use controllers::minimal_control_synthesis::{
    MinimalControlSynthesis as Law, MinimalControlSynthesisInput as Input,
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Minimal control synthesis from motion to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct MinimalControlSynthesis {
    law: Law,
    input: Input,
    valve_command: f64,
    gains: [f64; 2],
}

impl Component for MinimalControlSynthesis {
    const NAME: &'static str = "MinimalControlSynthesis";
    const DESCRIPTION: &'static str = "Minimal control synthesis: gains that adapt to the rig";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::bus(
            "reference",
            "reference",
            &[
                ("displacement", vocabulary::REFERENCE_DISPLACEMENT),
                ("velocity", vocabulary::REFERENCE_VELOCITY),
            ],
        ),
        Terminal::bus(
            "measured",
            "motion",
            &[("displacement", vocabulary::MEASURED_DISPLACEMENT)],
        ),
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input(vocabulary::REFERENCE_DISPLACEMENT, s.input.reference.displacement, "Wanted displacement", "m" => "in").nominal(0.0381);
            input(vocabulary::REFERENCE_VELOCITY, s.input.reference.velocity, "Wanted velocity", "m/s" => "in/s").nominal(0.5);
            input("wanted_displacement", s.input.wanted, "Wanted displacement at the time that is measured", "m" => "in").nominal(0.0381);
            input(vocabulary::MEASURED_DISPLACEMENT, s.input.measured, "Displacement of the table", "m" => "in").nominal(0.0381);
            output(vocabulary::VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            output("feedback_gain", s.gains[0], "K as learnt so far", "V/m" => "V/in")
                .discrete().nominal(300.0).depends_on_inputs(Dependent);
            output("feedforward_gain", s.gains[1], "Kr as learnt so far", "V/m" => "V/in")
                .discrete().nominal(300.0).depends_on_inputs(Dependent);
            group(s.law).tunable(&[
                Law::INTEGRAL_ADAPTATION,
                Law::PROPORTIONAL_ADAPTATION,
                Law::LEAK,
            ]);
            parameter(vocabulary::VALVE_LIMIT, s.law.limit, "Largest magnitude of the valve command", "V");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.law.validate()?;
        self.law.reset();
        self.valve_command = 0.0;
        self.gains = [0.0; 2];
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        self.valve_command = self.law.step(&self.input, step_size);
        self.gains = self.law.gains();
        Ok(())
    }
}

fmu_kit::export!(MinimalControlSynthesis);

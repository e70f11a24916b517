#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Three-variable control as an FMU.

use controllers::{
    Controller, Motion,
    three_variable::{
        ThreeVariableControl as Law, ThreeVariableGains as Gains, ThreeVariableInput,
    },
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary::{INTEGRAL_GAIN, PROPORTIONAL_GAIN, VALVE_COMMAND};

/// What the law reads at each sample; its integral is a voltage, which no gain changes afterwards.
const GAINS: [&str; 7] = [
    PROPORTIONAL_GAIN,
    INTEGRAL_GAIN,
    Gains::VELOCITY_FEEDBACK_GAIN,
    Gains::ACCELERATION_FEEDBACK_GAIN,
    Gains::DISPLACEMENT_FEEDFORWARD_GAIN,
    Gains::VELOCITY_FEEDFORWARD_GAIN,
    Gains::ACCELERATION_FEEDFORWARD_GAIN,
];

/// Three-variable control from motion to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct ThreeVariableControl {
    law: Law,
    reference: Motion,
    measured: Motion,
    valve_command: f64,
}

impl Component for ThreeVariableControl {
    const NAME: &'static str = "ThreeVariableControl";
    const DESCRIPTION: &'static str = "Three-variable control of a shake table";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] =
        &[Terminal::REFERENCE, Terminal::MEASURED, Terminal::VALVE];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            include(fmu_kit::tracking_inputs!(Self, s: s.reference, s.measured));
            output(VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            group(s.law).tunable(&GAINS);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.law.validate()?;
        self.law.reset();
        self.valve_command = 0.0;
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        let input = ThreeVariableInput {
            reference: self.reference,
            measured: self.measured,
        };
        self.valve_command = self.law.step(&input, step_size);
        Ok(())
    }
}

fmu_kit::export!(ThreeVariableControl);

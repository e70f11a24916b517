#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Control allocation as an FMU.

use controllers::{
    Controller,
    allocation::{ControlAllocation as Law, LoopCommands},
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// The shares of displacement and force loop in the valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct ControlAllocation {
    law: Law,
    displacement_loop_command: f64,
    force_loop_command: f64,
    valve_command: f64,
}

impl Component for ControlAllocation {
    const NAME: &'static str = "ControlAllocation";
    const DESCRIPTION: &'static str = "Shares the servo valve between two low-level loops";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::plug(
            "displacement_loop",
            "valve",
            &[("command", "displacement_loop_command")],
        ),
        Terminal::plug("force_loop", "valve", &[("command", "force_loop_command")]),
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("displacement_loop_command", s.displacement_loop_command, "Command of the displacement loop", "V")
                .nominal(10.0);
            input("force_loop_command", s.force_loop_command, "Command of the force loop", "V")
                .nominal(10.0);
            output(vocabulary::VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0)
                .depends_on_inputs(Dependent);
            group(s.law);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.law.validate()?;
        self.valve_command = 0.0;
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        let commands = LoopCommands {
            displacement_loop: self.displacement_loop_command,
            force_loop: self.force_loop_command,
        };
        self.valve_command = self.law.step(&commands, step_size);
        Ok(())
    }
}

fmu_kit::export!(ControlAllocation);

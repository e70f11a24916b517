#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Loop-shaping control as an FMU.

use controllers::{Controller, loop_shaping::LoopShaping as Law, pid::PidInput};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// The controller of Eq 3-10, with further sections or without, from displacement to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct LoopShaping {
    law: Law,
    reference_displacement: f64,
    measured_displacement: f64,
    valve_command: f64,
}

impl Component for LoopShaping {
    const NAME: &'static str = "LoopShaping";
    const DESCRIPTION: &'static str = "Loop-shaping control of the displacement of a shake table";
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
            &[("displacement", vocabulary::MEASURED_DISPLACEMENT)],
        ),
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input(vocabulary::REFERENCE_DISPLACEMENT, s.reference_displacement, "Wanted displacement", "m" => "in")
                .nominal(0.0381);
            input(vocabulary::MEASURED_DISPLACEMENT, s.measured_displacement, "Displacement of the table", "m" => "in")
                .nominal(0.0381);
            output(vocabulary::VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0)
                .depends_on_inputs(Dependent);
            group(s.law.coefficients);
            group(s.law.sections[0]).prefixed("section_1_").introduced("First further section, ");
            group(s.law.sections[1]).prefixed("section_2_").introduced("Second further section, ");
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
        let input = PidInput {
            reference: self.reference_displacement,
            measured: self.measured_displacement,
        };
        self.valve_command = self.law.step(&input, step_size);
        Ok(())
    }
}

fmu_kit::export!(LoopShaping);

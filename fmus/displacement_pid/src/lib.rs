#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Displacement PID control as an FMU.

use controllers::{
    Controller,
    pid::{Pid, PidInput},
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// PID control from displacement to valve command.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct DisplacementPid {
    law: Pid,
    reference_displacement: f64,
    measured_displacement: f64,
    valve_command: f64,
}

impl Default for DisplacementPid {
    fn default() -> Self {
        Self {
            law: Pid::equation_3_6(),
            reference_displacement: 0.0,
            measured_displacement: 0.0,
            valve_command: 0.0,
        }
    }
}

impl Component for DisplacementPid {
    const NAME: &'static str = "DisplacementPid";
    const DESCRIPTION: &'static str = "PID control of the displacement of a shake table";
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
            parameter(vocabulary::PROPORTIONAL_GAIN, s.law.proportional, "Proportional gain", "V/m" => "V/in").tunable();
            parameter(vocabulary::INTEGRAL_GAIN, s.law.integral, "Integral gain", "V/(m.s)" => "V/(in.s)").tunable();
            parameter(Pid::INTEGRAL_LEAK, s.law.integral_leak, "Rate at which the integral leaks away", "1/s");
            parameter(Pid::DERIVATIVE_GAIN, s.law.derivative, "Derivative gain", "V.s/m" => "V.s/in").tunable();
            parameter(Pid::DERIVATIVE_LAG, s.law.derivative_lag, "Time constant of the derivative's lag", "s");
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

fmu_kit::export!(DisplacementPid);

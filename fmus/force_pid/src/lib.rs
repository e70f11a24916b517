#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Force PID control as an FMU.

use controllers::{
    Controller,
    pid::{Pid, PidInput},
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// PID control from actuator force to valve command.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ForcePid {
    law: Pid,
    reference_force: f64,
    measured_force: f64,
    valve_command: f64,
}

impl Default for ForcePid {
    fn default() -> Self {
        Self {
            law: Pid::equation_3_7(),
            reference_force: 0.0,
            measured_force: 0.0,
            valve_command: 0.0,
        }
    }
}

impl Component for ForcePid {
    const NAME: &'static str = "ForcePid";
    const DESCRIPTION: &'static str = "PID control of the force of a hydraulic actuator";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::bus("reference", "reference", &[("force", "reference_force")]),
        Terminal::bus(
            "measured",
            "motion",
            &[("force", vocabulary::MEASURED_FORCE)],
        ),
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("reference_force", s.reference_force, "Wanted force of the actuator", "N" => "lbf")
                .nominal(200.0);
            input(vocabulary::MEASURED_FORCE, s.measured_force, "Force of the actuator", "N" => "lbf")
                .nominal(200.0);
            output(vocabulary::VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0)
                .depends_on_inputs(Dependent);
            parameter(vocabulary::PROPORTIONAL_GAIN, s.law.proportional, "Proportional gain", "V/N" => "V/lbf").tunable();
            parameter(vocabulary::INTEGRAL_GAIN, s.law.integral, "Integral gain", "V/(N.s)" => "V/(lbf.s)").tunable();
            parameter(Pid::INTEGRAL_LEAK, s.law.integral_leak, "Rate at which the integral leaks away", "1/s");
            parameter(Pid::DERIVATIVE_GAIN, s.law.derivative, "Derivative gain", "V.s/N" => "V.s/lbf").tunable();
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
            reference: self.reference_force,
            measured: self.measured_force,
        };
        self.valve_command = self.law.step(&input, step_size);
        Ok(())
    }
}

fmu_kit::export!(ForcePid);

#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Minimal control synthesis as an FMU.

use controllers::Controller;
use controllers::minimal_control_synthesis::{
    MinimalControlSynthesis as Law, MinimalControlSynthesisInput as Input,
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};

/// Minimal control synthesis from motion to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct MinimalControlSynthesis {
    law: Law,
    input: Input,
    valve_command: f64,
    gains: [f64; 2],
}

const INPUTS: [&str; 4] = [
    "reference_displacement",
    "reference_velocity",
    "wanted_displacement",
    "measured_displacement",
];

impl Component for MinimalControlSynthesis {
    const NAME: &'static str = "MinimalControlSynthesis";
    const DESCRIPTION: &'static str = "Minimal control synthesis: gains that adapt to the rig";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::bus(
            "reference",
            "reference",
            &[
                ("displacement", "reference_displacement"),
                ("velocity", "reference_velocity"),
            ],
        ),
        Terminal::bus(
            "measured",
            "motion",
            &[("displacement", "measured_displacement")],
        ),
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("reference_displacement", s.input.reference.displacement, "Wanted displacement", "m" => "in").nominal(0.0381);
            input("reference_velocity", s.input.reference.velocity, "Wanted velocity", "m/s" => "in/s").nominal(0.5);
            input("wanted_displacement", s.input.wanted, "Wanted displacement at the time that is measured", "m" => "in").nominal(0.0381);
            input("measured_displacement", s.input.measured, "Displacement of the table", "m" => "in").nominal(0.0381);
            output("valve_command", s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on(&INPUTS, Dependent);
            output("feedback_gain", s.gains[0], "K as learnt so far", "V/m" => "V/in")
                .discrete().nominal(300.0).depends_on(&INPUTS, Dependent);
            output("feedforward_gain", s.gains[1], "Kr as learnt so far", "V/m" => "V/in")
                .discrete().nominal(300.0).depends_on(&INPUTS, Dependent);
            parameter("bandwidth", s.law.bandwidth, "a of the reference model", "rad/s");
            parameter("integral_adaptation", s.law.integral_adaptation, "alpha", "V/(m3.s)");
            parameter("proportional_adaptation", s.law.proportional_adaptation, "beta", "V/m3");
            parameter("leak", s.law.leak, "Rate at which what was learnt leaks away", "1/s");
            parameter("initial_gain", s.law.initial_gain, "Kr and -K at the start", "V/m" => "V/in");
            parameter("valve_limit", s.law.limit, "Largest magnitude of the valve command", "V");
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

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_kit::conformance::number;

    #[test]
    fn parameters_and_inputs_arrive_where_they_belong() {
        let mut component = MinimalControlSynthesis::default();
        let named = component.law.named().map(|(name, _)| name);
        number(&mut component, &named);
        let arrived = component.law.named().map(|(_, value)| value);
        assert_eq!(arrived, [1.0, 2.0, 3.0, 4.0, 5.0]);
        number(&mut component, &INPUTS);
        let input = &component.input;
        let reference = (input.reference.displacement, input.reference.velocity);
        assert_eq!(
            (reference, input.wanted, input.measured),
            ((1.0, 2.0), 3.0, 4.0)
        );
    }
}

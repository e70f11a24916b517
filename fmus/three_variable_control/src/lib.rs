#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Three-variable control as an FMU.

use controllers::{
    Controller, Motion,
    three_variable::{ThreeVariableControl as Law, ThreeVariableInput},
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};

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
        let inputs = fmu_kit::tracking_inputs!(Self, s: s.reference, s.measured);
        let others = fmu_kit::table! { Self, s:
                        output("valve_command", s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_all(&inputs, Dependent);
            parameter("proportional_gain", s.law.gains.proportional, "P of Table 3-2", "V/m" => "V/in");
            parameter("integral_gain", s.law.gains.integral, "I of Table 3-2", "V/(m.s)" => "V/(in.s)");
            parameter("velocity_feedback_gain", s.law.gains.velocity_feedback, "Kbv of Table 3-2", "V.s/m" => "V.s/in");
            parameter("acceleration_feedback_gain", s.law.gains.acceleration_feedback, "Kba of Table 3-2", "V.s2/m" => "V.s2/in");
            parameter("displacement_feedforward_gain", s.law.gains.displacement_feedforward, "Kfd of Table 3-2", "V/m" => "V/in");
            parameter("velocity_feedforward_gain", s.law.gains.velocity_feedforward, "Kfv of Table 3-2", "V.s/m" => "V.s/in");
            parameter("acceleration_feedforward_gain", s.law.gains.acceleration_feedforward, "Kfa of Table 3-2", "V.s2/m" => "V.s2/in");
            parameter("valve_limit", s.law.limit, "Largest magnitude of the valve command", "V");
        };
        let mut variables = inputs;
        variables.extend(others);
        variables
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

#[cfg(test)]
mod tests {
    use super::*;
    use controllers::three_variable::ThreeVariableGains;
    use fmu_kit::conformance::number;

    #[test]
    fn parameters_and_inputs_arrive_where_they_belong() {
        let mut component = ThreeVariableControl::default();
        let parameters = [
            "proportional_gain",
            "integral_gain",
            "velocity_feedback_gain",
            "acceleration_feedback_gain",
            "displacement_feedforward_gain",
            "velocity_feedforward_gain",
            "acceleration_feedforward_gain",
            "valve_limit",
        ];
        number(&mut component, &parameters);
        let gains = ThreeVariableGains {
            proportional: 1.0,
            integral: 2.0,
            velocity_feedback: 3.0,
            acceleration_feedback: 4.0,
            displacement_feedforward: 5.0,
            velocity_feedforward: 6.0,
            acceleration_feedforward: 7.0,
        };
        assert_eq!(
            component.law,
            Law {
                gains,
                limit: 8.0,
                integral: 0.0
            }
        );
        let inputs = [
            "reference_displacement",
            "reference_velocity",
            "reference_acceleration",
            "measured_displacement",
            "measured_velocity",
            "measured_acceleration",
        ];
        number(&mut component, &inputs);
        let reference = Motion {
            displacement: 1.0,
            velocity: 2.0,
            acceleration: 3.0,
        };
        let measured = Motion {
            displacement: 4.0,
            velocity: 5.0,
            acceleration: 6.0,
        };
        assert_eq!(
            (component.reference, component.measured),
            (reference, measured)
        );
    }
}

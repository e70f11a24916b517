#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Acceleration trajectory tracking and the dual loop as an FMU.

use controllers::Controller;
use controllers::acceleration_tracking::{
    AccelerationTracking as Law, AccelerationTrackingInput as Input,
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};

/// Acceleration tracking from motion and force to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct AccelerationTracking {
    law: Law,
    input: Input,
    valve_command: f64,
}

const INPUTS: [&str; 9] = [
    "ahead_displacement",
    "ahead_velocity",
    "ahead_acceleration",
    "reference_displacement",
    "reference_velocity",
    "reference_acceleration",
    "measured_displacement",
    "measured_acceleration",
    "measured_force",
];

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
                ("displacement", "measured_displacement"),
                ("acceleration", "measured_acceleration"),
                ("force", "measured_force"),
            ],
        ),
        Terminal::VALVE,
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("ahead_displacement", s.input.ahead.displacement, "Wanted displacement, ahead by what the rig is late", "m" => "in").nominal(0.0381);
            input("ahead_velocity", s.input.ahead.velocity, "Wanted velocity, ahead", "m/s" => "in/s").nominal(0.5);
            input("ahead_acceleration", s.input.ahead.acceleration, "Wanted acceleration, ahead", "m/s2" => "g").nominal(10.0);
            input("reference_displacement", s.input.reference.displacement, "Wanted displacement at the time that is measured", "m" => "in").nominal(0.0381);
            input("reference_velocity", s.input.reference.velocity, "Wanted velocity at that time", "m/s" => "in/s").nominal(0.5);
            input("reference_acceleration", s.input.reference.acceleration, "Wanted acceleration at that time", "m/s2" => "g").nominal(10.0);
            input("measured_displacement", s.input.measured.displacement, "Displacement of the table", "m" => "in").nominal(0.0381);
            input("measured_acceleration", s.input.measured.acceleration, "Acceleration of the table", "m/s2" => "g").nominal(10.0);
            input("measured_force", s.input.force, "Force of the actuator", "N" => "lbf").nominal(200.0);
            output("valve_command", s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on(&INPUTS, Dependent);
            parameter("displacement_shaping", s.law.shaping[0], "F0 of command shaping", "V/m" => "V/in");
            parameter("velocity_shaping", s.law.shaping[1], "F1 of command shaping", "V.s/m" => "V.s/in");
            parameter("acceleration_shaping", s.law.shaping[2], "F2 of command shaping", "V.s2/m" => "V.s2/in");
            parameter("jerk_shaping", s.law.shaping[3], "F3 of command shaping", "V.s3/m" => "V.s3/in");
            parameter("displacement_gain", s.law.displacement_gain, "K of the displacement feedback", "V/m" => "V/in");
            parameter("displacement_noise", s.law.filter.displacement_noise, "Standard deviation of the measured displacement", "m" => "in");
            parameter("acceleration_noise", s.law.filter.acceleration_noise, "Standard deviation of the measured acceleration", "m/s2" => "g");
            parameter("acceleration_gain", s.law.acceleration.proportional, "Kp of the acceleration loop", "V.s2/m" => "V.s2/in");
            parameter("acceleration_integral_gain", s.law.acceleration.integral, "Ki of the acceleration loop", "V.s/m" => "V.s/in");
            parameter("acceleration_double_integral_gain", s.law.acceleration.double_integral, "Kii of the acceleration loop", "V/m" => "V/in");
            parameter("acceleration_leak", s.law.acceleration.leak, "Rate at which its integrals leak away", "1/s");
            parameter("force_gain", s.law.force.gain, "Kf of the force loop", "V/N" => "V/lbf");
            parameter("force_corner", s.law.force.corner, "Corner of its lag", "rad/s");
            parameter("table_mass", s.law.force.mass, "Mass of the table, for the wanted force", "kg" => "lbf.s2/in");
            parameter("table_damping", s.law.force.damping, "Viscous damping of the table", "N.s/m" => "lbf.s/in");
            parameter("table_stiffness", s.law.force.stiffness, "Stiffness from table to ground", "N/m" => "lbf/in");
            parameter("valve_limit", s.law.limit, "Largest magnitude of the valve command", "V");
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

#[cfg(test)]
mod tests {
    use super::*;
    use controllers::Motion;
    use fmu_kit::conformance::number;

    #[test]
    fn parameters_and_inputs_arrive_where_they_belong() {
        let mut component = AccelerationTracking::default();
        let named = component.law.named().map(|(name, _)| name);
        number(&mut component, &named);
        let arrived = component.law.named().map(|(_, value)| value);
        assert_eq!(arrived, std::array::from_fn(|i| 1.0 + i as f64));
        number(&mut component, &INPUTS);
        let motion = |first: f64| Motion {
            displacement: first,
            velocity: first + 1.0,
            acceleration: first + 2.0,
        };
        let measured = Motion {
            displacement: 7.0,
            velocity: 0.0,
            acceleration: 8.0,
        };
        let expected = Input {
            ahead: motion(1.0),
            reference: motion(4.0),
            measured,
            force: 9.0,
        };
        assert_eq!(component.input, expected);
    }
}

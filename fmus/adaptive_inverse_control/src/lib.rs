#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Adaptive inverse control of a shake table as an FMU.

use controllers::Controller;
use controllers::adaptive_inverse::{
    AdaptiveInverse as Law, AdaptiveInverseInput as Input, Memory, Parameters,
};
use fmu_kit::{Built, Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use plant::ModelError;
use serde::{Deserialize, Serialize};

/// Adaptive inverse control from motion to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct AdaptiveInverseControl {
    settings: Settings,
    input: Input,
    memory: Memory,
    valve_command: f64,
    #[serde(skip)]
    built: Built<Settings, Law>,
}

/// All parameters.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Settings {
    law: Parameters,
    loop_delay_samples: i32,
}

const INPUTS: [&str; 5] = [
    "ahead_velocity",
    "reference_displacement",
    "reference_acceleration",
    "measured_displacement",
    "measured_acceleration",
];

fn build(settings: &Settings) -> Result<Law, ModelError> {
    let mut parameters = settings.law;
    parameters.period = AdaptiveInverseControl::STEP_SIZE;
    parameters.rig.delay = ModelError::count("loop_delay_samples", settings.loop_delay_samples)?;
    Law::new(parameters)
}

impl Component for AdaptiveInverseControl {
    const NAME: &'static str = "AdaptiveInverseControl";
    const DESCRIPTION: &'static str =
        "Adaptive inverse control of a shake table: filtered-x least mean squares";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::bus(
            "reference",
            "reference",
            &[
                ("displacement", "reference_displacement"),
                ("acceleration", "reference_acceleration"),
            ],
        ),
        Terminal::bus(
            "measured",
            "motion",
            &[
                ("displacement", "measured_displacement"),
                ("acceleration", "measured_acceleration"),
            ],
        ),
        Terminal::VALVE,
    ];
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("ahead_velocity", s.input.ahead, "Wanted velocity 16 samples ahead", "m/s" => "in/s").nominal(0.5);
            input("reference_displacement", s.input.reference.displacement, "Wanted displacement at the time that is measured", "m" => "in").nominal(0.0381);
            input("reference_acceleration", s.input.reference.acceleration, "Wanted acceleration at that time", "m/s2" => "g").nominal(10.0);
            input("measured_displacement", s.input.measured.displacement, "Displacement of the table", "m" => "in").nominal(0.0381);
            input("measured_acceleration", s.input.measured.acceleration, "Acceleration of the table", "m/s2" => "g").nominal(10.0);
            output("valve_command", s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on(&INPUTS, Dependent);
            parameter("hold_gain", s.settings.law.hold_gain, "Gain that holds the displacement", "V/m" => "V/in").min(0.0);
            parameter("adaptation", s.settings.law.adaptation, "mu; 0: nothing is learnt").min(0.0).max(2.0);
            parameter("leak", s.settings.law.leak, "Rate at which what was learnt leaks away", "1/s").min(0.0);
            parameter("loop_delay_samples", s.settings.loop_delay_samples, "Samples by which measurements are late").min(0.0).max(4.0);
            parameter("valve_limit", s.settings.law.limit, "Largest magnitude of the valve command", "V");
            parameter("spool_lag", s.settings.law.rig.hydraulics.spool_lag, "2 D/w of the spool", "s");
            parameter("spool_inertia", s.settings.law.rig.hydraulics.spool_inertia, "1/w^2 of the spool", "s2");
            parameter("force_rate", s.settings.law.rig.hydraulics.force_rate, "Rate of the force under a valve open by one volt", "N/(V.s)" => "lbf/(V.s)");
            parameter("oil_stiffness", s.settings.law.rig.hydraulics.oil_stiffness, "Stiffness of the oil column", "N/m" => "lbf/in");
            parameter("leakage_rate", s.settings.law.rig.hydraulics.leakage_rate, "Rate at which leakage empties it", "1/s");
            parameter("seal_damping", s.settings.law.rig.hydraulics.seal_damping, "Viscous damping of the seals", "N.s/m" => "lbf.s/in");
            parameter("table_mass", s.settings.law.rig.table.mass, "Mass of the table", "kg" => "lbf.s2/in");
            parameter("table_damping", s.settings.law.rig.table.damping, "Viscous damping of the table", "N.s/m" => "lbf.s/in");
            parameter("table_stiffness", s.settings.law.rig.table.stiffness, "Stiffness from table to ground", "N/m" => "lbf/in");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.built.of(&self.settings, build)?;
        self.memory = Memory::default();
        self.valve_command = 0.0;
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        let control = self.built.of(&self.settings, build)?;
        control.memory = self.memory;
        self.valve_command = control.step(&self.input, step_size);
        self.memory = control.memory;
        Ok(())
    }
}

fmu_kit::export!(AdaptiveInverseControl);

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_kit::conformance::number;

    #[test]
    fn inputs_arrive_where_they_belong() {
        let mut component = AdaptiveInverseControl::default();
        number(&mut component, &INPUTS);
        let Input {
            ahead,
            reference,
            measured,
        } = component.input;
        let arrived = [
            ahead,
            reference.displacement,
            reference.acceleration,
            measured.displacement,
            measured.acceleration,
        ];
        assert_eq!(arrived, [1.0, 2.0, 3.0, 4.0, 5.0]);
    }
}

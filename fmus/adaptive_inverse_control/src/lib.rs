#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Adaptive inverse control of a shake table as an FMU.

use controllers::Controller;
use controllers::adaptive_inverse::{
    AdaptiveInverse as Law, AdaptiveInverseInput as Input, Memory, Parameters,
};
use fmu_kit::{Built, Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use plant::ModelError;
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Adaptive inverse control from motion to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct AdaptiveInverseControl {
    law: Parameters,
    input: Input,
    memory: Memory,
    valve_command: f64,
    #[serde(skip)]
    built: Built<Parameters, Law>,
}

fn build(law: &Parameters) -> Result<Law, ModelError> {
    Law::new(Parameters {
        period: AdaptiveInverseControl::STEP_SIZE,
        ..*law
    })
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
                ("displacement", vocabulary::REFERENCE_DISPLACEMENT),
                ("acceleration", vocabulary::REFERENCE_ACCELERATION),
            ],
        ),
        Terminal::bus(
            "measured",
            "motion",
            &[
                ("displacement", vocabulary::MEASURED_DISPLACEMENT),
                ("acceleration", vocabulary::MEASURED_ACCELERATION),
            ],
        ),
        Terminal::VALVE,
    ];
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("ahead_velocity", s.input.ahead, "Wanted velocity 16 samples ahead", "m/s" => "in/s").nominal(0.5);
            input(vocabulary::REFERENCE_DISPLACEMENT, s.input.reference.displacement, "Wanted displacement at the time that is measured", "m" => "in").nominal(0.0381);
            input(vocabulary::REFERENCE_ACCELERATION, s.input.reference.acceleration, "Wanted acceleration at that time", "m/s2" => "g").nominal(10.0);
            input(vocabulary::MEASURED_DISPLACEMENT, s.input.measured.displacement, "Displacement of the table", "m" => "in").nominal(0.0381);
            input(vocabulary::MEASURED_ACCELERATION, s.input.measured.acceleration, "Acceleration of the table", "m/s2" => "g").nominal(10.0);
            output(vocabulary::VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            group(s.law);
            parameter(vocabulary::LOOP_DELAY_SAMPLES, s.law.rig.delay, "Samples by which measurements are late").min(0.0).max(4.0);
            parameter(vocabulary::VALVE_LIMIT, s.law.limit, "Largest magnitude of the valve command", "V");
            group(s.law.rig);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.built.of(&self.law, build)?;
        self.memory = Memory::default();
        self.valve_command = 0.0;
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        let control = self.built.of(&self.law, build)?;
        control.memory = self.memory;
        self.valve_command = control.step(&self.input, step_size);
        self.memory = control.memory;
        Ok(())
    }
}

fmu_kit::export!(AdaptiveInverseControl);

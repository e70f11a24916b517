#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Sliding mode down to the valve as an FMU.

mod settings;

use controllers::preview::feedforward::PREVIEW;
use controllers::surface_control::{Memory, SurfaceControl as Law, SurfaceInput};
use controllers::{Controller, Motion};
use fmu_kit::{Built, Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};

use settings::{Settings, VARIANTS};

/// Sliding mode from reference and measured motion to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct SurfaceControl {
    settings: Settings,
    reference: Motion,
    displacement_ahead: [f64; PREVIEW],
    velocity_ahead: [f64; PREVIEW],
    acceleration_ahead: [f64; PREVIEW],
    measured: Motion,
    memory: Memory,
    valve_command: f64,
    #[serde(skip)]
    built: Built<Settings, Law>,
}

fn build(settings: &Settings) -> Result<Law, plant::ModelError> {
    Law::new(settings.parameters(SurfaceControl::STEP_SIZE)?)
}

impl Component for SurfaceControl {
    const NAME: &'static str = "SurfaceControl";
    const DESCRIPTION: &'static str =
        "Sliding mode of a shake table: multiple surfaces, dynamic surface, receding horizon";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] =
        &[Terminal::REFERENCE, Terminal::MEASURED, Terminal::VALVE];
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        let mut inputs = fmu_kit::tracking_inputs!(Self, s: s.reference, s.measured);
        inputs.extend(fmu_kit::reference_ahead::<Self>(
            PREVIEW,
            [
                |s| &mut s.displacement_ahead,
                |s| &mut s.velocity_ahead,
                |s| &mut s.acceleration_ahead,
            ],
        ));
        let outputs = fmu_kit::table! { Self, s:
            output("valve_command", s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_all(&inputs, Dependent);
        };
        let mut variables = inputs;
        variables.extend(outputs);
        variables.extend(settings::variables());
        variables.push(
            Variable::choice("variant", VARIANTS, |s: &mut Self| &mut s.settings.variant)
                .about("Which law"),
        );
        variables
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
        let input = SurfaceInput {
            reference: self.reference.with_ahead([
                &self.displacement_ahead,
                &self.velocity_ahead,
                &self.acceleration_ahead,
            ]),
            measured: self.measured,
        };
        self.valve_command = control.step(&input, step_size);
        self.memory = control.memory;
        Ok(())
    }
}

fmu_kit::export!(SurfaceControl);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_controller_is_built_from_is_refused_by_name() {
        fmu_kit::conformance::refuses::<SurfaceControl>(&[
            ("surface_rate", 0.0),
            ("oil_reaching_rate", -1.0),
            ("force_step", 0.0),
            ("valve_limit", 0.0),
            ("table_mass", 0.0),
            ("loop_delay_samples", 9.0),
        ]);
    }
}

#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Sliding mode down to the valve as an FMU.

mod settings;

use controllers::preview::feedforward::PREVIEW;
use controllers::surface_control::{Memory, SurfaceControl as Law, SurfaceInput};
use controllers::{Controller, Motion};
use fmu_kit::{Built, Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary::{LOOP_DELAY_SAMPLES, VALVE_COMMAND};

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
    Law::new(settings.parameters(SurfaceControl::STEP_SIZE))
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
        fmu_kit::table! { Self, s:
            include(fmu_kit::tracking_inputs!(Self, s: s.reference, s.measured));
            include(fmu_kit::reference_ahead::<Self>(PREVIEW, [
                |s| &mut s.displacement_ahead,
                |s| &mut s.velocity_ahead,
                |s| &mut s.acceleration_ahead,
            ]));
            output(VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            parameter(LOOP_DELAY_SAMPLES, s.settings.law.rig.delay, "Samples by which measurements are late").min(0.0).max(4.0);
            group(s.settings.law);
            parameter("variant", s.settings.variant, "Which law").choices(VARIANTS);
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
    use controllers::preview::feedback::Uncertainty;
    use controllers::surface_control::Parameters;
    use plant::identified::table::Table;
    use units::vocabulary::VALVE_LIMIT;

    #[test]
    fn what_no_controller_is_built_from_is_refused_by_name() {
        fmu_kit::conformance::refuses::<SurfaceControl>(&[
            (Parameters::SURFACE_RATE, 0.0),
            (Parameters::OIL_REACHING_RATE, -1.0),
            (Uncertainty::FORCE_STEP, 0.0),
            (VALVE_LIMIT, 0.0),
            (Table::TABLE_MASS, 0.0),
            (LOOP_DELAY_SAMPLES, 9.0),
        ]);
    }
}

#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Preview control as an FMU.

mod settings;

use controllers::preview::feedforward::PREVIEW;
use controllers::preview::{Memory, PreviewControl as Law, PreviewInput};
use controllers::{Controller, Motion};
use fmu_kit::{Built, Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};
use units::vocabulary::{CONTROLLER_COMMAND, MEASURED_FORCE, SPECIMEN_ACCELERATION, VALVE_COMMAND};

use settings::{ROLES, Settings};

/// Preview control from reference and measured motion to valve command.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct PreviewControl {
    settings: Settings,
    reference: Motion,
    displacement_ahead: [f64; PREVIEW],
    velocity_ahead: [f64; PREVIEW],
    acceleration_ahead: [f64; PREVIEW],
    measured: Motion,
    command: f64,
    memory: Memory,
    valve_command: f64,
    specimen_acceleration: f64,
    actuator_force: f64,
    specimen_mass: f64,
    specimen_stiffness: f64,
    specimen_yield_force: f64,
    #[serde(skip)]
    built: Built<Settings, Law>,
}

fn build(settings: &Settings) -> Result<Law, plant::ModelError> {
    Law::new(settings.parameters(PreviewControl::STEP_SIZE))
}

impl Component for PreviewControl {
    const NAME: &'static str = "PreviewControl";
    const DESCRIPTION: &'static str =
        "Preview control of a shake table with friction and specimen in its model";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::REFERENCE,
        Terminal::MEASURED,
        Terminal::CONTROLLER,
        Terminal::VALVE,
    ];
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            include(fmu_kit::tracking_inputs!(Self, s: s.reference, s.measured));
            input(CONTROLLER_COMMAND, s.command, "Another controller's command, where this compensates", "V").nominal(10.0);
            input(SPECIMEN_ACCELERATION, s.specimen_acceleration, "Absolute acceleration of the specimen, where it is estimated", "m/s2" => "g").nominal(10.0);
            input(MEASURED_FORCE, s.actuator_force, "Force of the actuator on the table, where the specimen is estimated", "N" => "lbf").nominal(400.0);
            include(fmu_kit::reference_ahead::<Self>(PREVIEW, [
                |s| &mut s.displacement_ahead,
                |s| &mut s.velocity_ahead,
                |s| &mut s.acceleration_ahead,
            ]));
            output(VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            include(settings::variables());
            local("estimated_specimen_mass", s.specimen_mass, "Mass of the specimen as it is known now", "kg" => "lbf.s2/in").discrete();
            local("estimated_specimen_stiffness", s.specimen_stiffness, "Its stiffness before it yields", "N/m" => "lbf/in").discrete();
            local("estimated_specimen_yield_force", s.specimen_yield_force, "Its yield force", "N" => "lbf").discrete();
            parameter("role", s.settings.role, "What the law does").choices(ROLES);
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
        let input = PreviewInput {
            reference: self.reference.with_ahead([
                &self.displacement_ahead,
                &self.velocity_ahead,
                &self.acceleration_ahead,
            ]),
            measured: self.measured,
            command: self.command,
            specimen_acceleration: self.specimen_acceleration,
            actuator_force: self.actuator_force,
        };
        self.valve_command = control.step(&input, step_size);
        self.memory = control.memory;
        if let Some(specimen) = control.specimen() {
            self.specimen_mass = specimen.mass;
            self.specimen_stiffness = specimen.columns.stiffness();
            self.specimen_yield_force = specimen.columns.yield_force;
        }
        Ok(())
    }
}

fmu_kit::export!(PreviewControl);

#[cfg(test)]
mod tests {
    use super::*;
    use controllers::preview::Parameters;
    use controllers::preview::feedback::Uncertainty;
    use plant::identified::table::Table;
    use units::vocabulary::{LOOP_DELAY_SAMPLES, VALVE_LIMIT};

    #[test]
    fn what_no_controller_is_built_from_is_refused_by_name() {
        fmu_kit::conformance::refuses::<PreviewControl>(&[
            (Parameters::MOVE_WEIGHT, 0.0),
            (Parameters::COMMAND_WEIGHT, -1.0),
            (Uncertainty::FORCE_STEP, 0.0),
            (VALVE_LIMIT, 0.0),
            (Table::TABLE_MASS, 0.0),
            (LOOP_DELAY_SAMPLES, 9.0),
        ]);
    }
}

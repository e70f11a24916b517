#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! The transfer system of hybrid simulation as an FMU.

use fmu_kit::{Component, ComponentResult, Enumeration, Item, Terminal, Variable};
use hybrid::vrths::{
    Converter, InteractionForm, PERIOD, TransferSystem as Plant, TransferSystemParameters,
};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Servo valve, actuator and specimen.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct TransferSystem {
    parameters: TransferSystemParameters,
    converter: Converter,
    form: i32,
    plant: Plant,
    command: f64,
    displacement: f64,
    velocity: f64,
    force: f64,
}

const FORMS: Enumeration = Enumeration {
    name: "InteractionForm",
    items: &[
        Item {
            name: "transfer_function",
            value: 0,
            description: "By the equations",
        },
        Item {
            name: "derivative_blocks",
            value: 1,
            description: "By differences, as the published program",
        },
    ],
};

impl Component for TransferSystem {
    const NAME: &'static str = "TransferSystem";
    const DESCRIPTION: &'static str =
        "Servo-hydraulic actuator with a specimen, for hybrid simulation";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::plug("command", "actuator-command", &[("command", "command")]),
        Terminal::bus(
            "motion",
            "motion",
            &[
                ("displacement", "displacement"),
                ("velocity", "velocity"),
                ("force", "force"),
            ],
        ),
    ];
    const STEP_SIZE: f64 = PERIOD;
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        let mut variables = fmu_kit::table! { Self, s:
            input("command", s.command, "Command to the actuator", "m" => "mm").nominal(5e-3);
            output("displacement", s.displacement, "Displacement of the specimen", "m" => "mm").nominal(5e-3);
            output("velocity", s.velocity, "Velocity of the specimen", "m/s" => "mm/s").nominal(0.1);
            output("force", s.force, "Force of the specimen", "N" => "kN").nominal(5e3);
            parameter("valve_gain", s.parameters.valve_gain, "a1 beta0", "N/(m.s3)");
            parameter(vocabulary::VALVE_BETA1, s.parameters.valve_beta1, "beta1 of the valve", "1/s");
            parameter(vocabulary::VALVE_BETA2, s.parameters.valve_beta2, "beta2 of the valve", "1/s2");
            parameter(vocabulary::ACTUATOR_A2, s.parameters.actuator_a2, "a2: interaction with the specimen's velocity", "N/m");
            parameter(vocabulary::ACTUATOR_A3, s.parameters.actuator_a3, "a3 of the actuator", "1/s");
            parameter("command_gain", s.parameters.command_gain, "Gain on the command");
            parameter(vocabulary::SPECIMEN_MASS, s.parameters.specimen_mass, "Mass of the specimen", "kg");
            parameter(vocabulary::SPECIMEN_STIFFNESS, s.parameters.specimen_stiffness, "Stiffness of the specimen", "N/m");
            parameter("specimen_damping_ratio", s.parameters.specimen_damping_ratio, "Damping ratio of the specimen");
            parameter("command_quantum", s.converter.quantum, "Step of the converter of the command, 0 for none", "m").min(0.0);
            parameter("command_limit", s.converter.limit, "Limit of the converter of the command, 0 for none", "m").min(0.0);
        };
        variables.push(
            Variable::choice("interaction_form", FORMS, |s: &mut Self| &mut s.form)
                .about("How velocity and acceleration are formed"),
        );
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        let form = match self.form {
            1 => InteractionForm::DerivativeBlocks,
            _ => InteractionForm::TransferFunction,
        };
        self.plant = Plant::new(self.parameters, form, Self::STEP_SIZE)?;
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        self.displacement = self.plant.state.displacement;
        self.velocity = self.plant.state.velocity;
        self.force = self.plant.force();
    }

    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult {
        self.plant.step(self.converter.write(self.command));
        if self.plant.state.displacement.is_finite() {
            return Ok(());
        }
        Err(format!(
            "the displacement is no longer finite after t = {} s",
            time + step_size
        )
        .into())
    }
}

fmu_kit::export!(TransferSystem);

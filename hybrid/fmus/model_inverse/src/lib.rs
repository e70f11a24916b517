#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by the inverse of a model as an FMU.

use controllers::Controller;
use fmu_kit::{Component, ComponentResult, Terminal, Variable};
use hybrid::laws::TrackingInput;
use hybrid::laws::extrapolation::Extrapolation;
use hybrid::laws::model_inverse::ModelInverse as Law;
use hybrid::vrths::TransferSystemParameters;
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Tracking control by the inverse of a model, with PI.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ModelInverse {
    proportional: f64,
    integral: f64,
    lead: f64,
    plant: TransferSystemParameters,
    law: Option<Law>,
    input: TrackingInput,
    command: f64,
}

impl Default for ModelInverse {
    fn default() -> Self {
        Self {
            proportional: 0.0,
            integral: 0.0,
            lead: 0.0,
            plant: TransferSystemParameters::default(),
            law: None,
            input: TrackingInput::default(),
            command: 0.0,
        }
    }
}

impl Component for ModelInverse {
    const NAME: &'static str = "ModelInverse";
    const DESCRIPTION: &'static str = "Tracking control by the inverse of a model, with PI";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::DESIRED_DISPLACEMENT,
        Terminal::MEASURED_DISPLACEMENT,
        Terminal::ACTUATOR,
    ];
    const STEP_SIZE: f64 = hybrid::vrths::PERIOD;
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        let mut variables = fmu_kit::displacement_tracking!(Self, s: s.input, s.command);
        variables.extend(fmu_kit::table! { Self, s:
            parameter(vocabulary::PROPORTIONAL_GAIN, s.proportional, "Proportional gain");
            parameter(vocabulary::INTEGRAL_GAIN, s.integral, "Integral gain", "1/s");
            parameter(vocabulary::LEAD_SAMPLES, s.lead, "Lead of the desired displacement beside that of the held command, samples");
            parameter(vocabulary::VALVE_BETA1, s.plant.valve_beta1, "beta1 of the model's valve", "1/s");
            parameter(vocabulary::VALVE_BETA2, s.plant.valve_beta2, "beta2 of the model's valve", "1/s2");
            parameter(vocabulary::ACTUATOR_A3, s.plant.actuator_a3, "a3 of the model's actuator", "1/s");
            parameter(vocabulary::SPECIMEN_MASS, s.plant.specimen_mass, "Mass of the model's specimen", "kg");
            parameter(vocabulary::SPECIMEN_STIFFNESS, s.plant.specimen_stiffness, "Stiffness of the model's specimen", "N/m");
        });
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        let law = {
            self.plant.validate()?;
            Law {
                proportional: self.proportional,
                integral: self.integral,
                // The held command is late by half a sample.
                desired: Extrapolation::new(5, 16, self.lead + 0.5)?,
                ..Law::of(&self.plant, 5)?
            }
        };
        law.validate()?;
        self.law = Some(law);
        self.command = 0.0;
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        if let Some(law) = &mut self.law {
            self.command = law.step(&self.input, step_size);
        }
        Ok(())
    }
}

fmu_kit::export!(ModelInverse);

#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Linear quadratic Gaussian tracking as an FMU.

use controllers::Controller;
use fmu_kit::{Component, ComponentResult, Terminal, Variable};
use hybrid::laws::TrackingInput;
use hybrid::laws::linear_quadratic::{LinearQuadraticDesign, LinearQuadraticTracking as Law};
use hybrid::vrths::{PERIOD, TransferSystemParameters};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Linear quadratic Gaussian tracking control.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LinearQuadraticTracking {
    design: LinearQuadraticDesign,
    law: Option<Law>,
    input: TrackingInput,
    command: f64,
}

impl Default for LinearQuadraticTracking {
    fn default() -> Self {
        Self {
            design: LinearQuadraticDesign::default(),
            law: None,
            input: TrackingInput::default(),
            command: 0.0,
        }
    }
}

impl Component for LinearQuadraticTracking {
    const NAME: &'static str = "LinearQuadraticTracking";
    const DESCRIPTION: &'static str = "Linear quadratic Gaussian tracking control";
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
            parameter(vocabulary::COMMAND_WEIGHT, s.design.command_weight, "Weight of the command against the displacement error");
            parameter("command_noise", s.design.command_noise, "White noise on the command, one standard deviation", "m");
            parameter("disturbance_step", s.design.disturbance_step, "Step of the disturbance at the command a sample, one standard deviation", "m");
            parameter(vocabulary::SENSOR_NOISE, s.design.measurement_noise, "Noise of the measured displacement, one standard deviation", "m");
            parameter(vocabulary::LEAD_SAMPLES, s.design.lead, "Lead of the desired displacement, samples");
        });
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        let law = Law::design(&TransferSystemParameters::default(), &self.design, PERIOD)?;
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

fmu_kit::export!(LinearQuadraticTracking);

#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by sliding mode as an FMU.

use controllers::Controller;
use fmu_kit::{Component, ComponentResult, Terminal, Variable};
use hybrid::laws::TrackingInput;
use hybrid::laws::sliding_mode::TrackingSlidingMode as Law;
use serde::{Deserialize, Serialize};

/// Tracking control by sliding mode.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TrackingSlidingMode {
    rate: f64,
    reaching: f64,
    boundary_layer: f64,
    damping_uncertainty: f64,
    stiffness_uncertainty: f64,
    law: Option<Law>,
    input: TrackingInput,
    command: f64,
}

impl Default for TrackingSlidingMode {
    fn default() -> Self {
        Self {
            rate: 150.0,
            reaching: 0.1,
            boundary_layer: 5e-3,
            damping_uncertainty: 0.36,
            stiffness_uncertainty: 0.1,
            law: None,
            input: TrackingInput::default(),
            command: 0.0,
        }
    }
}

impl Component for TrackingSlidingMode {
    const NAME: &'static str = "TrackingSlidingMode";
    const DESCRIPTION: &'static str = "Tracking control by sliding mode";
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
            parameter("rate", s.rate, "lambda", "1/s");
            parameter("reaching", s.reaching, "eta", "m/s2");
            parameter("boundary_layer", s.boundary_layer, "phi", "m/s");
            parameter("damping_uncertainty", s.damping_uncertainty, "beta_b").min(0.0);
            parameter("stiffness_uncertainty", s.stiffness_uncertainty, "beta_c").min(0.0);
        });
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        let law = Law {
            rate: self.rate,
            reaching: self.reaching,
            boundary_layer: self.boundary_layer,
            damping_uncertainty: self.damping_uncertainty,
            stiffness_uncertainty: self.stiffness_uncertainty,
            ..Law::published()?
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

fmu_kit::export!(TrackingSlidingMode);

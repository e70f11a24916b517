#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by loop shaping as an FMU.

use controllers::Controller;
use fmu_kit::{Component, ComponentResult, Terminal, Variable};
use hybrid::laws::TrackingInput;
use hybrid::laws::robust_tracking::RobustTracking as Law;
use hybrid::vrths::{PERIOD, TransferSystemParameters};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Tracking control by synthesised loop shaping.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RobustTracking {
    crossover: f64,
    zero: f64,
    lead: f64,
    law: Option<Law>,
    input: TrackingInput,
    command: f64,
}

impl Default for RobustTracking {
    fn default() -> Self {
        Self {
            crossover: 60.0,
            zero: 50.0,
            lead: 1.5,
            law: None,
            input: TrackingInput::default(),
            command: 0.0,
        }
    }
}

impl Component for RobustTracking {
    const NAME: &'static str = "RobustTracking";
    const DESCRIPTION: &'static str = "Tracking control by synthesised loop shaping";
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
            parameter("crossover", s.crossover, "Crossover of the weight's integrator", "rad/s");
            parameter("zero", s.zero, "Zero of the weight", "rad/s");
            parameter(vocabulary::LEAD_SAMPLES, s.lead, "Lead of the desired displacement, samples");
        });
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        let law = {
            let plant = TransferSystemParameters::default();
            Law::synthesise(&plant, self.crossover, self.zero, self.lead, PERIOD)?
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

fmu_kit::export!(RobustTracking);

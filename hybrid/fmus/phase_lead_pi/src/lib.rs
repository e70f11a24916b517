#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! PI with phase lead as an FMU.

use controllers::Controller;
use fmu_kit::{Component, ComponentResult, Terminal, Variable};
use hybrid::laws::TrackingInput;
use hybrid::laws::phase_lead_pi::PhaseLeadPi as Law;
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Tracking control by PI with phase lead.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PhaseLeadPi {
    start: Law,
    law: Option<Law>,
    input: TrackingInput,
    command: f64,
}

impl Default for PhaseLeadPi {
    fn default() -> Self {
        Self {
            start: Law::default(),
            law: None,
            input: TrackingInput::default(),
            command: 0.0,
        }
    }
}

impl Component for PhaseLeadPi {
    const NAME: &'static str = "PhaseLeadPi";
    const DESCRIPTION: &'static str = "Tracking control by PI with phase lead";
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
            parameter(vocabulary::PROPORTIONAL_GAIN, s.start.proportional, "Proportional gain");
            parameter(vocabulary::INTEGRAL_GAIN, s.start.integral, "Integral gain", "1/s");
            parameter("lead_gain", s.start.lead_gain, "Gain of the lead at high frequency");
            parameter("lead_numerator", s.start.lead_numerator, "Constant of the lead's numerator", "1/s");
            parameter("lead_pole", s.start.lead_pole, "Pole of the lead", "1/s");
            parameter(vocabulary::CONVERTER_QUANTUM, s.start.converter.quantum, "Step of the converters, 0 for none", "m").min(0.0);
            parameter(vocabulary::CONVERTER_LIMIT, s.start.converter.limit, "Limit of the converters, 0 for none", "m").min(0.0);
        });
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        let law = self.start;
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

fmu_kit::export!(PhaseLeadPi);

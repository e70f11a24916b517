#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by a gradient-adapted inverse as an FMU.

use controllers::Controller;
use fmu_kit::{Component, ComponentResult, Terminal, Variable};
use hybrid::laws::TrackingInput;
use hybrid::laws::gradient_inverse::GradientInverse as Law;
use serde::{Deserialize, Serialize};

/// Tracking control by the adaptive inverse of Galmez and Fermandois.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct GradientInverse {
    start: Law,
    law: Option<Law>,
    input: TrackingInput,
    command: f64,
}

impl Default for GradientInverse {
    fn default() -> Self {
        Self {
            start: Law::default(),
            law: None,
            input: TrackingInput::default(),
            command: 0.0,
        }
    }
}

impl Component for GradientInverse {
    const NAME: &'static str = "GradientInverse";
    const DESCRIPTION: &'static str =
        "Tracking control by the adaptive inverse of Galmez and Fermandois";
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
            parameter("initial_coefficient[1]", s.start.initial[0], "Coefficient 0 at the start, s^0");
            parameter("initial_coefficient[2]", s.start.initial[1], "Coefficient 1 at the start, s^1");
            parameter("initial_coefficient[3]", s.start.initial[2], "Coefficient 2 at the start, s^2");
            parameter("initial_coefficient[4]", s.start.initial[3], "Coefficient 3 at the start, s^3");
            parameter("adaptation_gain[1]", s.start.gains[0], "Gain of the adaptation of coefficient 0").min(0.0);
            parameter("adaptation_gain[2]", s.start.gains[1], "Gain of the adaptation of coefficient 1").min(0.0);
            parameter("adaptation_gain[3]", s.start.gains[2], "Gain of the adaptation of coefficient 2").min(0.0);
            parameter("adaptation_gain[4]", s.start.gains[3], "Gain of the adaptation of coefficient 3").min(0.0);
            parameter("corner", s.start.corner, "Corner of the filter of Butterworth", "Hz");
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

fmu_kit::export!(GradientInverse);

#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by an adaptive inverse as an FMU.

use controllers::Controller;
use fmu_kit::{Component, ComponentResult, Terminal, Variable};
use hybrid::laws::TrackingInput;
use hybrid::laws::adaptive_inverse::AdaptiveInverse as Law;
use hybrid::laws::extrapolation::{Extrapolation, WINDOW_SAMPLES};
use hybrid::vrths::{Deviation, PERIOD, TransferSystemParameters};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Tracking control by an inverse that is estimated during the test.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct AdaptiveInverse {
    lead: f64,
    deviation: Deviation,
    corner: f64,
    error_variance: f64,
    window: i32,
    law: Option<Law>,
    input: TrackingInput,
    command: f64,
}

impl Default for AdaptiveInverse {
    fn default() -> Self {
        let deviation = Deviation {
            specimen_stiffness: Law::STIFFNESS_DEVIATION,
            ..Deviation::default()
        };
        Self {
            lead: Law::LEAD,
            deviation,
            corner: Law::CORNER,
            error_variance: Law::ERROR_VARIANCE,
            window: 16,
            law: None,
            input: TrackingInput::default(),
            command: 0.0,
        }
    }
}

impl Component for AdaptiveInverse {
    const NAME: &'static str = "AdaptiveInverse";
    const DESCRIPTION: &'static str =
        "Tracking control by an inverse that is estimated during the test";
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
            parameter(vocabulary::LEAD_SAMPLES, s.lead, "Lead of the desired displacement, samples");
            parameter("stiffness_deviation", s.deviation.specimen_stiffness, "Standard deviation of the specimen's stiffness at the start", "N/m").min(0.0);
            parameter("beta1_deviation", s.deviation.valve_beta1, "Standard deviation of the valve's beta1 at the start", "1/s").min(0.0);
            parameter("beta2_deviation", s.deviation.valve_beta2, "Standard deviation of the valve's beta2 at the start", "1/s2").min(0.0);
            parameter("a3_deviation", s.deviation.actuator_a3, "Standard deviation of the actuator's a3 at the start", "1/s").min(0.0);
            parameter("corner", s.corner, "Corner of each lag of the estimation's filter", "rad/s");
            parameter("error_variance", s.error_variance, "Variance of the filtered equation's error times its correlation in samples", "m2");
            parameter(WINDOW_SAMPLES, s.window, "Samples that the derivatives of the desired displacement are fitted to").min(6.0).max(32.0);
        });
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        let law = {
            let nominal = TransferSystemParameters::default();
            let mut law = Law::for_family(&nominal, &self.deviation, PERIOD, self.lead)?;
            law.corner = self.corner;
            law.error_variance = self.error_variance;
            let window = usize::try_from(self.window).unwrap_or_default();
            law.desired = Extrapolation::new(5, window, self.lead)?;
            law
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

fmu_kit::export!(AdaptiveInverse);

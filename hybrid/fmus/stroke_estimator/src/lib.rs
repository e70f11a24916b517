#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! An estimator of two coupled strokes as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Variable};
use hybrid::marths::laws::{Estimator, PredictiveDesign};
use hybrid::marths::names::{COMMAND, MEASURED_STROKE, STROKE};
use hybrid::marths::{PERIOD, Pair};
use serde::{Deserialize, Serialize};

/// From the commands of the sample before and measured strokes to estimated strokes.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct StrokeEstimator {
    estimator: Option<Estimator>,
    command: Pair,
    measured: Pair,
    stroke: Pair,
}

const MEASURED: [&str; 2] = [MEASURED_STROKE[0], MEASURED_STROKE[1]];

impl Component for StrokeEstimator {
    const NAME: &'static str = "StrokeEstimator";
    const DESCRIPTION: &'static str =
        "Estimates two coupled strokes from commands and measured strokes";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const STEP_SIZE: f64 = PERIOD;
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input(COMMAND[0], s.command[0], "Command of actuator 1, one sample before", "m" => "mm").nominal(5e-3);
            input(COMMAND[1], s.command[1], "Command of actuator 2, one sample before", "m" => "mm").nominal(5e-3);
            input(MEASURED_STROKE[0], s.measured[0], "Measured stroke of actuator 1", "m" => "mm").nominal(5e-3);
            input(MEASURED_STROKE[1], s.measured[1], "Measured stroke of actuator 2", "m" => "mm").nominal(5e-3);
            output(STROKE[0], s.stroke[0], "Estimated stroke of actuator 1", "m" => "mm").discrete().nominal(5e-3).depends_on(&MEASURED, Dependent);
            output(STROKE[1], s.stroke[1], "Estimated stroke of actuator 2", "m" => "mm").discrete().nominal(5e-3).depends_on(&MEASURED, Dependent);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.estimator = Some(PredictiveDesign::default().estimator());
        self.stroke = [0.0; 2];
        Ok(())
    }

    fn step(&mut self, _time: f64, _step_size: f64) -> ComponentResult {
        let Some(estimator) = &mut self.estimator else {
            return Ok(());
        };
        estimator.advance(self.command);
        estimator.correct(self.measured);
        self.stroke = estimator.strokes();
        Ok(())
    }
}

fmu_kit::export!(StrokeEstimator);

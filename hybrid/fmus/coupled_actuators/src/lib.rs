#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Two coupled actuators as an FMU.

use fmu_kit::{Component, ComponentResult, Variable};
use hybrid::marths::names::{COMMAND, STROKE};
use hybrid::marths::{Deviation, PERIOD, Pair, Plant, PlantParameters};
use serde::{Deserialize, Serialize};

/// Two actuators that move one joint.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct CoupledActuators {
    parameters: PlantParameters,
    moved_by: [f64; 9],
    drawn: i32,
    seed: i32,
    delay: [i32; 2],
    plant: Option<Plant>,
    command: Pair,
    stroke: Pair,
}

impl Component for CoupledActuators {
    const NAME: &'static str = "CoupledActuators";
    const DESCRIPTION: &'static str =
        "Two coupled actuators that hold one joint, for hybrid simulation";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const STEP_SIZE: f64 = PERIOD;
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        let mut variables = fmu_kit::table! { Self, s:
            input(COMMAND[0], s.command[0], "Command of actuator 1", "m" => "mm").nominal(5e-3);
            input(COMMAND[1], s.command[1], "Command of actuator 2", "m" => "mm").nominal(5e-3);
            output(STROKE[0], s.stroke[0], "Stroke of actuator 1", "m" => "mm").nominal(5e-3);
            output(STROKE[1], s.stroke[1], "Stroke of actuator 2", "m" => "mm").nominal(5e-3);
            parameter("column_1_zero[1]", s.parameters.first_zeros[0], "First zero of column 1", "rad/s");
            parameter("column_1_zero[2]", s.parameters.first_zeros[1], "Second zero of column 1", "rad/s");
            parameter("column_1_pole[1]", s.parameters.columns[0].poles[0], "First pole of column 1", "rad/s");
            parameter("column_1_pole[2]", s.parameters.columns[0].poles[1], "Second pole of column 1", "rad/s");
            parameter("column_1_decay", s.parameters.columns[0].decay, "Decay of the complex pair of column 1", "rad/s");
            parameter("column_1_frequency", s.parameters.columns[0].frequency, "Frequency of the complex pair of column 1", "rad/s");
            parameter("zero_12", s.parameters.second_zeros[0], "Zero of entry 1,2", "rad/s");
            parameter("zero_22", s.parameters.second_zeros[1], "Zero of entry 2,2", "rad/s");
            parameter("column_2_pole[1]", s.parameters.columns[1].poles[0], "First pole of column 2", "rad/s");
            parameter("column_2_pole[2]", s.parameters.columns[1].poles[1], "Second pole of column 2", "rad/s");
            parameter("column_2_decay", s.parameters.columns[1].decay, "Decay of the complex pair of column 2", "rad/s");
            parameter("column_2_frequency", s.parameters.columns[1].frequency, "Frequency of the complex pair of column 2", "rad/s");
            parameter("static_gain_11", s.parameters.static_gain[0][0], "Stroke 1 by command 1 at rest");
            parameter("static_gain_12", s.parameters.static_gain[0][1], "Stroke 1 by command 2 at rest");
            parameter("static_gain_21", s.parameters.static_gain[1][0], "Stroke 2 by command 1 at rest");
            parameter("static_gain_22", s.parameters.static_gain[1][1], "Stroke 2 by command 2 at rest");
            parameter("delay_samples_1", s.delay[0], "Samples by which command 1 arrives late").min(0.0).max(64.0);
            parameter("delay_samples_2", s.delay[1], "Samples by which command 2 arrives late").min(0.0).max(64.0);
            parameter("drawn_plant", s.drawn, "Number of the perturbed plant that the seed draws, 0 for none").min(0.0);
            parameter("seed", s.seed, "Seed of the perturbed plants").min(0.0);
        };
        let moved = Variable::<Self>::array("moved_by", fmu_kit::Causality::Parameter, 9, |s| {
            &mut s.moved_by
        });
        variables.extend(moved.into_iter().zip(hybrid::marths::PERTURBED).map(
            |(element, name)| {
                element.about(&format!("Standard deviations by which it is moved: {name}"))
            },
        ));
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        let spread = Deviation::default();
        let mut plant = spread.moved(&self.parameters, self.moved_by);
        if self.drawn > 0 {
            let [seed, number] =
                [self.seed, self.drawn].map(|value| u64::from(value.cast_unsigned()));
            plant = spread.draw(&plant, seed, number);
        }
        plant.delay = self
            .delay
            .map(|samples| usize::try_from(samples).unwrap_or_default());
        self.plant = Some(Plant::new(plant)?);
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        if let Some(plant) = &self.plant {
            self.stroke = plant.strokes();
        }
    }

    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult {
        let Some(plant) = &mut self.plant else {
            return Ok(());
        };
        plant.step(self.command);
        if plant.strokes().iter().all(|stroke| stroke.is_finite()) {
            return Ok(());
        }
        Err(format!(
            "the strokes are no longer finite after t = {} s",
            time + step_size
        )
        .into())
    }
}

fmu_kit::export!(CoupledActuators);

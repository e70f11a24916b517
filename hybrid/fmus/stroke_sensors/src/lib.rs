#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Stroke sensors of two actuators as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Variable};
use hybrid::marths::names::{MEASURED_STROKE, STROKE};
use hybrid::marths::{NOISE, PERIOD, Pair};
use plant::sensors::channel::Noise;
use serde::{Deserialize, Serialize};

/// Two strokes with independent noise.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StrokeSensors {
    noise: f64,
    seed: i32,
    stream: i32,
    sample: u64,
    stroke: Pair,
    measured: Pair,
}

impl Default for StrokeSensors {
    fn default() -> Self {
        Self {
            noise: NOISE,
            seed: 1,
            stream: 0,
            sample: 0,
            stroke: [0.0; 2],
            measured: [0.0; 2],
        }
    }
}

impl Component for StrokeSensors {
    const NAME: &'static str = "StrokeSensors";
    const DESCRIPTION: &'static str = "Stroke sensors of two actuators, with independent noise";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const STEP_SIZE: f64 = PERIOD;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input(STROKE[0], s.stroke[0], "Stroke of actuator 1", "m" => "mm").nominal(5e-3);
            input(STROKE[1], s.stroke[1], "Stroke of actuator 2", "m" => "mm").nominal(5e-3);
            output(MEASURED_STROKE[0], s.measured[0], "Stroke 1 with noise", "m" => "mm").discrete().nominal(5e-3).depends_on(&[STROKE[0]], Dependent);
            output(MEASURED_STROKE[1], s.measured[1], "Stroke 2 with noise", "m" => "mm").discrete().nominal(5e-3).depends_on(&[STROKE[1]], Dependent);
            parameter("noise", s.noise, "White noise of each sensor, one standard deviation", "m" => "mm").min(0.0);
            parameter("seed", s.seed, "Seed of the noise").min(0.0);
            parameter("stream", s.stream, "Number of the draws that the seed stands for").min(0.0);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.sample = 0;
        self.measured = [0.0; 2];
        Ok(())
    }

    fn step(&mut self, _time: f64, _step_size: f64) -> ComponentResult {
        let [seed, stream] = [self.seed, self.stream].map(|value| u64::from(value.cast_unsigned()));
        for (sensor, (measured, stroke)) in self.measured.iter_mut().zip(self.stroke).enumerate() {
            let draw = Noise {
                seed,
                channel: stream << 1 | sensor as u64,
                sample: self.sample,
            };
            *measured = stroke + self.noise * draw.gaussian();
        }
        self.sample += 1;
        Ok(())
    }
}

fmu_kit::export!(StrokeSensors);

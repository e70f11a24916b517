#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Sensors of hybrid simulation as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use hybrid::vrths::{Converter, PERIOD, SensorNoise};
use plant::sensors::channel::Noise;
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// Noise and converter between the specimen and the computer.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct TrackingSensors {
    noise: SensorNoise,
    converter: Converter,
    seed: i32,
    stream: i32,
    sample: u64,
    displacement: f64,
    force: f64,
    measured_displacement: f64,
    read_displacement: f64,
    measured_force: f64,
}

impl Component for TrackingSensors {
    const NAME: &'static str = "TrackingSensors";
    const DESCRIPTION: &'static str = "Displacement sensor and load cell of hybrid simulation";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::bus(
            "rig",
            "motion",
            &[("displacement", "displacement"), ("force", "force")],
        ),
        Terminal::bus(
            "measured",
            "motion",
            &[
                ("displacement", vocabulary::MEASURED_DISPLACEMENT),
                ("force", vocabulary::MEASURED_FORCE),
            ],
        ),
    ];
    const STEP_SIZE: f64 = PERIOD;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("displacement", s.displacement, "Displacement of the specimen", "m" => "mm").nominal(5e-3);
            input("force", s.force, "Force of the specimen", "N" => "kN").nominal(5e3);
            output(vocabulary::MEASURED_DISPLACEMENT, s.measured_displacement, "Displacement with noise", "m" => "mm")
                .discrete().nominal(5e-3).depends_on(&["displacement"], Dependent);
            output("read_displacement", s.read_displacement, "The same behind the converter", "m" => "mm")
                .discrete().nominal(5e-3).depends_on(&["displacement"], Dependent);
            output(vocabulary::MEASURED_FORCE, s.measured_force, "Force with noise", "N" => "kN")
                .discrete().nominal(5e3).depends_on(&["force"], Dependent);
            parameter("displacement_noise", s.noise.displacement, "White noise of the displacement, one standard deviation", "m").min(0.0);
            parameter(vocabulary::FORCE_NOISE, s.noise.force, "White noise of the force, one standard deviation", "N").min(0.0);
            parameter(vocabulary::CONVERTER_QUANTUM, s.converter.quantum, "Step of the converter, 0 for none", "m").min(0.0);
            parameter(vocabulary::CONVERTER_LIMIT, s.converter.limit, "Limit of the converter, 0 for none", "m").min(0.0);
            parameter("seed", s.seed, "Seed of the noise").min(0.0);
            parameter("stream", s.stream, "Number of the draws that the seed stands for").min(0.0);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.sample = 0;
        Ok(())
    }

    fn step(&mut self, _time: f64, _step_size: f64) -> ComponentResult {
        let draw = |sensor: u64| {
            let stream = u64::from(self.stream.cast_unsigned());
            Noise {
                seed: u64::from(self.seed.cast_unsigned()),
                channel: stream << 1 | sensor,
                sample: self.sample,
            }
            .gaussian()
        };
        self.measured_displacement = self.displacement + self.noise.displacement * draw(0);
        self.measured_force = self.force + self.noise.force * draw(1);
        self.read_displacement = self.converter.read(self.measured_displacement);
        self.sample += 1;
        Ok(())
    }
}

fmu_kit::export!(TrackingSensors);

#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Sliding-mode control as an FMU.

use controllers::{
    Controller,
    allocation::ControlAllocation,
    hierarchy::{self, LowLevelReferences, SlidingModeInput},
    pid::Pid,
    prediction_over_delay::PredictionOverDelay,
    sliding_mode::SlidingMode as Law,
};
use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use plant::ModelError;
use plant::identified::{actuator::IdentifiedActuator, shake_table::ShakeTable, table::Table};
use serde::{Deserialize, Serialize};
use units::constants::SAMPLING_PERIOD;
use units::vocabulary;

/// The sliding-mode law over the loops of Fig 4-3.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SlidingMode {
    law: Law,
    input: SlidingModeInput,
    references: LowLevelReferences,
    surface: f64,
    loop_delay_samples: i32,
    command_delay_samples: i32,
    reference_ahead: bool,
    sampling_period: f64,
    actuator: IdentifiedActuator,
    displacement_loop: Pid,
    force_loop: Pid,
    allocation: ControlAllocation,
}

impl Default for SlidingMode {
    fn default() -> Self {
        let allocation = ControlAllocation::default();
        Self {
            law: Law::default(),
            input: SlidingModeInput::default(),
            references: LowLevelReferences::default(),
            surface: 0.0,
            loop_delay_samples: 0,
            command_delay_samples: 0,
            reference_ahead: false,
            sampling_period: SAMPLING_PERIOD,
            actuator: ShakeTable::default().actuator,
            displacement_loop: hierarchy::displacement_loop(&allocation),
            force_loop: hierarchy::force_loop(&allocation),
            allocation,
        }
    }
}

const MOTION: [&str; 5] = [
    vocabulary::REFERENCE_DISPLACEMENT,
    vocabulary::REFERENCE_VELOCITY,
    vocabulary::REFERENCE_ACCELERATION,
    vocabulary::MEASURED_DISPLACEMENT,
    vocabulary::MEASURED_VELOCITY,
];
impl Component for SlidingMode {
    const NAME: &'static str = "SlidingMode";
    const DESCRIPTION: &'static str = "Sliding mode over a displacement and a force loop";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::REFERENCE,
        Terminal::bus(
            "measured",
            "motion",
            &[
                ("displacement", vocabulary::MEASURED_DISPLACEMENT),
                ("velocity", vocabulary::MEASURED_VELOCITY),
                ("force", vocabulary::MEASURED_FORCE),
            ],
        ),
        Terminal::plug(
            "specimen",
            "specimen-motion",
            &[("acceleration", vocabulary::SPECIMEN_ACCELERATION)],
        ),
        Terminal::bus(
            "command",
            "reference",
            &[
                ("displacement", "displacement_command"),
                ("force", "force_command"),
            ],
        ),
    ];

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input(vocabulary::REFERENCE_DISPLACEMENT, s.input.reference.displacement, "Wanted displacement", "m" => "in").nominal(0.0381);
            input(vocabulary::REFERENCE_VELOCITY, s.input.reference.velocity, "Wanted velocity", "m/s" => "in/s").nominal(0.5);
            input(vocabulary::REFERENCE_ACCELERATION, s.input.reference.acceleration, "Wanted acceleration", "m/s2" => "g").nominal(10.0);
            input(vocabulary::MEASURED_DISPLACEMENT, s.input.measured.displacement, "Displacement of the table", "m" => "in").nominal(0.0381);
            input(vocabulary::MEASURED_VELOCITY, s.input.measured.velocity, "Velocity of the table", "m/s" => "in/s").nominal(0.5);
            input(vocabulary::MEASURED_FORCE, s.input.measured_force, "Force of the actuator, for the prediction over a delay", "N" => "lbf").nominal(200.0);
            input(vocabulary::SPECIMEN_ACCELERATION, s.input.specimen_acceleration, "Absolute acceleration of the specimen", "m/s2" => "g").nominal(10.0);
            output("displacement_command", s.references.displacement, "Reference of the displacement loop", "m" => "in")
                .discrete().nominal(0.0381).depends_on_inputs(Dependent);
            output("force_command", s.references.force, "Reference of the force loop", "N" => "lbf")
                .discrete().nominal(200.0).depends_on_inputs(Dependent);
            output("sliding_surface", s.surface, "S of Eq 4-7 as measured", "m/s" => "in/s")
                .discrete().nominal(0.5).depends_on(&MOTION, Dependent);
            parameter(Table::TABLE_MASS, s.law.table.mass, "Mass of the table", "kg");
            parameter(Table::TABLE_DAMPING, s.law.table.damping, "Damping of the table", "N.s/m" => "lbf.s/in");
            parameter(Table::TABLE_STIFFNESS, s.law.table.stiffness, "Stiffness of the table's springs", "N/m" => "lbf/in");
            group(s.law);
            parameter(vocabulary::LOOP_DELAY_SAMPLES, s.loop_delay_samples, "Samples from measurement to valve");
            parameter(vocabulary::COMMAND_DELAY_SAMPLES, s.command_delay_samples, "Samples from this law to the low-level loops");
            parameter("reference_ahead", s.reference_ahead, "The references are those of loop_delay_samples later");
            parameter("sampling_period", s.sampling_period, "Period of the prediction", "s" => "ms");
            group(s.actuator).introduced("Prediction: ");
            parameter("displacement_loop_proportional_gain", s.displacement_loop.proportional, "Of the displacement loop", "V/m" => "V/in");
            parameter("displacement_loop_integral_gain", s.displacement_loop.integral, "Of the displacement loop", "V/(m.s)" => "V/(in.s)");
            parameter("displacement_loop_integral_leak", s.displacement_loop.integral_leak, "Of the displacement loop", "1/s");
            parameter("displacement_loop_limit", s.displacement_loop.limit, "Of the displacement loop", "V");
            parameter("force_loop_proportional_gain", s.force_loop.proportional, "Of the force loop", "V/N" => "V/lbf");
            parameter("force_loop_integral_gain", s.force_loop.integral, "Of the force loop", "V/(N.s)" => "V/(lbf.s)");
            parameter("force_loop_integral_leak", s.force_loop.integral_leak, "Of the force loop", "1/s");
            parameter("force_loop_limit", s.force_loop.limit, "Of the force loop", "V");
            parameter(ControlAllocation::DISPLACEMENT_SHARE, s.allocation.displacement_share, "alpha of the allocation", "1");
            parameter(ControlAllocation::FORCE_SHARE, s.allocation.force_share, "beta of the allocation", "1");
            parameter(vocabulary::VALVE_LIMIT, s.allocation.limit, "Largest magnitude of the valve command", "V");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.law.prediction = None;
        let loop_delay =
            ModelError::count(vocabulary::LOOP_DELAY_SAMPLES, self.loop_delay_samples)?;
        let command_delay = ModelError::count(
            vocabulary::COMMAND_DELAY_SAMPLES,
            self.command_delay_samples,
        )?;
        self.law.validate()?;
        if loop_delay > 0 || command_delay > 0 {
            let table = ShakeTable {
                table: self.law.table,
                actuator: self.actuator,
            };
            let mut prediction =
                PredictionOverDelay::new(&table, self.sampling_period, loop_delay, command_delay)?;
            prediction.reference_ahead = self.reference_ahead;
            prediction.displacement_loop = self.displacement_loop;
            prediction.force_loop = self.force_loop;
            prediction.allocation = self.allocation;
            self.law.prediction = Some(prediction);
        }
        self.law.validate()?;
        self.law.reset();
        self.references = LowLevelReferences::default();
        self.surface = 0.0;
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        if self.law.prediction.is_some()
            && (step_size - self.sampling_period).abs() > 1e-9 * self.sampling_period
        {
            return Err(format!(
                "parameter `sampling_period` is {} s, the step {step_size} s: a prediction over a \
                 delay needs them equal",
                self.sampling_period
            )
            .into());
        }
        self.references = self.law.step(&self.input, step_size);
        self.surface = self
            .law
            .surface(&self.input.reference, &self.input.measured);
        Ok(())
    }
}

fmu_kit::export!(SlidingMode);

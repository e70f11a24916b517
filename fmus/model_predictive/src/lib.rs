#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Model predictive control over three-variable control as an FMU.

mod settings;

use controllers::mpc::{MAXIMUM_HORIZON, Memory, ModelPredictiveControl, ModelPredictiveInput};
use controllers::{Controller, Motion};
use fmu_kit::{Built, Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use serde::{Deserialize, Serialize};

use settings::{SOLVERS, Settings};

/// Model predictive control from reference and measured motion to the commands of three-variable
/// control.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct ModelPredictive {
    settings: Settings,
    reference: Motion,
    displacement_ahead: [f64; MAXIMUM_HORIZON],
    velocity_ahead: [f64; MAXIMUM_HORIZON],
    acceleration_ahead: [f64; MAXIMUM_HORIZON],
    measured: Motion,
    memory: Memory,
    command: Motion,
    counts: Counts,
    #[serde(skip)]
    built: Built<Settings, ModelPredictiveControl>,
}

/// Outputs about the solver.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Counts {
    shortcuts: i32,
    solved: i32,
    iterations: i32,
    fallbacks: i32,
    low_level_alone: i32,
}

fn build(settings: &Settings) -> Result<ModelPredictiveControl, plant::ModelError> {
    ModelPredictiveControl::new(settings.parameters(ModelPredictive::STEP_SIZE)?)
}

impl Component for ModelPredictive {
    const NAME: &'static str = "ModelPredictive";
    const DESCRIPTION: &'static str =
        "Model predictive control of a shake table over three-variable control";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::REFERENCE,
        Terminal::MEASURED,
        Terminal::bus(
            "command",
            "reference",
            &[
                ("displacement", "command_displacement"),
                ("velocity", "command_velocity"),
                ("acceleration", "command_acceleration"),
            ],
        ),
    ];
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            include(fmu_kit::tracking_inputs!(Self, s: s.reference, s.measured));
            include(fmu_kit::reference_ahead::<Self>(MAXIMUM_HORIZON, [
                |s| &mut s.displacement_ahead,
                |s| &mut s.velocity_ahead,
                |s| &mut s.acceleration_ahead,
            ]));
            output("command_displacement", s.command.displacement, "Displacement for three-variable control", "m" => "in")
                .discrete().nominal(0.0381).depends_on_inputs(Dependent);
            output("command_velocity", s.command.velocity, "Velocity for three-variable control", "m/s" => "in/s")
                .discrete().nominal(0.5).depends_on_inputs(Dependent);
            output("command_acceleration", s.command.acceleration, "Acceleration for three-variable control", "m/s2" => "g")
                .discrete().nominal(10.0).depends_on_inputs(Dependent);
            output("solver_shortcut_count", s.counts.shortcuts, "Steps in which no limit was active").depends_on_inputs(Dependent);
            output("solver_solved_count", s.counts.solved, "Steps that the solver solved").depends_on_inputs(Dependent);
            output("solver_iterations", s.counts.iterations, "Iterations of the solver in this step").depends_on_inputs(Dependent);
            output("fallback_count", s.counts.fallbacks, "Steps along the previous plan because the solver gave up").depends_on_inputs(Dependent);
            output("low_level_alone_count", s.counts.low_level_alone, "Steps left to three-variable control alone").depends_on_inputs(Dependent);
            include(settings::variables());
            parameter("solver", s.settings.solver, "Solver of the steps in which a limit is active").choices(SOLVERS);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.built.of(&self.settings, build)?;
        self.memory = Memory::default();
        self.command = Motion::default();
        self.counts = Counts::default();
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        let control = self.built.of(&self.settings, build)?;
        control.memory = self.memory;
        let input = ModelPredictiveInput {
            reference: self.reference.with_ahead([
                &self.displacement_ahead,
                &self.velocity_ahead,
                &self.acceleration_ahead,
            ]),
            measured: self.measured,
        };
        self.command = control.step(&input, step_size);
        self.memory = control.memory;
        let counters = &self.memory.counters;
        let whole = |count: u32| i32::try_from(count).unwrap_or(i32::MAX);
        self.counts = Counts {
            shortcuts: whole(counters.shortcuts),
            solved: whole(counters.solved),
            iterations: whole(counters.iterations),
            fallbacks: whole(counters.shifted_plans),
            low_level_alone: whole(counters.low_level_alone),
        };
        Ok(())
    }
}

fmu_kit::export!(ModelPredictive);

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_kit::conformance::allocations;

    #[test]
    fn steps_at_a_limit_do_not_allocate_either() {
        let mut component = ModelPredictive::default();
        component.initialize().unwrap();
        let counted = allocations(|| {
            for k in 0..1000 {
                let time = 0.002 * f64::from(k);
                component.reference.displacement = 0.05 * (3.0 * time).sin();
                component.measured = component.reference;
                component.step(time, 0.002).unwrap();
            }
        });
        assert_eq!(counted, 0);
        assert!(component.counts.solved > 50, "{:?}", component.counts);
        assert_eq!(component.counts.fallbacks, 0);
    }

    #[test]
    fn what_no_controller_is_built_from_is_refused_by_name() {
        fmu_kit::conformance::refuses::<ModelPredictive>(&[
            ("prediction_horizon", 0.0),
            ("displacement_weight", -1.0),
            ("minimum_displacement", 0.1),
            ("violation_weight", 0.0),
            ("valve_limit", 0.0),
            ("table_mass", 0.0),
        ]);
    }
}

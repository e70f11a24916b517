//! Parameters of the built-in systems' controllers for the physical rig.
//!
//! Every rule works on the model that [`ServoHydraulicTable::fitted`] gives of the rig, with
//! measurements one sample late:
//!
//! - three-variable control: [`ThreeVariableGains::tuned`];
//! - displacement PID and loop shaping: the printed controller, its gain changed so that the
//!   displacement gain is that of three-variable control (half the gain at which the loop
//!   oscillates);
//! - force loop, lambda and K of sliding mode: [`Hierarchy::tuned`], the largest gain that leaves the
//!   whole hierarchy a margin of 6 dB on the linearised rig;
//! - sliding mode and model predictive control have the fitted model as theirs and know the delay;
//!   the latter also knows the sensors' noise and weighs outputs in units of stroke, 20 in/s and 1 g.

use std::sync::OnceLock;

use controllers::pid::Pid;
use controllers::sliding_mode::DISPLACEMENT_INTEGRAL_LEAK;
use controllers::three_variable::ThreeVariableGains;
use controllers::tuning::sliding_mode::{Hierarchy, SlidingModeTuning};
use plant::identified::shake_table::ShakeTable;
use plant::servo_hydraulic::ServoHydraulicTable;
use plant::specimens::YieldingSpecimen;
use serde::{Deserialize, Serialize};
use units::constants::SAMPLING_PERIOD;

use super::SystemFile;
use super::file::ComponentFile;
use plant::identified::nominal::shake_table_values;

/// Samples by which the sensors of the physical rig are late.
const DELAY: usize = 1;

/// Which parameters the controllers of a built-in system have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Tuning {
    /// Those of the thesis, made for the identified plant.
    Printed,
    /// Made by rule from a model fitted to the physical rig.
    Tuned,
}

/// Gives the controllers in `file` the parameters for a rig.
///
/// # Errors
/// A plant for which there is no tuning.
pub(super) fn apply(
    file: &mut SystemFile,
    plant: &str,
    specimen: &str,
    tuning: Option<Tuning>,
) -> Result<(), String> {
    let is_physical = plant == "servohydraulic";
    match tuning {
        Some(Tuning::Tuned) if !is_physical => {
            return Err(format!(
                "there is no tuning for the plant `{plant}`: the printed one was made for it; \
                 expected `--plant servohydraulic` or `--tuning printed`"
            ));
        }
        Some(Tuning::Printed) => return Ok(()),
        None if !is_physical => return Ok(()),
        _ => {}
    }
    static RULES: OnceLock<Result<Rules, String>> = OnceLock::new();
    let rules = RULES.get_or_init(|| Rules::new().map_err(|error| error.to_string()));
    let rules = rules.as_ref().map_err(Clone::clone)?;
    let mut late_references = Vec::new();
    for (name, component) in &mut file.components {
        match component.fmu.as_str() {
            "DisplacementPid" => rules.displacement_pid(component),
            "LoopShaping" => rules.loop_shaping(component),
            "ThreeVariableControl" => rules.three_variable(component),
            "ForcePid" => rules.force_pid(component),
            "SlidingMode" => rules.sliding_mode(component, specimen),
            "ModelPredictive" => {
                rules.model_predictive(component);
                late_references.push(name.clone());
            }
            _ => {}
        }
    }
    for name in late_references {
        delay_references(file, &name);
    }
    Ok(())
}

/// The component `name` compares late measurements with the reference of the same time.
fn delay_references(file: &mut SystemFile, name: &str) {
    for connection in &mut file.connections {
        let text = connection.get_mut();
        let Some((from, to)) = text.split_once("->") else {
            continue;
        };
        let (from, to) = (from.trim(), to.trim());
        let own = to.strip_prefix(name).is_some_and(|r| r.starts_with('.'));
        let Some(quantity) = from.strip_prefix("reference.").filter(|_| own) else {
            continue;
        };
        let (quantity, ahead) = match quantity.strip_suffix(']').and_then(|r| r.split_once('[')) {
            Some((quantity, ahead)) => (quantity, ahead.parse().unwrap_or(0)),
            None => (quantity, 0isize),
        };
        let ahead = ahead - DELAY as isize;
        *text = format!("reference.{quantity}[{ahead}] -> {to}");
    }
}

/// What all rules use.
struct Rules {
    model: ShakeTable,
    gains: ThreeVariableGains,
    /// Displacement gain over the printed one.
    displacement: f64,
    sliding: SlidingModeTuning,
}

fn set(component: &mut ComponentFile, values: &[(&str, f64)]) {
    for (name, value) in values {
        component
            .parameters
            .insert((*name).to_string(), toml::Value::Float(*value));
    }
}

fn set_count(component: &mut ComponentFile, values: &[(&str, usize)]) {
    for (name, value) in values {
        component
            .parameters
            .insert((*name).to_string(), toml::Value::Integer(*value as i64));
    }
}

impl Rules {
    fn new() -> Result<Self, plant::ModelError> {
        let table = ServoHydraulicTable::default();
        let model = table.fitted()?;
        let gains = ThreeVariableGains::tuned(&model, DELAY, SAMPLING_PERIOD)?;
        let printed = Pid::equation_3_6();
        let displacement = gains.proportional / printed.proportional;
        let sliding = Hierarchy {
            rig: &table.linearised(),
            model: &model,
            displacement: Pid {
                proportional: gains.proportional,
                integral: printed.integral * displacement,
                integral_leak: DISPLACEMENT_INTEGRAL_LEAK,
                ..printed
            },
            delay: DELAY,
            period: SAMPLING_PERIOD,
        }
        .tuned()?;
        Ok(Self {
            model,
            gains,
            displacement,
            sliding,
        })
    }

    fn displacement_pid(&self, component: &mut ComponentFile) {
        let printed = Pid::equation_3_6();
        set(
            component,
            &[
                (
                    "proportional_gain",
                    printed.proportional * self.displacement,
                ),
                ("integral_gain", printed.integral * self.displacement),
            ],
        );
    }

    fn loop_shaping(&self, component: &mut ComponentFile) {
        set(component, &[("gain", self.gains.proportional)]);
    }

    fn three_variable(&self, component: &mut ComponentFile) {
        let g = &self.gains;
        set(
            component,
            &[
                ("proportional_gain", g.proportional),
                ("integral_gain", g.integral),
                ("velocity_feedback_gain", g.velocity_feedback),
                ("acceleration_feedback_gain", g.acceleration_feedback),
                ("displacement_feedforward_gain", g.displacement_feedforward),
                ("velocity_feedforward_gain", g.velocity_feedforward),
                ("acceleration_feedforward_gain", g.acceleration_feedforward),
            ],
        );
    }

    fn force_pid(&self, component: &mut ComponentFile) {
        let force = &self.sliding.force;
        set(
            component,
            &[
                ("proportional_gain", force.proportional),
                ("integral_gain", force.integral),
            ],
        );
    }

    fn sliding_mode(&self, component: &mut ComponentFile, specimen: &str) {
        self.model(component);
        let (displacement, force) = (Pid::equation_3_6(), &self.sliding.force);
        set(
            component,
            &[
                ("surface_rate", self.sliding.rate),
                ("reaching_rate", self.sliding.rate),
                (
                    "displacement_loop_proportional_gain",
                    displacement.proportional * self.displacement,
                ),
                (
                    "displacement_loop_integral_gain",
                    displacement.integral * self.displacement,
                ),
                ("force_loop_proportional_gain", force.proportional),
                ("force_loop_integral_gain", force.integral),
            ],
        );
        if specimen == "yielding" {
            set(
                component,
                &[("specimen_mass", YieldingSpecimen::default().mass)],
            );
        }
        set_count(component, &[("loop_delay_samples", DELAY)]);
        // The valve moves when the reference is due; only the measurements are late.
        component
            .parameters
            .insert("reference_ahead".to_string(), toml::Value::Boolean(true));
    }

    fn model_predictive(&self, component: &mut ComponentFile) {
        self.model(component);
        self.three_variable(component);
        // The sensors' noise, and outputs in units of the stroke, 20 in/s and 1 g: with the printed
        // weights on unscaled outputs displacement counts for nothing and drifts.
        set(
            component,
            &[
                ("displacement_measurement_noise", 1.27e-5),
                ("velocity_measurement_noise", 2e-3),
                ("acceleration_measurement_noise", 0.04),
                ("displacement_scale", 0.0381),
                ("velocity_scale", 0.508),
                ("acceleration_scale", 9.80665),
            ],
        );
        set_count(component, &[("loop_delay_samples", DELAY)]);
    }

    fn model(&self, component: &mut ComponentFile) {
        set(component, &shake_table_values(&self.model));
    }
}

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

use controllers::hierarchy::DISPLACEMENT_INTEGRAL_LEAK;
use controllers::pid::Pid;
use controllers::three_variable::ThreeVariableGains;
use controllers::tuning::sliding_mode::{Hierarchy, SlidingModeTuning};
use plant::identified::shake_table::ShakeTable;
use plant::servo_hydraulic::ServoHydraulicTable;
use serde::{Deserialize, Serialize};
use units::constants::SAMPLING_PERIOD;

use super::file::{ComponentFile, SystemFile};
use super::link::{Link, Origin};
use super::model::shake_table_values;
use super::rule::Rule;

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

/// Gives the controllers in `file` the parameters for `plant` with a specimen of that mass (kg).
///
/// # Errors
/// A plant for which there is no tuning, one without measurements of its own; a noise that cannot
/// be read.
pub(super) fn apply(
    file: &mut SystemFile,
    plant: &SystemFile,
    specimen_mass: Option<f64>,
    tuning: Option<Tuning>,
) -> Result<(), String> {
    let measurements = match (tuning, &plant.measurements) {
        (Some(Tuning::Tuned), None) => {
            return Err(format!(
                "there is no tuning for the plant `{}`: the printed one was made for it; \
                 expected `--plant servohydraulic` or `--tuning printed`",
                plant.name
            ));
        }
        (Some(Tuning::Printed), _) | (None, None) => return Ok(()),
        (_, Some(measurements)) => measurements,
    };
    static RULES: OnceLock<Result<Rules, String>> = OnceLock::new();
    let rules = RULES.get_or_init(|| Rules::new().map_err(|error| error.to_string()));
    let rules = rules.as_ref().map_err(Clone::clone)?;
    let noise = Noise {
        displacement: plant.number(&measurements.displacement_noise, "m")?,
        velocity: plant.number(&measurements.velocity_noise, "m/s")?,
        acceleration: plant.number(&measurements.acceleration_noise, "m/s2")?,
    };
    for (name, component) in &mut file.components {
        match component.tuning {
            None => {}
            Some(Rule::DisplacementPid) => rules.displacement_pid(component),
            Some(Rule::ForcePid) => rules.force_pid(component),
            Some(Rule::LoopShaping) => rules.loop_shaping(component),
            Some(Rule::ModelPredictive) => {
                rules.model_predictive(component, &noise);
                delay_references(&mut file.connections, name);
            }
            Some(Rule::SlidingMode) => {
                rules.sliding_mode(component, specimen_mass);
            }
            Some(Rule::ThreeVariable) => rules.three_variable(component),
        }
    }
    Ok(())
}

/// The component `name` compares late measurements with the reference of the same time.
fn delay_references(connections: &mut [Link], name: &str) {
    for link in connections {
        if let Origin::Reference { ahead, .. } = &mut link.from
            && link.to.component == name
        {
            *ahead -= DELAY as isize;
        }
    }
}

/// One standard deviation of what is measured, SI.
struct Noise {
    displacement: f64,
    velocity: f64,
    acceleration: f64,
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
        component.set(name, *value);
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
        set(component, &self.gains.named());
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

    fn sliding_mode(&self, component: &mut ComponentFile, specimen_mass: Option<f64>) {
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
        if let Some(mass) = specimen_mass {
            component.set("specimen_mass", mass);
        }
        component.set("loop_delay_samples", DELAY as i64);
        // The valve moves when the reference is due; only the measurements are late.
        component.set("reference_ahead", true);
    }

    fn model_predictive(&self, component: &mut ComponentFile, noise: &Noise) {
        self.model(component);
        self.three_variable(component);
        // The sensors' noise, and outputs in units of the stroke, 20 in/s and 1 g: with the printed
        // weights on unscaled outputs displacement counts for nothing and drifts.
        set(
            component,
            &[
                ("displacement_measurement_noise", noise.displacement),
                ("velocity_measurement_noise", noise.velocity),
                ("acceleration_measurement_noise", noise.acceleration),
                ("displacement_scale", 0.0381),
                ("velocity_scale", 0.508),
                ("acceleration_scale", 9.80665),
            ],
        );
        component.set("loop_delay_samples", DELAY as i64);
    }

    fn model(&self, component: &mut ComponentFile) {
        set(component, &shake_table_values(&self.model));
    }
}

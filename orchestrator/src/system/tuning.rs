//! Parameters of the built-in systems' controllers by rule from an identified model.
//!
//! Every rule works on what a `ControlModel` says: a model file of `shakebench identify`, by
//! default the one of the physical rig's commissioning. Nothing here knows the rig itself.
//!
//! - three-variable control: [`ThreeVariableGains::tuned`];
//! - displacement PID and loop shaping: the printed controller, its gain changed so that the
//!   displacement gain is that of three-variable control (half the gain at which the loop
//!   oscillates);
//! - force loop, lambda and K of sliding mode: [`Hierarchy::tuned`], the largest gain that leaves the
//!   whole hierarchy a margin of 6 dB on the model;
//! - sliding mode and model predictive control have the model as theirs and know the delay; the
//!   latter also knows the measurements' noise and weighs outputs in units of stroke, 20 in/s and
//!   1 g.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

use controllers::hierarchy::DISPLACEMENT_INTEGRAL_LEAK;
use controllers::pid::Pid;
use controllers::three_variable::ThreeVariableGains;
use controllers::tuning::sliding_mode::{Hierarchy, SlidingModeTuning};
use serde::{Deserialize, Serialize};
use units::constants::SAMPLING_PERIOD;

use super::control_model::ControlModel;
use super::file::{ComponentFile, SystemFile};
use super::link::{Link, Origin};
use super::rule::Rule;
use super::value::Setting;
use plant::identified::nominal::shake_table_values;

/// Which parameters the controllers of a built-in system have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Tuning {
    /// Those of the thesis, made for the identified plant.
    Printed,
    /// Made by rule from an identified model.
    Tuned,
}

/// What is wanted of the controllers' parameters.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wanted<'a> {
    /// Which parameters; none: by plant and model.
    pub tuning: Option<Tuning>,
    /// Model file to tune on; none: the physical rig's commissioning.
    pub model: Option<&'a Path>,
}

/// Tells the controllers in `file` that predict over a delay how many samples a master that steps
/// all components from the same values adds: one for each sampled component that a value passes
/// between measurement and valve. What a file says itself stays, but for a built-in system, whose
/// delay is that of its rig.
pub fn know_jacobi(file: &mut SystemFile, is_built_in: bool) {
    let sampled = |name: &String| {
        file.components
            .get(name)
            .is_some_and(|part| part.period.is_some())
    };
    let mut next: BTreeMap<&String, Vec<&String>> = BTreeMap::new();
    for link in &file.connections {
        if let Origin::Output(from) = &link.from {
            next.entry(&from.component)
                .or_default()
                .push(&link.to.component);
        }
    }
    let mut found: Vec<(String, i64)> = Vec::new();
    for (name, part) in &file.components {
        // Sliding mode counts from the measurement, the other from the loop below it.
        let through = match part.fmu.as_str() {
            "SlidingMode" => true,
            "ModelPredictive" => false,
            _ => continue,
        };
        let longest = |start: &String| longest_path(start, &next, &sampled, name, through);
        let starts = file.components.keys().filter(|name| !sampled(name));
        let hops = starts.filter_map(longest).max();
        if let Some(hops) = hops {
            found.push((name.clone(), hops));
        }
    }
    for (name, hops) in found {
        let Some(part) = file.components.get_mut(&name) else {
            continue;
        };
        for (parameter, samples) in [("loop_delay_samples", hops), ("command_delay_samples", 1)] {
            let own = match part.parameters.get(parameter) {
                Some(Setting::Integer(own)) if is_built_in => *own,
                Some(_) => continue,
                None => 0,
            };
            part.set(parameter, own + samples);
        }
    }
}

/// Sampled components on the longest way from `at` to a component that is none, through the
/// component `by` where `through` is set and past it otherwise.
fn longest_path(
    at: &String,
    next: &BTreeMap<&String, Vec<&String>>,
    sampled: &impl Fn(&String) -> bool,
    by: &String,
    through: bool,
) -> Option<i64> {
    fn walk<'a>(
        at: &'a String,
        next: &BTreeMap<&'a String, Vec<&'a String>>,
        sampled: &impl Fn(&String) -> bool,
        seen: &mut Vec<&'a String>,
        fits: &impl Fn(&[&String]) -> bool,
    ) -> Option<i64> {
        let mut most = None;
        for &to in next.get(at).into_iter().flatten() {
            if !sampled(to) {
                if !seen.is_empty() && fits(seen) {
                    most = most.max(Some(seen.len() as i64));
                }
                continue;
            }
            if seen.contains(&to) {
                continue;
            }
            seen.push(to);
            most = most.max(walk(to, next, sampled, seen, fits));
            seen.pop();
        }
        most
    }
    let fits = |seen: &[&String]| seen.contains(&by) == through;
    walk(at, next, sampled, &mut Vec::new(), &fits)
}

/// Gives the controllers in `file` the parameters for `plant` with a specimen of that mass (kg).
///
/// # Errors
/// A plant for which there is no tuning; a model that cannot be read or that a rule refuses.
pub(super) fn apply(
    file: &mut SystemFile,
    plant: &SystemFile,
    specimen_mass: Option<f64>,
    wanted: Wanted<'_>,
) -> Result<(), String> {
    let own;
    let rules = match (wanted.tuning, wanted.model, plant.commissioned) {
        (Some(Tuning::Printed), Some(_), _) => {
            return Err(
                "printed parameters know no `--control-model`; expected one of the two".into(),
            );
        }
        (Some(Tuning::Printed), None, _) | (None, None, false) => return Ok(()),
        (Some(Tuning::Tuned), None, false) => {
            return Err(format!(
                "there is no tuning for the plant `{}`: the printed one was made for it; \
                 expected `--plant servohydraulic`, `--tuning printed` or `--control-model FILE`",
                plant.name
            ));
        }
        (_, Some(path), _) => {
            own = Rules::new(ControlModel::read(path)?)
                .map_err(|error| format!("{}: {error}", path.display()))?;
            &own
        }
        (_, None, true) => {
            static RULES: OnceLock<Result<Rules, String>> = OnceLock::new();
            let rules = RULES.get_or_init(|| {
                Rules::new(ControlModel::commissioned()?).map_err(|error| error.to_string())
            });
            rules.as_ref().map_err(Clone::clone)?
        }
    };
    let specimen_mass = rules.model.specimen_mass.or(specimen_mass);
    for (name, component) in &mut file.components {
        match component.tuning {
            None => {}
            Some(Rule::DisplacementPid) => rules.displacement_pid(component),
            Some(Rule::ForcePid) => rules.force_pid(component),
            Some(Rule::LoopShaping) => rules.loop_shaping(component),
            Some(Rule::ModelPredictive) => {
                rules.model_predictive(component);
                delay_references(&mut file.connections, name, rules.model.delay);
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
fn delay_references(connections: &mut [Link], name: &str, delay: usize) {
    for link in connections {
        if let Origin::Reference { ahead, .. } = &mut link.from
            && link.to.component == name
        {
            *ahead -= delay as isize;
        }
    }
}

/// What all rules use.
struct Rules {
    model: ControlModel,
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
    fn new(model: ControlModel) -> Result<Self, plant::ModelError> {
        let ControlModel { rig, delay, .. } = model;
        let gains = ThreeVariableGains::tuned(&rig, delay, SAMPLING_PERIOD)?;
        let printed = Pid::equation_3_6();
        let displacement = gains.proportional / printed.proportional;
        let sliding = Hierarchy {
            rig: &rig.state_space(),
            model: &rig,
            displacement: Pid {
                proportional: gains.proportional,
                integral: printed.integral * displacement,
                integral_leak: DISPLACEMENT_INTEGRAL_LEAK,
                ..printed
            },
            delay,
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
        component.set("loop_delay_samples", self.model.delay as i64);
        // The valve moves when the reference is due; only the measurements are late.
        component.set("reference_ahead", true);
    }

    fn model_predictive(&self, component: &mut ComponentFile) {
        let noise = &self.model.noise;
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
        component.set("loop_delay_samples", self.model.delay as i64);
    }

    fn model(&self, component: &mut ComponentFile) {
        set(component, &shake_table_values(&self.model.rig));
    }
}

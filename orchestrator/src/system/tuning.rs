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
//! - preview control: model, friction, delay and noise, with a feedback that
//!   keeps a margin of 6 dB ([`preview::Parameters::tuned`]); of the specimen it knows mass and
//!   damping, its stiffness a fifth too low and its yield force a fifth too high;
//! - sliding mode and model predictive control have the model as theirs and know the delay; the
//!   latter also knows the measurements' noise and weighs outputs in units of stroke, 20 in/s and
//!   1 g.

use std::path::Path;
use std::sync::OnceLock;

use controllers::hierarchy::DISPLACEMENT_INTEGRAL_LEAK;
use controllers::pid::Pid;
use controllers::preview;
use controllers::preview::feedback::Uncertainty;
use controllers::preview::model::{Hydraulics, RigModel};
use controllers::three_variable::ThreeVariableGains;
use controllers::tuning::sliding_mode::{Hierarchy, SlidingModeTuning};
use serde::{Deserialize, Serialize};
use units::constants::SAMPLING_PERIOD;

use super::control_model::ControlModel;
use super::file::{ComponentFile, SystemFile};
use super::link::{Link, Origin};
use super::rule::Rule;
use plant::identified::nominal::shake_table_values;
use plant::specimens::YieldingSpecimen;

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

/// Gives the controllers in `file` the parameters for `plant` with a specimen.
///
/// # Errors
/// A plant for which there is no tuning; a model that cannot be read or that a rule refuses.
pub(super) fn apply(
    file: &mut SystemFile,
    plant: &SystemFile,
    specimen: Option<&YieldingSpecimen>,
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
    let mass = rules.model.specimen_mass;
    let specimen_mass = mass.or(specimen.map(|specimen| specimen.mass));
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
            Some(Rule::Preview) => rules.preview(component, specimen)?,
            Some(Rule::LinearQuadraticGaussian) => rules.linear_quadratic_gaussian(component)?,
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

/// Stiffness of the specimen as a controller knows it, over the true one: before a test it is known
/// within a fifth.
const KNOWN_STIFFNESS: f64 = 0.8;
/// As [`KNOWN_STIFFNESS`], for the yield force.
const KNOWN_YIELD_FORCE: f64 = 1.2;

/// What all rules use.
struct Rules {
    model: ControlModel,
    gains: ThreeVariableGains,
    /// Displacement gain over the printed one.
    displacement: f64,
    sliding: SlidingModeTuning,
    /// A model that preview control cannot hold is no fault of the others.
    preview: Result<preview::Parameters, plant::ModelError>,
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
        let preview = preview::Parameters {
            rig: RigModel {
                shake_table: rig,
                hydraulics: model.hydraulics.map(|own| Hydraulics {
                    spool_lag: own.spool_lag,
                    spool_inertia: own.spool_inertia,
                    force_rate: own.force_rate,
                    oil_stiffness: own.oil_stiffness,
                    leakage_rate: own.leakage_rate,
                    seal_damping: own.seal_damping,
                }),
            },
            delay,
            uncertainty: Uncertainty {
                measurement: [
                    model.noise.displacement,
                    model.noise.velocity,
                    model.noise.acceleration,
                ],
                ..preview::Parameters::default().uncertainty
            },
            ..preview::Parameters::default()
        }
        .tuned();
        Ok(Self {
            model,
            gains,
            preview,
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

    fn preview(
        &self,
        component: &mut ComponentFile,
        specimen: Option<&YieldingSpecimen>,
    ) -> Result<(), String> {
        self.linear_quadratic_gaussian(component)?;
        if let Some(own) = &self.model.hydraulics {
            set(
                component,
                &[
                    ("seal_friction", own.seal_friction),
                    ("seal_presliding", own.seal_presliding),
                    ("seal_excess", own.seal_excess),
                    ("seal_stribeck_velocity", own.seal_stribeck_velocity),
                    ("seal_sharpness", own.seal_sharpness),
                    ("seal_relaxation", own.seal_relaxation),
                ],
            );
        }
        component.set("specimen_known", specimen.is_some());
        if let Some(specimen) = specimen {
            let columns = &specimen.columns;
            let drift = columns.yield_displacement * KNOWN_YIELD_FORCE / KNOWN_STIFFNESS;
            set(
                component,
                &[
                    ("specimen_mass", specimen.mass),
                    ("specimen_damping", specimen.damping),
                    (
                        "specimen_yield_force",
                        columns.yield_force * KNOWN_YIELD_FORCE,
                    ),
                    ("specimen_yield_displacement", drift),
                    ("specimen_post_yield_ratio", columns.post_yield_ratio),
                ],
            );
        }
        Ok(())
    }

    /// Preview control's model, margins and noise, without friction and specimen.
    fn linear_quadratic_gaussian(&self, component: &mut ComponentFile) -> Result<(), String> {
        let tuned = self.preview.as_ref().map_err(ToString::to_string)?;
        let noise = &self.model.noise;
        self.model(component);
        if let Some(own) = &self.model.hydraulics {
            component.set("hydraulics_known", true);
            set(
                component,
                &[
                    ("spool_lag", own.spool_lag),
                    ("spool_inertia", own.spool_inertia),
                    ("force_rate", own.force_rate),
                    ("oil_stiffness", own.oil_stiffness),
                    ("leakage_rate", own.leakage_rate),
                    ("seal_damping", own.seal_damping),
                ],
            );
        }
        set(
            component,
            &[
                ("command_weight", tuned.command_weight),
                ("force_step", tuned.uncertainty.force_step),
                ("displacement_measurement_noise", noise.displacement),
                ("velocity_measurement_noise", noise.velocity),
                ("acceleration_measurement_noise", noise.acceleration),
            ],
        );
        component.set("loop_delay_samples", self.model.delay as i64);
        Ok(())
    }

    fn model(&self, component: &mut ComponentFile) {
        set(component, &shake_table_values(&self.model.rig));
    }
}

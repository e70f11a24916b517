//! Parameters of the built-in systems' controllers by rule from an identified model.
//!
//! Every rule works on what a `ControlModel` says: a model file of `shakebench identify`, by
//! default the one of the physical rig's commissioning. Nothing here knows the rig itself.
//!
//! - displacement PID: the printed controller with half the gain at which the loop oscillates;
//! - three-variable control: [`ThreeVariableGains::damped`](controllers::three_variable::ThreeVariableGains::damped);
//! - loop shaping: [`Shaped::fastest`](controllers::synthesis::whole_plant::Shaped::fastest);
//! - force loop, lambda and K of sliding mode: [`Hierarchy::tuned`](controllers::tuning::sliding_mode::Hierarchy::tuned),
//!   the largest gain that leaves the whole hierarchy a margin of 6 dB on the model;
//! - preview control: model, friction, delay and noise, with a feedback that
//!   keeps a margin of 6 dB, bare and under the specimen ([`preview::Parameters::tuned`]). It knows
//!   mass and damping of the specimen, and assumes a stiffness 20 % too low and a yield force 20 %
//!   too high;
//! - acceleration trajectory tracking, dual loop:
//!   [`AccelerationTracking::trajectory`], [`AccelerationTracking::dual_loop`]; multi-metric control:
//!   the feedback of preview control and [`Shaping::inverse`];
//! - minimal control synthesis: [`MinimalControlSynthesis::tuned`];
//! - multiple surfaces, dynamic surface, receding horizon:
//!   [`Parameters::tuned`](controllers::surface_control::Parameters::tuned);
//! - adaptive inverse control: a quarter of the displacement gain at which the loop oscillates holds;
//! - the aids of operators: [`AidsDesign::tuned`](controllers::tuning::aids::AidsDesign::tuned); behind a stabilised actuator the other rules have the
//!   [`stabilised`](controllers::tuning::aids::stabilised) rig for theirs;
//! - on a model whose valve is not an ideal one its curve is compensated behind every controller; where the command
//!   acts late, the controllers get the motion so many samples ahead;
//! - sliding mode and model predictive control have the model as theirs and know the delay; the
//!   latter also knows the measurements' noise and weighs outputs in units of stroke, 20 in/s and
//!   1 g.

use std::path::Path;
use std::sync::OnceLock;
use units::vocabulary;

use controllers::acceleration_tracking::{AccelerationTracking, SHAPES};
use controllers::aids::friction::FrictionCompensation;
use controllers::minimal_control_synthesis::MinimalControlSynthesis;
use controllers::preview;
use controllers::preview::feedback::Uncertainty;
use controllers::preview::model::{Hydraulics, RigModel};
use controllers::tuning::acceleration_tracking::{AccelerationTuning, Shaping};
use controllers::tuning::preview::Known;
use controllers::tuning::suite::{Member, Suite};
use identification::IdentificationError;
use identification::closed_loop::equations::HydraulicRig;
use serde::{Deserialize, Serialize};
use units::Parameters as _;

use super::control_model::ControlModel;
use super::rule::{Rule, TuningError};
use fmi_system::Setting;
use fmi_system::{ComponentFile, SystemFile};
use fmi_system::{Link, Origin};
use plant::identified::nominal::shake_table_values;
use plant::specimens::YieldingSpecimen;

/// The switch of the aids by which the rig is another one to the controllers.
pub(super) const PRESSURE_STABILISATION: &str = vocabulary::PRESSURE_STABILISATION;

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
    /// Rules on a model that has been read; they go before everything else.
    pub rules: Option<&'a Rules>,
    /// Whether the specimen of the model's recordings stands on the table, not the one that is named. A plant that has
    /// one inside sets it.
    pub inside: bool,
}

impl Wanted<'_> {
    /// Whether the model has a valve that is not an ideal one.
    ///
    /// # Errors
    /// A model file at fault.
    pub(super) fn has_curve(&self) -> Result<bool, IdentificationError> {
        match (self.rules, self.model) {
            (Some(rules), _) => Ok(rules.model.curve.is_some()),
            (None, Some(path)) if self.tuning != Some(Tuning::Printed) => {
                Ok(ControlModel::read(path)?.curve.is_some())
            }
            _ => Ok(false),
        }
    }
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
) -> Result<(), TuningError> {
    if let Some(rules) = wanted.rules {
        return rules.apply(file, specimen, wanted.inside);
    }
    let own;
    let rules = match (wanted.tuning, wanted.model, plant.commissioned) {
        (Some(Tuning::Printed), Some(_), _) => {
            return Err(TuningError::Printed);
        }
        (Some(Tuning::Printed), None, true) => return Ok(()),
        (Some(Tuning::Printed) | None, None, false) => {
            own = Rules::unprinted(ControlModel::identified());
            &own
        }
        (Some(Tuning::Tuned), None, false) => {
            return Err(TuningError::NoTuning {
                plant: plant.name.clone(),
            });
        }
        (_, Some(path), _) => {
            own = Rules::new(ControlModel::read(path)?);
            let applied = own.apply(file, specimen, wanted.inside);
            return applied.map_err(|error| TuningError::File {
                path: path.to_path_buf(),
                reason: Box::new(error),
            });
        }
        (_, None, true) => {
            static RULES: OnceLock<Rules> = OnceLock::new();
            match RULES.get() {
                Some(rules) => rules,
                None => {
                    let model = ControlModel::commissioned()?;
                    RULES.get_or_init(|| Rules::new(model))
                }
            }
        }
    };
    rules.apply(file, specimen, wanted.inside)
}

/// The rigid mass that moves on `plant` by the model that its controllers are tuned on, kg; none without a model of
/// valve and oil, in which it would be no more than a coefficient.
///
/// # Errors
/// A model that cannot be read.
pub(super) fn rigid_mass(
    plant: &SystemFile,
    wanted: Wanted<'_>,
) -> Result<Option<f64>, IdentificationError> {
    let of = |model: &ControlModel| model.hydraulics.map(|_| model.rig.table.mass);
    match (wanted.rules, wanted.tuning, wanted.model) {
        (Some(rules), ..) => Ok(of(&rules.model)),
        (None, Some(Tuning::Printed), _) => Ok(None),
        (None, _, Some(path)) => ControlModel::read(path).map(|model| of(&model)),
        (None, _, None) if plant.commissioned => {
            ControlModel::commissioned().map(|model| of(&model))
        }
        (None, _, None) => Ok(None),
    }
}

/// The references that go to `inputs` of the component `name` are those `ahead` samples ahead.
fn place_references(
    connections: &mut [Link],
    name: &str,
    inputs: impl Fn(&str) -> bool,
    samples: isize,
) {
    for link in connections {
        if let Origin::Reference { ahead, .. } = &mut link.from
            && link.to.component == name
            && inputs(&link.to.variable)
        {
            *ahead = samples;
        }
    }
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

/// A specimen that was not identified as a controller knows it.
fn known(specimen: &YieldingSpecimen) -> YieldingSpecimen {
    let mut known = *specimen;
    known.columns.yield_force *= KNOWN_YIELD_FORCE;
    known.columns.yield_displacement *= KNOWN_YIELD_FORCE / KNOWN_STIFFNESS;
    known
}

/// All rules on a model.
#[derive(Debug, Clone)]
pub struct Rules {
    pub(super) model: ControlModel,
    /// Of the controllers whose parameters the thesis prints; none: those stay as printed.
    pub(super) suite: Option<Suite>,
    /// The same behind a stabilised actuator, once it was asked for.
    pub(super) stabilised: OnceLock<Box<Rules>>,
}

pub(super) fn set(component: &mut ComponentFile, values: &[(&str, f64)]) {
    for (name, value) in values {
        component.set(name, *value);
    }
}

impl Rules {
    /// All controllers on a model, each found when a system asks for it.
    pub fn new(model: ControlModel) -> Self {
        Self {
            suite: Some(model.suite()),
            ..Self::unprinted(model)
        }
    }

    /// Those of the controllers alone whose parameters the thesis does not print.
    pub fn unprinted(model: ControlModel) -> Self {
        Self {
            model,
            suite: None,
            stabilised: OnceLock::new(),
        }
    }

    /// Gives the controllers in `file` their parameters, under a specimen: that of the model's recordings where it is
    /// `inside` of the plant.
    fn apply(
        &self,
        file: &mut SystemFile,
        specimen: Option<&YieldingSpecimen>,
        inside: bool,
    ) -> Result<(), TuningError> {
        let own = if inside {
            self.model.specimen.map(Into::into)
        } else {
            specimen.map(known)
        };
        let specimen = own.as_ref();
        let mut is_stabilised = false;
        for component in file.components.values_mut() {
            let rule = component.tuning.as_deref().map(Rule::named).transpose()?;
            if rule == Some(Rule::OperatorAids) {
                self.operator_aids(component, specimen)?;
                let switch = component.parameters.get(PRESSURE_STABILISATION);
                is_stabilised |= switch == Some(&Setting::Boolean(true));
            }
        }
        match is_stabilised {
            true => self.behind_stabilisation()?.tune(file, specimen)?,
            false => self.tune(file, specimen)?,
        }
        // A valve that acts late is told early: everything that follows the motion gets it so much ahead.
        for link in &mut file.connections {
            if let Origin::Reference { ahead, .. } = &mut link.from {
                *ahead += self.model.command_delay as isize;
            }
        }
        Ok(())
    }

    /// The same for the controllers, whatever aids are behind them.
    fn tune(
        &self,
        file: &mut SystemFile,
        specimen: Option<&YieldingSpecimen>,
    ) -> Result<(), TuningError> {
        let identified = self.model.specimen.map(|own| own.mass);
        let specimen_mass = identified.or(specimen.map(|own| own.mass));
        for (name, component) in &mut file.components {
            let Some(rule) = &component.tuning else {
                continue;
            };
            let rule = Rule::named(rule)?;
            match rule {
                Rule::Preview => self.preview(component, specimen)?,
                Rule::LinearQuadraticGaussian => {
                    self.linear_quadratic_gaussian(component, specimen)?;
                }
                Rule::MultiMetric => self.multi_metric(component, specimen)?,
                Rule::AdaptiveInverse => {
                    self.adaptive_inverse(component)?;
                    let compared = |variable: &str| variable.starts_with("reference_");
                    place_references(
                        &mut file.connections,
                        name,
                        compared,
                        -(self.model.delay as isize),
                    );
                }
                Rule::SurfaceControl => self.surface_control(component, specimen)?,
                Rule::TrajectoryTracking => {
                    let tuning = AccelerationTracking::trajectory;
                    let own = tuning(&self.model.rig, &self.model.measurements())?;
                    self.acceleration_tracking(component, name, &own, &mut file.connections);
                }
                Rule::DualLoop => {
                    let tuning = AccelerationTracking::dual_loop;
                    let own = tuning(&self.model.rig, &self.model.measurements())?;
                    self.acceleration_tracking(component, name, &own, &mut file.connections);
                }
                Rule::MinimalControlSynthesis => {
                    let own =
                        MinimalControlSynthesis::tuned(&self.model.rig, &self.model.measurements());
                    set(component, &own?.named());
                    let wanted = |variable: &str| variable == "wanted_displacement";
                    let delay = self.model.delay as isize;
                    place_references(&mut file.connections, name, wanted, -delay);
                }
                _ => {}
            }
            let Some(suite) = &self.suite else {
                continue;
            };
            let member = match rule {
                Rule::DisplacementPid => Member::DisplacementPid,
                Rule::LoopShaping => Member::LoopShaping,
                Rule::ThreeVariable => Member::ThreeVariable,
                Rule::ModelPredictive => {
                    self.model(component);
                    component.set(vocabulary::LOOP_DELAY_SAMPLES, self.model.delay as i64);
                    delay_references(&mut file.connections, name, self.model.delay);
                    Member::ModelPredictive
                }
                Rule::SlidingMode => {
                    self.sliding_mode(component, specimen_mass);
                    Member::SlidingMode
                }
                Rule::ForcePid => {
                    let found = suite.sliding_mode()?;
                    let force = &found.force;
                    let gains = [
                        (vocabulary::PROPORTIONAL_GAIN, force.proportional),
                        (vocabulary::INTEGRAL_GAIN, force.integral),
                    ];
                    set(component, &gains);
                    continue;
                }
                Rule::UnderPrediction => {
                    let mpc = suite.mpc()?;
                    set(component, &mpc.low_level.gains.named());
                    continue;
                }
                Rule::Preview
                | Rule::LinearQuadraticGaussian
                | Rule::MultiMetric
                | Rule::TrajectoryTracking
                | Rule::DualLoop
                | Rule::OperatorAids
                | Rule::SurfaceControl
                | Rule::AdaptiveInverse
                | Rule::MinimalControlSynthesis => continue,
            };
            let values = suite.named(member)?;
            for (parameter, value) in values {
                component.set(&parameter, value);
            }
        }
        Ok(())
    }

    /// Gains, the lead of the shaped motion, and the delay of the compared one.
    fn acceleration_tracking(
        &self,
        component: &mut ComponentFile,
        name: &str,
        tuning: &AccelerationTuning,
        connections: &mut [Link],
    ) {
        set(component, &tuning.law.named());
        let ahead = |variable: &str| variable.starts_with("ahead_");
        place_references(connections, name, ahead, tuning.lead as isize);
        let compared = |variable: &str| variable.starts_with("reference_");
        place_references(connections, name, compared, -(self.model.delay as isize));
    }

    /// The feedback of preview control, and the rig's inverse.
    fn multi_metric(
        &self,
        component: &mut ComponentFile,
        specimen: Option<&YieldingSpecimen>,
    ) -> Result<(), TuningError> {
        self.linear_quadratic_gaussian(component, specimen)?;
        let period = self.model.measurements().period;
        let shaping = Shaping::inverse(&self.model.rig, period)?;
        for (name, gain) in SHAPES.into_iter().zip(shaping.gains) {
            component.set(name, gain);
        }
        component.set("shaping_lead_samples", shaping.lead as i64);
        Ok(())
    }

    fn sliding_mode(&self, component: &mut ComponentFile, specimen_mass: Option<f64>) {
        self.model(component);
        if let Some(mass) = specimen_mass {
            component.set(vocabulary::SPECIMEN_MASS, mass);
        }
        component.set(vocabulary::LOOP_DELAY_SAMPLES, self.model.delay as i64);
        // The valve moves when the reference is due; only the measurements are late.
        component.set("reference_ahead", true);
    }

    /// Preview control's model, margins, noise, friction and specimen.
    fn preview(
        &self,
        component: &mut ComponentFile,
        specimen: Option<&YieldingSpecimen>,
    ) -> Result<(), TuningError> {
        self.linear_quadratic_gaussian(component, specimen)?;
        if let Some((own, shape)) = &self.model.hydraulics {
            set(
                component,
                &FrictionCompensation {
                    friction: own.seal_friction,
                    shape: *shape,
                    ..FrictionCompensation::default()
                }
                .named(),
            );
        }
        component.set("specimen_known", specimen.is_some());
        if let Some(known) = specimen {
            set(
                component,
                &[
                    (vocabulary::SPECIMEN_MASS, known.mass),
                    (vocabulary::SPECIMEN_DAMPING, known.damping),
                    ("specimen_yield_force", known.columns.yield_force),
                    (
                        "specimen_yield_displacement",
                        known.columns.yield_displacement,
                    ),
                    ("specimen_post_yield_ratio", known.columns.post_yield_ratio),
                ],
            );
        }
        Ok(())
    }

    /// Preview control's model and noise, and margins under the specimen; without friction and
    /// specimen in its model.
    fn linear_quadratic_gaussian(
        &self,
        component: &mut ComponentFile,
        specimen: Option<&YieldingSpecimen>,
    ) -> Result<(), TuningError> {
        let mut own = preview_control(&self.model);
        own.load.specimen = specimen.copied();
        let identified = self.model.specimen.map(YieldingSpecimen::from);
        let tuned = own.tuned_for(Known {
            identified_specimen: specimen.is_some() && specimen == identified.as_ref(),
            compensated_valve: self.model.curve.is_some(),
        })?;
        let noise = &self.model.noise;
        self.model(component);
        if let Some(own) = self.model.whole_samples() {
            component.set("hydraulics_known", true);
            set(component, &own.named());
        }
        set(
            component,
            &[
                (vocabulary::COMMAND_WEIGHT, tuned.command_weight),
                ("force_step", tuned.uncertainty.force_step),
                (vocabulary::MEASUREMENT_NOISE[0], noise.displacement),
                (vocabulary::MEASUREMENT_NOISE[1], noise.velocity),
                (vocabulary::MEASUREMENT_NOISE[2], noise.acceleration),
            ],
        );
        component.set(vocabulary::LOOP_DELAY_SAMPLES, self.model.delay as i64);
        Ok(())
    }

    fn model(&self, component: &mut ComponentFile) {
        set(component, &shake_table_values(&self.model.rig));
    }
}

/// Valve and oil alone.
pub(super) fn hydraulics(own: &HydraulicRig) -> Hydraulics {
    Hydraulics {
        spool_lag: own.spool_lag,
        spool_inertia: own.spool_inertia,
        force_rate: own.force_rate,
        oil_stiffness: own.oil_stiffness,
        leakage_rate: own.leakage_rate,
        seal_damping: own.seal_damping,
    }
}

/// Preview control of a model's rig, not yet tuned.
fn preview_control(model: &ControlModel) -> preview::Parameters {
    let usual = preview::Parameters::default();
    let noise = &model.noise;
    let mut load = usual.load;
    if let Some((own, shape)) = &model.hydraulics {
        (load.friction, load.shape) = (own.seal_friction, *shape);
    }
    preview::Parameters {
        load,
        rig: RigModel {
            shake_table: model.rig,
            hydraulics: model.whole_samples(),
        },
        delay: model.delay,
        uncertainty: Uncertainty {
            measurement: [noise.displacement, noise.velocity, noise.acceleration],
            ..usual.uncertainty
        },
        ..usual
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::identified::valve_curve::ValveCurve;

    #[test]
    fn preview_estimates_quicker_behind_the_valve_that_is_compensated() {
        let step = |curve: Option<ValveCurve>| {
            let mut model = ControlModel::commissioned().unwrap();
            model.curve = curve;
            let mut component = ComponentFile::default();
            Rules::unprinted(model)
                .linear_quadratic_gaussian(&mut component, None)
                .unwrap();
            match component.parameters.get("force_step") {
                Some(fmi_system::Setting::Number(step)) => *step,
                other => panic!("{other:?}"),
            }
        };
        let lapped = ValveCurve {
            overlap: 0.03,
            ..ValveCurve::default()
        };
        assert!(step(Some(lapped)) >= 4.0 * step(None));
    }
}

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
//!   [`AccelerationTracking::trajectory`](controllers::acceleration_tracking::AccelerationTracking::trajectory),
//!   [`AccelerationTracking::dual_loop`](controllers::acceleration_tracking::AccelerationTracking::dual_loop); multi-metric control:
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

use controllers::acceleration_tracking::SHAPES;
use controllers::aids::friction::FrictionCompensation;
use controllers::minimal_control_synthesis::MinimalControlSynthesis;
use controllers::preview;
use controllers::preview::feedback::Uncertainty;
use controllers::preview::model::{Hydraulics, RigModel};
use controllers::tuning::acceleration_tracking::{AccelerationTuning, Shaping};
use controllers::tuning::preview::Known;
use controllers::tuning::suite::{Measurements, Member, Suite};
use identification::IdentificationError;
use identification::closed_loop::equations::HydraulicRig;
use serde::{Deserialize, Serialize};
use units::Parameters as _;

use super::catalogue::{self, OPERATOR_AIDS};
use super::control_model::ControlModel;
use super::rule::{Tuned, TuningError};
use fmi_system::Origin;
use fmi_system::Setting;
use fmi_system::{ComponentFile, SystemFile};
use plant::ModelError;
use plant::identified::nominal::shake_table_values;
use plant::identified::shake_table::ShakeTable;
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
            own = Rules::new(ControlModel::commissioned()?);
            &own
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
        let is_aids =
            |component: &ComponentFile| component.tuning.as_deref() == Some(OPERATOR_AIDS);
        self.tune(file, specimen, is_aids)?;
        let is_stabilised = file.components.values().any(|component| {
            let switch = component.parameters.get(PRESSURE_STABILISATION);
            is_aids(component) && switch == Some(&Setting::Boolean(true))
        });
        let rules = if is_stabilised {
            self.behind_stabilisation()?
        } else {
            self
        };
        rules.tune(file, specimen, |component| !is_aids(component))?;
        // A valve that acts late is told early: everything that follows the motion gets it so much ahead.
        for link in &mut file.connections {
            if let Origin::Reference { ahead, .. } = &mut link.from {
                *ahead += self.model.command_delay as isize;
            }
        }
        Ok(())
    }

    /// Tunes the components that are `chosen`.
    fn tune(
        &self,
        file: &mut SystemFile,
        specimen: Option<&YieldingSpecimen>,
        chosen: impl Fn(&ComponentFile) -> bool,
    ) -> Result<(), TuningError> {
        for (name, component) in &mut file.components {
            let Some(rule) = component.tuning.as_deref() else {
                continue;
            };
            let rule = catalogue::rule(rule)?;
            if chosen(component) {
                let own = &mut Tuned {
                    name,
                    component,
                    connections: &mut file.connections,
                    specimen,
                };
                rule(self, own)?;
            }
        }
        Ok(())
    }

    /// The parameters of a controller of the thesis; without a suite those stay as printed.
    pub(super) fn member(&self, own: &mut Tuned<'_>, member: Member) -> Result<(), TuningError> {
        if let Some(suite) = &self.suite {
            for (parameter, value) in suite.named(member)? {
                own.component.set(&parameter, value);
            }
        }
        Ok(())
    }

    /// Model, delay and weights of model predictive control.
    pub(super) fn model_predictive(&self, own: &mut Tuned<'_>) -> Result<(), TuningError> {
        if self.suite.is_some() {
            self.model(own.component);
            self.delay(own.component);
            own.delay_references(self.model.delay);
        }
        self.member(own, Member::ModelPredictive)
    }

    /// The gains of force PID under sliding mode.
    pub(super) fn force_pid(&self, own: &mut Tuned<'_>) -> Result<(), TuningError> {
        if let Some(suite) = &self.suite {
            let force = &suite.sliding_mode()?.force;
            let gains = [
                (vocabulary::PROPORTIONAL_GAIN, force.proportional),
                (vocabulary::INTEGRAL_GAIN, force.integral),
            ];
            set(own.component, &gains);
        }
        Ok(())
    }

    /// The gains of three-variable control under model predictive control.
    pub(super) fn under_prediction(&self, own: &mut Tuned<'_>) -> Result<(), TuningError> {
        if let Some(suite) = &self.suite {
            set(own.component, &suite.mpc()?.low_level.gains.named());
        }
        Ok(())
    }

    /// Start and rates of adaptation of minimal control synthesis.
    pub(super) fn minimal_control_synthesis(&self, own: &mut Tuned<'_>) -> Result<(), TuningError> {
        let tuned = MinimalControlSynthesis::tuned(&self.model.rig, &self.model.measurements());
        set(own.component, &tuned?.named());
        let wanted = |variable: &str| variable == "wanted_displacement";
        own.place_references(wanted, -(self.model.delay as isize));
        Ok(())
    }

    /// Gains, the lead of the shaped motion, and the delay of the compared one.
    pub(super) fn acceleration_tracking(
        &self,
        own: &mut Tuned<'_>,
        tuning: fn(&ShakeTable, &Measurements) -> Result<AccelerationTuning, ModelError>,
    ) -> Result<(), TuningError> {
        let tuned = tuning(&self.model.rig, &self.model.measurements())?;
        set(own.component, &tuned.law.named());
        own.place_references(|input| input.starts_with("ahead_"), tuned.lead as isize);
        let compared = |input: &str| input.starts_with("reference_");
        own.place_references(compared, -(self.model.delay as isize));
        Ok(())
    }

    /// The feedback of preview control, and the rig's inverse.
    pub(super) fn multi_metric(&self, own: &mut Tuned<'_>) -> Result<(), TuningError> {
        self.linear_quadratic_gaussian(own)?;
        let period = self.model.measurements().period;
        let shaping = Shaping::inverse(&self.model.rig, period)?;
        for (name, gain) in SHAPES.into_iter().zip(shaping.gains) {
            own.component.set(name, gain);
        }
        own.component
            .set("shaping_lead_samples", shaping.lead as i64);
        Ok(())
    }

    /// Model and rates of sliding mode.
    pub(super) fn sliding_mode(&self, own: &mut Tuned<'_>) -> Result<(), TuningError> {
        if self.suite.is_some() {
            self.model(own.component);
            let identified = self.model.specimen.map(|own| own.mass);
            if let Some(mass) = identified.or(own.specimen.map(|own| own.mass)) {
                own.component.set(vocabulary::SPECIMEN_MASS, mass);
            }
            self.delay(own.component);
            // The valve moves when the reference is due; only the measurements are late.
            own.component.set("reference_ahead", true);
        }
        self.member(own, Member::SlidingMode)
    }

    /// Preview control's model, margins, noise, friction and specimen.
    pub(super) fn preview(&self, own: &mut Tuned<'_>) -> Result<(), TuningError> {
        self.linear_quadratic_gaussian(own)?;
        let Tuned {
            component,
            specimen,
            ..
        } = own;
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
        if let Some(known) = *specimen {
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
    pub(super) fn linear_quadratic_gaussian(
        &self,
        Tuned {
            component,
            specimen,
            ..
        }: &mut Tuned<'_>,
    ) -> Result<(), TuningError> {
        let specimen = *specimen;
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
        self.delay(component);
        Ok(())
    }

    pub(super) fn delay(&self, component: &mut ComponentFile) {
        component.set(vocabulary::LOOP_DELAY_SAMPLES, self.model.delay as i64);
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
    use super::super::built_in;
    use super::*;
    use plant::identified::valve_curve::ValveCurve;

    #[test]
    fn preview_estimates_quicker_behind_the_valve_that_is_compensated() {
        let step = |curve: Option<ValveCurve>| {
            let mut model = ControlModel::commissioned().unwrap();
            model.curve = curve;
            let mut component = ComponentFile::default();
            let own = &mut Tuned {
                name: "control",
                component: &mut component,
                connections: &mut [],
                specimen: None,
            };
            let rules = Rules::unprinted(model);
            rules.linear_quadratic_gaussian(own).unwrap();
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

    /// What a rule puts on a controller is the model: its table, its noise, its delay.
    #[test]
    fn every_rule_tells_its_controller_of_the_model() {
        let model = ControlModel::commissioned().unwrap();
        let known = [
            (vocabulary::TABLE_MASS, model.rig.table.mass),
            (vocabulary::MEASUREMENT_NOISE[0], model.noise.displacement),
            (vocabulary::MEASUREMENT_NOISE[1], model.noise.velocity),
            (vocabulary::MEASUREMENT_NOISE[2], model.noise.acceleration),
            (vocabulary::LOOP_DELAY_SAMPLES, model.delay as f64),
        ];
        for part in catalogue::CONTROLLERS {
            let printed = SystemFile::parse(part.name, part.text).unwrap();
            let wanted = Wanted::default();
            let file = built_in::system(part.name, "servohydraulic", "yielding", wanted).unwrap();
            for (name, own) in &file.components {
                let Some(rule) = own.tuning.as_deref() else {
                    continue;
                };
                let Some(before) = printed.components.get(name) else {
                    continue;
                };
                assert_ne!(own.parameters, before.parameters, "{}: {rule}", part.name);
                for (parameter, expected) in known {
                    let value = match own.parameters.get(parameter) {
                        Some(Setting::Number(value)) => *value,
                        Some(Setting::Integer(value)) => *value as f64,
                        _ => continue,
                    };
                    // The masses of both forms of the model differ a little.
                    assert!(
                        (value / expected - 1.0).abs() < 0.005,
                        "{}: {rule}: {parameter} = {value}, expected {expected}",
                        part.name
                    );
                }
            }
        }
    }
}

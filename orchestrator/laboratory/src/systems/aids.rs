//! The aids of operators by rule, and the other rules behind a stabilised actuator.

use controllers::aids::OperatorAids;
use controllers::aids::rig::KnownRig;
use controllers::tuning::aids::{AidsDesign, stabilised};
use identification::closed_loop::equations::HydraulicRig;
use plant::specimens::YieldingSpecimen;
use plant::specimens::linear::LinearSpecimen;
use units::Parameters as _;
use units::vocabulary;

use super::control_model::ControlModel;
use super::rule::{Tuned, TuningError};
use super::tuning::{Rules, hydraulics, set};
use fmi_system::Setting;

/// A specimen before it yields.
pub(super) fn unyielding(specimen: &YieldingSpecimen) -> LinearSpecimen {
    LinearSpecimen {
        mass: specimen.mass,
        damping: specimen.damping,
        stiffness: specimen.columns.stiffness(),
    }
}

impl Rules {
    /// Valve, oil and table as the model has them, or as they come nearest to it. The actuator that the thesis
    /// prints has none: for it they are those of the physical rig's commissioning.
    pub(super) fn known_rig(&self) -> Result<KnownRig, TuningError> {
        let model = &self.model;
        let with = |own: &HydraulicRig| KnownRig {
            hydraulics: hydraulics(own),
            table: model.rig.table,
            delay: model.delay,
        };
        if let Some((own, _)) = &model.hydraulics {
            return Ok(with(own));
        }
        KnownRig::of(&model.rig, model.delay).or_else(|error| {
            let is_printed = self.suite.is_none();
            match ControlModel::commissioned()?.hydraulics {
                Some((own, _)) if is_printed => Ok(with(&own)),
                _ => Err(error.into()),
            }
        })
    }

    /// The aids of operators on the model's rig.
    fn aids(&self, specimen: Option<&YieldingSpecimen>) -> Result<OperatorAids, TuningError> {
        let model = &self.model;
        let rig = self.known_rig()?;
        let own = specimen.map(unyielding);
        let design = AidsDesign {
            rig: &rig,
            late: model.late,
            period: model.measurements().period,
            specimen: own.as_ref(),
        };
        let mut aids = design.tuned()?;
        if let Some((own, shape)) = &model.hydraulics {
            aids.friction.friction = own.seal_friction;
            aids.friction.shape = *shape;
        }
        Ok(aids)
    }

    /// These rules on the rig as it is to a controller behind a stabilised actuator.
    pub(super) fn behind_stabilisation(&self) -> Result<&Self, TuningError> {
        if let Some(own) = self.stabilised.get() {
            return Ok(own);
        }
        let mut model = self.model.clone();
        let gain = self.aids(None)?.pressure.gain;
        // The command is held for half a period on average.
        let late = model.late + 0.5 * model.measurements().period;
        model.rig = stabilised(&model.rig, gain, late);
        model.hydraulics = None;
        let rules = match &self.suite {
            Some(_) => Self::new(model),
            None => Self::unprinted(model),
        };
        Ok(self.stabilised.get_or_init(|| Box::new(rules)))
    }

    /// What is known of the rig, friction, corners and gains.
    pub(super) fn operator_aids(
        &self,
        Tuned {
            component,
            specimen,
            ..
        }: &mut Tuned<'_>,
    ) -> Result<(), TuningError> {
        if let Some(curve) = self.model.curve {
            set(component, &curve.named());
            set(component, &self.known_rig()?.hydraulics.named());
        }
        let on = |switch: &str| component.parameters.get(switch) == Some(&Setting::Boolean(true));
        let known = [
            vocabulary::FRICTION_COMPENSATION,
            vocabulary::SPECIMEN_COMPENSATION,
            vocabulary::PRESSURE_STABILISATION,
            vocabulary::AMPLITUDE_PHASE_CONTROL,
            vocabulary::HARMONIC_CANCELLATION,
        ];
        if !known.into_iter().any(on) {
            return Ok(());
        }
        let aids = self.aids(*specimen)?;
        set(component, &aids.rig.named());
        set(component, &aids.friction.named());
        set(component, &aids.specimen.named());
        set(component, &aids.pressure.named());
        self.delay(component);
        Ok(())
    }
}

//! Real rigs: what was measured, what the nominal model gets wrong, which cause it has.
//!
//! A rig is one file that meets [`Equations`]; a set of measurements is a [`Description`] in TOML. The
//! diagnosis never asks for white residuals, which no real rig leaves: it names a cause that pays
//! on data not fitted and that is found on each part of the data.

mod closed_loop_actuator;
pub mod curves;
mod cyclic_material;
mod description;
mod diagnosis;
mod extended;
mod hybrid_actuator;
mod hysteretic_device;
mod measured;
mod positioning_drive;
mod reading;
mod recording;
pub mod shake_table;
mod table;

pub use description::{Column, Description, DescriptionError, LeftOut, Quantity};
pub use diagnosis::{NamedValue, PartEffect, PartReport, RigDiagnosis, diagnose};
pub use extended::ExtendedRig;

pub use hybrid_actuator::TransferSystemRig;
pub use reading::Measurement;
pub use recording::RigRecording;
pub use table::{Effect, EffectTable, NominalTable};

use crate::data::Channel;

/// A quantity by name and SI unit.
pub type Named = (&'static str, &'static str);

/// The equations of a kind of rig. A new kind is one file that implements this, and its line in
/// [`KINDS`].
pub trait Equations: Sync {
    /// Its name in a description.
    const KIND: &'static str;
    /// Parameters of the nominal model.
    type Nominal: NominalTable;
    /// The effects that it may have.
    type Effects: EffectTable;

    /// What the data must hold beside the output.
    const INPUTS: &'static [Channel];
    /// What is simulated and compared.
    const OUTPUT: Channel;
    /// True where the output depends on the input's path, which a loop shows best.
    const IS_HYSTERETIC: bool = false;

    /// Output for the inputs of `recording` alone.
    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Self::Nominal,
        effects: &Self::Effects,
        out: &mut [f64],
    );
}

/// [`Equations`] of any kind.
pub trait Rig: Sync {
    /// Its name in a description.
    fn kind(&self) -> &'static str;

    /// What the data must hold beside the output.
    fn inputs(&self) -> &'static [Channel];

    /// What is simulated and compared.
    fn output(&self) -> Channel;

    /// Whether the output depends on the input's path.
    fn is_hysteretic(&self) -> bool;

    /// Parameters of the nominal model.
    fn parameters(&self) -> &'static [Named];

    /// The effects.
    fn effects(&self) -> Vec<Effect>;

    /// Output for the inputs of `recording` alone, with values in the order of [`Self::parameters`] and
    /// of all parameters of [`Self::effects`], SI; not a number where their count is another.
    fn simulate(&self, recording: &RigRecording, nominal: &[f64], effects: &[f64], out: &mut [f64]);
}

impl<E: Equations> Rig for E {
    fn kind(&self) -> &'static str {
        E::KIND
    }

    fn inputs(&self) -> &'static [Channel] {
        E::INPUTS
    }

    fn output(&self) -> Channel {
        E::OUTPUT
    }

    fn is_hysteretic(&self) -> bool {
        E::IS_HYSTERETIC
    }

    fn parameters(&self) -> &'static [Named] {
        E::Nominal::TABLE
    }

    fn effects(&self) -> Vec<Effect> {
        E::Effects::table()
    }

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &[f64],
        effects: &[f64],
        out: &mut [f64],
    ) {
        match (
            E::Nominal::from_values(nominal),
            E::Effects::from_values(effects),
        ) {
            (Some(nominal), Some(effects)) => {
                Equations::simulate(self, recording, &nominal, &effects, out);
            }
            _ => out.fill(f64::NAN),
        }
    }
}

/// Every kind of rig.
pub static KINDS: [&dyn Rig; 5] = [
    &closed_loop_actuator::ClosedLoopActuator,
    &positioning_drive::PositioningDrive,
    &hysteretic_device::HystereticDevice,
    &cyclic_material::CyclicMaterial,
    &hybrid_actuator::HybridActuator,
];

/// The rig of a kind.
pub fn of_kind(kind: &str) -> Option<&'static dyn Rig> {
    KINDS.into_iter().find(|rig| rig.kind() == kind)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Recording;

    #[test]
    fn a_wrong_number_of_values_gives_no_number() {
        for rig in KINDS {
            let mut channels = rig.inputs().to_vec();
            channels.push(rig.output());
            let channels = channels.into_iter().map(|c| (c, vec![0.0; 16])).collect();
            let recording = Recording::new("none", 1.0, channels).unwrap();
            let recording = RigRecording::new(recording, rig.inputs(), rig.output());
            let nominal = vec![1.0; rig.parameters().len()];
            let effects: Vec<f64> = rig.effects().into_iter().flat_map(|e| e.off).collect();
            for (nominal, effects) in [(&nominal[1..], &effects[..]), (&nominal, &effects[1..])] {
                let mut out = vec![0.0; 16];
                rig.simulate(&recording, nominal, effects, &mut out);
                assert!(out.iter().all(|y| y.is_nan()), "{}", rig.kind());
            }
        }
    }
}

//! Real rigs: what was measured, what the nominal model gets wrong, which cause it has.
//!
//! A rig is one file that meets [`Equations`]; a set of measurements is a [`Description`] in TOML. The
//! diagnosis never asks for white residuals, which no real rig leaves: it names a cause that pays
//! on data not fitted and that is found on each part of the data.

mod alternatives;
mod answer;
mod between;
mod carriage;
mod cause;
mod causes;
mod closed_loop_actuator;
mod confirmed;
mod controlled_damper;
pub mod curves;
mod cyclic_material;
mod description;
mod diagnosis;
mod drive;
mod extended;
mod fitted;
pub mod foreign;
mod frame;
mod friction;
pub mod guess;
pub mod hypotheses;
mod hysteretic_device;
mod linear_axis;
mod linear_loop;
mod loop_step;
mod loose;
mod measured;
mod named_value;
mod natural;
mod oscillator;
mod part_report;
mod parts;
mod positioning_drive;
mod profile;
mod reading;
mod readings;
mod recording;
mod restoring_force;
mod sensors;
pub mod shake_table;
mod table;
mod template;
mod transfer_system;

pub use cause::{Cause, INTERVAL_95, ends, is_undetermined};
pub use confirmed::Confirmed;
pub use description::{
    Column, Description, DescriptionError, LeftOut, Quantity, Windows, column_map, renamed,
};
pub use diagnosis::{RigDiagnosis, SetAside, diagnose};
pub use drive::{DriveSearch, RigDrive};
pub use extended::{ExtendedRig, FileErrors, PredictedColumn, Prediction};
pub use fitted::{FittedNominal, fit_nominal};
pub use named_value::NamedValue;

pub use natural::Natural;
pub use part_report::{PartEffect, PartReport};
pub use reading::{Measurement, even_period};
pub use readings::Reading;
pub use recording::{Begin, RigRecording};
pub use table::{Effect, EffectTable, NominalTable, SessionParameter, SessionRole, SessionTable};
pub use template::template;
pub use transfer_system::TransferSystemRig;

use hypotheses::Inside;
use recordings::Channel;

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
    /// What every file has for itself: the zero of a transducer, where a test began.
    type Session: SessionTable;

    /// What the data must hold beside the output.
    const INPUTS: &'static [Channel];
    /// What they may hold; an effect that needs it is not looked for without it.
    const OPTIONAL: &'static [(Channel, &'static [&'static str])] = &[];
    /// What is simulated and compared.
    const OUTPUT: Channel;
    /// What is simulated and compared with it where the data hold it.
    const ALSO: &'static [Channel] = &[];
    /// True where the output depends on the input's path, which a loop shows best.
    const IS_HYSTERETIC: bool = false;
    /// True where a row without a time is a point of a path and no sample.
    const IS_PATH: bool = false;
    /// True where the table of effects is in natural units.
    const IS_SCALED: bool = false;
    /// True if the equations restart wherever the recording states it.
    const BEGINS_ANEW: bool = false;
    /// Samples that are enough for a first look at candidates, where a simulation is costly.
    const SCREENED: usize = usize::MAX;
    /// Effects that an uncertain nominal parameter says as well.
    const SAID_BY: &'static [(&'static str, &'static str)] = &[];
    /// Nominal parameters whose deviation from what was stated is a cause, such as a scale.
    const CAUSES: &'static [&'static str] = &[];
    /// Nominal parameters that are this at most, SI, whatever the data say.
    const LIMITS: &'static [(&'static str, f64)] = &[];
    /// Places inside of the equations at which a user's own effect may act, beside its inputs and its output:
    /// `force` on what moves, `valve` on what the controller sends.
    const PLACES: &'static [&'static str] = &[];

    /// Output for the inputs of `recording` alone, and after all its samples those of
    /// [`RigRecording::also`], divided by their sizes.
    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Self::Nominal,
        effects: &Self::Effects,
        session: &Self::Session,
        out: &mut [f64],
    );

    /// As [`Self::simulate`], with what acts `inside` at [`Self::PLACES`].
    fn simulate_with(
        &self,
        recording: &RigRecording,
        nominal: &Self::Nominal,
        effects: &Self::Effects,
        session: &Self::Session,
        _inside: &mut Inside<'_>,
        out: &mut [f64],
    ) {
        self.simulate(recording, nominal, effects, session, out);
    }

    /// Natural units, from those of the channels.
    fn natural(_nominal: &Self::Nominal, channels: Natural) -> Natural {
        channels
    }

    /// Further starts of effects, read from the `errors` (not a number where there is none) of a
    /// model without them.
    fn starts(
        &self,
        _recording: &RigRecording,
        _nominal: &Self::Nominal,
        _errors: &[f64],
    ) -> Vec<(&'static str, Vec<f64>)> {
        Vec::new()
    }

    /// Whole models with one effect at most, read from the measured samples at `places`, from which fits begin
    /// as well: for where a simulation from the nominal values loses the motion.
    fn read_off(
        &self,
        _recording: &RigRecording,
        _places: &[usize],
        _nominal: &Self::Nominal,
    ) -> Vec<Begun> {
        Vec::new()
    }

    /// Nominal values, near `nominal`, of an equation that is solved without a simulation, from which fits begin
    /// as well.
    fn estimated(
        &self,
        _recording: &RigRecording,
        _places: &[usize],
        _nominal: &Self::Nominal,
    ) -> Option<Vec<f64>> {
        None
    }

    /// What the equations read out of a recording beside its inputs, a sentence each.
    fn notes(&self, _recording: &RigRecording, _nominal: &Self::Nominal) -> Vec<String> {
        Vec::new()
    }

    /// Sensors of `recordings` that contradict each other, and nominal parameters that sensors alone tell, whether they
    /// are as stated or not.
    fn contradictions(&self, _recordings: &[RigRecording]) -> Vec<Cause> {
        Vec::new()
    }
}

/// [`Equations`] of any kind.
pub trait Rig: Sync {
    /// Its name in a description.
    fn kind(&self) -> &'static str;

    /// What the data must hold beside the output.
    fn inputs(&self) -> &'static [Channel];

    /// What they may hold, with the effects that need it.
    fn optional(&self) -> &'static [(Channel, &'static [&'static str])];

    /// What is simulated and compared.
    fn output(&self) -> Channel;

    /// As [`Equations::ALSO`].
    fn also(&self) -> &'static [Channel];

    /// Whether the output depends on the input's path.
    fn is_hysteretic(&self) -> bool;

    /// Whether a row without a time is a point of a path and no sample.
    fn is_path(&self) -> bool;

    /// Whether the equations restart wherever the recording states it.
    fn begins_anew(&self) -> bool;

    /// Parameters of the nominal model.
    fn parameters(&self) -> &'static [Named];

    /// What each of them is.
    fn about_parameters(&self) -> &'static [&'static str];

    /// Their values where a description leaves them out.
    fn defaults(&self) -> &'static [Option<f64>];

    /// The effects, in natural units where [`Self::is_scaled`].
    fn effects(&self) -> Vec<Effect>;

    /// Whether the table of effects is in natural units.
    fn is_scaled(&self) -> bool;

    /// What every file has for itself.
    fn session(&self) -> &'static [SessionParameter];

    /// Samples that are enough for a first look at candidates.
    fn screened(&self) -> usize;

    /// Effects that an uncertain nominal parameter says as well, with its name.
    fn said_by(&self) -> &'static [(&'static str, &'static str)];

    /// Nominal parameters whose deviation from what was stated is a cause.
    fn causes(&self) -> &'static [&'static str];

    /// Nominal parameters that are this at most, SI.
    fn limits(&self) -> &'static [(&'static str, f64)];

    /// Natural units of `recordings`; `nominal` in the order of [`Self::parameters`].
    fn natural(&self, nominal: &[f64], recordings: &[RigRecording]) -> Natural;

    /// As [`Equations::starts`].
    fn starts(
        &self,
        recording: &RigRecording,
        nominal: &[f64],
        errors: &[f64],
    ) -> Vec<(&'static str, Vec<f64>)>;

    /// As [`Equations::read_off`].
    fn read_off(&self, recording: &RigRecording, places: &[usize], nominal: &[f64]) -> Vec<Begun>;

    /// As [`Equations::estimated`].
    fn estimated(
        &self,
        recording: &RigRecording,
        places: &[usize],
        nominal: &[f64],
    ) -> Option<Vec<f64>>;

    /// As [`Equations::notes`].
    fn notes(&self, recording: &RigRecording, nominal: &[f64]) -> Vec<String>;

    /// As [`Equations::contradictions`].
    fn contradictions(&self, recordings: &[RigRecording]) -> Vec<Cause>;

    /// As [`Equations::PLACES`].
    fn places(&self) -> &'static [&'static str];

    /// Output for the inputs of `recording` alone, SI; not a number where a count is wrong.
    fn simulate(&self, recording: &RigRecording, values: &Values, out: &mut [f64]);

    /// As [`Self::simulate`], with what acts `inside`.
    fn simulate_with(
        &self,
        recording: &RigRecording,
        values: &Values,
        inside: &mut Inside<'_>,
        out: &mut [f64],
    );
}

/// A model from which a fit begins, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Begun {
    /// In the order of [`Rig::parameters`].
    pub nominal: Vec<f64>,
    /// In the order of [`Rig::session`], of the recording that it was read from.
    pub session: Vec<f64>,
    /// An effect with the values of its parameters.
    pub effect: Option<(&'static str, Vec<f64>)>,
}

/// Values of everything that a rig's equations read, SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Values {
    /// In the order of [`Rig::parameters`].
    pub nominal: Vec<f64>,
    /// Of all parameters of [`Rig::effects`].
    pub effects: Vec<f64>,
    /// In the order of [`Rig::session`].
    pub session: Vec<f64>,
}

impl<E: Equations> Rig for E {
    fn kind(&self) -> &'static str {
        E::KIND
    }

    fn inputs(&self) -> &'static [Channel] {
        E::INPUTS
    }

    fn optional(&self) -> &'static [(Channel, &'static [&'static str])] {
        E::OPTIONAL
    }

    fn output(&self) -> Channel {
        E::OUTPUT
    }

    fn also(&self) -> &'static [Channel] {
        E::ALSO
    }

    fn is_hysteretic(&self) -> bool {
        E::IS_HYSTERETIC
    }

    fn is_path(&self) -> bool {
        E::IS_PATH
    }

    fn begins_anew(&self) -> bool {
        E::BEGINS_ANEW
    }

    fn parameters(&self) -> &'static [Named] {
        E::Nominal::TABLE
    }

    fn about_parameters(&self) -> &'static [&'static str] {
        E::Nominal::ABOUT
    }

    fn defaults(&self) -> &'static [Option<f64>] {
        E::Nominal::DEFAULTS
    }

    fn effects(&self) -> Vec<Effect> {
        E::Effects::table()
    }

    fn is_scaled(&self) -> bool {
        E::IS_SCALED
    }

    fn session(&self) -> &'static [SessionParameter] {
        E::Session::TABLE
    }

    fn screened(&self) -> usize {
        E::SCREENED
    }

    fn said_by(&self) -> &'static [(&'static str, &'static str)] {
        E::SAID_BY
    }

    fn causes(&self) -> &'static [&'static str] {
        E::CAUSES
    }

    fn limits(&self) -> &'static [(&'static str, f64)] {
        E::LIMITS
    }

    fn natural(&self, nominal: &[f64], recordings: &[RigRecording]) -> Natural {
        let channels: Vec<Channel> = [E::OUTPUT]
            .into_iter()
            .chain(E::INPUTS.iter().copied())
            .chain(E::OPTIONAL.iter().map(|(channel, _)| *channel))
            .collect();
        let natural = Natural::of(recordings, &channels);
        E::Nominal::from_values(nominal).map_or(natural, |nominal| E::natural(&nominal, natural))
    }

    fn starts(
        &self,
        recording: &RigRecording,
        nominal: &[f64],
        errors: &[f64],
    ) -> Vec<(&'static str, Vec<f64>)> {
        E::Nominal::from_values(nominal).map_or_else(Vec::new, |nominal| {
            Equations::starts(self, recording, &nominal, errors)
        })
    }

    fn read_off(&self, recording: &RigRecording, places: &[usize], nominal: &[f64]) -> Vec<Begun> {
        E::Nominal::from_values(nominal).map_or_else(Vec::new, |nominal| {
            Equations::read_off(self, recording, places, &nominal)
        })
    }

    fn estimated(
        &self,
        recording: &RigRecording,
        places: &[usize],
        nominal: &[f64],
    ) -> Option<Vec<f64>> {
        let nominal = E::Nominal::from_values(nominal)?;
        Equations::estimated(self, recording, places, &nominal)
    }

    fn notes(&self, recording: &RigRecording, nominal: &[f64]) -> Vec<String> {
        E::Nominal::from_values(nominal).map_or_else(Vec::new, |nominal| {
            Equations::notes(self, recording, &nominal)
        })
    }

    fn contradictions(&self, recordings: &[RigRecording]) -> Vec<Cause> {
        Equations::contradictions(self, recordings)
    }

    fn places(&self) -> &'static [&'static str] {
        E::PLACES
    }

    fn simulate(&self, recording: &RigRecording, values: &Values, out: &mut [f64]) {
        Rig::simulate_with(self, recording, values, &mut Inside::default(), out);
    }

    fn simulate_with(
        &self,
        recording: &RigRecording,
        values: &Values,
        inside: &mut Inside<'_>,
        out: &mut [f64],
    ) {
        match (
            E::Nominal::from_values(&values.nominal),
            E::Effects::from_values(&values.effects),
            E::Session::from_values(&values.session),
        ) {
            (Some(nominal), Some(effects), Some(session)) => {
                Equations::simulate_with(
                    self, recording, &nominal, &effects, &session, inside, out,
                );
            }
            _ => out.fill(f64::NAN),
        }
    }
}

/// Every kind of rig.
pub static KINDS: [&dyn Rig; 9] = [
    &closed_loop_actuator::ClosedLoopActuator,
    &positioning_drive::PositioningDrive,
    &linear_axis::LinearAxis,
    &hysteretic_device::HystereticDevice,
    &cyclic_material::CyclicMaterial,
    &transfer_system::TransferSystemKind,
    &oscillator::Oscillator,
    &controlled_damper::ControlledDamper,
    &frame::Frame,
];

/// The only rig whose kind holds `word`, such as `actuator` or `hysteretic device`.
pub fn like(word: &str) -> Option<&'static dyn Rig> {
    let word = word.trim().to_lowercase().replace([' ', '-'], "_");
    let mut all = KINDS.into_iter().filter(|rig| rig.kind().contains(&word));
    let found = all.next()?;
    (all.next().is_none() && !word.is_empty()).then_some(found)
}

/// The rig of a kind.
pub fn of_kind(kind: &str) -> Option<&'static dyn Rig> {
    KINDS.into_iter().find(|rig| rig.kind() == kind)
}

#[cfg(test)]
mod tests {
    use super::*;
    use recordings::Recording;

    #[test]
    fn a_wrong_number_of_values_gives_no_number() {
        for rig in KINDS {
            let mut channels = rig.inputs().to_vec();
            channels.push(rig.output());
            let channels = channels.into_iter().map(|c| (c, vec![0.0; 16])).collect();
            let recording = Recording::new("none", 1.0, channels).unwrap();
            let recording = RigRecording::new(recording, rig.inputs(), rig.output());
            let values = Values {
                nominal: vec![1.0; rig.parameters().len()],
                effects: rig.effects().into_iter().flat_map(|e| e.off).collect(),
                session: vec![0.0; rig.session().len()],
            };
            let mut short = [values.clone(), values.clone(), values];
            short[0].nominal.pop();
            short[1].effects.pop();
            short[2].session.push(0.0);
            for values in short {
                let mut out = vec![0.0; 16];
                rig.simulate(&recording, &values, &mut out);
                assert!(out.iter().all(|y| y.is_nan()), "{}", rig.kind());
            }
        }
    }
}

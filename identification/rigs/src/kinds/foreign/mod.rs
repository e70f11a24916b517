//! A model that came from elsewhere, of which only inputs, outputs and parameters are known.
//!
//! Its errors are those of a simulation of whole records (output error). What may be wrong is looked
//! for where it can be reached: on the way of every signal into the model and out of it
//! ([`plant::signal_path`]), and in the values of its parameters. What is wrong inside it can be
//! seen and not named.

mod catalogue;
mod left_over;
mod measured;

use plant::signal_path::SignalEffects;

use super::diagnosis::judge;
use super::parts::InParts;
use super::{NamedValue, RigDiagnosis};
use diagnosis::{Observer, Point, SimulatedModel, Verdict};
use measured::Bordered;

pub use catalogue::Border;

/// Kind of such a model among [`RigDiagnosis::kind`].
pub const KIND: &str = "fmu";

/// Share of the residual that signals of the model predict, above which it is unexplained.
const LEFT_OVER: f64 = 0.1;
/// What is predicted of the squared error may be this share of the nominal model's, or of the
/// output's variation if that is less.
const SMALL: f64 = 0.01;
/// Normalised error below which nothing is asked any more.
const NEGLIGIBLE: f64 = 1e-3;
/// A parameter is as stated within so many stated deviations.
const AS_STATED: f64 = 2.0;

/// An input or output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signal {
    /// Its name.
    pub name: String,
    /// Its unit, empty where it has none.
    pub unit: String,
}

/// A parameter that may have drifted.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its unit, empty where it has none.
    pub unit: String,
    /// Its value in the nominal model.
    pub value: f64,
    /// One standard deviation as stated, 0 where nothing is.
    pub plus_minus: f64,
}

/// A record.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// What it is called.
    pub name: String,
    /// Step of the model, s.
    pub step: f64,
    /// Steps from one sample of the outputs to the next.
    pub stride: usize,
    /// For every input one value per step.
    pub inputs: Vec<Vec<f64>>,
    /// For every output one value per sample, not a number where it was not measured.
    pub outputs: Vec<Vec<f64>>,
    /// What is not fitted, by sample.
    pub left_out: Vec<bool>,
}

impl Trial {
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.left_out.len()
    }

    /// Steps of the model that reach the sample before `samples`.
    fn steps(&self, samples: usize) -> usize {
        samples.saturating_sub(1) * self.stride + 1
    }
}

/// What simulates the model.
pub trait Simulator: Sync {
    /// The outputs at every one of `steps` steps of `step` s, for `inputs` (one value per step
    /// each, held over it) and parameters by place and value in place of their nominal ones. None
    /// if the simulation ends early.
    fn simulate(
        &self,
        inputs: &[&[f64]],
        parameters: &[(usize, f64)],
        step: f64,
        steps: usize,
    ) -> Option<Vec<Vec<f64>>>;
}

/// A model with its records.
pub struct ForeignModel<'a> {
    /// What it is called.
    pub name: String,
    /// What simulates it.
    pub simulator: &'a dyn Simulator,
    /// Inputs that the records hold.
    pub inputs: Vec<Signal>,
    /// Outputs that they hold.
    pub outputs: Vec<Signal>,
    /// Parameters that may have drifted.
    pub parameters: Vec<Parameter>,
    /// The records.
    pub trials: Vec<Trial>,
}

/// The model with the effects around it.
#[derive(Debug, Clone, PartialEq)]
pub struct Extension {
    /// On the way of every input.
    pub inputs: Vec<SignalEffects>,
    /// On the way of every output.
    pub outputs: Vec<SignalEffects>,
    /// Parameters that are not nominal, by place and value.
    pub parameters: Vec<(usize, f64)>,
}

/// What came out.
#[derive(Debug, Clone, PartialEq)]
pub struct ForeignDiagnosis {
    /// The verdict with its evidence.
    pub found: RigDiagnosis,
    /// Effects that the records cannot tell from a named one, by the named one.
    pub equivalents: Vec<(String, Vec<String>)>,
    /// What else the reader should know.
    pub notes: Vec<String>,
    /// The extended model.
    pub extension: Extension,
    /// For every record and output the nominal model's values, a sample each.
    pub nominal: Vec<Vec<Vec<f64>>>,
    /// The same of the extended model.
    pub extended: Vec<Vec<Vec<f64>>>,
    /// Share of the extended model's squared error on the held-out data that its own signals
    /// predict: nothing where only noise is left.
    pub predictable: f64,
}

/// Diagnoses `model` on its records; none where the nominal model cannot be simulated on them.
pub fn diagnose(model: &ForeignModel<'_>, observer: Observer<'_>) -> Option<ForeignDiagnosis> {
    let measured = Bordered::new(model)?;
    let mut found = judge(&measured, observer)?;
    let point = found.confirmed.point.clone();
    let predictable = left_over::predictable(&measured, &point);
    let equivalents: Vec<(String, Vec<String>)> = point
        .effects
        .iter()
        .map(|(i, _)| {
            let all = 0..measured.candidates().len();
            let others = all.filter(|other| other != i && measured.are_alike(*i, *other));
            let others = others.filter(|other| !measured.candidates()[*other].starts.is_empty());
            let names = others.map(|other| measured.name(other)).collect();
            (measured.name(*i), names)
        })
        .collect();
    for (name, (_, others)) in found.named.iter_mut().zip(&equivalents) {
        if !others.is_empty() {
            *name = format!("{name} (or {})", others.join(" or "));
        }
    }
    let mut notes = Vec::new();
    weigh(&mut found, predictable, &mut notes);
    as_stated(model, &mut found, &mut notes);
    notes.push(
        "the search covers the paths of the signals into and out of the model and the parameters \
         of the map; causes inside the model are beyond this diagnosis"
            .to_owned(),
    );
    let simulate = |point: &Point| -> Option<Vec<Vec<Vec<f64>>>> {
        let all = 0..model.trials.len();
        all.map(|trial| measured.simulate(point, trial, model.trials[trial].samples()))
            .collect()
    };
    Some(ForeignDiagnosis {
        nominal: simulate(&measured.origin())?,
        extended: simulate(&point)?,
        extension: measured.extension(&point),
        found,
        equivalents,
        notes,
        predictable,
    })
}

/// A verdict that leaves more than noise is none.
fn weigh(found: &mut RigDiagnosis, predictable: f64, notes: &mut Vec<String>) {
    let error = found.confirmed.error;
    if predictable < LEFT_OVER || error < NEGLIGIBLE {
        return;
    }
    let told = format!(
        "{:.0} % of the remaining squared error on the held-out data can be predicted from the \
         model's own signals",
        100.0 * predictable
    );
    let is_named = matches!(found.verdict, Verdict::Named | Verdict::Ambiguous);
    let before = found.as_described.nominal_error.min(1.0);
    if is_named && predictable * error.powi(2) < SMALL * before.powi(2) {
        notes.push(format!("{told}: a small effect is still missing"));
        return;
    }
    notes.push(format!(
        "{told}: a cause inside the model, or one outside the search; effects that improve the \
         model are evidence, not the cause"
    ));
    found.verdict = Verdict::Unexplained;
}

/// Parameters that are what was stated of them are not a finding.
fn as_stated(model: &ForeignModel<'_>, found: &mut RigDiagnosis, notes: &mut Vec<String>) {
    let is_within = |(name, values): &(String, Vec<NamedValue>)| {
        let parameter = model
            .parameters
            .iter()
            .find(|p| catalogue::drift(p) == *name)?;
        let change = values.first()?.value * catalogue::drift_unit(parameter);
        (change.abs() < AS_STATED * parameter.plus_minus).then_some(parameter)
    };
    let own = &found.confirmed.effects;
    let within: Vec<&Parameter> = own.iter().filter_map(is_within).collect();
    for parameter in &within {
        let (name, unit) = (&parameter.name, &parameter.unit);
        notes.push(format!(
            "`{name}` agrees with its stated value, {} ± {} {unit}",
            parameter.value, parameter.plus_minus
        ));
    }
    if !within.is_empty() && within.len() == own.len() && found.verdict == Verdict::Named {
        found.verdict = Verdict::Adequate;
    }
}

#[cfg(test)]
mod tests;

//! A kind of rig with the user's own effects behind those of its catalogue.

use std::path::Path;

use super::compiled::{Compiled, Place, Wrong};
use super::running::rate;
use super::{Hypotheses, Inside, Running, line_of};
use crate::kinds::{
    Begun, Cause, DescriptionError, Effect, Named, Natural, Rig, RigRecording, SessionParameter,
    Values,
};
use recordings::Channel;

/// A kind with effects that were read from a file.
struct ExtendedKind {
    base: &'static dyn Rig,
    own: Vec<Compiled>,
    /// Values that the effects of the catalogue take.
    catalogue: usize,
}

/// `base` with `hypotheses`, which the file `path` with this text holds. It lives as long as the program, as every
/// kind does; a description asks once and keeps it.
///
/// # Errors
/// A hypothesis that does not fit the kind, by line and key.
pub fn extended(
    base: &'static dyn Rig,
    hypotheses: &Hypotheses,
    path: &Path,
) -> Result<&'static dyn Rig, DescriptionError> {
    if hypotheses.is_empty() {
        return Ok(base);
    }
    let mut own = Vec::new();
    for (name, hypothesis) in hypotheses {
        let compiled = Compiled::new(name, hypothesis, base);
        own.push(compiled.map_err(|wrong| refused(wrong, name, path))?);
    }
    let catalogue = base.effects().iter().map(|effect| effect.off.len()).sum();
    Ok(Box::leak(Box::new(ExtendedKind {
        base,
        own,
        catalogue,
    })))
}

fn refused(wrong: Wrong, name: &str, path: &Path) -> DescriptionError {
    let Wrong { key, text, what } = wrong;
    let file = std::fs::read_to_string(path).unwrap_or_default();
    let line = line_of(&file, name, &key).map_or_else(String::new, |line| format!("line {line}, "));
    let is_named = text == name || key.split('.').any(|part| part == text);
    let key = if key.is_empty() {
        String::new()
    } else {
        format!(".{key}")
    };
    let text = if text.is_empty() || is_named || what.starts_with(&format!("`{text}`")) {
        String::new()
    } else {
        format!("`{text}` ")
    };
    DescriptionError::Description {
        path: path.to_owned(),
        what: format!("{line}`{name}{key}`: {text}{what}"),
    }
}

impl ExtendedKind {
    /// The effects that are there, with their values.
    fn present<'a>(&'a self, values: &'a [f64]) -> Vec<(&'a Compiled, &'a [f64])> {
        let mut rest = values;
        let mut present = Vec::new();
        for own in &self.own {
            let Some((mine, others)) = rest.split_at_checked(own.parameters.len()) else {
                return present;
            };
            if !own.is_off(mine) {
                present.push((own, mine));
            }
            rest = others;
        }
        present
    }
}

fn running<'a>(
    (of, own): &(&'a Compiled, &[f64]),
    values: &Values,
    recording: &'a RigRecording,
) -> Running<'a> {
    Running::new(of, own, &values.nominal, recording)
}

impl Rig for ExtendedKind {
    fn kind(&self) -> &'static str {
        self.base.kind()
    }

    fn inputs(&self) -> &'static [Channel] {
        self.base.inputs()
    }

    fn optional(&self) -> &'static [(Channel, &'static [&'static str])] {
        self.base.optional()
    }

    fn output(&self) -> Channel {
        self.base.output()
    }

    fn also(&self) -> &'static [Channel] {
        self.base.also()
    }

    fn is_hysteretic(&self) -> bool {
        self.base.is_hysteretic()
    }

    fn is_path(&self) -> bool {
        self.base.is_path()
    }

    fn begins_anew(&self) -> bool {
        self.base.begins_anew()
    }

    fn parameters(&self) -> &'static [Named] {
        self.base.parameters()
    }

    fn about_parameters(&self) -> &'static [&'static str] {
        self.base.about_parameters()
    }

    fn defaults(&self) -> &'static [Option<f64>] {
        self.base.defaults()
    }

    fn effects(&self) -> Vec<Effect> {
        let own = self.own.iter().map(Compiled::effect);
        self.base.effects().into_iter().chain(own).collect()
    }

    fn is_scaled(&self) -> bool {
        self.base.is_scaled()
    }

    fn session(&self) -> &'static [SessionParameter] {
        self.base.session()
    }

    fn screened(&self) -> usize {
        self.base.screened()
    }

    fn said_by(&self) -> &'static [(&'static str, &'static str)] {
        self.base.said_by()
    }

    fn causes(&self) -> &'static [&'static str] {
        self.base.causes()
    }

    fn limits(&self) -> &'static [(&'static str, f64)] {
        self.base.limits()
    }

    fn natural(&self, nominal: &[f64], recordings: &[RigRecording]) -> Natural {
        self.base.natural(nominal, recordings)
    }

    fn starts(
        &self,
        recording: &RigRecording,
        nominal: &[f64],
        errors: &[f64],
    ) -> Vec<(&'static str, Vec<f64>)> {
        self.base.starts(recording, nominal, errors)
    }

    fn read_off(&self, recording: &RigRecording, places: &[usize], nominal: &[f64]) -> Vec<Begun> {
        self.base.read_off(recording, places, nominal)
    }

    fn estimated(
        &self,
        recording: &RigRecording,
        places: &[usize],
        nominal: &[f64],
    ) -> Option<Vec<f64>> {
        self.base.estimated(recording, places, nominal)
    }

    fn notes(&self, recording: &RigRecording, nominal: &[f64]) -> Vec<String> {
        self.base.notes(recording, nominal)
    }

    fn contradictions(&self, recordings: &[RigRecording]) -> Vec<Cause> {
        self.base.contradictions(recordings)
    }

    fn places(&self) -> &'static [&'static str] {
        self.base.places()
    }

    fn simulate(&self, recording: &RigRecording, values: &Values, out: &mut [f64]) {
        self.simulate_with(recording, values, &mut Inside::default(), out);
    }

    fn simulate_with(
        &self,
        recording: &RigRecording,
        values: &Values,
        _: &mut Inside<'_>,
        out: &mut [f64],
    ) {
        let Some((catalogue, own)) = values.effects.split_at_checked(self.catalogue) else {
            out.fill(f64::NAN);
            return;
        };
        let known = Values {
            nominal: values.nominal.clone(),
            effects: catalogue.to_vec(),
            session: values.session.clone(),
        };
        let present = self.present(own);
        if present.is_empty() {
            self.base.simulate(recording, &known, out);
            return;
        }
        let mut changed: Option<RigRecording> = None;
        for one in &present {
            if let Place::Input(channel) = one.0.place {
                let now = changed.as_ref().unwrap_or(recording);
                let signal = running(one, values, recording).along(now.input(channel), &[]);
                match now.with_input(channel, signal, self.inputs()) {
                    Some(with) => changed = Some(with),
                    None => {
                        out.fill(f64::NAN);
                        return;
                    }
                }
            }
        }
        let mut inside = Inside::default();
        for one in &present {
            let own = running(one, values, recording);
            match own.place() {
                Place::Force => inside.forces.push(own),
                Place::Valve => inside.valves.push(own),
                _ => {}
            }
        }
        let acted_on = changed.as_ref().unwrap_or(recording);
        self.base.simulate_with(acted_on, &known, &mut inside, out);
        let begins: Vec<usize> = recording.begins.iter().map(|begin| begin.at).collect();
        for one in &present {
            match one.0.place {
                Place::Output => {
                    // Further outputs follow the one that is meant.
                    let own = recording.len().min(out.len());
                    let out = &mut out[..own];
                    let signal = running(one, values, recording).along(out, &begins);
                    out.copy_from_slice(&signal);
                }
                Place::Device => {
                    let x = recording.input(Channel::Displacement);
                    let measured = recording.input(Channel::Velocity);
                    let derived = measured.is_empty().then(|| rate(x, recording.period()));
                    let v = derived.as_deref().unwrap_or(measured);
                    running(one, values, recording).add_force(x, v, out);
                }
                _ => {}
            }
        }
    }
}

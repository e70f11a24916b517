//! Values on their way between signals and FMUs: value references prepared once, nothing allocated
//! afterwards.

use crate::fmu::{CallError, Instance, Kind, Variable};

type Outcome = Result<(), Box<CallError>>;

/// Connected inputs of an instance, grouped by type.
#[derive(Default)]
pub(super) struct Inputs(Vec<InputGroup>);

struct InputGroup {
    kind: Kind,
    references: Vec<u32>,
    sources: Vec<InputSource>,
    values: Vec<f64>,
}

struct InputSource {
    signal: usize,
    factor: f64,
    /// It changes between samples.
    is_smooth: bool,
}

/// Outputs of an instance, grouped by type; each group's signals stand side by side.
#[derive(Default, Clone)]
pub(super) struct Outputs(Vec<OutputGroup>);

#[derive(Clone)]
struct OutputGroup {
    kind: Kind,
    references: Vec<u32>,
    first: usize,
    /// What was read, until all of it is known to be good.
    values: Vec<f64>,
}

impl Inputs {
    /// Adds an input that takes `factor` times the value of `signal`.
    pub(super) fn add(&mut self, variable: &Variable, signal: usize, factor: f64, is_smooth: bool) {
        let known = self.0.iter().position(|group| group.kind == variable.kind);
        let place = known.unwrap_or_else(|| {
            self.0.push(InputGroup {
                kind: variable.kind.clone(),
                references: Vec::new(),
                sources: Vec::new(),
                values: Vec::new(),
            });
            self.0.len() - 1
        });
        let group = &mut self.0[place];
        group.references.push(variable.reference);
        group.sources.push(InputSource {
            signal,
            factor,
            is_smooth,
        });
        group.values.push(0.0);
    }

    /// Sets the inputs from the signals.
    pub(super) fn transfer(&mut self, signals: &[f64], instance: &mut Instance) -> Outcome {
        for group in &mut self.0 {
            for (value, source) in group.values.iter_mut().zip(&group.sources) {
                *value = source.factor * signals[source.signal];
            }
            instance.set(&group.kind, &group.references, &group.values)?;
        }
        Ok(())
    }

    /// As [`Inputs::transfer`], but inputs that change between samples are set to
    /// `now + share (other - now)`.
    pub(super) fn transfer_between(
        &mut self,
        now: &[f64],
        other: &[f64],
        share: f64,
        instance: &mut Instance,
    ) -> Outcome {
        for group in &mut self.0 {
            for (value, source) in group.values.iter_mut().zip(&group.sources) {
                let at = now[source.signal];
                let change = other[source.signal] - at;
                let share = if source.is_smooth { share } else { 0.0 };
                *value = source.factor * (at + share * change);
            }
            instance.set(&group.kind, &group.references, &group.values)?;
        }
        Ok(())
    }
}

impl Outputs {
    /// Adds `variables` (of one type), whose signals begin at `first`.
    pub(super) fn add(&mut self, kind: &Kind, references: Vec<u32>, first: usize) {
        self.0.push(OutputGroup {
            kind: kind.clone(),
            values: vec![0.0; references.len()],
            references,
            first,
        });
    }

    /// Adds what `other` has.
    pub(super) fn extend(&mut self, other: &Self) {
        self.0.extend(other.0.iter().cloned());
    }

    /// Reads the outputs into the signals, which keep their values where the instance fails.
    pub(super) fn read(&mut self, signals: &mut [f64], instance: &mut Instance) -> Outcome {
        for group in &mut self.0 {
            instance.get(&group.kind, &group.references, &mut group.values)?;
        }
        for group in &self.0 {
            signals[group.first..group.first + group.values.len()].copy_from_slice(&group.values);
        }
        Ok(())
    }
}

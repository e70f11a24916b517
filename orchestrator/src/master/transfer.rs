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
    /// Signal and factor of each.
    sources: Vec<(usize, f64)>,
    values: Vec<f64>,
}

/// Outputs of an instance, grouped by type; each group's signals stand side by side.
#[derive(Default, Clone)]
pub(super) struct Outputs(Vec<OutputGroup>);

#[derive(Clone)]
struct OutputGroup {
    kind: Kind,
    references: Vec<u32>,
    first: usize,
}

impl Inputs {
    /// Adds an input that takes `factor` times the value of `signal`.
    pub(super) fn add(&mut self, variable: &Variable, signal: usize, factor: f64) {
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
        group.sources.push((signal, factor));
        group.values.push(0.0);
    }

    /// Sets the inputs from the signals.
    pub(super) fn transfer(&mut self, signals: &[f64], instance: &Instance) -> Outcome {
        for group in &mut self.0 {
            for (value, &(signal, factor)) in group.values.iter_mut().zip(&group.sources) {
                *value = factor * signals[signal];
            }
            instance.set(&group.kind, &group.references, &group.values)?;
        }
        Ok(())
    }

    /// Sets the inputs from the mean of the signals now and at the end of the step.
    pub(super) fn transfer_mean(
        &mut self,
        now: &[f64],
        next: &[f64],
        instance: &Instance,
    ) -> Outcome {
        for group in &mut self.0 {
            for (value, &(signal, factor)) in group.values.iter_mut().zip(&group.sources) {
                *value = match group.kind {
                    Kind::Float64 => factor * 0.5 * (now[signal] + next[signal]),
                    _ => factor * now[signal],
                };
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
            references,
            first,
        });
    }

    /// Adds what `other` has.
    pub(super) fn extend(&mut self, other: &Self) {
        self.0.extend(other.0.iter().cloned());
    }

    /// Reads the outputs into the signals.
    pub(super) fn read(&self, signals: &mut [f64], instance: &Instance) -> Outcome {
        for group in &self.0 {
            let values = &mut signals[group.first..group.first + group.references.len()];
            instance.get(&group.kind, &group.references, values)?;
        }
        Ok(())
    }
}

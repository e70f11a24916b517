//! A loop of direct feedthrough: outputs that depend on each other at the same instant.

use super::action::{Action, Moment};
use super::newton::{self, Round, Solver, Unsolved};
use super::signals::Signals;
use super::{MasterError, Part};

/// A loop of direct feedthrough, cut open where its actions read what is computed after them.
pub(super) struct AlgebraicLoop {
    actions: Vec<Action>,
    /// Sampled components among them, whose state is kept for the repetition.
    called: Vec<usize>,
    /// The signals at the cut.
    cut: Vec<usize>,
    solver: Solver,
    /// The variables round the loop, for people.
    round: Vec<String>,
    values: Vec<f64>,
    /// How the signals change with one of them.
    changes: Vec<f64>,
}

impl AlgebraicLoop {
    /// The numbers that it gives.
    pub(super) fn signals(&self, parts: &[Part]) -> Vec<usize> {
        let given = |action: &Action| -> Vec<usize> {
            match action {
                Action::Read { outputs, .. } => outputs.signals().collect(),
                Action::Call { part } => parts[*part].outputs.signals().collect(),
                Action::Solve(inner) => inner.signals(parts),
            }
        };
        self.actions.iter().flat_map(given).collect()
    }

    /// Of the actions of a pass.
    pub(super) fn new(actions: Vec<Action>, parts: &[Part], round: Vec<String>) -> Self {
        let reads = |action: &Action| -> Vec<usize> {
            match action {
                Action::Read { inputs, .. } => inputs.sources().collect(),
                Action::Call { part } => parts[*part].inputs.sources().collect(),
                Action::Solve(inner) => inner.cut.clone(),
            }
        };
        let gives = |action: &Action| match action {
            Action::Read { outputs, .. } => (
                outputs.signals().collect::<Vec<_>>(),
                outputs.real_signals().collect::<Vec<_>>(),
            ),
            Action::Call { part } => {
                let outputs = &parts[*part].outputs;
                (
                    outputs.signals().collect(),
                    outputs.real_signals().collect(),
                )
            }
            Action::Solve(_) => (Vec::new(), Vec::new()),
        };
        let given: Vec<_> = actions.iter().map(gives).collect();
        let mut cut: Vec<usize> = Vec::new();
        for (place, action) in actions.iter().enumerate() {
            let later = |signal: &usize| given[place..].iter().any(|(all, _)| all.contains(signal));
            cut.extend(reads(action).into_iter().filter(later));
        }
        cut.sort_unstable();
        cut.dedup();
        let real = |signal: &usize| given.iter().any(|(_, real)| real.contains(signal));
        let smooth: Vec<bool> = cut.iter().map(real).collect();
        let called = actions.iter().filter_map(|action| match action {
            Action::Call { part } => Some(*part),
            _ => None,
        });
        Self {
            called: called.collect(),
            solver: Solver::new(&smooth),
            values: vec![0.0; cut.len()],
            cut,
            actions,
            round,
            changes: Vec::new(),
        }
    }

    /// Whether it reads continuous components only.
    pub(super) fn is_continuous(&self) -> bool {
        self.called.is_empty()
    }

    /// Finds values of the signals that agree with each other, beginning with the present ones.
    pub(super) fn solve(
        &mut self,
        at: Moment,
        parts: &mut [Part],
        signals: &mut Signals,
        names: &[String],
    ) -> Result<(), MasterError> {
        for &part in self.called.iter().filter(|_| at.calls) {
            let part = &mut parts[part];
            if part.failure.is_none() {
                part.instance.save_state(&mut part.state)?;
            }
        }
        for (value, &signal) in self.values.iter_mut().zip(&self.cut) {
            *value = signals.numbers[signal];
        }
        let mut pass = Pass {
            actions: &mut self.actions,
            called: &self.called,
            cut: &self.cut,
            changes: &mut self.changes,
            at,
            parts,
            signals,
            names,
            is_first: true,
        };
        match newton::solve(&mut self.solver, &mut pass, &mut self.values)? {
            Ok(()) => Ok(()),
            Err(unsolved) => Err(self.explain(at.time, &unsolved, names)),
        }
    }

    fn explain(&self, time: f64, unsolved: &Unsolved, names: &[String]) -> MasterError {
        let signal = self.cut.get(unsolved.place).copied().unwrap_or_default();
        MasterError::Loop {
            time,
            round: self.round.join(" -> "),
            variable: names.get(signal).cloned().unwrap_or_default(),
            value: unsolved.value,
            back: unsolved.back,
            reason: unsolved.reason(),
        }
    }
}

/// A loop while it is solved.
struct Pass<'a> {
    actions: &'a mut [Action],
    called: &'a [usize],
    cut: &'a [usize],
    changes: &'a mut Vec<f64>,
    at: Moment,
    parts: &'a mut [Part],
    signals: &'a mut Signals,
    names: &'a [String],
    is_first: bool,
}

impl Round for Pass<'_> {
    fn send(&mut self, values: &[f64], back: &mut [f64]) -> Result<(), MasterError> {
        if !std::mem::take(&mut self.is_first) {
            for &part in self.called.iter().filter(|_| self.at.calls) {
                self.parts[part].go_back()?;
            }
        }
        for (value, &signal) in values.iter().zip(self.cut) {
            self.signals.numbers[signal] = *value;
        }
        for action in self.actions.iter_mut() {
            action.perform(self.at, self.parts, self.signals, self.names)?;
        }
        for (value, &signal) in back.iter_mut().zip(self.cut) {
            *value = self.signals.numbers[signal];
        }
        Ok(())
    }

    fn derivative(
        &mut self,
        place: usize,
        _values: &[f64],
        change: &mut [f64],
    ) -> Result<bool, MasterError> {
        let gives = |action: &Action| match action {
            Action::Read { part, .. } => self.parts[*part].instance.gives_derivatives(),
            Action::Call { .. } | Action::Solve(_) => false,
        };
        if !self.actions.iter().all(gives) {
            return Ok(false);
        }
        self.changes.clear();
        self.changes.resize(self.signals.numbers.len(), 0.0);
        self.changes[self.cut[place]] = 1.0;
        for action in self.actions.iter() {
            let Action::Read {
                part,
                inputs,
                outputs,
            } = action
            else {
                return Ok(false);
            };
            let Some((references, seed)) = inputs.change(self.changes) else {
                return Ok(false);
            };
            let instance = &mut self.parts[*part].instance;
            if !outputs.change((&references, &seed), self.changes, instance)? {
                return Ok(false);
            }
        }
        for (change, &signal) in change.iter_mut().zip(self.cut) {
            *change = self.changes[signal];
        }
        Ok(true)
    }
}

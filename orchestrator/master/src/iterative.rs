//! The coupling over a step by iteration: inputs from continuous components are held at the mean of
//! their values at both ends of the step (the trapezoidal rule). Nothing is extrapolated, and the
//! method is of second order. A component that cannot go back to a state takes extrapolated inputs,
//! as in Gauss-Seidel order, which is of second order, too.

use super::action::{Action, Moment};
use super::newton::{self, Round, Solver};
use super::signals::Signals;
use super::{MasterError, Part, Simulation};

/// Continuous components over `[t_k, t_k + h]`, repeated until the values at the end agree.
pub(super) fn advance(simulation: &mut Simulation) -> Result<(), MasterError> {
    if simulation.tick == 0 {
        simulation.keep_as_last();
    }
    step(simulation, 1, 1.0)?;
    simulation.keep_as_last();
    Ok(())
}

/// The step alone, over so many ticks; the step before it was shorter by `ratio`.
pub(super) fn step(
    simulation: &mut Simulation,
    ticks: usize,
    ratio: f64,
) -> Result<(), MasterError> {
    let (time, length) = (simulation.time(), ticks as f64 * simulation.step);
    // Between two calls of a sampled component nothing of it changes.
    let end = Moment {
        tick: simulation.tick,
        time: time + length,
        step: simulation.step,
        calls: false,
    };
    let Simulation {
        parts,
        actions,
        signals,
        next_signals: next,
        last_signals: last,
        names,
        coupling,
        reference,
        ..
    } = simulation;
    // What cannot go back makes its step once, and what nothing couples as well.
    let continuous = parts.iter_mut().zip(&coupling.repeats);
    for (part, repeats) in continuous.filter(|(part, _)| part.every.is_none()) {
        if *repeats {
            part.instance.save_state(&mut part.state)?;
        } else {
            part.inputs
                .transfer_between(signals, last, -0.5 * ratio, &mut part.instance)?;
            part.step(time, length)?;
        }
    }
    next.copy_from(signals);
    let Coupling {
        sources,
        tables,
        solver,
        values,
        repeats,
    } = coupling;
    if !tables.is_empty() {
        reference.ahead(end.time, &mut next.numbers);
    }
    for (value, &signal) in values.iter_mut().zip(sources.iter()) {
        *value = next.numbers[signal];
    }
    let mut pass = Pass {
        start: time,
        length,
        end,
        sources,
        repeats,
        parts,
        actions,
        signals,
        next,
        names,
        is_first: true,
    };
    newton::solve(solver, &mut pass, values)?.map_err(|unsolved| {
        let signal = sources.get(unsolved.place).copied().unwrap_or_default();
        MasterError::NotConverged {
            time,
            passes: unsolved.passes,
            variable: names.get(signal).cloned().unwrap_or_default(),
            change: (unsolved.back - unsolved.value).abs(),
        }
    })
}

/// The signals that continuous components give each other.
#[derive(Default)]
pub(super) struct Coupling {
    sources: Vec<usize>,
    /// The signals of input tables that change within a step.
    tables: Vec<usize>,
    solver: Solver,
    values: Vec<f64>,
    /// Which components repeat their steps: continuous ones with such inputs that save their states.
    repeats: Vec<bool>,
}

impl Coupling {
    /// Copies these signals.
    #[inline]
    pub(super) fn copy(&self, from: &Signals, to: &mut Signals) {
        for &signal in self.sources.iter().chain(&self.tables) {
            to.numbers[signal] = from.numbers[signal];
        }
    }

    /// Components that are coupled and cannot go back, by index.
    pub(super) fn explicit(&self, parts: &[Part]) -> Vec<usize> {
        let coupled = |&at: &usize| {
            let part = &parts[at];
            let is_coupled = part.inputs.smooth_sources().next().is_some();
            part.every.is_none() && !self.repeats[at] && is_coupled
        };
        (0..parts.len()).filter(coupled).collect()
    }

    /// All that changes within a step and drives a component that is not sampled.
    pub(super) fn signals(&self) -> impl Iterator<Item = usize> + '_ {
        self.sources.iter().chain(&self.tables).copied()
    }

    /// Of these components; the first so many signals come from outside.
    pub(super) fn new(parts: &[Part], outside: usize) -> Self {
        let continuous = parts.iter().filter(|part| part.every.is_none());
        let mut sources: Vec<usize> = continuous
            .flat_map(|part| part.inputs.smooth_sources())
            .collect();
        sources.sort_unstable();
        sources.dedup();
        let (tables, sources): (Vec<usize>, Vec<usize>) =
            sources.into_iter().partition(|&signal| signal < outside);
        let repeats = parts.iter().map(|part| {
            let is_coupled = part.every.is_none() && part.inputs.smooth_sources().next().is_some();
            is_coupled && part.instance.fmu.description.saves_state
        });
        Self {
            repeats: repeats.collect(),
            solver: Solver::new(&vec![true; sources.len()]),
            values: vec![0.0; sources.len()],
            sources,
            tables,
        }
    }
}

/// A step while it is sought.
struct Pass<'a> {
    start: f64,
    length: f64,
    end: Moment,
    sources: &'a [usize],
    repeats: &'a [bool],
    parts: &'a mut [Part],
    actions: &'a mut [Action],
    signals: &'a Signals,
    next: &'a mut Signals,
    names: &'a [String],
    is_first: bool,
}

impl Round for Pass<'_> {
    fn send(&mut self, values: &[f64], back: &mut [f64]) -> Result<(), MasterError> {
        let is_first = std::mem::take(&mut self.is_first);
        for (value, &signal) in values.iter().zip(self.sources) {
            self.next.numbers[signal] = *value;
        }
        let repeats = self.repeats;
        let repeated = move |(at, _): &(usize, &mut Part)| repeats[*at];
        if !is_first {
            for (_, part) in self.parts.iter_mut().enumerate().filter(repeated) {
                part.go_back()?;
            }
        }
        for (_, part) in self.parts.iter_mut().enumerate().filter(repeated) {
            let (now, next) = (self.signals, &*self.next);
            part.inputs
                .transfer_between(now, next, 0.5, &mut part.instance)?;
            part.begin_step(self.start, self.length)?;
        }
        for part in self.parts.iter_mut() {
            part.finish_step()?;
        }
        let continuous = self.actions.iter_mut();
        for action in continuous.filter(|action| action.is_continuous()) {
            action.perform(self.end, self.parts, self.next, self.names)?;
        }
        for (value, &signal) in back.iter_mut().zip(self.sources) {
            *value = self.next.numbers[signal];
        }
        Ok(())
    }
}

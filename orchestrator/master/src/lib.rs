//! The master: steps the FMUs of a system together.
//!
//! At tick k the outputs at `t_k = k h` become known in dependency order, sampled components being
//! called from the reference down ([`Simulation::observe`]); then the continuous components step
//! over `[t_k, t_k + h]` with their inputs held ([`Simulation::advance`]). A row of the record
//! holds the outputs at `t_k` together with the commands computed from them.

mod action;
mod algebraic;
mod checkpoint;
mod clock;
mod compile;
mod driven;
mod error;
mod foresee;
mod gauss_seidel;
mod iterative;
mod jacobi;
mod newton;
mod observer;
mod order;
mod record;
mod reference;
mod run;
mod samples;
mod signals;
mod start;
mod stepwise;
mod together;
mod transfer;
mod tuning;
mod variable;

use std::collections::HashMap;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

pub use checkpoint::{Checkpoint, KeepCheckpoint};
pub use clock::RealTime;
pub use compile::Plan;
pub use driven::{Asked, Driven, OUTSIDE};
pub use error::MasterError;
pub use observer::Observer;
pub use record::Record;
pub use run::{Ended, Ending, LogLine, Outcome, Pace};
pub use samples::{Column, Samples};
pub use stepwise::{Saved, Stepwise};
pub use tuning::{Change, Panel, Refused, Tunable};
pub use variable::{StepsTaken, VariableStep};

use action::{Action, Moment};
use fmi_import::{CallError, Diverted, Instance, Item, Progress, State};
use reference::Reference;
use signals::Signals;
use together::Together;
use transfer::{Inputs, Outputs};

/// The order in which components are called and values are exchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Algorithm {
    /// All inputs are set, all components step, all outputs are read: each connection adds a
    /// sample of delay.
    Jacobi,
    /// In dependency order, with no delay added.
    #[default]
    GaussSeidel,
    /// In dependency order; loops of direct feedthrough and the coupling over a step are solved, by
    /// Newton's method where repeating does not settle quickly (coupled FMUs must be able to save
    /// their state).
    Iterative,
}

impl fmt::Display for Algorithm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Jacobi => "jacobi",
            Self::GaussSeidel => "gauss-seidel",
            Self::Iterative => "iterative",
        })
    }
}

/// A system loaded, connected and initialized, at some tick of its run.
pub struct Simulation {
    algorithm: Algorithm,
    /// Time at which it begins, s.
    begin: f64,
    /// Coupling step, s: the least one where it varies.
    step: f64,
    /// Chooses the steps where they vary.
    variable: Option<variable::StepControl>,
    tick: usize,
    /// Ticks from one row of the record to the next: one sample of the motion.
    ticks_per_row: usize,
    /// The latest value of every source of connections and every output.
    signals: Signals,
    /// Names of the numbers.
    names: Vec<String>,
    /// Names of the values that numbers do not hold.
    exact_names: Vec<String>,
    reference: Reference,
    parts: Vec<Part>,
    /// While foreign FMUs live in this process, what they print does not go among the results.
    diverted: Option<Diverted>,
    actions: Vec<Action>,
    /// Calls whose steps travel to another process together.
    together: Vec<Together>,
    /// What the user should know of the order of calls.
    notes: Vec<String>,
    /// Ends the run when it becomes true.
    interrupt: Option<&'static AtomicBool>,
    /// One row is kept of so many.
    keep_every: usize,
    /// Places of the numbers that are recorded: not what lies ahead of the motion, which is the
    /// same history some samples later.
    kept: Vec<Range<usize>>,
    /// Signals that are recorded under a further name, and those names.
    alias_signals: Vec<usize>,
    alias_names: Vec<String>,
    /// Real time, where the run keeps pace with it.
    clock: Option<clock::Clock>,
    /// What ends the run early.
    end: Option<EndSignals>,
    /// The part and input that is set when a sampled component fails.
    stop: Option<(usize, u32)>,
    /// Whether it has been set.
    is_stopped: bool,
    /// The signals at the tick before.
    last_signals: Signals,
    /// What continuous components give each other, for [`Algorithm::Iterative`].
    coupling: iterative::Coupling,
    /// Signals at the end of the step, for [`Algorithm::Iterative`].
    next_signals: Signals,
    /// Who watches.
    observer: Option<Arc<dyn Observer>>,
    /// What tripped, while the run continues to its end.
    tripped: Option<run::Tripped>,
    /// Who keeps checkpoints.
    keeper: Option<checkpoint::Keeper>,
    /// What was before, where the run goes on from a checkpoint.
    resumed: Option<checkpoint::Resumed>,
    /// The tick at which this process began.
    first_tick: usize,
    /// Parameters that change during the run.
    tuning: tuning::Tuning,
}

/// What ends a run early.
struct EndSignals {
    /// The signal that ends the run when it is not 0.
    when: usize,
    /// The signal that says why, and what its values mean.
    cause: Option<(usize, Vec<Item>)>,
    /// How long the run goes on then, s.
    after: f64,
}

/// A component in a simulation.
struct Part {
    instance: Instance,
    /// Every so many ticks a sampled component is called; none for a continuous one.
    every: Option<usize>,
    /// All its connected inputs.
    inputs: Inputs,
    /// All its outputs.
    outputs: Outputs,
    /// Where the state is kept that a repetition goes back to.
    state: State,
    /// Whether the run goes on when it fails, until the valve is at null.
    may_fail: bool,
    /// Why it is called no more; its outputs keep their last values.
    failure: Option<MasterError>,
    /// When it asked to end the run, s.
    ended: Option<f64>,
    /// Whether it is in another process.
    is_apart: bool,
    /// A step was requested whose outcome is not known yet.
    is_requested: bool,
    /// Its steps so far.
    steps: u32,
    /// Time that its timed steps took.
    spent: Duration,
}

/// One in so many steps of a component is timed: looking at the clock costs as much as a short step.
const TIMED: u32 = 64;

/// Whether what comes every so many ticks comes at this one. Most comes at every tick, and a division
/// takes longer than many a call of an FMU.
#[inline]
fn comes(tick: usize, every: usize) -> bool {
    every == 1 || tick.is_multiple_of(every)
}

impl Part {
    /// Steps it; a failure that may be is kept instead of given.
    fn step(&mut self, time: f64, length: f64) -> Result<(), MasterError> {
        if self.failure.is_some() || self.ended.is_some() {
            return Ok(());
        }
        let begun = self.is_timed().then(Instant::now);
        let stepped = self.instance.do_step(time, length);
        if let Some(begun) = begun {
            self.spent += begun.elapsed();
        }
        self.stepped(stepped)
    }

    /// Notes what came of a step.
    #[inline]
    fn stepped(&mut self, stepped: Result<Progress, Box<CallError>>) -> Result<(), MasterError> {
        self.steps = self.steps.wrapping_add(1);
        match stepped {
            Err(error) if self.may_fail => self.failure = Some(error.into()),
            done => {
                if let Progress::Ended(at) = done? {
                    self.ended = Some(at);
                }
            }
        }
        Ok(())
    }

    /// As [`Part::step`]; what came of it may be known only after [`Part::finish_step`], so that steps of
    /// several FMUs in another process travel there together.
    fn begin_step(&mut self, time: f64, length: f64) -> Result<(), MasterError> {
        if !self.is_apart || self.failure.is_some() || self.ended.is_some() {
            return self.step(time, length);
        }
        if !self.instance.request_step(time, length, self.is_timed()) {
            return self.step(time, length);
        }
        self.is_requested = true;
        Ok(())
    }

    /// Ends what [`Part::begin_step`] began.
    #[inline]
    fn finish_step(&mut self) -> Result<(), MasterError> {
        match std::mem::take(&mut self.is_requested) {
            true => self.take_answer(),
            false => Ok(()),
        }
    }

    #[inline(never)]
    fn take_answer(&mut self) -> Result<(), MasterError> {
        let is_timed = self.is_timed();
        let stepped = self.instance.finish_step().map(|(progress, taken)| {
            if is_timed {
                self.spent += Duration::try_from_secs_f64(taken).unwrap_or_default();
            }
            progress
        });
        self.stepped(stepped)
    }

    /// Goes back to the state that was kept, to repeat its step.
    fn go_back(&mut self) -> Result<(), MasterError> {
        if self.failure.is_none() {
            self.ended = None;
            self.instance.restore_state(&self.state)?;
        }
        Ok(())
    }

    /// Reads its outputs into the signals; a failure that may be is kept instead of given.
    fn read(&mut self, signals: &mut Signals) -> Result<(), MasterError> {
        if !self.may_fail {
            return Ok(self.outputs.read(signals, &mut self.instance)?);
        }
        let read = self.outputs.read_all_or_none(signals, &mut self.instance);
        if let Err(error) = read {
            self.failure = Some(error.into());
        }
        Ok(())
    }

    /// Time that its steps took, s, from those that were timed.
    fn wall(&self) -> f64 {
        let timed = self.steps.div_ceil(TIMED).max(1);
        self.spent.as_secs_f64() * f64::from(self.steps) / f64::from(timed)
    }

    /// Whether its next step is timed.
    fn is_timed(&self) -> bool {
        self.steps.is_multiple_of(TIMED)
    }

    fn is_due(&self, tick: usize) -> bool {
        self.every.is_none_or(|every| comes(tick, every))
    }
}

impl Simulation {
    /// Shows every row of its record to `observer` from now on.
    pub fn watch(&mut self, observer: Arc<dyn Observer>) {
        self.observer = Some(observer);
    }

    /// Time of the present tick, s.
    pub fn time(&self) -> f64 {
        let since = self.tick as f64 * self.step;
        self.begin + since
    }

    /// The sample of the motion at or before the present tick.
    #[inline]
    fn sample(&self) -> usize {
        match self.ticks_per_row {
            1 => self.tick,
            ticks => self.tick / ticks,
        }
    }

    /// Coupling step, s; the least one where it varies.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Names of the signals, as `component.variable`, in the order of [`Simulation::signals`].
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The latest values, SI.
    pub fn signals(&self) -> &[f64] {
        &self.signals.numbers
    }

    /// How often calls have travelled to other processes and back so far.
    pub fn exchanges(&self) -> u64 {
        let apart = self.parts.iter();
        let of =
            apart.filter_map(|part| Some((part.instance.process()?, part.instance.exchanges())));
        of.collect::<HashMap<_, _>>().values().sum()
    }

    /// Makes the outputs at the present tick known; due sampled components are called.
    ///
    /// # Errors
    /// A call that an FMU did not complete, or a loop that does not converge.
    pub fn observe(&mut self) -> Result<(), MasterError> {
        let (sample, time) = (self.sample(), self.time());
        self.reference
            .sample(sample, time, &mut self.signals.numbers);
        match self.algorithm {
            Algorithm::Jacobi => Ok(()),
            Algorithm::GaussSeidel | Algorithm::Iterative => gauss_seidel::observe(self),
        }
    }

    /// Carries out all actions.
    fn perform(&mut self, at: Moment) -> Result<(), MasterError> {
        let mut together = self.together.iter().filter(|_| at.calls).peekable();
        for (index, action) in self.actions.iter_mut().enumerate() {
            if let Some(steps) = together.next_if(|it| it.at == index) {
                steps.request(at, &mut self.parts, &self.signals);
            }
            action.perform(at, &mut self.parts, &mut self.signals, &self.names)?;
        }
        Ok(())
    }

    /// Takes the present signals for those of the step before.
    #[inline]
    fn keep_as_last(&mut self) {
        self.coupling.copy(&self.signals, &mut self.last_signals);
    }

    /// Steps over `[t_k, t_k + h]`, or as far as the error allows where steps vary.
    ///
    /// # Errors
    /// A call that an FMU did not complete, or a coupling that does not converge.
    pub fn advance(&mut self) -> Result<(), MasterError> {
        if let Some(mut control) = self.variable.take() {
            let made = variable::advance(self, &mut control);
            self.variable = Some(control);
            self.tick += made?;
            return Ok(());
        }
        match self.algorithm {
            Algorithm::Jacobi => jacobi::advance(self)?,
            Algorithm::GaussSeidel => gauss_seidel::advance(self)?,
            Algorithm::Iterative => iterative::advance(self)?,
        }
        self.tick += 1;
        Ok(())
    }
}

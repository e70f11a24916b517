//! A run between two steps, kept so that another process can go on with it to the bit.

use std::error::Error;

use serde::{Deserialize, Serialize};

use super::run::Tripped;
use super::variable::Progress as StepProgress;
use super::{Change, MasterError, Record, Simulation};
use fmi_import::{Datum, State};

/// Everything that the rest of a run depends on, with the states of its FMUs as they write them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Coupling steps made.
    pub tick: usize,
    /// Its time, s.
    pub time: f64,
    numbers: Vec<f64>,
    exact: Vec<Datum>,
    last_numbers: Vec<f64>,
    last_exact: Vec<Datum>,
    tripped: Option<Tripped>,
    variable: Option<StepProgress>,
    parts: Vec<PartState>,
    /// Time that the stepping has taken, s.
    wall: f64,
    changes: Vec<Change>,
}

/// A component between two steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct PartState {
    name: String,
    state: Vec<u8>,
    steps: u32,
    /// Time that its timed steps took, s.
    spent: f64,
}

/// Whoever keeps checkpoints, with the record until then; gives what went wrong, any error.
pub type KeepCheckpoint =
    Box<dyn FnMut(&Checkpoint, &Record) -> Result<(), Box<dyn Error + Send + Sync>> + Send>;

/// Checkpoints during a run.
pub(super) struct Keeper {
    /// Rows of the motion from one to the next.
    pub every: usize,
    pub keep: KeepCheckpoint,
}

/// Where a run goes on.
pub(super) struct Resumed {
    /// What was recorded until then.
    pub record: Record,
    /// Time that the stepping had taken, s.
    pub wall: f64,
}

impl Simulation {
    /// Whether all components can write their states.
    ///
    /// # Errors
    /// The first that cannot.
    pub fn check_checkpoints(&self) -> Result<(), MasterError> {
        let cannot = |part: &&super::Part| {
            let description = &part.instance.fmu.description;
            !(description.saves_state && description.writes_state)
        };
        match self.parts.iter().find(cannot) {
            None => Ok(()),
            Some(part) => Err(MasterError::NoWrittenState(part.instance.name.clone())),
        }
    }

    /// Gives a checkpoint to `keep` every so many samples of the motion, and when the run is
    /// interrupted.
    ///
    /// # Errors
    /// A component that cannot write its state.
    pub fn keep_checkpoints(
        &mut self,
        every: usize,
        keep: KeepCheckpoint,
    ) -> Result<(), MasterError> {
        self.check_checkpoints()?;
        let every = every.max(1);
        self.keeper = Some(Keeper { every, keep });
        Ok(())
    }

    /// Goes on where a checkpoint of the same run was kept, behind what was recorded until then.
    ///
    /// # Errors
    /// A checkpoint of another system, or a state that an FMU does not take.
    pub fn resume(&mut self, checkpoint: &Checkpoint, record: Record) -> Result<(), MasterError> {
        if record.columns != self.columns() || record.exact_columns != self.exact_names {
            return Err(MasterError::OtherCheckpoint);
        }
        self.go_to(checkpoint)?;
        self.repeat(&checkpoint.changes)?;
        self.notes.push(format!(
            "the run continues from its checkpoint at {} s",
            // Sums of steps have rounding errors behind the nanoseconds.
            (1e9 * checkpoint.time).round() / 1e9
        ));
        self.resumed = Some(Resumed {
            record,
            wall: checkpoint.wall,
        });
        Ok(())
    }

    /// Takes over the moment of a checkpoint of the same system.
    ///
    /// # Errors
    /// A checkpoint of another system, or a state that an FMU does not take.
    pub(super) fn go_to(&mut self, checkpoint: &Checkpoint) -> Result<(), MasterError> {
        let fits = checkpoint.numbers.len() == self.signals.numbers.len()
            && checkpoint.exact.len() == self.signals.exact.len()
            && checkpoint.last_numbers.len() == self.last_signals.numbers.len()
            && checkpoint.last_exact.len() == self.last_signals.exact.len()
            && checkpoint.parts.len() == self.parts.len()
            && checkpoint
                .parts
                .iter()
                .zip(&self.parts)
                .all(|(kept, part)| kept.name == part.instance.name);
        let fits = fits && checkpoint.variable.is_some() == self.variable.is_some();
        if !fits {
            return Err(MasterError::OtherCheckpoint);
        }
        self.check_checkpoints()?;
        for (kept, part) in checkpoint.parts.iter().zip(&mut self.parts) {
            let state = part.instance.state_of_bytes(&kept.state)?;
            part.instance.restore_state(&state)?;
            part.instance.free_state(state)?;
            part.steps = kept.steps;
            part.spent = std::time::Duration::try_from_secs_f64(kept.spent).unwrap_or_default();
        }
        self.signals.numbers.clone_from(&checkpoint.numbers);
        self.signals.exact.clone_from(&checkpoint.exact);
        self.last_signals
            .numbers
            .clone_from(&checkpoint.last_numbers);
        self.last_signals.exact.clone_from(&checkpoint.last_exact);
        self.tripped.clone_from(&checkpoint.tripped);
        if let (Some(control), Some(progress)) = (&mut self.variable, &checkpoint.variable) {
            control.progress.clone_from(progress);
        }
        for part in &mut self.parts {
            (part.failure, part.ended) = (None, None);
        }
        self.is_stopped = false;
        self.tick = checkpoint.tick;
        Ok(())
    }

    /// The present moment; none where a component has failed, which nothing can go on from.
    pub(super) fn checkpoint(&mut self, wall: f64) -> Result<Option<Checkpoint>, MasterError> {
        if self.parts.iter().any(|part| part.failure.is_some()) {
            return Ok(None);
        }
        let mut parts = Vec::with_capacity(self.parts.len());
        for part in &mut self.parts {
            let mut state = State::default();
            part.instance.save_state(&mut state)?;
            let bytes = part.instance.state_as_bytes(&state);
            part.instance.free_state(state)?;
            parts.push(PartState {
                name: part.instance.name.clone(),
                state: bytes?,
                steps: part.steps,
                spent: part.spent.as_secs_f64(),
            });
        }
        Ok(Some(Checkpoint {
            tick: self.tick,
            time: self.time(),
            numbers: self.signals.numbers.clone(),
            exact: self.signals.exact.clone(),
            last_numbers: self.last_signals.numbers.clone(),
            last_exact: self.last_signals.exact.clone(),
            tripped: self.tripped.clone(),
            variable: self
                .variable
                .as_ref()
                .map(|control| control.progress.clone()),
            parts,
            wall,
            changes: self.tuning.changes(),
        }))
    }

    /// Whether to save a checkpoint before the present tick.
    pub(super) fn is_checkpoint_due(&self) -> bool {
        self.keeper.as_ref().is_some_and(|keeper| {
            self.tick > self.first_tick
                && self.tick.is_multiple_of(self.ticks_per_row * keeper.every)
        })
    }

    /// Keeps a checkpoint; the run goes on without where that fails, and says so.
    pub(super) fn keep_checkpoint(
        &mut self,
        record: &Record,
        wall: f64,
    ) -> Result<(), MasterError> {
        let Some(mut keeper) = self.keeper.take() else {
            return Ok(());
        };
        let Some(checkpoint) = self.checkpoint(wall)? else {
            return Ok(());
        };
        match (keeper.keep)(&checkpoint, record) {
            Ok(()) => self.keeper = Some(keeper),
            Err(reason) => self.notes.push(format!(
                "no checkpoints are saved from {} s on: {reason}",
                checkpoint.time
            )),
        }
        Ok(())
    }
}

//! Why a run cannot begin or go on.

use thiserror::Error;

use crate::fmu::{CallError, FmuError};
use crate::system::SystemError;

/// Why a run cannot begin or go on.
#[derive(Debug, Error)]
pub enum MasterError {
    /// An FMU cannot be loaded.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// The system cannot be ordered.
    #[error(transparent)]
    System(#[from] SystemError),
    /// An FMU did not complete a call.
    #[error(transparent)]
    Call(#[from] Box<CallError>),
    /// Steps and periods that do not fit together.
    #[error("{0}")]
    Step(String),
    /// Steps of different lengths where they cannot be.
    #[error("--variable-step: {0}")]
    VariableStep(String),
    /// A sampled component in a loop of direct feedthrough that cannot save its state.
    #[error(
        "--algorithm iterative repeats the call of the sampled component `{0}`, which is part of a loop \
         of direct feedthrough, but it cannot save its state (its FMU does not offer it); break the \
         loop with a component that has no direct feedthrough"
    )]
    NoState(String),
    /// A component whose state cannot be kept in a file.
    #[error(
        "checkpoints keep the states of all components, but `{0}` cannot write its own (its FMU does \
         not offer canGetAndSetFMUState and canSerializeFMUState for co-simulation); run without \
         --checkpoint-every"
    )]
    NoWrittenState(String),
    /// A checkpoint of another system.
    #[error("the checkpoint is one of another run: its components or signals are not these")]
    OtherCheckpoint,
    /// Values that grow without bound.
    #[error("the run diverges: `{variable}` is {value:e} at {time} s")]
    Diverged {
        /// Time, s.
        time: f64,
        /// The first variable that is too large.
        variable: String,
        /// Its value.
        value: f64,
    },
    /// A table that does not follow at all.
    #[error(
        "the run ran away: the table went {error:.3} m from what it was asked for, which is \
         {peak:.3} m at most, first beyond five times that at {time:.3} s"
    )]
    RanAway {
        /// When the error first was five times the motion's peak, s.
        time: f64,
        /// Largest error, m.
        error: f64,
        /// Largest displacement asked for, m.
        peak: f64,
    },
    /// A loop of direct feedthrough without a solution.
    #[error(
        "the loop {round} has no solution at {time} s that can be found: the closest is \
         `{variable}` = {value}, and {back} comes back; {reason}"
    )]
    Loop {
        /// Time, s.
        time: f64,
        /// The variables round the loop.
        round: String,
        /// The variable that is furthest from what comes back.
        variable: String,
        /// The closest that was found of it.
        value: f64,
        /// What comes back.
        back: f64,
        /// Why, as far as it is known, and what to do.
        reason: String,
    },
    /// An iteration that does not settle.
    #[error(
        "the values do not stand still at {time} s after {passes} repetitions: `{variable}` still \
         changes by {change:e}"
    )]
    NotConverged {
        /// Time, s.
        time: f64,
        /// Repetitions made.
        passes: usize,
        /// The variable that changes most.
        variable: String,
        /// Its last change.
        change: f64,
    },
}

impl MasterError {
    /// Whether a shorter step may help: an FMU that discarded it, values that did not settle over it.
    pub(super) fn is_of_the_step(&self) -> bool {
        match self {
            Self::Call(error) => error.may_be_of_the_step,
            Self::NotConverged { .. } | Self::Loop { .. } => true,
            _ => false,
        }
    }
}

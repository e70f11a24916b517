//! Why a run cannot begin or go on.

use thiserror::Error;

use fmi_import::{CallError, FmuError};
use fmi_system::SystemError;

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
         of direct feedthrough, but it cannot save its state (its FMU does not offer it). Break \
         the loop with a component that has no direct feedthrough"
    )]
    NoState(String),
    /// A component whose state cannot be kept in a file.
    #[error(
        "checkpoints save the states of all components, but `{0}` cannot save its own (its FMU \
         does \
         not offer canGetAndSetFMUState and canSerializeFMUState for co-simulation); run without \
         --checkpoint-every"
    )]
    NoWrittenState(String),
    /// A parameter that cannot be changed during a run.
    #[error("`{variable}` cannot be changed during a run: {reason}")]
    NotTunable {
        /// The parameter.
        variable: String,
        /// Why.
        reason: String,
    },
    /// A checkpoint of another system.
    #[error("the checkpoint belongs to another run: its components or signals differ")]
    OtherCheckpoint,
    /// A motion that is wanted before anybody knows it.
    #[error(
        "`{0}` is wanted ahead of time, but what comes from outside is known only when it comes; take \
         a controller without preview"
    )]
    Ahead(String),
    /// Something else is asked for at a sample that has passed.
    #[error(
        "the components that are called at samples have been called at {time} s; something else can be \
         asked for at the next sample only"
    )]
    Passed {
        /// s.
        time: f64,
    },
    /// A component whose state cannot be saved.
    #[error(
        "a trial can be taken back only where all components save their states, but `{0}` cannot (its \
         FMU does not offer canGetAndSetFMUState); take --mode rig"
    )]
    NotSaved(String),
    /// A simulation that has ended has no state to go on from.
    #[error("the run has ended at {time} s; save a state before its end")]
    Ended {
        /// When, s.
        time: f64,
    },
    /// A component asked to end the run.
    #[error("`{0}` asked to end the run")]
    Over(String),
    /// The client whom a system answers ended the run early.
    #[error("{0}")]
    Client(String),
    /// The system ended the run.
    #[error("{0}")]
    Tripped(String),
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
        "the run diverged: the table is {error:.3} m from its reference, whose peak is {peak:.3} \
         m; it first exceeded five times that peak at {time:.3} s"
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
        "the values do not settle at {time} s after {passes} repetitions: `{variable}` still \
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

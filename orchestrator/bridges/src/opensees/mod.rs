//! A structure in OpenSees as a specimen: its model runs in a process of its own, behind an `adapter`
//! element that is moved step by step.

mod find;
mod process;

use std::path::PathBuf;

use thiserror::Error;

pub use find::{Candidate, PYTHON, find_python};
pub use process::{CARRIED, PREFIX, Reply, Role, Settings, Structure, model_of};

use crate::link::LinkError;
use crate::scale::ScaleError;

/// What OpenSees needs to be here, for people.
pub const CURE: &str = "install it with `pip install openseespy` into a Python of your own and name \
                        that in SHAKEBENCH_PYTHON; on Debian and Ubuntu it needs `apt install \
                        libblas3 liblapack3`";

/// Why a model in OpenSees cannot begin or go on.
#[derive(Debug, Error)]
pub enum OpenSeesError {
    /// No Python with the library.
    #[error("no Python with openseespy was found ({tried}); {CURE}")]
    NoPython {
        /// What was tried, with what each said.
        tried: String,
    },
    /// The library does not load.
    #[error("openseespy does not load: {reason}; {CURE}")]
    Missing {
        /// What Python says.
        reason: String,
    },
    /// There is no such model.
    #[error("{path}: {reason}; expected an OpenSees model in Python")]
    NoModel {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// The model's units.
    #[error("{path}: {reason}")]
    Units {
        /// The model.
        path: PathBuf,
        /// What is missing or wrong.
        reason: String,
    },
    /// Units that are none.
    #[error(transparent)]
    Scale(#[from] ScaleError),
    /// The script failed.
    #[error("{path}: {message}{printed}")]
    Python {
        /// The model.
        path: PathBuf,
        /// Line and error.
        message: String,
        /// What it printed last.
        printed: Printed,
    },
    /// The model lacks something.
    #[error("{path}: {message}")]
    Refused {
        /// The model.
        path: PathBuf,
        /// What.
        message: String,
    },
    /// A step without a solution.
    #[error(
        "{path}: OpenSees found no solution in step {step}, from {time} s (analyze returned \
         {status}){printed}"
    )]
    Convergence {
        /// The model.
        path: PathBuf,
        /// From 1.
        step: usize,
        /// Time of the model, s.
        time: f64,
        /// What `analyze` returned.
        status: i64,
        /// What OpenSees printed last.
        printed: Printed,
    },
    /// The process ended.
    #[error("{path}: the process of OpenSees {how}{printed}")]
    Ended {
        /// The model.
        path: PathBuf,
        /// By which signal or with which status.
        how: String,
        /// What it printed last.
        printed: Printed,
    },
    /// The process says nothing.
    #[error(
        "{path}: OpenSees was silent for {limit_s} s {what}; if that is what the model takes, allow \
         more with `time_limit`"
    )]
    Silent {
        /// The model.
        path: PathBuf,
        /// The limit, s.
        limit_s: f64,
        /// Doing what.
        what: &'static str,
    },
    /// A step of another length.
    #[error(
        "OpenSees was begun with steps of {begun} s and is asked for one of {asked} s; its adapter \
         takes steps of one length (run without --variable-step)"
    )]
    Step {
        /// The first step, s.
        begun: f64,
        /// This one, s.
        asked: f64,
    },
    /// A process that cannot be started.
    #[error("{program}: {source}")]
    Start {
        /// The Python.
        program: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The connection to the adapter.
    #[error("the adapter of OpenSees: {0}")]
    Link(#[from] LinkError),
}

/// The last lines that a process printed, for a message.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Printed(pub Vec<String>);

impl std::fmt::Display for Printed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0.is_empty() {
            return Ok(());
        }
        write!(f, "; it printed: {}", self.0.join(" | "))
    }
}

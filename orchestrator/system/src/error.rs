//! What can be wrong with a system.

use std::path::PathBuf;

use thiserror::Error;

use fmi_import::FmuError;

use super::connection::ConnectionError;
use super::fitted::FitError;
use super::given::SettingError;
use super::link::LinkError;
use super::lookup::NameError;
use super::table::TableError;
use super::terminals::TerminalError;
use super::value::ValueError;

/// Why a system cannot be run. Every message names the file (or built-in system) and the place.
#[derive(Debug, Error)]
pub enum SystemError {
    /// The file cannot be read.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The operating system's word.
        reason: String,
    },
    /// The file is not a system file.
    #[error("{origin}: {reason}")]
    Syntax {
        /// File or built-in system.
        origin: String,
        /// What is wrong, with line and column.
        reason: String,
    },
    /// Something in it does not hold.
    #[error("{origin}: {place}: {reason}")]
    Place {
        /// File or built-in system.
        origin: String,
        /// The place: a connection, a component, a parameter.
        place: String,
        /// What is wrong and what was expected.
        reason: Box<Misfit>,
    },
    /// No built-in system, rig part or file of that name.
    #[error("{what} `{name}` is unknown{hint}")]
    Unknown {
        /// What was looked for.
        what: &'static str,
        /// The name.
        name: String,
        /// The nearest one.
        hint: String,
    },
    /// A loop in which every variable depends directly on the one before.
    #[error(
        "{system}: a loop of direct feedthrough: {}; no order of calls can resolve it. \
         Break it with a component that has no direct feedthrough, or choose --algorithm iterative",
        variables.join(" -> ")
    )]
    Cycle {
        /// The system.
        system: String,
        /// The variables round the loop, the first one again at the end.
        variables: Vec<String>,
    },
    /// An FMU that cannot be used.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// A component's FMU cannot be found or built.
    #[error("{origin}: components.{component}: {reason}")]
    Missing {
        /// File or built-in system.
        origin: String,
        /// The component.
        component: String,
        /// What was looked for where.
        reason: String,
    },
}

/// What does not hold at a place of a system.
#[derive(Debug, Error)]
pub enum Misfit {
    /// A connection that cannot be read.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A component or variable that is not there, or is of another causality.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A value that does not fit its variable.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// A setting that cannot be carried out.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A connection whose ends do not fit.
    #[error(transparent)]
    Connection(#[from] ConnectionError),
    /// Terminals that do not fit.
    #[error(transparent)]
    Terminal(#[from] TerminalError),
    /// An input table that cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// An FMU that cannot be used as the system asks.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// An FMU whose arrays cannot have the sizes that the system gives.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// What the library, or whoever uses the system, found.
    #[error(transparent)]
    Outside(#[from] Box<dyn std::error::Error + Send + Sync>),
    /// A system without components.
    #[error("there is none")]
    NoComponent,
    /// A component whose name means something else.
    #[error(
        "this name is not allowed for a component (`reference` is the motion, and `.` separates component and \
         variable)"
    )]
    ComponentName,
    /// A table whose name means something else.
    #[error(
        "the name is that of the motion or of another component, or contains a `.`; choose another name"
    )]
    TableName,
    /// An input with two sources.
    #[error("`{input}` is already driven by `{source_before}`")]
    DrivenTwice {
        /// The input.
        input: String,
        /// What the first connection takes its value from.
        source_before: String,
    },
    /// A further name of an output that is taken.
    #[error("`{0}` is a variable of it")]
    AliasTaken(String),
    /// A variable of another type than the experiment needs.
    #[error("`{name}` is not {expected}")]
    Type {
        /// The variable, with its component.
        name: String,
        /// The type.
        expected: &'static str,
    },
}

//! What can be wrong with a system.

use std::path::PathBuf;

use thiserror::Error;

use fmi_import::FmuError;

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
        reason: String,
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

//! How FMUs are run.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use super::Trace;

/// Which FMUs run in a process of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Isolation {
    /// All of them.
    All,
    /// Those that are not components of this project.
    Foreign,
    /// Only the necessary ones: further instances of an FMU that allows one per process.
    #[default]
    None,
}

/// How FMUs are run, for all FMUs of a system.
#[derive(Debug, Clone)]
pub struct Options {
    /// Which FMUs run in a process of their own.
    pub isolation: Isolation,
    /// The program that becomes such a process: one that calls [`isolation::guest`](crate::isolation::guest)
    /// where its first argument is [`isolation::COMMAND`](crate::isolation::COMMAND). Without one no FMU
    /// can have a process of its own.
    pub guest: Option<PathBuf>,
    /// How long a call of an FMU in a process of its own may take.
    pub call_limit: Duration,
    /// Where every call is written to.
    pub trace: Option<Arc<Trace>>,
    /// Log categories that FMUs are asked for, all of theirs where the list is empty; absent: only
    /// those of warnings and errors.
    pub log_categories: Option<Vec<String>>,
}

impl Options {
    /// How long a call may take by default.
    pub const CALL_LIMIT: Duration = Duration::from_secs(120);
}

impl Default for Options {
    fn default() -> Self {
        Self {
            isolation: Isolation::default(),
            guest: None,
            call_limit: Self::CALL_LIMIT,
            trace: None,
            log_categories: None,
        }
    }
}

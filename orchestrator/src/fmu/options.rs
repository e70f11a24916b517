//! How FMUs are run.

use std::sync::Arc;
use std::time::Duration;

use super::Trace;

/// Which FMUs run in a process of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Isolation {
    /// All of them.
    All,
    /// Those that are not components of this project.
    Foreign,
    /// None but those that must: further instances of an FMU of which a process takes one only.
    #[default]
    None,
}

/// How FMUs are run, for all FMUs of a system.
#[derive(Debug, Clone)]
pub struct Options {
    /// Which FMUs run in a process of their own.
    pub isolation: Isolation,
    /// How long a call of an FMU in a process of its own may take.
    pub call_limit: Duration,
    /// Where every call is written to.
    pub trace: Option<Arc<Trace>>,
    /// Log categories that FMUs are asked for, all of theirs where the list is empty; absent: only
    /// those of warnings and errors.
    pub log_categories: Option<Vec<String>>,
}

impl Options {
    /// How long a call may take when nothing else is said.
    pub const CALL_LIMIT: Duration = Duration::from_secs(120);
}

impl Default for Options {
    fn default() -> Self {
        Self {
            isolation: Isolation::default(),
            call_limit: Self::CALL_LIMIT,
            trace: None,
            log_categories: None,
        }
    }
}

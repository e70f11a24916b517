//! How FMUs are run.

use std::sync::Arc;

use super::Trace;

/// How FMUs are run, for all FMUs of a system.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Where every call is written to.
    pub trace: Option<Arc<Trace>>,
    /// Log categories that FMUs are asked for, all of theirs where the list is empty; absent: only
    /// those of warnings and errors.
    pub log_categories: Option<Vec<String>>,
}

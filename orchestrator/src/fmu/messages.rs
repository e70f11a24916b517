//! What FMUs log, kept instead of printed.

use std::sync::{Mutex, PoisonError};

use fmi_rs::fmi2::types::fmi2Status;
use fmi_rs::fmi3::types::fmi3Status;

/// A line that an FMU logged.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// `ok`, `warning`, `discard`, `error`, `fatal` or `pending`.
    pub status: &'static str,
    /// The FMU's log category.
    pub category: String,
    /// The text.
    pub text: String,
}

/// Messages of one instance since they were last taken, the first [`Messages::KEPT`] of them.
#[derive(Debug, Default)]
pub(super) struct Messages(Mutex<Vec<Message>>);

/// The names of the status codes, which both versions number alike.
pub(super) const STATUS: [&str; 6] = ["ok", "warning", "discard", "error", "fatal", "pending"];

impl Messages {
    /// An FMU that logs without end does not fill the memory.
    const KEPT: usize = 1000;

    pub(super) fn take(&self) -> Vec<Message> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn keep(&self, status: i32, category: &str, text: &str) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() < Self::KEPT {
            kept.push(Message {
                status: STATUS.get(status as usize).copied().unwrap_or("unknown"),
                category: category.to_string(),
                text: text.trim().to_string(),
            });
        }
    }
}

impl fmi_rs::fmi2::log::Logger for Messages {
    fn log_call(&self, _status: fmi2Status, _message: &str) {}

    fn log_message(&self, status: fmi2Status, category: &str, message: &str) {
        self.keep(status as i32, category, message);
    }
}

impl fmi_rs::fmi3::log::Logger for Messages {
    fn log_call(&self, _status: fmi3Status, _message: &str) {}

    fn log_message(&self, status: fmi3Status, category: &str, message: &str) {
        self.keep(status as i32, category, message);
    }
}

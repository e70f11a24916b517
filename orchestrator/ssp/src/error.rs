//! What can be wrong with an SSP archive.

use std::path::PathBuf;

use thiserror::Error;

use fmi_import::FmuError;

/// Why an SSP archive cannot be used.
#[derive(Debug, Error)]
pub enum SspError {
    /// A file cannot be read.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The operating system's word.
        reason: String,
    },
    /// The archive is broken or hostile.
    #[error(transparent)]
    Archive(#[from] FmuError),
    /// A system that the format does not hold.
    #[error("{}: {reason}", path.display())]
    Export {
        /// The archive that was to be written.
        path: PathBuf,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A part of the archive other than the system is not available.
    #[error(transparent)]
    Supply(Box<dyn std::error::Error + Send + Sync>),
    /// A file in it is at fault.
    #[error("{}: {file}{}: {reason}", path.display(), line.map_or(String::new(), |line| format!(":{line}")))]
    File {
        /// The archive.
        path: PathBuf,
        /// The file in it.
        file: String,
        /// The line.
        line: Option<u32>,
        /// What is wrong and what was expected.
        reason: String,
    },
}

/// What is wrong at a place of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fault {
    pub line: Option<u32>,
    pub reason: String,
}

impl Fault {
    pub(super) fn new(reason: impl Into<String>) -> Self {
        Self {
            line: None,
            reason: reason.into(),
        }
    }
}

//! What can be wrong with an FMU, and a call that it did not complete.

use std::path::PathBuf;

use thiserror::Error;

use super::archive::file_name;

/// An FMU that cannot be used.
#[derive(Debug, Error)]
pub enum FmuError {
    /// The file cannot be read.
    #[error("{}: {source}", fmu.display())]
    Unreadable {
        /// The file.
        fmu: PathBuf,
        /// The operating system's word.
        source: std::io::Error,
    },
    /// The file is not a zip archive, or is damaged.
    #[error("{}: {sort}: {reason}", fmu.display())]
    Archive {
        /// The file.
        fmu: PathBuf,
        /// What it is not.
        sort: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// There is nowhere to unpack it.
    #[error(
        "{}: it cannot be unpacked in the temporary folder {} ({source}); set TMPDIR to a folder \
         that can be written", fmu.display(), folder.display()
    )]
    Temporary {
        /// The file.
        fmu: PathBuf,
        /// The folder for temporary files.
        folder: PathBuf,
        /// The operating system's word.
        source: std::io::Error,
    },
    /// An entry that would be written outside the FMU's own directory.
    #[error(
        "{}: the entry `{entry}` {reason}; the archive is broken or hostile and was not unpacked",
        fmu.display()
    )]
    Hostile {
        /// The file.
        fmu: PathBuf,
        /// The entry's name.
        entry: String,
        /// Why it is refused.
        reason: &'static str,
    },
    /// The description cannot be used.
    #[error("{}: modelDescription.xml: {reason}", fmu.display())]
    Description {
        /// The file.
        fmu: PathBuf,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// No binary, or none for this platform.
    #[error("{}: {reason}", fmu.display())]
    Binary {
        /// The file.
        fmu: PathBuf,
        /// What is missing and what is there.
        reason: String,
    },
    /// The instance could not be made.
    #[error("{}: `{instance}` could not be instantiated: {reason}", fmu.display())]
    Instantiation {
        /// The file.
        fmu: PathBuf,
        /// The instance.
        instance: String,
        /// What the FMU or the loader said.
        reason: String,
    },
}

/// A call that an FMU did not complete.
#[derive(Debug, Clone, Error)]
#[error(
    "`{instance}` ({}) failed at {time} s: {call}{} {outcome}{}",
    file_name(fmu),
    list(variables),
    said(messages)
)]
pub struct CallError {
    /// The instance.
    pub instance: String,
    /// Its file.
    pub fmu: PathBuf,
    /// Time of the communication point, s.
    pub time: f64,
    /// The function of the standard.
    pub call: String,
    /// The variables that were got or set.
    pub variables: Vec<String>,
    /// What came of it, as a clause.
    pub outcome: String,
    /// Whether a shorter step from a saved state may do: the FMU discarded it, or its result is not
    /// a number.
    pub may_be_of_the_step: bool,
    /// What the FMU logged since the last call that went well.
    pub messages: Vec<String>,
}

fn list(variables: &[String]) -> String {
    match variables {
        [] => String::new(),
        names => format!(" of `{}`", names.join("`, `")),
    }
}

fn said(messages: &[String]) -> String {
    match messages {
        [] => " and logged nothing".to_string(),
        messages => format!(": {}", messages.join("; ")),
    }
}

//! What can be wrong with an FMU, and a call that it did not complete.

use std::path::PathBuf;

use thiserror::Error;

use super::archive::file_name;
use super::call::Lost;
use super::stand_in::BehaviourError;

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

/// Why an instance cannot be made.
#[derive(Debug, Error)]
pub(super) enum InstanceError {
    /// The loader refuses the library.
    #[error("the library cannot be loaded: {}", with_causes(.0))]
    Library(#[from] libloading::Error),
    /// Functions that the library lacks.
    #[error("{}", lacking(.0))]
    Lacking(Vec<String>),
    /// A text that C cannot take.
    #[error("`{}` has a zero in it", .0.escape_debug())]
    Zero(String),
    /// The FMU gave no instance.
    #[error("the FMU refused")]
    Refused,
    /// Clocks that nobody can tick.
    #[error(
        "its input clock `{0}` has to be ticked from outside, which is possible in co-simulation with \
         hasEventMode=\"true\" only; export it with event mode"
    )]
    Clock(String),
    /// An interface for real-time schedulers.
    #[error(
        "it supports only scheduled execution: a real-time scheduler must call its parts, which a co-simulation \
         cannot do"
    )]
    Scheduled,
    /// What computes the instance cannot begin, in its own words.
    #[error("{0}")]
    StandIn(BehaviourError),
    /// It needs a process of its own.
    #[error(
        "it needs a process of its own, and no program is named that can be one (`Options::guest`)"
    )]
    NoGuest,
    /// No memory for another process.
    #[error(
        "no memory can be shared with another process: {0}; raise the limit of the size of files (ulimit -f), or \
         choose --isolate none"
    )]
    Memory(std::io::Error),
    /// A process that does not begin.
    #[error("{}: the process for FMUs cannot be started: {error}", program.display())]
    NotStarted {
        /// The program.
        program: PathBuf,
        /// The operating system's word.
        error: std::io::Error,
    },
    /// A process that began and does not answer.
    #[error("{}: the process for FMUs {}", program.display(), gone.0)]
    Gone {
        /// The program.
        program: PathBuf,
        /// What became of it.
        gone: Lost,
    },
    /// Another process could not make the instance.
    #[error("{}", .0.0)]
    Apart(Lost),
    /// What to make cannot be handed over.
    #[error(transparent)]
    Setup(#[from] serde_json::Error),
}

/// The loader's word, with the causes that it does not name itself.
fn with_causes(error: &libloading::Error) -> String {
    let mut reason = error.to_string();
    let mut source = std::error::Error::source(error);
    while let Some(cause) = source {
        let text = cause.to_string();
        if !reason.contains(&text) {
            reason += &format!(": {text}");
        }
        source = cause.source();
    }
    reason
}

fn lacking(names: &[String]) -> String {
    match names {
        [] => "the library lacks functions".to_string(),
        [name] => format!("the library lacks the function {name}"),
        names => format!("the library lacks the functions {}", names.join(", ")),
    }
}

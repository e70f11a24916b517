//! Why a call was refused or failed.

use std::fmt;

/// What an FMI function returns; the numbers are those of both standards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum Status {
    /// Done.
    Ok = 0,
    /// Done, with something to say in the log.
    Warning = 1,
    /// Not possible here, nothing was changed.
    Discard = 2,
    /// Refused or failed.
    Error = 3,
}

/// Why a call was refused or failed: a status and a message for the importer's log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The status to return.
    pub status: Status,
    /// What is wrong and what was expected.
    pub message: String,
}

/// Outcome of a call, in one machine word.
pub type Outcome<T = ()> = Result<T, Box<Fault>>;

impl Fault {
    /// A call that is refused.
    #[cold]
    pub fn error(message: impl Into<String>) -> Box<Self> {
        Box::new(Self {
            status: Status::Error,
            message: message.into(),
        })
    }

    /// Something that is not available in the present situation.
    #[cold]
    pub fn discard(message: impl Into<String>) -> Box<Self> {
        Box::new(Self {
            status: Status::Discard,
            message: message.into(),
        })
    }

    /// A call that was carried out but deserves a word.
    #[cold]
    pub fn warning(message: impl Into<String>) -> Box<Self> {
        Box::new(Self {
            status: Status::Warning,
            message: message.into(),
        })
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

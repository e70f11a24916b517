//! Whatever a command can fail with.

use std::path::PathBuf;

use thiserror::Error;

use crate::fmu::FmuError;
use crate::master::MasterError;
use crate::motion::MotionError;
use crate::pack::PackError;
use crate::results::ResultsError;
use crate::ssp::SspError;
use crate::system::SystemError;

/// Why a command did not do what it was asked for; nothing has been written then.
#[derive(Debug, Error)]
pub enum Error {
    /// A system is at fault.
    #[error(transparent)]
    System(#[from] SystemError),
    /// A motion is at fault.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// An FMU is at fault.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// An SSP archive is at fault.
    #[error(transparent)]
    Ssp(#[from] SspError),
    /// A run cannot begin.
    #[error(transparent)]
    Master(#[from] MasterError),
    /// The components cannot be built.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// Results cannot be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// A file of measured data is at fault.
    #[error(transparent)]
    Data(#[from] identification::data::DataError),
    /// Measured data give no model.
    #[error(transparent)]
    Identification(#[from] identification::IdentificationError),
    /// An option is at fault.
    #[error("{option}: {reason}")]
    Option {
        /// The option.
        option: &'static str,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A file is at fault.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong and what was expected.
        reason: String,
    },
}

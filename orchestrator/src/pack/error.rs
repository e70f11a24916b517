//! What can go wrong while components are built and packed.

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

/// Why FMUs could not be built or packed.
#[derive(Debug, Error)]
pub enum PackError {
    /// The program does not run inside its workspace.
    #[error(
        "no workspace with `fmus/kit` found above {0}: components are built from source, so run \
         this inside the project's folder"
    )]
    NoWorkspace(PathBuf),
    /// Cargo could not be started.
    #[error("cannot start `{cargo}`, which builds the components: {error}")]
    NoCargo {
        /// The command.
        cargo: String,
        /// What the system says.
        error: io::Error,
    },
    /// Cargo failed.
    #[error("`{command}` failed:\n{output}")]
    Cargo {
        /// The command.
        command: String,
        /// What it wrote to standard error.
        output: String,
    },
    /// Cargo's answer has another form than expected.
    #[error("`cargo {command}` answered in an unexpected form: {problem}")]
    Answer {
        /// The subcommand.
        command: &'static str,
        /// What was missing.
        problem: String,
    },
    /// A library does not describe itself as a component does.
    #[error("{library}: {problem}")]
    Library {
        /// The library.
        library: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A file could not be read or written.
    #[error("{path}: {error}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// An FMU cannot be varied as asked.
    #[error("{path}: {problem}")]
    Variant {
        /// The FMU.
        path: PathBuf,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// FMUs could not be packed earlier in this process.
    #[error("{0}")]
    Earlier(String),
}

pub(crate) fn file_error(path: &Path) -> impl FnOnce(io::Error) -> PackError {
    let path = path.to_path_buf();
    move |error| PackError::File { path, error }
}

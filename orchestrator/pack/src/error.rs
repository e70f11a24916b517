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
         this inside the project's folder (a release contains built ones)"
    )]
    NoWorkspace(PathBuf),
    /// A program that belongs beside this one is missing.
    #[error(
        "`{0}` is missing beside this program; install the release again, or run this inside the \
         project's folder"
    )]
    NoCompanion(String),
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
        problem: VariantFault,
    },
    /// There are no packed FMUs, and no sources to build them from.
    #[error(
        "no FMUs of the components: none next to the program{}, none in --fmus or \
         SHAKEBENCH_FMUS, and no sources above the present folder to build them from. Unpack the \
         release's FMUs into a folder `fmus` next to the program, or pass their folder with --fmus",
        places(beside)
    )]
    NoFmus {
        /// Where an installed program looks.
        beside: Vec<PathBuf>,
    },
    /// A folder that was chosen holds none.
    #[error(
        "{}: no FMUs in this folder, {by}; expected fmi2/NAME.fmu or fmi3/NAME.fmu, as in the \
         release's archive or from `shakebench build --out`", folder.display()
    )]
    EmptyFolder {
        /// The folder.
        folder: PathBuf,
        /// Who chose it.
        by: &'static str,
    },
    /// An FMU is damaged, of another version or another's.
    #[error(
        "{}: this FMU {problem}; install again, or pass the folder of this version's FMUs with \
         --fmus", path.display()
    )]
    Unfit {
        /// The FMU.
        path: PathBuf,
        /// What is wrong, as a clause.
        problem: String,
    },
    /// Libraries of this platform are not among those to pack.
    #[error(
        "no libraries for {0} among those of --libraries: the components of this platform are \
         loaded to learn their descriptions"
    )]
    NoOwnLibraries(String),
    /// Two FMUs of one name do not fit together.
    #[error(
        "{} and {} cannot be merged: {problem}; expected FMUs of one component, built from the \
         same sources for different platforms", first.display(), second.display()
    )]
    Unlike {
        /// One.
        first: PathBuf,
        /// The other.
        second: PathBuf,
        /// In what they differ.
        problem: Difference,
    },
    /// FMUs could not be packed earlier in this process.
    #[error("{0}")]
    Earlier(String),
}

/// In what two FMUs of one component differ.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Difference {
    /// A file that only one of them has.
    #[error("only one has `{0}`")]
    Lone(String),
    /// Two libraries for one platform.
    #[error("each has another `{0}`")]
    Library(String),
    /// Another file.
    #[error("`{0}` differs")]
    Content(String),
}

/// Why an FMU cannot be varied.
#[derive(Debug, Error)]
pub enum VariantFault {
    /// It has start values of its own.
    #[error("is a variant itself, expected an original")]
    Variant,
    /// No description, or not text.
    #[error("has no readable modelDescription.xml")]
    NoDescription,
    /// A description that is not XML.
    #[error(transparent)]
    Xml(#[from] roxmltree::Error),
    /// An attribute to replace is missing.
    #[error("an attribute `{0}` is missing")]
    NoAttribute(&'static str),
    /// Neither GUID nor instantiation token.
    #[error("the token is missing")]
    NoToken,
    /// A name that no parameter has.
    #[error("`{0}` is not a parameter of it")]
    NotAParameter(String),
    /// A value for a parameter of another type.
    #[error("`{name}` = {value} is neither Float64 nor an enumeration")]
    Type {
        /// The parameter.
        name: String,
        /// The value.
        value: f64,
    },
}

fn places(beside: &[PathBuf]) -> String {
    let places: Vec<String> = beside.iter().map(|p| p.display().to_string()).collect();
    if places.is_empty() {
        return String::new();
    }
    format!(" ({})", places.join(", "))
}

pub(crate) fn file_error(path: &Path) -> impl FnOnce(io::Error) -> PackError {
    let path = path.to_path_buf();
    move |error| PackError::File { path, error }
}

//! What can be wrong with a file of data.

use std::path::{Path, PathBuf};

use thiserror::Error;
use units::UnitError;

/// Why a file of data cannot be used. Every message names the file and, where there is one, line
/// and column (both counted from 1), and what was expected.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DataError {
    /// The file cannot be opened or read.
    #[error("{}: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The operating system's message, or the content of the file instead of text.
        reason: String,
    },
    /// The file is there and holds nothing.
    #[error("{}: the file is empty", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// The file as a whole is not what was expected.
    #[error("{}: {reason}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// One line is not what was expected.
    #[error("{}, line {line}: {reason}", file.display())]
    Line {
        /// The file.
        file: PathBuf,
        /// The line.
        line: u64,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A cell that holds no finite number.
    #[error(
        "{}, line {line}, column {column}{}: \"{text}\" is not a finite number{hint}",
        file.display(), named(name)
    )]
    NotANumber {
        /// The file.
        file: PathBuf,
        /// The line.
        line: u64,
        /// The cell of the line.
        column: usize,
        /// The column's name, or nothing.
        name: String,
        /// The content of the cell.
        text: String,
        /// What would do, as a clause, or nothing.
        hint: &'static str,
    },
    /// A column whose unit cannot be used.
    #[error("{}, line {line}, column {column} (`{name}`): {source}", file.display())]
    Unit {
        /// The file.
        file: PathBuf,
        /// The line of the unit.
        line: u64,
        /// The cell of the line.
        column: usize,
        /// The column's name.
        name: String,
        /// What is wrong with the unit.
        source: Box<UnitError>,
    },
}

fn named(name: &str) -> String {
    if name.is_empty() {
        String::new()
    } else {
        format!(" (`{name}`)")
    }
}

impl DataError {
    /// A fault of a file as a whole.
    pub fn file(file: &Path, reason: impl Into<String>) -> Self {
        Self::File {
            file: file.to_path_buf(),
            reason: reason.into(),
        }
    }

    /// A fault of a line.
    pub fn line(file: &Path, line: u64, reason: impl Into<String>) -> Self {
        Self::Line {
            file: file.to_path_buf(),
            line,
            reason: reason.into(),
        }
    }
}

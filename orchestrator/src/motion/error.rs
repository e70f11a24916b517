//! What can be wrong with a ground motion.

use std::path::PathBuf;

use thiserror::Error;

use crate::units::{INCH, UnitError};

/// Why a motion cannot be played. Every message names the file and, where there is one, the place.
#[derive(Debug, Error)]
pub enum MotionError {
    /// The file cannot be opened or read.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The operating system's word, or what stands in the file instead of text.
        reason: String,
    },
    /// The file is there and holds nothing.
    #[error("{}: the file is empty", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The file as a whole is not what was expected.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// One line is not what was expected.
    #[error("{}, line {line}: {reason}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A field is not a finite number.
    #[error("{}, line {line}, column {column}: \"{text}\" is not a finite number", path.display())]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// The column (field of the line), counted from 1.
        column: usize,
        /// What stands there.
        text: String,
    },
    /// Fewer points than the header announces.
    #[error("{}: truncated: {found} of {announced} points, {} missing", path.display(), announced - found)]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Points in the file.
        found: usize,
        /// Points announced.
        announced: usize,
    },
    /// A header cell whose unit cannot be used.
    #[error("{}, line {line}, column {column} (`{name}`): {source}", path.display())]
    Unit {
        /// The file.
        path: PathBuf,
        /// The line of the header, counted from 1.
        line: usize,
        /// The column, counted from 1.
        column: usize,
        /// The name in the header.
        name: String,
        /// What is wrong with the unit.
        source: Box<UnitError>,
    },
    /// The motion needs more stroke than there is.
    #[error(
        "{name}: the peak displacement {} in exceeds the stroke of {} in by {} in; \
         a scale of at most {fitting_scale} fits (--scale {fitting_scale})",
        inches(*peak), inches(*stroke), inches(peak - stroke)
    )]
    Stroke {
        /// The motion.
        name: String,
        /// Peak displacement, m.
        peak: f64,
        /// Stroke available to either side, m.
        stroke: f64,
        /// The largest `--scale` that fits, rounded down.
        fitting_scale: f64,
    },
    /// An option makes no sense, or the motion cannot be scaled as asked.
    #[error("{name}: {reason}")]
    Option {
        /// The motion.
        name: String,
        /// What is wrong and what was expected.
        reason: String,
    },
}

/// Inches with at most four decimals.
fn inches(metres: f64) -> String {
    let text = format!("{:.4}", metres / INCH);
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

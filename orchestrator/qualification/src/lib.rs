//! Seismic qualification: required response spectra, motions that fit them, and what a record shows
//! against them.
//!
//! A [`Rule`] is data with its source: required spectrum, damping, band, grid, tolerance, duration. [`verdict`]
//! compares a record with it. [`matching`] makes a motion of noise or of a record, and [`resonance`] finds
//! resonances with their intervals. Nothing here knows a rig or an FMU.
//!
//! A verdict states that a test response spectrum lies within the bounds of a rule, computed so. It is not a
//! certificate.

mod file;
pub mod matching;
mod record;
pub mod resonance;
mod rule;
pub mod verdict;
mod wavelets;

pub use file::load;
pub use record::doubts;
pub use rule::{Interpolation, Point, Rule, Search, grid};
pub use verdict::{Ratio, Verdict, ratios};

use std::path::PathBuf;

/// What is wrong with a rule, a record or a motion that is asked for.
#[derive(Debug, thiserror::Error)]
pub enum QualificationError {
    /// A rule, or the setting of one.
    #[error("{rule}: {reason}")]
    Rule {
        /// The rule or its file, with the place.
        rule: String,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A record that a rule cannot be computed for.
    #[error("{record}: {reason}")]
    Record {
        /// The record.
        record: String,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A file that cannot be read.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A sheet that cannot be read.
    #[error(transparent)]
    Data(#[from] recordings::DataError),
}

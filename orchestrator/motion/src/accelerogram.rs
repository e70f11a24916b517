//! A record of ground acceleration, as read.

use std::path::{Path, PathBuf};

/// An accelerogram: evenly sampled ground acceleration, not processed.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Short name: the stem of the file.
    pub name: String,
    /// Sample time, s.
    pub dt: f64,
    /// Acceleration, m/s^2.
    pub acceleration: Vec<f64>,
    /// Where it comes from, for people.
    pub origin: String,
    /// The seed, when it was generated.
    pub seed: Option<u64>,
}

/// The stem of a file name.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(
        || "motion".to_string(),
        |stem| stem.to_string_lossy().into(),
    )
}

/// The last part of a path, for people.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(
        || PathBuf::from(path).display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}

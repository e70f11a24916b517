//! Motions from a file, or built in.

use std::path::Path;

use super::clough_penzien::CloughPenzien;
use super::error::MotionError;
use super::options::Options;
use super::playable::Motion;
use super::process::process;
use super::record::read_record;

/// Reads a record (`.AT2`, or CSV) and processes it into a motion.
///
/// # Errors
/// A file that cannot be read (with file, line and column), or a motion beyond the stroke.
pub fn load(path: &Path, options: &Options) -> Result<Motion, MotionError> {
    process(&read_record(path)?, options)
}

/// The built-in motion: a synthetic Clough-Penzien record, processed as any other.
///
/// # Errors
/// Options that make no sense, or a motion beyond the stroke.
pub fn built_in(seed: u64, options: &Options) -> Result<Motion, MotionError> {
    process(&CloughPenzien::default().record(seed), options)
}

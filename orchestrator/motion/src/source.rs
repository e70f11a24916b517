//! Motions from a file, or built in.

use std::path::Path;

use super::clough_penzien::CloughPenzien;
use super::error::MotionError;
use super::options::Options;
use super::playable::Motion;
use super::process::Unscaled;
use super::record::read_record;

/// Reads a record (`.AT2`, or CSV) and processes it into a motion.
///
/// # Errors
/// A file that cannot be read (with file, line and column), or a motion beyond the stroke.
pub fn load(path: &Path, options: &Options) -> Result<Motion, MotionError> {
    load_unscaled(path, options)?.scaled(options)
}

/// As [`load`], to be played at any scale.
///
/// # Errors
/// A file that cannot be read, with file, line and column.
pub fn load_unscaled(path: &Path, options: &Options) -> Result<Unscaled, MotionError> {
    Unscaled::new(&read_record(path)?, options)
}

/// The built-in motion: a synthetic Clough-Penzien record, processed as any other.
///
/// # Errors
/// Options that make no sense, or a motion beyond the stroke.
pub fn built_in(seed: u64, options: &Options) -> Result<Motion, MotionError> {
    built_in_unscaled(seed, options)?.scaled(options)
}

/// As [`built_in`], to be played at any scale.
///
/// # Errors
/// Options that make no sense.
pub fn built_in_unscaled(seed: u64, options: &Options) -> Result<Unscaled, MotionError> {
    Unscaled::new(&CloughPenzien::default().record(seed), options)
}

//! Ground motions: what the table is asked to do.
//!
//! A *record* is an acceleration only (PEER AT2, or CSV) and is processed into a motion the table
//! can play ([`load`]); a *reference* gives displacement, velocity and acceleration and is used to
//! the letter ([`load_reference`]); [`built_in`] is a synthetic record for when nothing is at hand.

mod at2;
mod clough_penzien;
mod csv_file;
mod error;
mod process;
mod record;
mod reference;

use std::path::Path;

pub use clough_penzien::{CloughPenzien, DEFAULT_SEED};
pub use error::MotionError;
pub use process::process;
pub use record::{Record, read_record};
pub use reference::load_reference;

use crate::units::{INCH, STANDARD_GRAVITY};

/// A motion sampled as the controllers are, SI units, all three histories of equal length.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Short name, for tables and file names' sake the stem of the file.
    pub name: String,
    /// Sample time, s.
    pub dt: f64,
    /// Displacement, m.
    pub displacement: Vec<f64>,
    /// Velocity, m/s.
    pub velocity: Vec<f64>,
    /// Acceleration, m/s^2.
    pub acceleration: Vec<f64>,
    /// What was done to the record, one line a step, for people.
    pub notes: Vec<String>,
    /// The seed, when the motion was generated.
    pub seed: Option<u64>,
}

impl Motion {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.displacement.len()
    }

    /// Whether there is no sample at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.displacement.is_empty()
    }

    /// Time from the first to the last sample, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.len().saturating_sub(1) as f64 * self.dt
    }

    /// Largest absolute acceleration, m/s^2.
    #[must_use]
    pub fn peak_acceleration(&self) -> f64 {
        peak(&self.acceleration)
    }

    /// Largest absolute velocity, m/s.
    #[must_use]
    pub fn peak_velocity(&self) -> f64 {
        peak(&self.velocity)
    }

    /// Largest absolute displacement, m.
    #[must_use]
    pub fn peak_displacement(&self) -> f64 {
        peak(&self.displacement)
    }
}

/// How large a motion is played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scaling {
    /// The largest scale that keeps both peaks within these limits.
    Within {
        /// Acceleration, m/s^2.
        acceleration: f64,
        /// Displacement, m.
        displacement: f64,
    },
    /// A factor on the processed record (or on a reference).
    Factor(f64),
    /// Peak acceleration, m/s^2.
    PeakAcceleration(f64),
    /// Peak displacement, m.
    PeakDisplacement(f64),
}

/// How a record becomes a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Sample time of the controllers, s.
    pub sample_time: f64,
    /// Lower and upper corner of the band kept, Hz.
    pub band_hz: [f64; 2],
    /// Length of the taper at either end, s.
    pub taper: f64,
    /// How large the motion is played; none: records to the smaller of 0.3 g and 1.2 in,
    /// references to the letter.
    pub scaling: Option<Scaling>,
    /// Stroke to either side, m.
    pub stroke: f64,
}

impl Options {
    /// What a record is scaled to when nothing is said: the smaller of 0.3 g and 1.2 in.
    pub const DEFAULT_SCALING: Scaling = Scaling::Within {
        acceleration: 0.3 * STANDARD_GRAVITY,
        displacement: 1.2 * INCH,
    };
}

impl Default for Options {
    fn default() -> Self {
        Self {
            sample_time: 0.002,
            band_hz: [0.25, 20.0],
            taper: 2.0,
            scaling: None,
            stroke: 1.5 * INCH,
        }
    }
}

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

/// Largest absolute value, 0 for none.
pub(crate) fn peak(values: &[f64]) -> f64 {
    values
        .iter()
        .fold(0.0, |largest, value| value.abs().max(largest))
}

#[cfg(test)]
mod tests;

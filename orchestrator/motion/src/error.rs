//! What can be wrong with a ground motion.

use std::path::PathBuf;

use recordings::DataError;
use thiserror::Error;

use units::INCH;

/// Why a motion cannot be played. Every message names the file and, where there is one, the place.
#[derive(Debug, Error)]
pub enum MotionError {
    /// The file is missing, or is not what was expected.
    #[error(transparent)]
    Data(#[from] DataError),
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

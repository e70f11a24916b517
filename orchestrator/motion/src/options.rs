//! How a record becomes a motion.

use serde::{Deserialize, Serialize};

use units::{INCH, STANDARD_GRAVITY};

/// How large a motion is played.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
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
    /// references as given.
    pub scaling: Option<Scaling>,
    /// Stroke to either side, m.
    pub stroke: f64,
}

impl Options {
    /// What a record is scaled to by default: the smaller of 0.3 g and 1.2 in.
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

//! How each axis of a table with two of them followed its own motion.

use serde::{Deserialize, Serialize};

use super::table::Table;
use fmi_master::Record;
use fmi_system::Link;
use motion::Motion;
use motion::metrics::{self, Tracking, rms};
use units::STANDARD_GRAVITY;

use super::summary::MotionSummary;

/// Names of the axes in the order of the reference.
pub const NAMES: [&str; 2] = ["x", "y"];

/// What an axis was asked for and what it did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// `x` or `y`.
    pub axis: String,
    /// What was played along it.
    pub motion: MotionSummary,
    /// How well it followed; absent for an axis at rest, and where the run was stopped.
    pub tracking: Option<Tracking>,
    /// The motion of an axis that was to rest while the other one moved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_rest: Option<CrossMotion>,
}

/// Motion of an axis that was to rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CrossMotion {
    /// RMS of its displacement over the peak of the other axis' reference, %.
    pub displacement_percent: f64,
    /// RMS of its acceleration over the peak of the other axis' reference, %.
    pub acceleration_percent: f64,
    /// Its largest displacement, m.
    pub peak_displacement_m: f64,
    /// Its largest acceleration, m/s².
    pub peak_acceleration_m_s2: f64,
}

/// The tables of both axes; none of a system with a single one.
pub fn tables<'a>(
    names: impl Iterator<Item = &'a str> + Clone,
    connections: &[Link],
    record: &Record,
) -> Option<[Table<'a>; 2]> {
    let second = Table::second(names.clone(), connections, record)?;
    Some([Table::among(names, connections, record)?, second])
}

/// The motions along both axes.
pub fn motions(motion: &Motion) -> Option<[&Motion; 2]> {
    Some([motion, motion.across.as_deref()?])
}

/// The figures of both axes; empty for a system with a single one. Without `is_measured`, of a run that was stopped or
/// thinned, there are only motions and peaks.
pub fn measure(
    tables: Option<&[Table<'_>; 2]>,
    motion: &Motion,
    record: &Record,
    is_measured: bool,
) -> Vec<Axis> {
    let (Some(tables), Some(motions)) = (tables, motions(motion)) else {
        return Vec::new();
    };
    let column = |axis: usize, output| record.column(&tables[axis].name(output));
    let one = |axis: usize| {
        let (own, other) = (motions[axis], motions[1 - axis]);
        let is_still = own.peak_acceleration() == 0.0;
        let histories = column(axis, "displacement").zip(column(axis, "acceleration"));
        let histories = histories.filter(|_| is_measured);
        let tracking = histories.as_ref().filter(|_| !is_still);
        let cross = histories.as_ref().filter(|_| is_still);
        Axis {
            axis: NAMES[axis].to_string(),
            motion: MotionSummary::of(own),
            tracking: tracking.and_then(|(x, a)| metrics::tracking(own, x, a).ok()),
            at_rest: cross.and_then(|(x, a)| CrossMotion::new(x, a, other)),
        }
    };
    vec![one(0), one(1)]
}

impl CrossMotion {
    /// Of an axis at rest while the other one was to follow `other`; none where that rested too.
    fn new(displacement: &[f64], acceleration: &[f64], other: &Motion) -> Option<Self> {
        let played = acceleration.len().min(other.len());
        let peaks =
            [&other.displacement, &other.acceleration].map(|all| motion::peak(&all[..played]));
        peaks.iter().all(|peak| *peak > 0.0).then(|| Self {
            displacement_percent: 100.0 * rms(displacement) / peaks[0],
            acceleration_percent: 100.0 * rms(acceleration) / peaks[1],
            peak_displacement_m: motion::peak(displacement),
            peak_acceleration_m_s2: motion::peak(acceleration),
        })
    }
}

impl MotionSummary {
    /// Its name, length and peaks.
    pub fn of(motion: &Motion) -> Self {
        Self {
            name: motion.name.clone(),
            duration_s: motion.duration(),
            pga_g: motion.peak_acceleration() / STANDARD_GRAVITY,
            peak_displacement_m: motion.peak_displacement(),
        }
    }
}

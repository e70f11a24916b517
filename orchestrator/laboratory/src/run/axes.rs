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

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(name: &str, displacement: &[f64], acceleration: &[f64]) -> Motion {
        Motion {
            name: name.into(),
            dt: 0.5,
            displacement: displacement.to_vec(),
            velocity: vec![0.0; displacement.len()],
            acceleration: acceleration.to_vec(),
            notes: Vec::new(),
            seed: None,
            across: None,
        }
    }

    #[test]
    fn an_axis_at_rest_is_measured_by_the_peaks_of_the_other() {
        let wanted = motion("wave", &[0.0, -0.2, 0.1, 9.0], &[0.0, 4.0, -5.0, 9.0]);
        let cross = CrossMotion::new(&[0.01, -0.01, 0.01], &[0.3, 0.4, 0.0], &wanted).unwrap();
        // Of the reference only what was played counts.
        assert!((cross.displacement_percent - 5.0).abs() < 1e-9, "{cross:?}");
        let rms = (0.25_f64 / 3.0).sqrt();
        assert!(
            (cross.acceleration_percent - 100.0 * rms / 5.0).abs() < 1e-9,
            "{cross:?}"
        );
        assert_eq!(
            (cross.peak_displacement_m, cross.peak_acceleration_m_s2),
            (0.01, 0.4)
        );
        let rest = motion("rest", &[0.0; 4], &[0.0; 4]);
        assert!(CrossMotion::new(&[0.1], &[0.1], &rest).is_none());
        let summary = MotionSummary::of(&wanted);
        assert_eq!(
            (
                &*summary.name,
                summary.duration_s,
                summary.peak_displacement_m
            ),
            ("wave", 1.5, 9.0)
        );
        assert!((summary.pga_g - 9.0 / STANDARD_GRAVITY).abs() < 1e-12);
    }

    #[test]
    fn both_axes_are_measured_where_the_run_was_whole() {
        let wave: Vec<f64> = (0..400).map(|n| (0.1 * f64::from(n)).sin()).collect();
        let still = vec![0.0; wave.len()];
        let both = motion("x", &wave, &wave).along_two_axes(motion("y", &still, &still));
        let links: Vec<Link> = [
            "reference.displacement -> control.u",
            "control.valve_command -> table.valve_command",
            "reference.displacement_y -> control_y.u",
            "control_y.valve_command -> table_y.valve_command",
        ]
        .map(|text| Link::try_from(text.to_string()).unwrap())
        .to_vec();
        let names = ["table", "table_y"];
        let columns = names.iter().flat_map(|name| {
            let outputs = ["displacement", "velocity", "acceleration"];
            outputs.map(|output| format!("{name}.{output}"))
        });
        let columns = std::iter::once("time".to_string()).chain(columns).collect();
        let mut record = Record::with_capacity(columns, wave.len());
        for (n, x) in wave.iter().enumerate() {
            record.push(
                0.5 * n as f64,
                &[0.9 * x, 0.0, 0.8 * x, 0.01, 0.0, 0.02],
                &[],
            );
        }
        let found = tables(names.into_iter(), &links, &record);
        let all = measure(found.as_ref(), &both, &record, true);
        let [x, y] = &all[..] else {
            panic!("{} axes", all.len())
        };
        assert_eq!(
            (&*x.axis, &*x.motion.name, &*y.axis, &*y.motion.name),
            ("x", "x", "y", "y")
        );
        assert!(x.at_rest.is_none() && y.tracking.is_none());
        let tracking = x.tracking.unwrap();
        // A fifth of the acceleration is missing.
        assert!(
            (tracking.peak_acceleration_error - 0.2 * tracking.peak_acceleration / 0.8).abs()
                < 1e-9
        );
        assert!((y.at_rest.unwrap().peak_displacement_m - 0.01).abs() < 1e-12);
        let all = measure(found.as_ref(), &both, &record, false);
        assert!(
            all.iter()
                .all(|own| own.tracking.is_none() && own.at_rest.is_none())
        );
        assert!(measure(None, &both, &record, true).is_empty());
        assert!(measure(found.as_ref(), &motion("x", &wave, &wave), &record, true).is_empty());
    }
}

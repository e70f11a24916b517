//! What a comparison finds.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::run::axes::Axis;
use fmi_master::Ending;

/// Runs of controllers on motions: `comparison.json`, and what `--json` prints.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Comparison {
    /// Plant of all runs.
    pub plant: String,
    /// Specimen of all runs.
    pub specimen: String,
    /// The runs, those of one controller together, motions in the same order.
    pub rows: Vec<Row>,
    /// Medians by controller.
    pub medians: BTreeMap<String, Median>,
}

/// A run of the comparison.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Row {
    /// Name of the motion.
    pub record: String,
    /// The built-in system.
    pub controller: String,
    /// Time-domain error of the acceleration, %.
    pub time_domain_percent: Option<f64>,
    /// Frequency-domain error of the acceleration, %.
    pub frequency_domain_percent: Option<f64>,
    /// Largest deviation of the response spectrum at 5 % damping from 0.5 to 15 Hz, %.
    #[serde(default)]
    pub response_spectrum_percent: Option<f64>,
    /// Time-domain error over the significant duration, %.
    #[serde(default)]
    pub significant_duration_percent: Option<f64>,
    /// Largest displacement of the table, m.
    pub peak_displacement_m: Option<f64>,
    /// The second axis of a table with two; the other errors are then those of the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along_y: Option<AlongY>,
    /// How it ended.
    pub ended: Ending,
    /// Why it ended early.
    pub ended_because: Option<String>,
    /// When it was stopped, s.
    pub ended_s: Option<f64>,
    /// For the plots, of the first motion only.
    #[serde(skip)]
    pub history: Option<History>,
}

/// Errors along the second axis; of an axis at rest there is its motion alone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AlongY {
    /// Time-domain error of the acceleration, %.
    pub time_domain_percent: Option<f64>,
    /// Frequency-domain error of the acceleration, %.
    pub frequency_domain_percent: Option<f64>,
    /// Largest deviation of the response spectrum at 5 % damping from 0.5 to 15 Hz, %.
    pub response_spectrum_percent: Option<f64>,
    /// Time-domain error over the significant duration, %.
    pub significant_duration_percent: Option<f64>,
    /// RMS acceleration of an axis that was to rest, over the peak of the other axis' reference, %.
    pub at_rest_percent: Option<f64>,
}

impl AlongY {
    pub(super) fn of(axis: &Axis) -> Self {
        let figures = axis.tracking.as_ref();
        let laboratory = figures.and_then(|own| own.laboratory.as_ref());
        Self {
            time_domain_percent: figures.map(|own| own.time_domain_percent),
            frequency_domain_percent: figures.map(|own| own.frequency_domain_percent),
            response_spectrum_percent: laboratory.map(|own| own.largest_spectrum_deviation()),
            significant_duration_percent: laboratory.map(|own| own.significant_duration_percent),
            at_rest_percent: axis.at_rest.map(|own| own.acceleration_percent),
        }
    }
}

/// Distance of the table from its reference, one value per sample.
#[derive(Debug, Clone)]
pub struct History {
    /// Sample time, s.
    pub dt: f64,
    /// m.
    pub displacement_error: Vec<f64>,
    /// m/s².
    pub acceleration_error: Vec<f64>,
}

/// What a controller reached over all motions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Median {
    /// Time-domain error, %; none where half of the runs ended early.
    pub time_domain_percent: Option<f64>,
    /// Frequency-domain error, %.
    pub frequency_domain_percent: Option<f64>,
    /// Largest deviation of the response spectrum, %.
    #[serde(default)]
    pub response_spectrum_percent: Option<f64>,
    /// Time-domain error over the significant duration, %.
    #[serde(default)]
    pub significant_duration_percent: Option<f64>,
    /// Medians along the second axis, of tables with two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along_y: Option<AlongY>,
    /// Runs that were stopped or failed; they count as worse than any other.
    pub ended_early: usize,
}

/// One of the errors of a run.
pub(super) type Measure = fn(&Row) -> Option<f64>;

impl Row {
    /// Whether it was played to its end.
    pub fn is_complete(&self) -> bool {
        self.ended == Ending::Complete
    }
}

impl Comparison {
    /// Of runs on one rig.
    pub fn new(plant: &str, specimen: &str, rows: Vec<Row>) -> Self {
        let mut comparison = Self {
            plant: plant.to_string(),
            specimen: specimen.to_string(),
            rows,
            medians: BTreeMap::new(),
        };
        comparison.medians = comparison.medians();
        comparison
    }

    /// The controllers in the order of their runs.
    pub fn controllers(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for row in &self.rows {
            if !names.contains(&row.controller.as_str()) {
                names.push(&row.controller);
            }
        }
        names
    }

    /// Whether any of the tables has two axes.
    pub fn is_biaxial(&self) -> bool {
        self.rows.iter().any(|row| row.along_y.is_some())
    }

    /// The runs that did not reach the end of their motion.
    pub fn ended_early(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| !row.is_complete())
    }

    fn medians(&self) -> BTreeMap<String, Median> {
        let rows = &self.rows;
        let of = |controller: &str, measure: Measure| median(&column(rows, controller, measure));
        let controllers = self.controllers().into_iter();
        controllers
            .map(|controller| {
                let own = self
                    .ended_early()
                    .filter(|row| row.controller == controller);
                let median = Median {
                    time_domain_percent: of(controller, |row| row.time_domain_percent),
                    frequency_domain_percent: of(controller, |row| row.frequency_domain_percent),
                    response_spectrum_percent: of(controller, |row| row.response_spectrum_percent),
                    significant_duration_percent: of(controller, |row| {
                        row.significant_duration_percent
                    }),
                    along_y: self.is_biaxial().then(|| AlongY {
                        time_domain_percent: of(controller, |row| row.along_y?.time_domain_percent),
                        frequency_domain_percent: of(controller, |row| {
                            row.along_y?.frequency_domain_percent
                        }),
                        response_spectrum_percent: of(controller, |row| {
                            row.along_y?.response_spectrum_percent
                        }),
                        significant_duration_percent: of(controller, |row| {
                            row.along_y?.significant_duration_percent
                        }),
                        at_rest_percent: of(controller, |row| row.along_y?.at_rest_percent),
                    }),
                    ended_early: own.count(),
                };
                (controller.to_string(), median)
            })
            .collect()
    }
}

/// Values of a controller; a run that ended early counts as infinitely bad.
pub(super) fn column(rows: &[Row], controller: &str, measure: Measure) -> Vec<f64> {
    let own = rows.iter().filter(|row| row.controller == controller);
    own.filter_map(|row| match row.is_complete() {
        true => measure(row),
        false => Some(f64::INFINITY),
    })
    .collect()
}

/// The middle value; none where it is infinite or there is none.
pub(super) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    let median = match sorted.len() {
        0 => return None,
        length if length % 2 == 1 => sorted[middle],
        _ => 0.5 * (sorted[middle - 1] + sorted[middle]),
    };
    median.is_finite().then_some(median)
}

/// Of a sample (over n - 1), as in Table 4-1; none where a run ended early.
pub(super) fn deviation(values: &[f64]) -> Option<f64> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let sum: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let variance = sum / (count - 1.0);
    (values.len() > 1 && variance.is_finite()).then(|| variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run with an error, and a second axis with an error twice as large; none of one that was stopped.
    fn row(controller: &str, error: Option<f64>, along_y: Option<f64>) -> Row {
        Row {
            record: "wave".into(),
            controller: controller.into(),
            time_domain_percent: error,
            frequency_domain_percent: error.map(|own| 10.0 * own),
            response_spectrum_percent: error.map(|own| 100.0 * own),
            significant_duration_percent: error.map(|own| own + 0.5),
            peak_displacement_m: None,
            along_y: along_y.map(|own| AlongY {
                time_domain_percent: Some(own),
                frequency_domain_percent: None,
                response_spectrum_percent: Some(2.0 * own),
                significant_duration_percent: Some(3.0 * own),
                at_rest_percent: Some(4.0 * own),
            }),
            ended: match error {
                Some(_) => Ending::Complete,
                None => Ending::Interlock,
            },
            ended_because: None,
            ended_s: None,
            history: None,
        }
    }

    #[test]
    fn medians_are_by_controller_and_a_stopped_run_is_worse_than_any() {
        let found = Comparison::new(
            "rig",
            "none",
            vec![
                row("b", Some(3.0), None),
                row("a", Some(7.0), None),
                row("b", None, None),
                row("a", Some(1.0), None),
                row("b", Some(1.0), None),
                row("c", None, None),
                row("c", Some(1.0), None),
            ],
        );
        assert_eq!(found.controllers(), ["b", "a", "c"]);
        assert_eq!(found.ended_early().count(), 2);
        assert!(!found.is_biaxial());
        let of = |controller: &str| &found.medians[controller];
        let median = |scale: Option<f64>, ended_early| Median {
            time_domain_percent: scale,
            frequency_domain_percent: scale.map(|own| 10.0 * own),
            response_spectrum_percent: scale.map(|own| 100.0 * own),
            significant_duration_percent: scale.map(|own| own + 0.5),
            along_y: None,
            ended_early,
        };
        // Of 1, 3 and the stopped one; of 1 and 7; of 1 and the stopped one.
        assert_eq!(*of("b"), median(Some(3.0), 1));
        assert_eq!(*of("a"), median(Some(4.0), 0));
        assert_eq!(*of("c"), median(None, 1));
    }

    #[test]
    fn a_second_axis_has_medians_of_its_own() {
        let rows = vec![
            row("a", Some(1.0), Some(2.0)),
            row("a", Some(1.0), Some(6.0)),
            row("a", Some(1.0), Some(3.0)),
        ];
        let found = Comparison::new("rig", "none", rows);
        assert!(found.is_biaxial());
        let expected = AlongY {
            time_domain_percent: Some(3.0),
            frequency_domain_percent: None,
            response_spectrum_percent: Some(6.0),
            significant_duration_percent: Some(9.0),
            at_rest_percent: Some(12.0),
        };
        assert_eq!(found.medians["a"].along_y, Some(expected));
    }

    /// As `statistics.median` and `statistics.stdev` of Python give them.
    #[test]
    fn median_and_deviation_are_those_of_a_sample() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[4.0]), Some(4.0));
        assert_eq!(median(&[5.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[5.0, 1.0, 2.0, 8.0]), Some(3.5));
        assert_eq!(median(&[1.0, f64::INFINITY]), None);
        let own = deviation(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap();
        assert!((own - 2.138_089_935_299_395).abs() < 1e-14, "{own}");
        assert_eq!(deviation(&[1.0, 3.0]), Some(2_f64.sqrt()));
        assert_eq!(deviation(&[1.0]), None);
        assert_eq!(deviation(&[1.0, f64::INFINITY]), None);
    }
}

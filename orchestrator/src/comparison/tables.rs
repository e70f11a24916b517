//! The tables of a comparison in the form of Table 4-1 and 5-2, the printed values beside ours.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::errors as compare_errors;
use crate::cli::compare::{History, Row};
use crate::error::Error;
use crate::report::columns::aligned;
use crate::report::{self, Axis, Cell, Panel, Report, Section, Series, Units};
use crate::results::Results;

/// A record of the thesis: how a file of it is recognised, its title, and the printed errors, loop
/// shaping, sliding mode (Table 4-1) and model predictive control (Table 5-2), in frequency and
/// in time.
struct Printed {
    file: &'static str,
    title: &'static str,
    frequency: [f64; 3],
    time: [f64; 3],
}

const fn printed(
    file: &'static str,
    title: &'static str,
    frequency: [f64; 3],
    time: [f64; 3],
) -> Printed {
    Printed {
        file,
        title,
        frequency,
        time,
    }
}

const CONTROLLERS: [&str; 3] = ["loop-shaping", "sliding-mode", "mpc"];

/// Table 4-1 and 5-2.
const PRINTED: [Printed; 8] = [
    printed(
        "nahanni",
        "Nahanni, Canada (1985)",
        [0.51, 0.50, 0.11],
        [7.68, 6.86, 2.34],
    ),
    printed(
        "coalinga",
        "Coalinga, USA (1983)",
        [0.63, 0.54, 0.24],
        [12.73, 12.93, 5.99],
    ),
    printed(
        "kobe",
        "Kobe, Japan (1995)",
        [0.44, 0.39, 0.14],
        [17.43, 15.19, 4.73],
    ),
    printed(
        "morgan",
        "Morgan Hill, USA (1984)",
        [0.53, 0.50, 0.15],
        [7.60, 9.38, 4.79],
    ),
    printed(
        "northridge",
        "Northridge, USA (1994)",
        [0.63, 0.73, 0.10],
        [11.31, 11.09, 3.22],
    ),
    printed(
        "friuli",
        "Friuli, Italy (1976), stand-in for Irpinia, Italy (1980)",
        [0.67, 0.42, 0.23],
        [14.98, 9.93, 7.05],
    ),
    printed(
        "manjil",
        "Manjil, Iran (1990)",
        [1.49, 1.06, 0.31],
        [20.59, 20.23, 8.62],
    ),
    printed(
        "imperial",
        "Imperial Valley, US (1979)",
        [2.21, 1.61, 0.24],
        [13.64, 10.31, 3.89],
    ),
];

/// Median and standard deviation as printed, in frequency and in time. The median of loop shaping in
/// frequency, 0.65 there, is a misprint: the eight values give 0.63.
const PRINTED_FREQUENCY: [[f64; 3]; 2] = [[0.65, 0.52, 0.19], [0.62, 0.42, 0.08]];
const PRINTED_TIME: [[f64; 3]; 2] = [[13.19, 10.70, 4.76], [4.49, 4.14, 2.06]];

/// File with the errors by run.
pub(crate) const COMPARISON: &str = "comparison.json";

/// A table as words.
pub(crate) struct Words {
    caption: String,
    rows: Vec<Vec<String>>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Median {
    time_domain_percent: Option<f64>,
    frequency_domain_percent: Option<f64>,
    /// Runs that were stopped or failed; they count as worse than any other.
    ended_early: usize,
}

type Measure = fn(&Row) -> Option<f64>;

/// Medians of each controller over the motions; none where half of the runs ended early.
pub(crate) fn medians(rows: &[Row], controllers: &[String]) -> BTreeMap<String, Median> {
    let of = |controller: &str, measure: Measure| median(&column(rows, controller, measure));
    controllers
        .iter()
        .map(|controller| {
            let median = Median {
                time_domain_percent: of(controller, |row| row.time_domain_percent),
                frequency_domain_percent: of(controller, |row| row.frequency_domain_percent),
                ended_early: ended_early(rows, controller),
            };
            (controller.clone(), median)
        })
        .collect()
}

/// Errors in time and in frequency, a row for each motion, then median and standard deviation.
pub(crate) fn tables(rows: &[Row], controllers: &[String]) -> [Words; 2] {
    [
        words(
            "Error in time, % (printed values of Table 4-1 and 5-2 in brackets)",
            rows,
            controllers,
            |row| row.time_domain_percent,
            |printed| printed.time,
            PRINTED_TIME,
        ),
        words(
            "Error in frequency, % (printed values in brackets; their scaling is not given, and the \
             printed median 0.65 should be 0.63)",
            rows,
            controllers,
            |row| row.frequency_domain_percent,
            |printed| printed.frequency,
            PRINTED_FREQUENCY,
        ),
    ]
}

fn words(
    caption: &str,
    rows: &[Row],
    controllers: &[String],
    measure: Measure,
    values: fn(&Printed) -> [f64; 3],
    [medians, deviations]: [[f64; 3]; 2],
) -> Words {
    let place = |controller: &str| CONTROLLERS.iter().position(|known| *known == controller);
    let cell = |ours: Option<f64>, theirs: Option<f64>| {
        let ours = ours.map_or("-".to_string(), |value| format!("{value:.3}"));
        theirs.map_or(ours.clone(), |value| format!("{ours} [{value:.2}]"))
    };
    let mut records: Vec<&str> = Vec::new();
    for row in rows {
        if !records.contains(&row.record.as_str()) {
            records.push(&row.record);
        }
    }
    let mut head = vec!["motion".to_string()];
    head.extend(controllers.iter().cloned());
    let mut lines = vec![head];
    for record in &records {
        let known = known(record);
        let mut line = vec![known.map_or(*record, |printed| printed.title).to_string()];
        for controller in controllers {
            let mut ours = rows
                .iter()
                .filter(|r| r.record == *record && r.controller == *controller);
            let theirs = known
                .zip(place(controller))
                .map(|(printed, at)| values(printed)[at]);
            let ours = ours.next();
            line.push(match ours {
                Some(row) if !row.is_complete() => match row.ended_s {
                    Some(time) => format!("stopped at {time:.1} s"),
                    None => "failed".to_string(),
                },
                _ => cell(ours.and_then(measure), theirs),
            });
        }
        lines.push(line);
    }
    // The printed statistics are those of the eight printed values.
    let all = PRINTED.iter().all(|printed| {
        records
            .iter()
            .any(|record| known(record).is_some_and(|found| found.title == printed.title))
    });
    for (name, statistic, printed) in [
        ("Median", median as fn(&[f64]) -> Option<f64>, medians),
        ("Standard deviation", deviation, deviations),
    ] {
        let mut line = vec![name.to_string()];
        for controller in controllers {
            let theirs = place(controller).filter(|_| all).map(|at| printed[at]);
            line.push(cell(statistic(&column(rows, controller, measure)), theirs));
        }
        lines.push(line);
    }
    Words {
        caption: caption.to_string(),
        rows: lines,
    }
}

impl Words {
    /// For the terminal.
    pub(crate) fn text(&self) -> String {
        format!("{}\n{}", self.caption, aligned(&self.rows))
    }

    fn table(&self) -> report::Table {
        let mut rows = self.rows.iter();
        report::Table {
            caption: self.caption.clone(),
            columns: rows.next().cloned().unwrap_or_default(),
            rows: rows
                .map(|row| row.iter().cloned().map(Cell::Text).collect())
                .collect(),
        }
    }
}

/// Writes `report.html`, `comparison.json` and `errors.csv`; says where.
pub(crate) fn write(
    folder: &Path,
    rows: &[Row],
    controllers: &[String],
    json: &serde_json::Value,
) -> Result<Vec<PathBuf>, Error> {
    let page = page(folder, rows, controllers)?;
    let mut results = Results::begin(folder)?;
    results.write_text("report.html", &page)?;
    results.write_text(COMPARISON, &json.to_string())?;
    results.write_text(compare_errors::FILE, &compare_errors::written(rows))?;
    Ok(results.finish()?)
}

fn page(folder: &Path, rows: &[Row], controllers: &[String]) -> Result<String, Error> {
    let report = Report {
        title: "Comparison of controllers".into(),
        summary: format!("{} runs of {}.", rows.len(), controllers.join(", ")),
        sections: vec![Section {
            heading: "Tracking errors".into(),
            text: vec![
                "100 rms of the acceleration error over the largest reference acceleration; in \
                 frequency, of the difference of the Fourier amplitudes up to 25 Hz."
                    .into(),
            ],
            tables: tables(rows, controllers).iter().map(Words::table).collect(),
            notes: early(rows),
            panels: panels(rows),
            ..Section::default()
        }],
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
        ..Report::default()
    };
    report::html(&report).map_err(|error| Error::File {
        path: folder.to_path_buf(),
        reason: error.to_string(),
    })
}

/// The report of the comparison whose files lie in `folder`; without `errors.csv` it has no plots.
///
/// # Errors
/// A file that cannot be read or is none of a comparison.
pub(crate) fn page_again(folder: &Path) -> Result<String, Error> {
    #[derive(Deserialize)]
    struct Comparison {
        rows: Vec<Row>,
    }
    let path = folder.join(COMPARISON);
    let fault = |reason: String| Error::File {
        path: path.clone(),
        reason,
    };
    let text = std::fs::read_to_string(&path).map_err(|error| fault(error.to_string()))?;
    let Comparison { mut rows } = serde_json::from_str(&text)
        .map_err(|error| fault(format!("not the JSON of a comparison: {error}")))?;
    let mut controllers: Vec<String> = Vec::new();
    for row in &rows {
        if !controllers.contains(&row.controller) {
            controllers.push(row.controller.clone());
        }
    }
    let plots = folder.join(compare_errors::FILE);
    if plots.is_file() {
        for controller in &controllers {
            let history = compare_errors::read(&plots, controller)?;
            let mut own = rows.iter_mut().filter(|row| row.controller == *controller);
            if let Some(first) = own.next() {
                first.history = history;
            }
        }
    }
    page(folder, &rows, &controllers)
}

/// A line for each run that ended early.
fn early(rows: &[Row]) -> Vec<String> {
    let early = rows.iter().filter(|row| !row.is_complete());
    early
        .map(|row| {
            format!(
                "{} on {} ended early and counts as worse than any other: {}",
                row.controller,
                row.record,
                row.ended_because.as_deref().unwrap_or(&row.ended)
            )
        })
        .collect()
}

/// Errors over time on the first motion, a line for each controller.
fn panels(rows: &[Row]) -> Vec<Panel> {
    let kept: Vec<(&Row, &History)> = rows
        .iter()
        .filter_map(|row| Some((row, row.history.as_ref()?)))
        .collect();
    let Some((first, _)) = kept.first() else {
        return Vec::new();
    };
    let panel = |what: &str, units: Units, values: fn(&History) -> &[f64]| Panel {
        title: format!("{what} error on {}", first.record),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear("table less reference", units),
        series: kept
            .iter()
            .map(|(row, history)| Series::history(&row.controller, history.dt, values(history)))
            .collect(),
    };
    vec![
        panel("Displacement", Units::DISPLACEMENT, |h| {
            &h.displacement_error
        }),
        panel("Acceleration", Units::ACCELERATION, |h| {
            &h.acceleration_error
        }),
    ]
}

fn known(record: &str) -> Option<&'static Printed> {
    let name = record.to_lowercase();
    PRINTED.iter().find(|printed| name.contains(printed.file))
}

/// Values of a controller; a run that ended early counts as infinitely bad.
fn column(rows: &[Row], controller: &str, measure: Measure) -> Vec<f64> {
    let own = rows.iter().filter(|row| row.controller == controller);
    own.filter_map(|row| match row.is_complete() {
        true => measure(row),
        false => Some(f64::INFINITY),
    })
    .collect()
}

fn ended_early(rows: &[Row], controller: &str) -> usize {
    let own = rows.iter().filter(|row| row.controller == controller);
    own.filter(|row| !row.is_complete()).count()
}

fn median(values: &[f64]) -> Option<f64> {
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
fn deviation(values: &[f64]) -> Option<f64> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let sum: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let variance = sum / (count - 1.0);
    (values.len() > 1 && variance.is_finite()).then(|| variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_values_have_the_printed_medians_and_deviations() {
        let of = |at: usize| -> Vec<f64> { PRINTED.iter().map(|p| p.time[at]).collect() };
        for at in 0..3 {
            let [middle, spread] = PRINTED_TIME.map(|row| row[at]);
            assert!((median(&of(at)).unwrap() - middle).abs() < 0.0051, "{at}");
            assert!((deviation(&of(at)).unwrap() - spread).abs() < 0.006, "{at}");
        }
        let frequency: Vec<f64> = PRINTED.iter().map(|p| p.frequency[0]).collect();
        assert!((median(&frequency).unwrap() - 0.63).abs() < 1e-9);
    }

    #[test]
    fn runs_that_ended_early_count_as_worse_than_any_other() {
        let row = |percent: f64, ended: &str| Row {
            record: "any".into(),
            controller: "mpc".into(),
            time_domain_percent: Some(percent),
            frequency_domain_percent: Some(percent),
            peak_displacement_m: None,
            ended: ended.into(),
            ended_because: None,
            ended_s: Some(3.21),
            history: None,
        };
        let mut rows = vec![
            row(0.1, "interlock"),
            row(2.0, "complete"),
            row(3.0, "complete"),
        ];
        let controllers = ["mpc".to_string()];
        let median = |rows: &[Row]| medians(rows, &controllers)["mpc"].time_domain_percent;
        assert_eq!(median(&rows), Some(3.0));
        assert!(
            tables(&rows, &controllers)[0]
                .text()
                .contains("stopped at 3.2 s")
        );
        rows[1].ended = "failed".into();
        assert_eq!(median(&rows), None);
        assert_eq!(medians(&rows, &controllers)["mpc"].ended_early, 2);
    }

    #[test]
    fn a_stand_in_is_labelled() {
        let title = known("Friuli_Italy_1976_TMZ-000").unwrap().title;
        assert!(title.contains("stand-in for Irpinia"));
        assert!(known("synthetic-1").is_none());
    }
}

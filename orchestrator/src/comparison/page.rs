//! The files of a comparison.

use std::path::{Path, PathBuf};

use super::errors;
use super::result::{Comparison, History, Row};
use super::tables::{ErrorTable, tables};
use crate::error::Error;
use crate::report::{self, Axis, Panel, Report, Section, Series, Units};
use crate::results::Results;

/// File with the errors by run.
pub const COMPARISON: &str = "comparison.json";

/// Writes `report.html`, `comparison.json` and `errors.csv`; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(comparison: &Comparison, folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let page = page(comparison, folder)?;
    let mut results = Results::begin(folder)?;
    results.write_text("report.html", &page)?;
    results.write_text(COMPARISON, &serde_json::json!(comparison).to_string())?;
    results.write_text(errors::FILE, &errors::written(&comparison.rows))?;
    Ok(results.finish()?)
}

fn page(comparison: &Comparison, folder: &Path) -> Result<String, Error> {
    let rows = &comparison.rows;
    let report = Report {
        title: "Comparison of controllers".into(),
        summary: format!(
            "{} runs of {}.",
            rows.len(),
            comparison.controllers().join(", ")
        ),
        sections: vec![Section {
            heading: "Tracking errors".into(),
            text: vec![
                "100 rms of the acceleration error over the largest reference acceleration; in \
                 frequency, of the difference of the Fourier amplitudes up to 25 Hz."
                    .into(),
            ],
            tables: tables(comparison)
                .iter()
                .map(ErrorTable::report_table)
                .collect(),
            notes: early(comparison),
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
pub fn page_again(folder: &Path) -> Result<String, Error> {
    let path = folder.join(COMPARISON);
    let fault = |reason: String| Error::File {
        path: path.clone(),
        reason,
    };
    let text = std::fs::read_to_string(&path).map_err(|error| fault(error.to_string()))?;
    let mut comparison: Comparison = serde_json::from_str(&text)
        .map_err(|error| fault(format!("not the JSON of a comparison: {error}")))?;
    let plots = folder.join(errors::FILE);
    if plots.is_file() {
        let controllers = comparison.controllers().into_iter().map(String::from);
        for controller in controllers.collect::<Vec<_>>() {
            let history = errors::read(&plots, &controller)?;
            let mut rows = comparison.rows.iter_mut();
            if let Some(first) = rows.find(|row| row.controller == controller) {
                first.history = history;
            }
        }
    }
    page(&comparison, folder)
}

/// A line for each run that ended early.
fn early(comparison: &Comparison) -> Vec<String> {
    comparison
        .ended_early()
        .map(|row| {
            format!(
                "{} on {} ended early and counts as worse than any other: {}",
                row.controller,
                row.record,
                row.ended_because.as_deref().unwrap_or(row.ended.word())
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

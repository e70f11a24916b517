//! The files of an iteration.

use std::path::{Path, PathBuf};

use super::{Iteration, drive};
use crate::error::Error;
use crate::report::{self, Axis, Cell, Panel, Report, Section, Series, Table, Units};
use crate::results::Results;

/// File with the figures by run.
pub const ITERATION: &str = "iteration.json";
/// The best drive.
const DRIVE: &str = "drive.csv";

/// Writes `report.html`, `iteration.json` and `drive.csv`; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(iteration: &Iteration, folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let page = report::render(&page(iteration), &folder.join(report::FILE))?;
    let mut results = Results::begin(folder)?;
    results.write_text(report::FILE, &page)?;
    results.write_text(
        ITERATION,
        &(serde_json::json!(iteration).to_string() + "\n"),
    )?;
    if let Some(best) = &iteration.drive {
        results.write_text(DRIVE, &drive::text(best))?;
    }
    Ok(results.finish()?)
}

fn page(iteration: &Iteration) -> Report {
    let percent = |value: Option<f64>| {
        value.map_or("-".into(), |value| Cell::Quantity(value, Units::PERCENT, 3))
    };
    let rows = iteration.runs.iter().map(|run| {
        [
            Cell::Number(run.iteration as f64, 2),
            percent(run.measured_percent),
            percent(run.time_domain_percent),
            percent(run.frequency_domain_percent),
            percent(run.response_spectrum_percent),
            Cell::Number(run.exposure, 3),
            run.ended_because
                .as_deref()
                .unwrap_or(run.ended.word())
                .into(),
        ]
    });
    let errors = iteration.errors.iter().map(|(dt, first, best)| Panel {
        title: "Acceleration error".into(),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear("table less reference", Units::ACCELERATION),
        series: vec![
            Series::history("first run", *dt, first),
            Series::history("best run", *dt, best),
        ],
    });
    Report {
        title: format!(
            "Iterative control: {} on {}",
            iteration.system, iteration.motion
        ),
        summary: format!(
            "{} runs; {}. Mean coherence of the transfer function {:.3}.",
            iteration.runs.len(),
            iteration.stop.sentence(),
            iteration.coherence
        ),
        sections: vec![Section {
            heading: "Runs".into(),
            text: vec![
                "The drive of each run is that of the best before, corrected by the inverse of the \
                 measured transfer function times its coherence. The measured error is what the \
                 sensors show within the band; the others are the table's own. Exposure is the \
                 energy of all runs on the specimen over that of the motion played once."
                    .into(),
            ],
            tables: vec![Table::of(
                &format!(
                    "The best run is {}; its drive is in {DRIVE}.",
                    iteration.best
                ),
                [
                    "corrections",
                    "measured error",
                    "RMS acceleration error",
                    "Fourier amplitude error",
                    "response spectrum",
                    "exposure",
                    "ended",
                ],
                rows,
            )],
            panels: errors.collect(),
            ..Section::default()
        }],
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
        ..Report::default()
    }
}

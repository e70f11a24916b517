//! The files of a comparison.

use std::path::{Path, PathBuf};

use super::errors;
use super::result::{Comparison, History, Measure, Row};
use super::tables::{ErrorTable, tables};
use crate::error::Error;
use crate::json;
use crate::results::{Out, Results};
use pages::report::{
    self, Axis, Bar, BarGroup, Bars, Panel, Report, Section, Series, Units, identity,
};

/// File with the errors by run.
pub const COMPARISON: &str = "comparison.json";

/// Writes `report.html`, `comparison.json` and `errors.csv`; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(comparison: &Comparison, folder: &Out) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    results.write_page(report::FILE, &page(comparison))?;
    results.write_text(COMPARISON, &serde_json::json!(comparison).to_string())?;
    results.write_text(errors::FILE, &errors::written(&comparison.rows))?;
    Ok(results.finish()?)
}

fn page(comparison: &Comparison) -> Report {
    let rows = &comparison.rows;
    Report {
        title: "Comparison of controllers".into(),
        summary: summary(comparison),
        identity: vec![
            identity::entry("Plant", comparison.plant.as_str()),
            identity::entry("Specimen", comparison.specimen.as_str()),
            identity::entry("Controllers", comparison.controllers().join(", ")),
            identity::entry("Motions", motions(rows).join(", ")),
            identity::version(),
        ],
        sections: vec![Section {
            heading: "Tracking errors".into(),
            text: vec![
                "Root mean square of the acceleration error, and of the difference of the Fourier \
                 amplitudes up to 25 Hz, relative to the largest acceleration of the reference."
                    .into(),
            ],
            bars: bars(comparison),
            tables: tables(comparison)
                .iter()
                .map(ErrorTable::report_table)
                .collect(),
            notes: early(comparison),
            panels: panels(rows),
        }],
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
        ..Report::default()
    }
}

/// The report of the comparison whose files lie in `folder`; without `errors.csv` it has no plots.
///
/// # Errors
/// A file that cannot be read or is none of a comparison.
pub fn page_again(folder: &Path) -> Result<Report, Error> {
    let path = folder.join(COMPARISON);
    let mut comparison: Comparison = json::read(&path, "the JSON of a comparison")?;
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
    Ok(page(&comparison))
}

fn motions(rows: &[Row]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for row in rows {
        if !names.contains(&row.record.as_str()) {
            names.push(&row.record);
        }
    }
    names
}

/// Which controller follows best, and how many runs ended early.
fn summary(comparison: &Comparison) -> String {
    let medians = comparison.medians.iter();
    let medians = medians.filter_map(|(name, own)| Some((own.time_domain_percent?, name)));
    let least = medians.min_by(|a, b| a.0.total_cmp(&b.0));
    let best = least.map_or(String::new(), |(error, name)| {
        let along_y = comparison.medians[name].along_y.and_then(|own| own.time_domain_percent);
        match along_y {
            Some(other) => format!(
                " The smallest median of the acceleration error along x is {error:.2} %, of {name}; along y it has \
                 {other:.2} %."
            ),
            None => {
                format!(" The smallest median of the acceleration error is {error:.2} %, of {name}.")
            }
        }
    });
    let early = comparison.ended_early().count();
    let early = match early {
        0 => String::new(),
        1 => " One run ended early.".to_string(),
        many => format!(" {many} runs ended early."),
    };
    format!(
        "{} runs of {}.{best}{early}",
        comparison.rows.len(),
        comparison.controllers().join(", ")
    )
}

/// The acceleration error by motion and controller; runs that ended early have no bar.
fn bars(comparison: &Comparison) -> Vec<Bars> {
    let controllers = comparison.controllers();
    let colour = |name: &str| {
        let place = controllers.iter().position(|own| *own == name);
        1 + place.unwrap_or(0) % 8
    };
    let group = |motion: &str, measure: Measure| BarGroup {
        label: motion.to_string(),
        bars: comparison
            .rows
            .iter()
            .filter(|row| row.record == motion && row.is_complete())
            .filter_map(|row| {
                Some(Bar {
                    name: row.controller.clone(),
                    value: measure(row)?,
                    interval: None,
                    colour: colour(&row.controller),
                })
            })
            .collect(),
    };
    let bars = |title: &str, measure: Measure| Bars {
        title: title.into(),
        groups: motions(&comparison.rows)
            .into_iter()
            .map(|motion| group(motion, measure))
            .collect(),
        mark: None,
    };
    match comparison.is_biaxial() {
        false => vec![bars("Normalised RMS acceleration error, %", |row| {
            row.time_domain_percent
        })],
        true => vec![
            bars("Normalised RMS acceleration error along x, %", |row| {
                row.time_domain_percent
            }),
            bars("Normalised RMS acceleration error along y, %", |row| {
                row.along_y?.time_domain_percent
            }),
        ],
    }
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
        title: match first.along_y {
            Some(_) => format!("{what} error along x on {}", first.record),
            None => format!("{what} error on {}", first.record),
        },
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear("table minus reference", units),
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

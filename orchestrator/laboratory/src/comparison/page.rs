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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::result::AlongY;
    use fmi_master::Ending;
    use pages::report::UnitSystem;

    fn row(record: &str, controller: &str, percent: f64) -> Row {
        Row {
            record: record.into(),
            controller: controller.into(),
            time_domain_percent: Some(percent),
            frequency_domain_percent: Some(0.1 * percent),
            response_spectrum_percent: Some(2.0 * percent),
            significant_duration_percent: Some(1.5 * percent),
            peak_displacement_m: Some(0.05),
            along_y: None,
            ended: Ending::Complete,
            ended_because: None,
            ended_s: None,
            history: None,
        }
    }

    fn history(error: &[f64]) -> Option<History> {
        Some(History {
            dt: 0.002,
            displacement_error: error.iter().map(|own| 0.01 * own).collect(),
            acceleration_error: error.to_vec(),
        })
    }

    /// Two controllers on a record of the thesis and another one; one run was stopped, one failed.
    fn comparison() -> Comparison {
        let mut rows = vec![
            row("RSN495_NAHANNI_S1280", "mpc", 2.0),
            row("other", "mpc", 3.0),
            row("third", "mpc", 4.5),
            row("RSN495_NAHANNI_S1280", "own", 7.0),
            row("other", "own", 9.0),
            row("third", "own", 1.0),
        ];
        rows[0].history = history(&[0.5, -1.5, 1.0]);
        rows[3].history = history(&[0.25, 2.0]);
        rows[4].ended = Ending::Interlock;
        rows[4].ended_s = Some(3.25);
        rows[4].ended_because = Some("the table left its reference".into());
        rows[5].ended = Ending::Failed;
        rows[5].time_domain_percent = None;
        Comparison::new("identified", "linear", rows)
    }

    /// The same on a table with two axes, of which the second rested once.
    fn biaxial() -> Comparison {
        let along = |percent: Option<f64>, at_rest: Option<f64>| {
            Some(AlongY {
                time_domain_percent: percent,
                frequency_domain_percent: percent.map(|own| 0.2 * own),
                response_spectrum_percent: percent.map(|own| 3.0 * own),
                significant_duration_percent: None,
                at_rest_percent: at_rest,
            })
        };
        let mut rows = vec![
            row("one", "mpc", 2.0),
            row("two", "mpc", 3.0),
            row("one", "lqg", 1.0),
        ];
        rows[0].along_y = along(Some(4.0), None);
        rows[1].along_y = along(None, Some(0.75));
        rows[2].along_y = along(Some(5.0), None);
        rows[0].history = history(&[1.0, 2.0]);
        Comparison::new("biaxial", "none", rows)
    }

    fn shown(comparison: &Comparison) -> String {
        expected::text_of(&page(comparison), UnitSystem::Si)
            .replace(env!("CARGO_PKG_VERSION"), "VERSION")
    }

    #[test]
    fn a_comparison_has_tables_beside_the_printed_values_and_plots() {
        let all = [comparison(), biaxial()];
        let tables = all.iter().flat_map(tables);
        let mut text: Vec<String> = tables.map(|own| own.text()).collect();
        text.extend(all.iter().map(shown));
        let medians = all.iter().map(|own| format!("{:#?}", own.medians));
        text.extend(medians);
        expected::compare(
            env!("CARGO_MANIFEST_DIR"),
            "comparison.txt",
            &text.join("\n======\n"),
        );
    }

    #[test]
    fn the_page_is_made_again_from_the_files_of_a_comparison() {
        let folder = tempfile::tempdir().unwrap();
        let out = Out::new(folder.path().join("out"));
        let own = comparison();
        let written = write(&own, &out).unwrap();
        assert_eq!(written.len(), 3);
        let again = page_again(&out).unwrap();
        let again =
            expected::text_of(&again, UnitSystem::Si).replace(env!("CARGO_PKG_VERSION"), "VERSION");
        assert_eq!(again, shown(&own));
        // Without errors over time there are no plots.
        std::fs::remove_file(out.join(errors::FILE)).unwrap();
        assert!(page_again(&out).unwrap().sections[0].panels.is_empty());
        std::fs::write(out.join(COMPARISON), "[]").unwrap();
        let told = page_again(&out).unwrap_err().to_string();
        assert!(told.contains("not the JSON of a comparison"), "{told}");
    }

    #[test]
    fn errors_over_time_leave_cells_empty_behind_an_early_end() {
        let own = comparison();
        assert_eq!(
            errors::written(&own.rows),
            "time,mpc.displacement_error,mpc.acceleration_error,own.displacement_error,own.acceleration_error\n\
             0,0.005,0.5,0.0025,0.25\n0.002,-0.015,-1.5,0.02,2\n0.004,0.01,1,,\n"
        );
        assert_eq!(errors::written(&[]), "time\n");
    }
}

//! The files of an iteration.

use std::path::PathBuf;

use super::{Iteration, Plan, drive};
use crate::error::Error;
use crate::results::{Out, Results};
use crate::run::identity::tuning;
use pages::report::identity::{entry, version};
use pages::report::{
    self, Abscissa, Axis, Cell, Panel, Report, Section, Series, Style, Table, Units,
};

/// File with the figures by run.
pub const ITERATION: &str = "iteration.json";
/// The best drive.
const DRIVE: &str = "drive.csv";
/// The best drive along the second axis.
const DRIVE_Y: &str = "drive_y.csv";

/// Writes `report.html`, `iteration.json` and `drive.csv`; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(plan: &Plan, iteration: &Iteration, folder: &Out) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    results.write_page(report::FILE, &page(plan, iteration))?;
    results.write_text(
        ITERATION,
        &(serde_json::json!(iteration).to_string() + "\n"),
    )?;
    if let Some(best) = &iteration.drive {
        results.write_text(DRIVE, &drive::text(best))?;
        if let Some(across) = &best.across {
            results.write_text(DRIVE_Y, &drive::text(across))?;
        }
    }
    Ok(results.finish()?)
}

/// What was iterated, in few words.
fn identity(plan: &Plan, iteration: &Iteration) -> Vec<(String, Cell)> {
    let request = &plan.request;
    let mut all = vec![
        entry("System", request.system.as_str()),
        entry("Plant", request.plant.as_str()),
        entry("Specimen", request.specimen.as_str()),
        entry("Tuning", tuning(request)),
    ];
    if !request.set.is_empty() {
        all.push(entry("Set", request.set.join(", ")));
    }
    all.extend([
        entry("Motion", iteration.motion.as_str()),
        entry("Part of the inverse", Cell::Number(plan.gain, 3)),
        entry("Band", format!("{} to {} Hz", plan.band[0], plan.band[1])),
    ]);
    if let Some(mass) = plan.dummy_mass {
        all.push(entry(
            "Dummy mass",
            Cell::Quantity(mass, Units::of("kg"), 3),
        ));
    }
    if let Some(most) = plan.exposure {
        all.push(entry("Most exposure", Cell::Number(most, 3)));
    }
    all.push(version());
    all
}

/// Errors by correction, errors over time, and the transfer function that is inverted.
fn panels(iteration: &Iteration) -> Vec<Panel> {
    let complete = iteration.runs.iter().filter_map(|run| {
        Some((
            run.iteration as f64,
            run.measured_percent?,
            run.time_domain_percent,
        ))
    });
    let (corrections, measured): (Vec<f64>, Vec<f64>) =
        complete.clone().map(|(n, error, _)| (n, error)).unzip();
    let own: Vec<f64> = complete.map(|run| run.2.unwrap_or(f64::NAN)).collect();
    let places = || Abscissa::At(corrections.clone().into());
    let mut panels = vec![Panel {
        title: "Error by correction".into(),
        x: Axis::linear("corrections", Units::NONE),
        y: Axis::linear("RMS error over the peak", Units::PERCENT),
        series: vec![
            Series::line("measured, within the band", places(), measured),
            Series::line("of the table", places(), own),
        ],
    }];
    if let Some((dt, first, best)) = &iteration.errors {
        panels.push(Panel {
            title: "Acceleration error (table minus reference)".into(),
            x: Axis::linear("time", Units::TIME),
            y: Axis::linear("error", Units::ACCELERATION),
            series: vec![
                Series::history("first run", *dt, first),
                Series::history("best run", *dt, best),
            ],
        });
    }
    let frequency: Vec<f64> = iteration.response.iter().map(|own| own.frequency).collect();
    let over_frequency = |title: &str, label: &str, value: fn(&super::Line) -> f64| Panel {
        title: title.into(),
        x: Axis::logarithmic("frequency", Units::FREQUENCY),
        y: Axis::linear(label, Units::NONE),
        series: vec![
            Series::line(
                label,
                Abscissa::At(frequency.clone().into()),
                iteration.response.iter().map(value).collect(),
            )
            .styled(Style::Line),
        ],
    };
    if !frequency.is_empty() {
        panels.push(over_frequency(
            "Transfer function from drive to table",
            "gain",
            |own| own.gain,
        ));
        panels.push(over_frequency("Its coherence", "coherence", |own| {
            own.coherence
        }));
    }
    panels
}

/// The second axis by run, where there is one.
fn along_y(iteration: &Iteration) -> Option<Table> {
    iteration.runs.first()?.along_y?;
    let percent = |value: Option<f64>| {
        value.map_or("-".into(), |value| Cell::Quantity(value, Units::PERCENT, 3))
    };
    Some(Table::of(
        &format!(
            "Along y, with its drive in {DRIVE_Y}. The measured error above is the larger of both axes; the errors \
             beside it are those along x. The error of an axis that is to rest is relative to the peak of the other one."
        ),
        ["corrections", "measured error", "RMS acceleration error"],
        iteration.runs.iter().filter_map(|run| {
            let own = run.along_y?;
            Some([
                run.iteration.to_string().into(),
                percent(own.measured_percent),
                percent(own.time_domain_percent),
            ])
        }),
    ))
}

fn page(plan: &Plan, iteration: &Iteration) -> Report {
    let percent = |value: Option<f64>| {
        value.map_or("-".into(), |value| Cell::Quantity(value, Units::PERCENT, 3))
    };
    let rows = iteration.runs.iter().map(|run| {
        [
            run.iteration.to_string().into(),
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
        identity: identity(plan, iteration),
        sections: vec![Section {
            heading: "Runs".into(),
            text: vec![
                "The drive of each run is that of the best before, corrected by the inverse of the \
                 measured transfer function times its coherence. The measured error is what the \
                 sensors show within the band; the others are the table's own. Exposure is the \
                 energy of all runs on the specimen over that of the motion played once."
                    .into(),
            ],
            tables: std::iter::once(Table::of(
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
            ))
            .chain(along_y(iteration))
            .collect(),
            panels: panels(iteration),
            ..Section::default()
        }],
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
        ..Report::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::iteration::{AlongY, Line, Run, Stop};
    use crate::run::experiment::Request;
    use fmi_master::Ending;
    use pages::report::UnitSystem;

    fn run(iteration: usize, measured: Option<f64>) -> Run {
        Run {
            iteration,
            measured_percent: measured,
            along_y: None,
            time_domain_percent: measured.map(|own| own + 0.5),
            frequency_domain_percent: Some(0.25),
            response_spectrum_percent: None,
            exposure: 1.0 + iteration as f64,
            gain: 0.7,
            ended: Ending::Complete,
            ended_because: None,
        }
    }

    fn plan() -> Plan {
        Plan {
            request: Request {
                set: vec!["table.mass=600 kg".into()],
                ..Request::built_in("three-variable")
            },
            iterations: 3,
            gain: 0.7,
            target_percent: 1.0,
            band: [0.2, 25.0],
            exposure: Some(10.0),
            measurement_delay: None,
            dummy_mass: Some(120.0),
            drive: None,
            drive_y: None,
        }
    }

    fn iteration() -> Iteration {
        let mut last = run(2, None);
        last.ended = Ending::Interlock;
        last.ended_because = Some("the table left its reference".into());
        let line = |frequency, gain, coherence| Line {
            frequency,
            gain,
            coherence,
        };
        Iteration {
            system: "three-variable".into(),
            motion: "wave".into(),
            coherence: 0.987_65,
            runs: vec![run(0, Some(8.0)), run(1, Some(2.5)), last],
            best: 1,
            stop: Stop::EndedEarly,
            converges: true,
            drive: None,
            errors: Some((0.002, vec![1.0, -2.0], vec![0.5, 0.25])),
            response: vec![line(1.0, 0.9, 0.99), line(2.0, 1.1, 0.95)],
        }
    }

    #[test]
    fn the_page_of_an_iteration_has_a_row_for_each_run() {
        let mut all = vec![expected::text_of(
            &page(&plan(), &iteration()),
            UnitSystem::Us,
        )];
        let mut both = iteration();
        for (n, run) in both.runs.iter_mut().enumerate() {
            run.along_y = Some(AlongY {
                measured_percent: Some(1.5 * n as f64),
                time_domain_percent: None,
            });
        }
        both.errors = None;
        both.response.clear();
        let bare = Plan {
            request: Request::built_in("mpc"),
            exposure: None,
            dummy_mass: None,
            ..plan()
        };
        all.push(expected::text_of(&page(&bare, &both), UnitSystem::Si));
        let text = all
            .join("\n======\n")
            .replace(env!("CARGO_PKG_VERSION"), "VERSION");
        expected::compare(env!("CARGO_MANIFEST_DIR"), "iteration.txt", &text);
    }

    #[test]
    fn the_best_drives_are_written_for_each_axis() {
        let motion = motion::built_in(1, &motion::Options::default()).unwrap();
        let both = motion.clone().along_two_axes(motion);
        let own = Iteration {
            drive: Some(both),
            ..iteration()
        };
        let folder = tempfile::tempdir().unwrap();
        let written = write(&plan(), &own, &Out::new(folder.path().join("out"))).unwrap();
        let names: Vec<_> = written
            .iter()
            .filter_map(|path| path.file_name()?.to_str())
            .collect();
        for name in [ITERATION, DRIVE, DRIVE_Y, report::FILE] {
            assert!(names.contains(&name), "{names:?}");
        }
    }

    #[test]
    fn every_end_of_an_iteration_has_its_sentence() {
        let all = [
            Stop::Target,
            Stop::Iterations,
            Stop::Stalled,
            Stop::Diverges,
            Stop::Exposure,
            Stop::EndedEarly,
        ];
        let mut sentences = all.map(Stop::sentence).to_vec();
        assert!(sentences.iter().all(|own| own.len() > 20), "{sentences:?}");
        sentences.sort_unstable();
        sentences.dedup();
        assert_eq!(sentences.len(), all.len());
    }
}

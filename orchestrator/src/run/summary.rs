//! The figures and files of a run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::experiment::{Prepared, Request};
use super::manifest::Manifest;
use super::signals::{read_csv, write_csv};
use crate::error::Error;
use crate::master::{Ending, Outcome, Record};
use crate::metrics::{self, Tracking};
use crate::motion::Motion;
use crate::report::columns::{aligned, significant};
use crate::report::{self, Cell, Whole};
use crate::results::Results;
use crate::units::{INCH, STANDARD_GRAVITY};

/// `summary.json` of a run, and what `--json` prints.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Summary {
    system: String,
    motion: MotionSummary,
    steps: usize,
    step_s: f64,
    fmi: String,
    algorithm: String,
    wall_s: f64,
    real_time_factor: f64,
    ended: Ending,
    ended_because: Option<String>,
    /// Seeds of random components (such as sensors' noise), by instance.
    seeds: BTreeMap<String, serde_json::Value>,
    tracking: Option<Tracking>,
    /// What the user should know.
    pub(crate) warnings: Vec<String>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct MotionSummary {
    name: String,
    duration_s: f64,
    pga_g: f64,
    peak_displacement_m: f64,
}

impl Summary {
    /// Measures a run.
    pub(crate) fn new(
        request: &Request,
        prepared: &Prepared,
        outcome: &Outcome,
        manifest: &Manifest,
    ) -> Self {
        let Prepared { system, motion, .. } = prepared;
        let mut warnings: Vec<String> = outcome
            .messages
            .iter()
            .map(|line| format!("`{}` logged: {}", line.component, line.message.text))
            .collect();
        let tracking = Table::find(manifest, &outcome.record).and_then(|table| {
            let displacement = outcome.record.column(&table.name("displacement"))?;
            let acceleration = outcome.record.column(&table.name("acceleration"))?;
            match metrics::tracking(motion, &displacement, &acceleration) {
                Ok(tracking) => Some(tracking),
                Err(error) => {
                    warnings.push(format!("tracking cannot be measured: {error}"));
                    None
                }
            }
        });
        if let Some(tracking) = &tracking
            && tracking.peak_displacement > units::constants::STROKE
        {
            warnings.push(format!(
                "the table went to {:.2} in, the stroke is {:.2} in: a real one would have hit \
                 its stop",
                tracking.peak_displacement / INCH,
                units::constants::STROKE / INCH
            ));
        }
        let simulated = outcome.steps as f64 * outcome.step;
        let mut versions: Vec<String> = system
            .components
            .iter()
            .map(|component| component.fmu.description.version.to_string())
            .collect();
        versions.sort();
        versions.dedup();
        Self {
            system: system.name.clone(),
            motion: MotionSummary {
                name: motion.name.clone(),
                duration_s: motion.duration(),
                pga_g: motion.peak_acceleration() / STANDARD_GRAVITY,
                peak_displacement_m: motion.peak_displacement(),
            },
            steps: outcome.steps,
            step_s: outcome.step,
            fmi: versions.join(" and "),
            algorithm: request.algorithm.to_string(),
            wall_s: outcome.wall,
            real_time_factor: simulated / outcome.wall,
            ended: outcome.ended.kind(),
            ended_because: outcome.ended.reason(),
            seeds: manifest
                .components
                .iter()
                .filter_map(|(name, part)| {
                    let (seed, _) = part.parameters.get("seed")?;
                    Some((name.clone(), seed.clone()))
                })
                .collect(),
            tracking,
            warnings,
        }
    }

    /// The figures as a table for people.
    pub(crate) fn table(&self, motion: &Motion) -> String {
        let mut text = format!("{} on {}\n", self.system, self.motion.name);
        for note in &motion.notes {
            text += &format!("  {note}\n");
        }
        for (name, seed) in &self.seeds {
            text += &format!("  seed of the noise of `{name}`: {seed}\n");
        }
        text += &format!(
            "\n{} steps of {} ms (FMI {}, {}), {} times real time, {}\n\n",
            self.steps,
            significant(1e3 * self.step_s, 3)
                .trim_end_matches('0')
                .trim_end_matches('.'),
            self.fmi,
            self.algorithm,
            significant(self.real_time_factor, 2),
            self.ended.word(),
        );
        let Some(tracking) = &self.tracking else {
            return text;
        };
        let row = |name: &str, cells: [String; 3]| {
            let mut row = vec![name.to_string()];
            row.extend(cells);
            row
        };
        let inches = |value: f64| format!("{:.4} in", value / INCH);
        let gravity = |value: f64| format!("{:.4} g", value / STANDARD_GRAVITY);
        let percent = |value: f64| format!("{value:.4} %");
        text += &aligned(&[
            row(
                "",
                ["reference".into(), "table".into(), "largest error".into()],
            ),
            row(
                "displacement, peak",
                [
                    inches(motion.peak_displacement()),
                    inches(tracking.peak_displacement),
                    inches(tracking.peak_displacement_error),
                ],
            ),
            row(
                "acceleration, peak",
                [
                    gravity(motion.peak_acceleration()),
                    gravity(tracking.peak_acceleration),
                    gravity(tracking.peak_acceleration_error),
                ],
            ),
        ]);
        text += "\n";
        let pair = |name: &str, value: String| vec![name.to_string(), value];
        text += &aligned(&[
            pair(
                "error in time, acceleration",
                percent(tracking.time_domain_percent),
            ),
            pair(
                "error in frequency, acceleration",
                percent(tracking.frequency_domain_percent),
            ),
            pair(
                "error in time, displacement",
                percent(tracking.displacement_percent),
            ),
            pair(
                "delay of the table",
                format!("{:.1} ms", 1e3 * tracking.delay),
            ),
        ]);
        text
    }
}

/// The component that is the table: `table`, or the first with a displacement, velocity and
/// acceleration that takes a valve command.
struct Table<'a> {
    name: &'a str,
    /// The output that drives the valve.
    valve: Option<&'a str>,
}

impl<'a> Table<'a> {
    fn find(manifest: &'a Manifest, record: &Record) -> Option<Self> {
        let valve = |name: &str| {
            let mut ends = manifest
                .connections
                .iter()
                .filter_map(|c| c.split_once(" -> "));
            ends.find(|(_, to)| to.strip_prefix(name) == Some(".valve_command"))
                .map(|(from, _)| from)
        };
        let moves = |name: &str| {
            let mut outputs = ["displacement", "velocity", "acceleration"].into_iter();
            outputs.all(|output| record.columns.contains(&format!("{name}.{output}")))
                && valve(name).is_some()
        };
        let mut names = manifest.components.keys().map(String::as_str);
        let name = match manifest.components.get_key_value("table") {
            Some((name, _)) => name,
            None => names.find(|name| moves(name))?,
        };
        let valve = valve(name).filter(|from| !from.starts_with("reference."));
        Some(Self { name, valve })
    }

    fn name(&self, output: &str) -> String {
        format!("{}.{output}", self.name)
    }
}

/// Writes the files of a run and says where they are.
pub(crate) fn write(
    folder: &Path,
    prepared: &Prepared,
    outcome: &Outcome,
    summary: &Summary,
    manifest: &Manifest,
) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    results.write("results.csv", |file| write_csv(&outcome.record, file))?;
    results.write_text("summary.json", &json(summary))?;
    results.write_text("manifest.json", &json(manifest))?;
    let motion = &prepared.motion;
    if let Some(page) = page(summary, manifest, motion, motion.into(), &outcome.record) {
        results.write_text("report.html", &page)?;
    }
    Ok(results.finish()?)
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// The report; none where there is no table.
fn page(
    summary: &Summary,
    manifest: &Manifest,
    motion: &Motion,
    whole: Whole,
    record: &Record,
) -> Option<String> {
    let table = Table::find(manifest, record)?;
    let column = |output| record.column(&table.name(output)).unwrap_or_default();
    let valve = table.valve.and_then(|name| record.column(name));
    let row = |name: &str, value: String| (name.to_string(), Cell::from(value));
    let mut settings = vec![
        row("FMI", summary.fmi.clone()),
        row("Algorithm", summary.algorithm.clone()),
        row("Step", format!("{} ms", 1e3 * summary.step_s)),
        row(
            "Speed",
            format!(
                "{} times real time",
                significant(summary.real_time_factor, 2)
            ),
        ),
    ];
    for (name, component) in &manifest.components {
        let file = component.fmu.file_name().unwrap_or_default();
        let sum = component.sha256.get(..16).unwrap_or(&component.sha256);
        settings.push(row(
            name,
            format!("{}, SHA-256 {sum}", file.to_string_lossy()),
        ));
    }
    let run = report::Run {
        system: &summary.system,
        motion,
        whole,
        displacement: &column("displacement"),
        velocity: &column("velocity"),
        acceleration: &column("acceleration"),
        valve_command: valve.as_deref(),
        tracking: summary.tracking.as_ref(),
        ended: summary
            .ended_because
            .as_deref()
            .unwrap_or(summary.ended.word()),
        settings,
        footer: format!(
            "shakebench {}; repeat with: shakebench run --manifest manifest.json",
            manifest.shakebench
        ),
    };
    report::html(&report::run(&run)).ok()
}

/// The report of the run whose files lie in `folder`; of a motion that was not played to its end, it
/// draws what was played.
///
/// # Errors
/// A file that is missing or is none of a run.
pub(crate) fn page_again(folder: &Path) -> Result<String, Error> {
    let manifest = Manifest::read(&folder.join("manifest.json"))?;
    let place = folder.join("summary.json");
    let fault = |reason: String| Error::File {
        path: place.clone(),
        reason,
    };
    let text = std::fs::read_to_string(&place).map_err(|error| fault(error.to_string()))?;
    let summary: Summary = serde_json::from_str(&text)
        .map_err(|error| fault(format!("not the summary of a run: {error}")))?;
    let place = folder.join("results.csv");
    let record = read_csv(&place)?;
    let column = |quantity| {
        let name = format!("reference.{quantity}");
        record.column(&name).ok_or_else(|| Error::File {
            path: place.clone(),
            reason: format!("not the results of a run: there is no column `{name}`"),
        })
    };
    let motion = Motion {
        name: manifest.motion.name.clone(),
        dt: manifest.motion.dt_s,
        displacement: column("displacement")?,
        velocity: column("velocity")?,
        acceleration: column("acceleration")?,
        notes: manifest.motion.notes.clone(),
        seed: manifest.motion.seed,
    };
    let whole = Whole {
        duration: summary.motion.duration_s,
        peak_displacement: summary.motion.peak_displacement_m,
        peak_acceleration: summary.motion.pga_g * STANDARD_GRAVITY,
    };
    page(&summary, &manifest, &motion, whole, &record).ok_or_else(|| Error::File {
        path: folder.to_path_buf(),
        reason: "no component of the run is a table with displacement, velocity and acceleration, \
                 which a report needs"
            .into(),
    })
}

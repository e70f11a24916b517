//! The figures and files of a run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::table::{aligned, significant};
use crate::error::Error;
use crate::experiment::{Prepared, Request};
use crate::manifest::Manifest;
use crate::master::{Ended, Outcome};
use crate::metrics::{self, Tracking};
use crate::motion::Motion;
use crate::report::{self, Cell};
use crate::results::{Results, write_csv};
use crate::system::{Source, System};
use crate::units::{INCH, STANDARD_GRAVITY};

/// `summary.json` of a run, and what `--json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    system: String,
    motion: MotionSummary,
    steps: usize,
    step_s: f64,
    fmi: String,
    algorithm: String,
    wall_s: f64,
    real_time_factor: f64,
    ended: &'static str,
    ended_because: Option<String>,
    /// Seeds of random components (such as sensors' noise), by instance.
    seeds: BTreeMap<String, serde_json::Value>,
    tracking: Option<TrackingSummary>,
    /// What the user should know.
    pub(super) warnings: Vec<String>,
    #[serde(skip)]
    figures: Option<Tracking>,
}

#[derive(Debug, Clone, Serialize)]
struct MotionSummary {
    name: String,
    duration_s: f64,
    pga_g: f64,
    peak_displacement_m: f64,
}

#[derive(Debug, Clone, Serialize)]
struct TrackingSummary {
    time_domain_percent: f64,
    frequency_domain_percent: f64,
    displacement_percent: f64,
    peak_displacement_m: f64,
    peak_acceleration_m_s2: f64,
    delay_s: f64,
}

impl Summary {
    /// Measures a run.
    pub(super) fn new(
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
        let figures = Table::find(system).and_then(|table| {
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
        if let Some(tracking) = &figures
            && tracking.peak_displacement > plant::units::STROKE
        {
            warnings.push(format!(
                "the table went to {:.2} in, the stroke is {:.2} in: a real one would have hit \
                 its stop",
                tracking.peak_displacement / INCH,
                plant::units::STROKE / INCH
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
            ended: outcome.ended.word(),
            ended_because: match &outcome.ended {
                Ended::Complete => None,
                ended => Some(ended.story()),
            },
            seeds: manifest
                .components
                .iter()
                .filter_map(|(name, part)| {
                    let (seed, _) = part.parameters.get("seed")?;
                    Some((name.clone(), seed.clone()))
                })
                .collect(),
            tracking: figures.map(|tracking| TrackingSummary {
                time_domain_percent: tracking.time_domain_percent,
                frequency_domain_percent: tracking.frequency_domain_percent,
                displacement_percent: tracking.displacement_percent,
                peak_displacement_m: tracking.peak_displacement,
                peak_acceleration_m_s2: tracking.peak_acceleration,
                delay_s: tracking.delay,
            }),
            warnings,
            figures,
        }
    }

    /// The figures as a table for people.
    pub(super) fn table(&self, motion: &Motion) -> String {
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
            self.ended,
        );
        let Some(tracking) = &self.figures else {
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

/// The component that is the table: `table`, or the first with a displacement and an acceleration
/// that takes a valve command.
struct Table<'a> {
    system: &'a System,
    component: usize,
}

impl<'a> Table<'a> {
    fn find(system: &'a System) -> Option<Self> {
        let moves = |component: usize| {
            let description = &system.components[component].fmu.description;
            let all = ["displacement", "velocity", "acceleration", "valve_command"];
            all.iter().all(|name| description.variable(name).is_some())
        };
        let count = system.components.len();
        let named = (0..count).find(|&c| system.components[c].name == "table");
        let component = named.or_else(|| (0..count).find(|&c| moves(c)))?;
        Some(Self { system, component })
    }

    fn name(&self, output: &str) -> String {
        format!("{}.{output}", self.system.components[self.component].name)
    }

    /// The output that drives the valve.
    fn valve(&self) -> Option<String> {
        let description = &self.system.components[self.component].fmu.description;
        let input = description.position("valve_command")?;
        let connections = self.system.connections.iter();
        let mut driving = connections.filter(|c| c.component == self.component && c.input == input);
        let source = driving.next()?.source;
        matches!(source, Source::Output { .. }).then(|| self.system.source_name(source))
    }
}

/// Writes the files of a run and says where they are.
pub(super) fn write(
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
    if let Some(page) = page(prepared, outcome, summary) {
        results.write_text("report.html", &page)?;
    }
    Ok(results.finish()?)
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

fn page(prepared: &Prepared, outcome: &Outcome, summary: &Summary) -> Option<String> {
    let table = Table::find(&prepared.system)?;
    let column = |output| {
        outcome
            .record
            .column(&table.name(output))
            .unwrap_or_default()
    };
    let valve = table.valve().and_then(|name| outcome.record.column(&name));
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
    for component in &prepared.system.components {
        let fmu = &component.fmu;
        settings.push(row(
            &component.name,
            format!("{}, SHA-256 {}", fmu.file_name(), &fmu.sha256[..16]),
        ));
    }
    let run = report::Run {
        system: &prepared.system.name,
        motion: &prepared.motion,
        displacement: &column("displacement"),
        velocity: &column("velocity"),
        acceleration: &column("acceleration"),
        valve_command: valve.as_deref(),
        tracking: summary.figures.as_ref(),
        ended: &outcome.ended.story(),
        settings,
        footer: format!(
            "shakebench {}; repeat with: shakebench run --manifest manifest.json",
            env!("CARGO_PKG_VERSION")
        ),
    };
    report::html(&report::run(&run)).ok()
}

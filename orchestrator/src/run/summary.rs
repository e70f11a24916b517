//! The figures of a run.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::experiment::Prepared;
use super::manifest::Manifest;
use crate::master::{Ending, Outcome, RealTime, Record};
use crate::metrics::{self, Tracking};
use crate::system::Origin;
use crate::units::{self, INCH, STANDARD_GRAVITY};

/// `summary.json` of a run, and what `--json` prints.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Summary {
    /// Name of the system.
    pub system: String,
    /// What was played.
    pub motion: MotionSummary,
    /// Coupling steps made.
    pub steps: usize,
    /// Coupling step.
    pub step_s: f64,
    /// Versions of FMI of its components.
    pub fmi: String,
    /// Order of calls.
    pub algorithm: String,
    /// Time that the stepping took.
    pub wall_s: f64,
    /// Time simulated over time taken.
    pub real_time_factor: f64,
    /// How it ended.
    pub ended: Ending,
    /// Why it ended early.
    pub ended_because: Option<String>,
    /// Seeds of random components (such as sensors' noise), by instance.
    pub seeds: BTreeMap<String, serde_json::Value>,
    /// How well the table followed; absent where there is no table.
    pub tracking: Option<Tracking>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Time that each component took in its steps, s, estimated from one step in 32.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub step_time_s: BTreeMap<String, f64>,
    /// How the clock on the wall was kept; of a run in real time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub real_time: Option<RealTime>,
}

/// The motion of a run, whole.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct MotionSummary {
    /// Its name.
    pub name: String,
    /// From its first to its last sample.
    pub duration_s: f64,
    /// Peak acceleration.
    pub pga_g: f64,
    /// Peak displacement.
    pub peak_displacement_m: f64,
}

impl Summary {
    /// Measures a run.
    pub fn new(
        prepared: &Prepared,
        outcome: &Outcome,
        manifest: &Manifest,
    ) -> Self {
        let Prepared { system, motion, .. } = prepared;
        let mut warnings: Vec<String> = outcome
            .messages
            .iter()
            .map(|line| {
                let times = match line.message.times {
                    1 => String::new(),
                    times => format!(" ({times} times)"),
                };
                format!("`{}` logged: {}{times}", line.component, line.message.text)
            })
            .collect();
        let notes = system.notes.iter().chain(&outcome.notes);
        warnings.splice(0..0, notes.cloned());
        let is_whole = outcome.record.len() < 2 || {
            let times = outcome.record.column("time").unwrap_or_default();
            times[1] - times[0] < 1.5 * motion.dt
        };
        let table = Table::find(manifest, &outcome.record).filter(|_| !motion.is_empty());
        let tracking = table.and_then(|table| {
            if !is_whole {
                warnings.push("tracking is not measured on a thinned record".to_string());
                return None;
            }
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
            algorithm: prepared.algorithm.to_string(),
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
            step_time_s: outcome.step_time.iter().cloned().collect(),
            real_time: outcome.real_time.clone(),
        }
    }
}

/// The component that is the table: `table`, or the first with a displacement, velocity and
/// acceleration that takes a valve command.
pub(super) struct Table<'a> {
    name: &'a str,
    /// The output that drives the valve.
    pub(super) valve: Option<String>,
}

impl<'a> Table<'a> {
    pub(super) fn find(manifest: &'a Manifest, record: &Record) -> Option<Self> {
        let valve = |name: &str| {
            let mut links = manifest.connections.iter();
            links
                .find(|link| link.to.component == name && link.to.variable == "valve_command")
                .map(|link| &link.from)
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
        let valve = match valve(name) {
            Some(Origin::Output(output)) => Some(output.to_string()),
            _ => None,
        };
        Some(Self { name, valve })
    }

    /// The signal that is an output of it.
    pub(super) fn name(&self, output: &str) -> String {
        format!("{}.{output}", self.name)
    }
}

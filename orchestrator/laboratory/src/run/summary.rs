//! The figures of a run.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::axes::{self, Axis};
use super::experiment::Prepared;
use super::manifest::Manifest;
use super::refinement::CouplingError;
use super::table::Table;
use crate::error::Error;
use crate::json;
use fmi_master::{Change, Ended, Ending, Outcome, RealTime, Record, StepsTaken};
use motion::Motion;
use motion::metrics::{self, Tracking};
use units::{self, INCH};

/// `summary.json` of a run, and what `--json` prints.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Summary {
    /// Name of the system.
    pub system: String,
    /// What was played.
    pub motion: MotionSummary,
    /// Coupling steps made.
    pub steps: usize,
    /// Coupling step; the greatest one where it varied.
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
    /// What stopped it, where something did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trip: Option<Trip>,
    /// Time that the steps of each component took.
    #[serde(default)]
    pub component_wall_s: BTreeMap<String, f64>,
    /// Seeds of random components (such as sensors' noise), by instance.
    pub seeds: BTreeMap<String, serde_json::Value>,
    /// How well the table followed what was played; absent where there is no table or the run was stopped.
    pub tracking: Option<Tracking>,
    /// Each axis of a table with two of them; `motion` and `tracking` are then those of the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axes: Vec<Axis>,
    /// Parameters that were changed during the run, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<Change>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// How real time was kept; of a run in real time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub real_time: Option<RealTime>,
    /// The error of the coupling, where it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coupling_error: Option<CouplingError>,
    /// How the steps were, where they varied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variable_step: Option<StepsTaken>,
}

/// What stopped a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Trip {
    /// When.
    pub time_s: f64,
    /// Why, in words.
    pub cause: String,
}

impl Trip {
    fn of(ended: &Ended) -> Option<Self> {
        let cause = match ended {
            Ended::Interlock { cause, signal, .. } => cause.clone().unwrap_or(signal.clone()),
            Ended::Stopped { error, .. } => error.to_string(),
            Ended::Complete
            | Ended::Terminated { .. }
            | Ended::Interrupted { .. }
            | Ended::Failed(_) => return None,
        };
        Some(Self {
            time_s: ended.time()?,
            cause,
        })
    }
}

/// The motion of a run, whole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// Reads `summary.json`.
    ///
    /// # Errors
    /// A file that cannot be read or is none.
    pub fn read(path: &Path) -> Result<Self, Error> {
        json::read(path, "the summary of a run")
    }

    /// Measures a run.
    pub fn new(prepared: &Prepared, outcome: &Outcome, manifest: &Manifest) -> Self {
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
        warnings.extend(super::warned::warned(system, outcome));
        if let Some(taken) = outcome.variable.as_ref().filter(|taken| taken.over > 0) {
            warnings.push(format!(
                "{} of {} steps were accepted with an estimated coupling error above {} % (at \
                 most {:.3} % of `{}`): {}",
                taken.over,
                outcome.steps,
                taken.tolerance_percent,
                taken.worst_percent,
                taken.worst_signal.as_deref().unwrap_or_default(),
                match taken.repeated {
                    0 => "steps could not be repeated, or were the shortest",
                    _ => "they were the shortest; a smaller --least-step follows faster changes",
                }
            ));
        }
        let asked = asked(&outcome.record, motion);
        let wanted = asked.as_ref().unwrap_or(motion);
        let is_whole = outcome.record.len() < 2 || {
            let times = outcome.record.column("time").unwrap_or_default();
            times[1] - times[0] < 1.5 * motion.dt
        };
        // The beginning of a run that was stopped says nothing about how the motion is followed.
        let table = Table::find(manifest, &outcome.record)
            .filter(|_| !motion.is_empty() && outcome.ended.is_regular());
        let tracking = table.and_then(|table| {
            if !is_whole {
                warnings.push("tracking is not measured on a thinned record".to_string());
                return None;
            }
            let displacement = outcome.record.column(&table.name("displacement"))?;
            let acceleration = outcome.record.column(&table.name("acceleration"))?;
            match metrics::tracking(wanted, &displacement, &acceleration) {
                Ok(tracking) => Some(tracking),
                Err(error) => {
                    warnings.push(format!("tracking cannot be measured: {error}"));
                    None
                }
            }
        });
        let names = manifest.components.keys().map(String::as_str);
        let both = axes::tables(names, &manifest.connections, &outcome.record);
        let is_measured = is_whole && !motion.is_empty() && outcome.ended.is_regular();
        let axes = axes::measure(both.as_ref(), motion, &outcome.record, is_measured);
        if let Some(tracking) = &tracking
            && tracking.peak_displacement > units::constants::STROKE
        {
            warnings.push(format!(
                "the table reached {:.2} in, but the stroke is {:.2} in: a real table would have \
                 hit its stop",
                tracking.peak_displacement / INCH,
                units::constants::STROKE / INCH
            ));
        }
        let mut versions: Vec<String> = system
            .components
            .iter()
            .map(|component| component.fmu.description.version.to_string())
            .collect();
        versions.sort();
        versions.dedup();
        Self {
            system: system.name.clone(),
            motion: MotionSummary::of(motion),
            steps: outcome.steps,
            step_s: outcome.step,
            fmi: versions.join(" and "),
            algorithm: prepared.algorithm.to_string(),
            wall_s: outcome.wall,
            real_time_factor: outcome.simulated / outcome.wall,
            ended: outcome.ended.kind(),
            ended_because: outcome.ended.reason(),
            trip: Trip::of(&outcome.ended),
            component_wall_s: outcome.spent.iter().cloned().collect(),
            seeds: manifest
                .components
                .iter()
                .filter_map(|(name, part)| {
                    let (seed, _) = part.parameters.get("seed")?;
                    Some((name.clone(), seed.clone()))
                })
                .collect(),
            tracking,
            axes,
            changes: outcome.changes.clone(),
            warnings,
            real_time: outcome.real_time.clone(),
            coupling_error: None,
            variable_step: outcome.variable.clone(),
        }
    }
}

/// What a table is asked for, where that is not the motion itself: what a component computes that has
/// the outputs `table_displacement`, `table_velocity` and `table_acceleration`.
pub fn asked(record: &Record, motion: &Motion) -> Option<Motion> {
    let mut columns = record.columns.iter();
    let name = columns.find_map(|column| column.strip_suffix(".table_displacement"))?;
    let column = |quantity| record.column(&format!("{name}.table_{quantity}"));
    Some(Motion {
        name: format!("{} through `{name}`", motion.name),
        displacement: column("displacement")?,
        velocity: column("velocity")?,
        acceleration: column("acceleration")?,
        ..motion.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    #[test]
    fn a_table_is_asked_for_what_a_structure_computes_where_there_is_one() {
        let motion = made::wave("wave", 3);
        let columns = [
            "time",
            "structure.table_displacement",
            "structure.table_velocity",
            "structure.table_acceleration",
        ];
        let columns = columns.map(String::from).to_vec();
        let record = Record::of(
            columns.clone(),
            vec![0.0, 1.0, 2.0, 3.0, 0.5, 4.0, 5.0, 6.0],
            Vec::new(),
            Vec::new(),
        );
        let own = asked(&record.unwrap(), &motion).unwrap();
        assert_eq!(own.name, "wave through `structure`");
        assert_eq!(
            (own.displacement, own.velocity, own.acceleration),
            (vec![1.0, 4.0], vec![2.0, 5.0], vec![3.0, 6.0])
        );
        assert!(asked(&Record::with_capacity(columns[..3].to_vec(), 0), &motion).is_none());
        assert!(asked(&made::followed(&motion, 1.0), &motion).is_none());
    }

    #[test]
    fn a_trip_is_what_stopped_a_run() {
        let trip = |ended: &Ended| Trip::of(ended).map(|own| (own.time_s, own.cause));
        let interlock = |cause: Option<&str>| Ended::Interlock {
            signal: "interlock.tripped".into(),
            time: 1.5,
            cause: cause.map(str::to_string),
        };
        assert_eq!(
            trip(&interlock(Some("stroke"))),
            Some((1.5, "stroke".into()))
        );
        assert_eq!(
            trip(&interlock(None)),
            Some((1.5, "interlock.tripped".into()))
        );
        assert_eq!(trip(&Ended::Complete), None);
        assert_eq!(trip(&Ended::Interrupted { time: 2.0 }), None);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("summary.json");
        std::fs::write(&path, "{}").unwrap();
        let told = Summary::read(&path).unwrap_err().to_string();
        assert!(
            told.contains("summary.json") && told.contains("not the summary of a run"),
            "{told}"
        );
    }
}

//! Every motion under every controller.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::result::{Comparison, History, Row};
use crate::error::Error;
use crate::run::experiment::{Request, prepare};
use crate::systems::tuning::Tuning;
use motion::{metrics, peak};

/// What is compared on which rig.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Built-in systems.
    pub controllers: Vec<String>,
    /// What is played.
    pub motions: Vec<Played>,
    /// Plant of the systems.
    pub plant: String,
    /// Specimen of the systems.
    pub specimen: String,
    /// Parameters of the controllers; none: by the plant.
    pub tuning: Option<Tuning>,
    /// Model file on which they are tuned.
    pub control_model: Option<PathBuf>,
}

/// What is played.
#[derive(Debug, Clone)]
pub enum Played {
    /// A record, made playable.
    Record(PathBuf),
    /// A reference, as it stands.
    Reference(PathBuf),
    /// The built-in motion with a seed.
    Seed(u64),
}

/// How far a comparison is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Runs that are done.
    pub done: usize,
    /// All runs.
    pub of: usize,
}

impl Played {
    /// `base` with this motion.
    pub fn request(&self, base: &Request) -> Request {
        let mut own = base.clone();
        match self {
            Self::Record(path) => own.record = Some(path.clone()),
            Self::Reference(path) => own.reference = Some(path.clone()),
            Self::Seed(number) => own.seed = *number,
        }
        own
    }

    /// The records in a folder (`.AT2`, `.csv`), by name.
    ///
    /// # Errors
    /// A folder that cannot be read or holds none.
    pub fn records_in(folder: &Path) -> Result<Vec<Self>, Error> {
        let fault = |reason: String| Error::File {
            path: folder.to_path_buf(),
            reason,
        };
        let entries = std::fs::read_dir(folder).map_err(|error| fault(error.to_string()))?;
        let mut found = Vec::new();
        for entry in entries {
            let path = entry.map_err(|error| fault(error.to_string()))?.path();
            let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
            if matches!(extension.as_deref(), Some("at2" | "csv")) {
                found.push(path);
            }
        }
        if found.is_empty() {
            return Err(fault("holds no record (.AT2 or .csv)".into()));
        }
        found.sort();
        Ok(found.into_iter().map(Self::Record).collect())
    }
}

/// Plays every motion under every controller, in parallel; `progress` is called after each run.
///
/// # Errors
/// Unknown names, or a motion at fault: nothing is run then.
pub fn compare(plan: &Plan, progress: &(dyn Fn(Progress) + Sync)) -> Result<Comparison, Error> {
    let requests: Vec<Request> = plan
        .controllers
        .iter()
        .flat_map(|controller| {
            plan.motions
                .iter()
                .map(|motion| request(plan, controller, motion))
        })
        .collect();
    let motions = plan.motions.len().max(1);
    // One system assembled first builds the components once, and finds faults before the runs.
    for request in requests.iter().step_by(motions) {
        prepare(request)?;
    }
    let done = AtomicUsize::new(0);
    let tell = |done| {
        progress(Progress {
            done,
            of: requests.len(),
        });
    };
    tell(0);
    let rows: Result<Vec<Row>, Error> = requests
        .par_iter()
        .enumerate()
        .map(|(place, request)| {
            let row = run(request, place.is_multiple_of(motions));
            tell(1 + done.fetch_add(1, Ordering::Relaxed));
            row
        })
        .collect();
    Ok(Comparison::new(&plan.plant, &plan.specimen, rows?))
}

fn request(plan: &Plan, controller: &str, played: &Played) -> Request {
    played.request(&Request {
        plant: plan.plant.clone(),
        specimen: plan.specimen.clone(),
        tuning: plan.tuning,
        control_model: plan.control_model.clone(),
        ..Request::built_in(controller)
    })
}

fn run(request: &Request, keep_history: bool) -> Result<Row, Error> {
    let prepared = prepare(request)?;
    let outcome = prepared.run(prepared.algorithm)?;
    let column = |name: &str| outcome.record.column(&format!("table.{name}"));
    let motion = &prepared.motion;
    let histories = column("displacement").zip(column("acceleration"));
    let tracking = histories
        .as_ref()
        .filter(|_| outcome.ended.is_regular())
        .and_then(|(x, a)| metrics::tracking(motion, x, a).ok());
    let difference = |got: &[f64], wanted: &[f64]| {
        let pairs = got.iter().zip(wanted);
        pairs.map(|(got, wanted)| got - wanted).collect()
    };
    let peak_displacement_m = histories.as_ref().map(|(x, _)| peak(x));
    let history = histories.filter(|_| keep_history).map(|(x, a)| History {
        dt: motion.dt,
        displacement_error: difference(&x, &motion.displacement),
        acceleration_error: difference(&a, &motion.acceleration),
    });
    Ok(Row {
        record: prepared.motion.name.clone(),
        controller: request.system.clone(),
        time_domain_percent: tracking.map(|t| t.time_domain_percent),
        frequency_domain_percent: tracking.map(|t| t.frequency_domain_percent),
        response_spectrum_percent: tracking
            .and_then(|t| Some(t.laboratory?.largest_spectrum_deviation())),
        significant_duration_percent: tracking
            .and_then(|t| Some(t.laboratory?.significant_duration_percent)),
        peak_displacement_m,
        ended: outcome.ended.kind(),
        ended_because: outcome.ended.reason(),
        ended_s: outcome.ended.time(),
        history,
    })
}

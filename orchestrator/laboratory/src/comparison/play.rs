//! Every motion under every controller.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::result::{AlongY, Comparison, History, Row};
use crate::error::Error;
use crate::run::axes;
use crate::run::experiment::{Request, is_file, prepare, system_file};
use crate::run::table::Table;
use fmi_system::Link;
use motion::{metrics, peak};

/// What is compared on which rig.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Built-in systems, and paths of files.
    pub systems: Vec<String>,
    /// What is played.
    pub motions: Vec<Played>,
    /// Everything else of the runs: the rig, the length and the parameters, each for the systems that
    /// have its component.
    pub base: Request,
}

/// What is played.
#[derive(Debug, Clone)]
pub enum Played {
    /// A record, made playable.
    Record(PathBuf),
    /// Records along two axes, made playable at one scale.
    Records([PathBuf; 2]),
    /// A reference, as it stands.
    Reference(PathBuf),
    /// References along two axes.
    References([PathBuf; 2]),
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
    /// What a request plays.
    pub fn of(request: &Request) -> Self {
        match (&request.record, &request.reference) {
            (Some(x), _) => match &request.record_y {
                Some(y) => Self::Records([x.clone(), y.clone()]),
                None => Self::Record(x.clone()),
            },
            (None, Some(x)) => match &request.reference_y {
                Some(y) => Self::References([x.clone(), y.clone()]),
                None => Self::Reference(x.clone()),
            },
            (None, None) => Self::Seed(request.seed),
        }
    }

    /// `base` with this motion.
    pub fn request(&self, base: &Request) -> Request {
        let mut own = Request {
            record: None,
            record_y: None,
            reference: None,
            reference_y: None,
            ..base.clone()
        };
        match self {
            Self::Record(path) => own.record = Some(path.clone()),
            Self::Records([x, y]) => {
                (own.record, own.record_y) = (Some(x.clone()), Some(y.clone()));
            }
            Self::Reference(path) => own.reference = Some(path.clone()),
            Self::References([x, y]) => {
                (own.reference, own.reference_y) = (Some(x.clone()), Some(y.clone()));
            }
            Self::Seed(number) => own.seed = *number,
        }
        own
    }

    /// The records in a folder (`.AT2`, `.csv`), by name.
    ///
    /// # Errors
    /// A folder that cannot be read or holds none.
    pub fn records_in(folder: &Path) -> Result<Vec<PathBuf>, Error> {
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
        Ok(found)
    }
}

/// Plays every motion under every controller, in parallel; `progress` is called after each run.
///
/// # Errors
/// Unknown names, or a motion at fault: nothing is run then.
pub fn compare(plan: &Plan, progress: &(dyn Fn(Progress) + Sync)) -> Result<Comparison, Error> {
    let mut requests = Vec::new();
    for system in &plan.systems {
        for motion in &plan.motions {
            requests.push(request(&plan.base, system, motion)?);
        }
    }
    for set in &plan.base.set {
        if requests.iter().all(|own| !own.set.contains(set)) {
            return Err(Error::Option {
                option: "--set",
                reason: format!("`{set}`: none of the systems has this component"),
            });
        }
    }
    let motions = plan.motions.len().max(1);
    // One system assembled first builds the components once, and finds faults before the runs.
    for request in requests.iter().step_by(motions) {
        prepare(request)?;
    }
    let labels = labels(&plan.systems);
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
            let label = &labels[place / motions];
            let row = run(request, label, place.is_multiple_of(motions));
            tell(1 + done.fetch_add(1, Ordering::Relaxed));
            row
        })
        .collect();
    let of_rig = |text: &str| match plan.systems.iter().all(|system| is_file(system)) {
        true => "of each file".to_string(),
        false => text.to_string(),
    };
    let base = &plan.base;
    Ok(Comparison::new(
        &of_rig(&base.plant),
        &of_rig(&base.specimen),
        rows?,
    ))
}

/// `base` of this system on this motion, with the parameters of the components that the system has.
///
/// # Errors
/// A system that cannot be read.
pub fn request(base: &Request, system: &str, played: &Played) -> Result<Request, Error> {
    let mut request = Request {
        system: system.to_string(),
        ..played.request(base)
    };
    if !request.set.is_empty() {
        let file = system_file(&request, None)?;
        request.set.retain(|set| {
            let name = set.split('=').next().unwrap_or(set).trim();
            let component = name.split('.').next().unwrap_or(name);
            file.components.contains_key(component)
        });
    }
    Ok(request)
}

/// Names of systems in a comparison: of a file that without its ending, with its folder or its whole path where
/// another system has the same name.
pub fn labels(systems: &[String]) -> Vec<String> {
    let names = |system: &String| {
        let path = Path::new(system);
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let folder = path.parent().and_then(Path::file_name).unwrap_or_default();
        match is_file(system) {
            true => [
                stem.to_string(),
                format!("{}-{stem}", folder.to_string_lossy()),
                system.clone(),
            ],
            false => [system.clone(), system.clone(), system.clone()],
        }
    };
    let all: Vec<[String; 3]> = systems.iter().map(names).collect();
    let is_only = |name: &String, level: usize| {
        let same = all.iter().filter(|other| other[level] == *name);
        same.count() == 1
    };
    let label = |own: &[String; 3]| {
        let mut levels = own.iter().enumerate();
        let found = levels.find(|(level, name)| is_only(name, *level));
        found.map_or(&own[2], |(_, name)| name).clone()
    };
    all.iter().map(label).collect()
}

fn run(request: &Request, label: &str, keep_history: bool) -> Result<Row, Error> {
    let prepared = prepare(request)?;
    let outcome = prepared.run(prepared.algorithm)?;
    let system = &prepared.system;
    let names = system.components.iter().map(|own| own.name.as_str());
    let links: Vec<Link> = system.links().collect();
    let both = axes::tables(names.clone(), &links, &outcome.record);
    let is_measured = outcome.ended.is_regular();
    let axes = axes::measure(
        both.as_ref(),
        &prepared.motion,
        &outcome.record,
        is_measured,
    );
    let table = Table::among(names, &links, &outcome.record);
    let column = |name: &str| outcome.record.column(&table.as_ref()?.name(name));
    let motion = &prepared.motion;
    let histories = column("displacement").zip(column("acceleration"));
    let tracking = histories
        .as_ref()
        .filter(|_| is_measured)
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
        record: match &motion.across {
            Some(across) => format!("{} and {}", motion.name, across.name),
            None => motion.name.clone(),
        },
        controller: label.to_string(),
        time_domain_percent: tracking.map(|t| t.time_domain_percent),
        frequency_domain_percent: tracking.map(|t| t.frequency_domain_percent),
        response_spectrum_percent: tracking
            .and_then(|t| Some(t.laboratory?.largest_spectrum_deviation())),
        significant_duration_percent: tracking
            .and_then(|t| Some(t.laboratory?.significant_duration_percent)),
        peak_displacement_m,
        along_y: axes.get(1).map(AlongY::of),
        ended: outcome.ended.kind(),
        ended_because: outcome.ended.reason(),
        ended_s: outcome.ended.time(),
        history,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_one_name_are_told_apart_by_their_folders() {
        let named =
            |systems: &[&str]| labels(&systems.iter().map(|s| s.to_string()).collect::<Vec<_>>());
        assert_eq!(named(&["mpc", "/rigs/a/lqg.toml"]), ["mpc", "lqg"]);
        assert_eq!(
            named(&["/rigs/a/mpc.toml", "/rigs/b/mpc.toml"]),
            ["a-mpc", "b-mpc"]
        );
        assert_eq!(
            named(&["/x/a/mpc.toml", "/y/a/mpc.toml"]),
            ["/x/a/mpc.toml", "/y/a/mpc.toml"]
        );
        assert_eq!(named(&["mpc", "/rigs/a/mpc.toml"]), ["mpc", "a-mpc"]);
    }
}

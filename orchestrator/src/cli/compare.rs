//! `shakebench compare`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::comparison::tables as compare_tables;
use crate::error::Error;
use crate::fmu::FmiVersion;
use crate::master::{Algorithm, Ended};
use crate::metrics;
use crate::motion;
use crate::run::experiment::{Request, prepare};
use crate::system::built_in;
use crate::system::tuning::Tuning;

/// Options of `shakebench compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench compare --records NGA --specimen none\n  \
    shakebench compare --controllers three-variable,sliding-mode --json")]
pub struct Arguments {
    /// Built-in systems, separated by commas [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    controllers: Vec<String>,
    /// Records, or folders of them [default: the built-in motion with eight seeds]
    #[arg(long, value_name = "FILE|DIR", num_args = 1.., conflicts_with = "reference")]
    records: Vec<PathBuf>,
    /// Reference: .csv with time, displacement, velocity, acceleration, used to the letter
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Plant: identified, servohydraulic [default: identified]
    #[arg(long)]
    plant: Option<String>,
    /// Specimen: none, linear, yielding [default: linear]
    #[arg(long)]
    specimen: Option<String>,
    /// Parameters of the controllers [default: tuned on servohydraulic, otherwise printed]
    #[arg(long, value_enum)]
    tuning: Option<Tuning>,
    /// Folder for report.html, comparison.json and errors.csv [default: shakebench-results/comparison]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// A run of the comparison.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) record: String,
    pub(crate) controller: String,
    pub(crate) time_domain_percent: Option<f64>,
    pub(crate) frequency_domain_percent: Option<f64>,
    pub(crate) peak_displacement_m: Option<f64>,
    /// `complete`, `interlock` or `failed`.
    pub(crate) ended: String,
    /// Why it ended early.
    pub(crate) ended_because: Option<String>,
    /// When it was stopped, s.
    pub(crate) ended_s: Option<f64>,
    /// For the plots, of the first motion only.
    #[serde(skip)]
    pub(crate) history: Option<History>,
}

impl Row {
    pub(crate) fn is_complete(&self) -> bool {
        self.ended == "complete"
    }
}

/// How far the table was from its reference, a value a sample.
#[derive(Debug, Clone)]
pub(crate) struct History {
    /// Sample time, s.
    pub(crate) dt: f64,
    /// m.
    pub(crate) displacement_error: Vec<f64>,
    /// m/s².
    pub(crate) acceleration_error: Vec<f64>,
}

/// What is played.
#[derive(Debug, Clone)]
enum Played {
    Record(PathBuf),
    Reference(PathBuf),
    Seed(u64),
}

/// Plays every motion under every controller, in parallel, and prints the errors beside those of
/// the thesis.
///
/// # Errors
/// Unknown names, or a motion at fault: nothing is run then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let controllers = controllers(&arguments.controllers)?;
    let played = played(arguments)?;
    // One system assembled first builds the components once, and finds faults before the runs.
    let requests: Vec<Request> = controllers
        .iter()
        .flat_map(|controller| {
            played
                .iter()
                .map(|motion| request(arguments, controller, motion))
        })
        .collect();
    for request in requests.iter().step_by(played.len().max(1)) {
        prepare(request)?;
    }
    let bar = ProgressBar::new(requests.len() as u64);
    // A template that cannot be read leaves the plain bar.
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos} of {len} runs, {eta} left") {
        bar.set_style(style);
    }
    let rows: Result<Vec<Row>, Error> = requests
        .par_iter()
        .enumerate()
        .map(|(place, request)| {
            let is_first = place.is_multiple_of(played.len().max(1));
            let row = run(request, is_first);
            bar.inc(1);
            row
        })
        .collect();
    bar.finish_and_clear();
    let rows = rows?;

    let medians = compare_tables::medians(&rows, &controllers);
    let json = serde_json::json!({
        "rows": rows,
        "medians": medians,
        "plant": plant(arguments),
        "specimen": specimen(arguments),
    });
    let folder = arguments.out.clone();
    let folder = folder.unwrap_or_else(|| "shakebench-results/comparison".into());
    let tables = compare_tables::tables(&rows, &controllers);
    let files = compare_tables::write(&folder, &rows, &controllers, &json)?;
    if arguments.json {
        println!("{json}");
    } else {
        println!(
            "plant {}, specimen {}\n",
            plant(arguments),
            specimen(arguments)
        );
        for table in &tables {
            println!("{}", table.text());
        }
        println!("written:");
        for file in files {
            println!("  {}", file.display());
        }
    }
    let failed: Vec<&Row> = rows.iter().filter(|row| !row.is_complete()).collect();
    for row in &failed {
        eprintln!(
            "error: {} on {} ended early ({}): {}",
            row.controller,
            row.record,
            row.ended,
            row.ended_because.as_deref().unwrap_or_default()
        );
    }
    Ok(if failed.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(1)
    })
}

fn plant(arguments: &Arguments) -> &str {
    arguments
        .plant
        .as_deref()
        .unwrap_or(built_in::DEFAULT_PLANT)
}

fn specimen(arguments: &Arguments) -> &str {
    arguments
        .specimen
        .as_deref()
        .unwrap_or(built_in::DEFAULT_SPECIMEN)
}

fn controllers(asked: &[String]) -> Result<Vec<String>, Error> {
    if asked.is_empty() {
        return Ok(built_in::names().map(String::from).collect());
    }
    for name in asked {
        if !built_in::names().any(|known| known == name) {
            let known: Vec<&str> = built_in::names().collect();
            return Err(Error::Option {
                option: "--controllers",
                reason: format!(
                    "`{name}` is no built-in system; expected {}",
                    known.join(", ")
                ),
            });
        }
    }
    Ok(asked.to_vec())
}

fn played(arguments: &Arguments) -> Result<Vec<Played>, Error> {
    if let Some(reference) = &arguments.reference {
        return Ok(vec![Played::Reference(reference.clone())]);
    }
    if arguments.records.is_empty() {
        return Ok((1..=8).map(Played::Seed).collect());
    }
    let mut found = Vec::new();
    for path in &arguments.records {
        if !path.is_dir() {
            found.push(Played::Record(path.clone()));
            continue;
        }
        let mut inside = records_in(path)?;
        inside.sort();
        found.extend(inside.into_iter().map(Played::Record));
    }
    Ok(found)
}

fn records_in(folder: &Path) -> Result<Vec<PathBuf>, Error> {
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
    Ok(found)
}

fn request(arguments: &Arguments, controller: &str, played: &Played) -> Request {
    let (mut record, mut reference, mut seed) = (None, None, motion::DEFAULT_SEED);
    match played {
        Played::Record(path) => record = Some(path.clone()),
        Played::Reference(path) => reference = Some(path.clone()),
        Played::Seed(number) => seed = *number,
    }
    Request {
        system: controller.to_string(),
        plant: plant(arguments).to_string(),
        specimen: specimen(arguments).to_string(),
        tuning: arguments.tuning,
        record,
        reference,
        seed,
        scaling: None,
        set: Vec::new(),
        fmi: FmiVersion::V3,
        algorithm: Algorithm::default(),
        step_s: None,
        duration_s: None,
    }
}

fn run(request: &Request, keep_history: bool) -> Result<Row, Error> {
    let prepared = prepare(request)?;
    let outcome = prepared.run(request.algorithm)?;
    let column = |name: &str| outcome.record.column(&format!("table.{name}"));
    let motion = &prepared.motion;
    let histories = column("displacement").zip(column("acceleration"));
    let tracking = histories
        .as_ref()
        .and_then(|(x, a)| metrics::tracking(motion, x, a).ok());
    let difference = |got: &[f64], wanted: &[f64]| {
        let pairs = got.iter().zip(wanted);
        pairs.map(|(got, wanted)| got - wanted).collect()
    };
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
        peak_displacement_m: tracking.map(|t| t.peak_displacement),
        ended: outcome.ended.word().to_string(),
        ended_because: match &outcome.ended {
            Ended::Complete => None,
            ended => Some(ended.story()),
        },
        ended_s: outcome.ended.time(),
        history,
    })
}

//! `shakebench benchmark marths`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use hybrid::marths::criteria::COLUMNS;
use hybrid::marths::run::ground;
use indicatif::{ProgressBar, ProgressStyle};
use laboratory::error::Error;
use laboratory::results::{Out, Results};
use pages::report;

use super::outcome::Outcome;
use super::study::{Motion, Plants, Study};
use super::{page, roster};
use crate::console;
use crate::vrths::motions::{INTENSITY, data_folder, records};

/// Options of `shakebench benchmark marths`.
#[derive(Debug, Args)]
#[command(
    after_help = "Controllers: rodeac (the benchmark's own), none, predictive, \
    adaptive-predictive, adaptive-predictive-estimate, and the latter three with `decoupled-` before the name, which \
    leave the coupling out.\n\nExamples:\n  \
    shakebench benchmark marths --motion el-centro --perturbed 0\n  \
    shakebench benchmark marths --controller rodeac,adaptive-predictive --json > scores.json"
)]
pub struct Marths {
    /// Ground motions: el-centro, kobe, morgan-hill, built-in or files [default: the three]
    #[arg(long = "motion", value_name = "NAME|FILE", value_delimiter = ',')]
    motions: Vec<String>,
    /// Controllers [default: all]
    #[arg(long = "controller", value_name = "NAME", value_delimiter = ',')]
    controllers: Vec<String>,
    /// Perturbed plants, in addition to the nominal one
    #[arg(long, value_name = "N", default_value_t = 20)]
    perturbed: u32,
    /// Run on 32 corners of the perturbations instead: three standard deviations, gains 5 % off, commands a sample late
    #[arg(long, conflicts_with = "perturbed")]
    corners: bool,
    /// Seed of plants and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder of the benchmark's records [default: marths in SHAKEBENCH_SHARED, or ../shared/marths]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Folder for report.html, scores.json and runs.csv [default: none are written]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Runs the benchmark.
///
/// # Errors
/// Unknown names: nothing is run then; a folder that cannot be written.
pub fn execute(arguments: &Marths, results: &Out) -> Result<ExitCode, Error> {
    let folder = data_folder("marths", arguments.data.as_deref());
    if let (Some(given), None) = (&arguments.data, &folder) {
        return Err(Error::File {
            path: given.clone(),
            reason: "folder not found; expected el-centro.csv, kobe.csv and morgan-hill.csv in it"
                .into(),
        });
    }
    let study = Study {
        motions: records(&arguments.motions, folder.as_deref())?
            .into_iter()
            .map(|record| Motion {
                ground: ground(record.spacing, &record.acceleration, INTENSITY),
                name: record.name,
            })
            .collect(),
        controllers: controllers(&arguments.controllers)?,
        plants: match arguments.corners {
            true => Plants::Corners,
            false => Plants::Drawn(arguments.perturbed),
        },
        seed: arguments.seed,
    };
    let given = arguments.out.as_deref();
    let out = given.map(|path| results.at(path));
    if let Some(out) = &out {
        Results::check(out)?;
    }
    let bar = ProgressBar::new(study.jobs() as u64);
    // A template that cannot be read leaves the plain bar.
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos} of {len} plants, {eta} left") {
        bar.set_style(style);
    }
    let mut outcome = Outcome::of(&study, || bar.inc(1)).map_err(|error| Error::Option {
        option: "benchmark marths",
        reason: error.to_string(),
    })?;
    bar.finish_and_clear();
    if folder.is_none() && arguments.motions.is_empty() {
        outcome.notes.push(
            "the benchmark's records were not found (--data DIR): the built-in motion is used \
             instead"
                .into(),
        );
    }
    let files = match &out {
        Some(out) => write(out, &outcome)?,
        None => Vec::new(),
    };
    let printed = console::print(
        arguments.json,
        &serde_json::json!(outcome),
        &outcome.text(),
        &files,
    );
    printed.map_err(|error| Error::File {
        path: "standard output".into(),
        reason: error.to_string(),
    })?;
    Ok(ExitCode::SUCCESS)
}

fn controllers(names: &[String]) -> Result<Vec<roster::Entry>, Error> {
    if names.is_empty() {
        return Ok(roster::ALL.to_vec());
    }
    let known = || roster::ALL.iter().map(|entry| entry.name);
    let find = |name: &String| {
        roster::entry(name).ok_or_else(|| Error::Option {
            option: "--controller",
            reason: format!(
                "`{name}` is not a controller{}; expected {}",
                units::hint(name, known()),
                known().collect::<Vec<_>>().join(", ")
            ),
        })
    };
    names.iter().map(find).collect()
}

/// Writes report, scores and one row per run.
fn write(folder: &Out, outcome: &Outcome) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    results.write_page(report::FILE, &page::report(outcome))?;
    results.write("scores.json", |file| {
        serde_json::to_writer_pretty(file, outcome).map_err(std::io::Error::other)
    })?;
    results.write("runs.csv", |file| {
        let mut csv = csv::Writer::from_writer(file);
        let heads = ["controller", "motion", "plant", "stable", "peak_volts"];
        csv.write_record(heads.into_iter().chain(COLUMNS))?;
        for (name, score) in &outcome.controllers {
            for run in &score.all {
                let heads = [
                    (*name).to_string(),
                    run.motion.clone(),
                    run.plant.to_string(),
                    run.criteria.is_some().to_string(),
                    run.peak_volts.to_string(),
                ];
                let criteria = run.criteria.unwrap_or([f64::NAN; COLUMNS.len()]);
                csv.write_record(heads.into_iter().chain(criteria.map(|c| c.to_string())))?;
            }
        }
        csv.flush()
    })?;
    Ok(results.finish()?)
}

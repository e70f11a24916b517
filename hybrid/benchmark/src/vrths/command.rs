//! `shakebench benchmark vrths`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use hybrid::vrths::{BenchmarkCase, InteractionForm};
use identification::diagnosis::engine::Observer;
use indicatif::{ProgressBar, ProgressStyle};

use super::hidden::{HiddenError, HiddenStudy, read_hidden};
use super::motions::{self, INTENSITY, RECORDS};
use super::outcome::Outcome;
use super::study::{Plants, Study};
use super::{page, published, roster};
use laboratory::diagnosis::EXTENDED_MODEL;
use laboratory::error::Error;
use laboratory::results::{Out, Results};
use pages::report;
use units::nearest;

use crate::console::print;

/// Options of `shakebench benchmark vrths`.
#[derive(Debug, Args)]
#[command(after_help = "Controllers: phase-lead-pi (the benchmark's own), \
    inverse-without-specimen, inverse, inverse-pi, robust, linear-quadratic, sliding-mode, \
    gradient-inverse, adaptive-inverse.\n\nExamples:\n  \
    shakebench benchmark vrths --case 1 --motion el-centro --perturbed 0\n  \
    shakebench benchmark vrths --controller adaptive-inverse --plant derivative-blocks --corners 3\n  \
    shakebench benchmark vrths --hidden delay=1ms --case 1 --out play\n  \
    shakebench benchmark vrths --json > scores.json")]
pub struct Vrths {
    /// Cases, 1 to 4 [default: all]
    #[arg(long = "case", value_name = "N", value_delimiter = ',')]
    cases: Vec<u8>,
    /// Ground motions: el-centro, kobe, morgan-hill, built-in or files [default: the three]
    #[arg(long = "motion", value_name = "NAME|FILE", value_delimiter = ',')]
    motions: Vec<String>,
    /// Controllers [default: all]
    #[arg(long = "controller", value_name = "NAME", value_delimiter = ',')]
    controllers: Vec<String>,
    /// Perturbed plants per case, in addition to the nominal one [default: 20]
    #[arg(long, value_name = "N", conflicts_with_all = ["corners", "stiffness_within"])]
    perturbed: Option<u32>,
    /// Instead, the sixteen corners at this number of standard deviations
    #[arg(long, value_name = "DEVIATIONS", conflicts_with = "stiffness_within")]
    corners: Option<f64>,
    /// Instead, ten plants per case with specimen stiffness spread up to this factor
    #[arg(long, value_name = "FACTOR")]
    stiffness_within: Option<f64>,
    /// Seed of plants and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// How the plant computes its derivatives
    #[arg(long, value_enum, default_value_t)]
    plant: Form,
    /// Add this effect to the nominal plant, record it, diagnose the record and design the laws
    /// again on the result: EFFECT=VALUE, such as "delay=1 ms"
    #[arg(long = "hidden", value_name = "EFFECT=VALUE",
          conflicts_with_all = ["perturbed", "corners", "stiffness_within", "plant"])]
    hidden: Vec<String>,
    /// Factor on the ground motions
    #[arg(long, value_name = "FACTOR", default_value_t = INTENSITY)]
    intensity: f64,
    /// Folder of the benchmark's records and table [default: vrths in SHAKEBENCH_SHARED, or
    /// ../shared/vrths]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Folder for report.html, scores.json and runs.csv [default: none are written]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, Default, ValueEnum)]
enum Form {
    /// By its equations
    #[default]
    TransferFunction,
    /// As the published program does
    DerivativeBlocks,
}

impl From<Form> for InteractionForm {
    fn from(form: Form) -> Self {
        match form {
            Form::TransferFunction => Self::TransferFunction,
            Form::DerivativeBlocks => Self::DerivativeBlocks,
        }
    }
}

/// Plants a case of `--stiffness-within`.
const STIFFNESSES: u32 = 10;

/// Runs the benchmark.
///
/// # Errors
/// Unknown names and numbers out of range: nothing is run then; a folder that cannot be written.
pub fn execute(arguments: &Vrths, results: &Out) -> Result<ExitCode, Error> {
    let folder = motions::data_folder("vrths", arguments.data.as_deref());
    if let (Some(given), None) = (&arguments.data, &folder) {
        return Err(Error::File {
            path: given.clone(),
            reason: "folder not found; expected el-centro.csv, kobe.csv and morgan-hill.csv in it"
                .into(),
        });
    }
    let study = study(arguments, folder.as_deref())?;
    let given = arguments.out.as_deref();
    let out = given.map(|path| results.at(path));
    if let Some(out) = &out {
        Results::check(out)?;
    }
    if !arguments.hidden.is_empty() {
        return hidden(arguments, study, out.as_ref());
    }
    let published = folder
        .as_deref()
        .map(published::read)
        .transpose()?
        .flatten();
    let el_centro = match &folder {
        Some(folder) => motions::motions(&[RECORDS[0].into()], Some(folder), INTENSITY)?.pop(),
        None => None,
    };

    let bar = ProgressBar::new(study.runs() as u64);
    // A template that cannot be read leaves the plain bar.
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos} of {len} plants, {eta} left") {
        bar.set_style(style);
    }
    let simulation = |error: plant::ModelError| Error::Option {
        option: "benchmark vrths",
        reason: error.to_string(),
    };
    let mut outcome =
        Outcome::of(&study, el_centro.as_ref(), published, || bar.inc(1)).map_err(simulation)?;
    bar.finish_and_clear();
    if folder.is_none() {
        outcome.notes.push(
            "the benchmark's records were not found (--data DIR): the built-in motion is used \
             instead, and the published table is omitted"
                .into(),
        );
    }

    let mut files = Vec::new();
    if let Some(out) = &out {
        let pictures = page::pictures(&study).map_err(simulation)?;
        files = write(out, &outcome, &page::report(&outcome, &pictures))?;
    }
    print(
        arguments.json,
        &serde_json::json!(outcome),
        &outcome.text(),
        &files,
    )
    .map_err(unwritable)?;
    Ok(ExitCode::SUCCESS)
}

/// Adds effects to the plant, diagnoses it and scores the laws.
fn hidden(arguments: &Vrths, study: Study, out: Option<&Out>) -> Result<ExitCode, Error> {
    let refused = |reason: String| Error::Option {
        option: "--hidden",
        reason,
    };
    let read = arguments.hidden.iter().map(|text| read_hidden(text));
    let hidden = HiddenStudy {
        hidden: read
            .collect::<Result<_, _>>()
            .map_err(|error| refused(error.to_string()))?,
        cases: study.cases,
        motions: study.motions,
        controllers: study.controllers,
        seed: study.seed,
    };
    let fault = |error: HiddenError| refused(error.to_string());
    let record = hidden.record().map_err(fault)?;
    let results = match out {
        Some(out) => {
            let mut results = Results::begin(out)?;
            results.write("record.csv", |file| record.write(file))?;
            // A diagnosis takes minutes.
            results.check_existing()?;
            Some(results)
        }
        None => None,
    };
    let outcome = hidden.run(&record, Observer::none()).map_err(fault)?;
    let mut files = Vec::new();
    if let (Some(out), Some(mut results)) = (out, results) {
        let model = outcome.extended_model().map_err(|error| Error::File {
            path: out.join(EXTENDED_MODEL),
            reason: error.to_string(),
        })?;
        results.write_text(EXTENDED_MODEL, &model)?;
        results.write("scores.json", |file| {
            serde_json::to_writer_pretty(file, &outcome).map_err(std::io::Error::other)
        })?;
        files = results.finish()?;
    }
    print(
        arguments.json,
        &serde_json::json!(outcome),
        &outcome.text(),
        &files,
    )
    .map_err(unwritable)?;
    Ok(ExitCode::SUCCESS)
}

fn unwritable(error: std::io::Error) -> Error {
    Error::File {
        path: "standard output".into(),
        reason: error.to_string(),
    }
}

fn study(arguments: &Vrths, folder: Option<&std::path::Path>) -> Result<Study, Error> {
    let cases: Result<Vec<_>, _> = arguments
        .cases
        .iter()
        .map(|number| BenchmarkCase::new(*number))
        .collect();
    let mut cases = cases.map_err(|error| Error::Option {
        option: "--case",
        reason: error.to_string(),
    })?;
    if cases.is_empty() {
        cases = BenchmarkCase::ALL.to_vec();
    }
    let positive = |option: &'static str, value: f64, expected: &str| {
        if value.is_finite() && value > 0.0 {
            return Ok(value);
        }
        Err(Error::Option {
            option,
            reason: format!("{value}, expected {expected}"),
        })
    };
    let intensity = positive("--intensity", arguments.intensity, "a positive factor")?;
    let plants = match (arguments.corners, arguments.stiffness_within) {
        (Some(by), _) => Plants::Corners(positive("--corners", by, "standard deviations")?),
        (None, Some(factor)) => Plants::StiffnessWithin {
            factor: positive("--stiffness-within", factor, "a positive factor")?,
            count: STIFFNESSES,
        },
        (None, None) => Plants::Drawn(arguments.perturbed.unwrap_or(20)),
    };
    Ok(Study {
        cases,
        motions: motions::motions(&arguments.motions, folder, intensity)?,
        controllers: controllers(&arguments.controllers)?,
        plants,
        form: arguments.plant.into(),
        seed: arguments.seed,
    })
}

fn controllers(names: &[String]) -> Result<Vec<roster::Entry>, Error> {
    if names.is_empty() {
        return Ok(roster::ALL.to_vec());
    }
    names
        .iter()
        .map(|name| {
            roster::entry(name).ok_or_else(|| {
                let known = || roster::ALL.iter().map(|entry| entry.name);
                let hint = nearest(name, known())
                    .map_or(String::new(), |near| format!("; did you mean `{near}`?"));
                let known: Vec<_> = known().collect();
                Error::Option {
                    option: "--controller",
                    reason: format!(
                        "`{name}` is not a controller; expected {}{hint}",
                        known.join(", ")
                    ),
                }
            })
        })
        .collect()
}

/// Writes report, scores and one row per run.
fn write(folder: &Out, outcome: &Outcome, page: &report::Report) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    results.write_page(report::FILE, page)?;
    results.write("scores.json", |file| {
        serde_json::to_writer_pretty(file, outcome).map_err(std::io::Error::other)
    })?;
    results.write("runs.csv", |file| {
        let mut csv = csv::Writer::from_writer(file);
        let heads = ["controller", "case", "motion", "plant", "stable", "J1 [ms]"];
        let scores = (2..=9).map(|i| format!("J{i} [%]"));
        let rest = [
            "true tracking [%]",
            "peak force [N]",
            "peak displacement [m]",
        ];
        csv.write_record(
            heads
                .map(String::from)
                .into_iter()
                .chain(scores)
                .chain(rest.map(String::from)),
        )?;
        for (name, score) in &outcome.controllers {
            for run in &score.all {
                let heads = [
                    (*name).to_string(),
                    run.case.to_string(),
                    run.motion.clone(),
                    run.plant.to_string(),
                    run.stable.to_string(),
                ];
                let rest = [
                    run.true_tracking_percent,
                    run.peak_force_n,
                    run.peak_displacement_m,
                ];
                let numbers = run.criteria.iter().chain(&rest).map(f64::to_string);
                csv.write_record(heads.into_iter().chain(numbers))?;
            }
        }
        csv.flush()
    })?;
    Ok(results.finish()?)
}

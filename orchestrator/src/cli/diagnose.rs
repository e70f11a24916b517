//! `shakebench diagnose`: a case of the shake table, or the description of a rig; and what a model
//! that came out of it makes of further records.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use identification::diagnosis::DiagnosisReport;
use identification::diagnosis::engine::{Observer, Progress};

use super::progress;
use crate::diagnosis::{diagnose, files, foreign, model, template, text};
use crate::error::Error;
use crate::fmu::Isolation;
use crate::results::unused;

/// What `diagnose` takes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench diagnose cases/dev-03 --out results/dev-03 --json\n  \
    shakebench diagnose identification/rigs/positioning_drive.toml --out results\n  \
    shakebench diagnose --template oscillator > rig.toml\n  \
    shakebench diagnose --model results/extended_model.toml --validate later.csv\n  \
    shakebench diagnose --model results/extended_model.toml --predict input.csv --out prediction.csv\n  \
    shakebench diagnose --fmu Theirs.fmu --template map > map.toml\n  \
    shakebench diagnose --fmu Theirs.fmu --map map.toml test.csv\n\n\
    A case is a folder with nominal.toml, identification.csv and validation.csv, and may have\n\
    small.csv and baseline.csv. Each header cell is `name [unit]`, in any order and unit; columns\n\
    of other names are left alone.")]
pub struct Arguments {
    /// Folder of a case (nominal.toml and records), description of a rig (.toml), or data files of an FMU
    #[arg(value_name = "CASE", required_unless_present_any = ["template", "model"])]
    cases: Vec<PathBuf>,
    /// Data files in place of those that the description of a rig names
    #[arg(long, value_name = "FILE")]
    data: Vec<PathBuf>,
    /// What the columns of the files are called: `channel = "header"` or
    /// `channel = { column = "header", unit = "mm" }` a line, in place of the usual names or of the
    /// description's
    #[arg(long, value_name = "MAP.toml")]
    columns: Option<PathBuf>,
    /// Print a commented description to fill in: table, actuator, drive, axis, hysteretic device, material,
    /// oscillator, damper or transfer system; with --fmu, `map`
    #[arg(long, value_name = "KIND", conflicts_with_all = ["cases", "model", "data"])]
    template: Option<String>,
    /// Extended model that a diagnosis wrote, of a table, a rig or an FMU; nothing is fitted
    #[arg(long, value_name = "EXTENDED.toml", conflicts_with_all = ["cases", "data"])]
    model: Option<PathBuf>,
    /// Diagnose a model that came as an FMU, by effects at its inputs and outputs and drifts of its
    /// parameters, on data files in place of CASE
    #[arg(long, value_name = "MODEL.fmu", conflicts_with = "columns")]
    fmu: Option<PathBuf>,
    /// Which column of the data is which input and output of the FMU; with --model, in place of the map
    /// beside it
    #[arg(long, value_name = "MAP.toml")]
    map: Option<PathBuf>,
    /// FMUs in a process of their own: without it foreign ones, but for the many simulations of a
    /// diagnosis, which then run in this process once the nominal model came to its end
    #[arg(long, value_enum)]
    isolate: Option<Isolation>,
    /// Score the model on these files
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "model")]
    validate: Vec<PathBuf>,
    /// Predict the output for every row of this file, whose output cells may be empty
    #[arg(
        long,
        value_name = "FILE",
        requires = "model",
        conflicts_with = "validate"
    )]
    predict: Option<PathBuf>,
    /// The predicted file is a period of a motion that goes on: predict its steady state
    #[arg(long, requires = "predict")]
    periodic: bool,
    /// Folder for report, JSON and extended model [default: shakebench-results/diagnosis-NAME], or file
    /// for a prediction [default: prediction.csv]
    #[arg(long, value_name = "DIR|FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Tell on standard error what is tried
    #[arg(long)]
    verbose: bool,
}

/// Diagnoses, writes the files and prints what was found; or does what `--template` and `--model` ask
/// for.
///
/// # Errors
/// What is at fault, by file and place; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    if let Some(kind) = &arguments.template {
        let text = match &arguments.fmu {
            Some(fmu) if kind.eq_ignore_ascii_case("map") => foreign::template(fmu)?,
            Some(_) => {
                return Err(Error::Option {
                    option: "--template",
                    reason: format!("`{kind}` with --fmu: expected `map`"),
                });
            }
            None => template(kind)?,
        };
        print!("{text}");
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(path) = &arguments.model {
        return with_model(arguments, path);
    }
    if arguments.map.is_some() && arguments.fmu.is_none() {
        return Err(Error::Option {
            option: "--map",
            reason: "it says which column is which input and output of an FMU: expected --fmu MODEL.fmu or \
                     --model with it"
                .into(),
        });
    }
    let case = match (&arguments.fmu, arguments.cases.as_slice()) {
        (Some(fmu), _) => fmu,
        (None, [case]) => case,
        (None, _) => {
            return Err(Error::Option {
                option: "CASE",
                reason: "expected one case or description; data files in place of a description's \
                         own go with --data"
                    .into(),
            });
        }
    };
    let folder = arguments.out.clone().unwrap_or_else(|| {
        let place = std::path::absolute(case).unwrap_or_else(|_| case.clone());
        let name = if place.is_dir() {
            place.file_name()
        } else {
            place.file_stem()
        };
        let name = name.unwrap_or_default().to_string_lossy();
        let folder = Path::new("shakebench-results").join(format!("diagnosis-{name}"));
        unused(&folder, |_| false)
    });
    let bar = progress::spinner("reading");
    let tell = |event: &Progress| {
        if arguments.verbose {
            eprintln!("{event}");
        } else {
            let words = event.to_string();
            bar.set_message(words.lines().next().unwrap_or_default().to_string());
        }
    };
    if arguments.verbose {
        bar.finish_and_clear();
    }
    let columns = arguments.columns.as_deref();
    let observer = Observer::new(&tell);
    let report = match &arguments.fmu {
        Some(fmu) => of_fmu(arguments, fmu, &folder, observer),
        None => diagnose(case, &arguments.data, columns, &folder, observer),
    };
    bar.finish_and_clear();
    let report = report?;
    if arguments.json {
        println!("{}", serde_json::json!(report));
    } else {
        print!("{}", text::text(&report));
        println!("\nwritten ({:.1} s):", report.wall_s);
        for file in files(&report, &folder) {
            println!("  {}", file.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn of_fmu(
    arguments: &Arguments,
    fmu: &Path,
    folder: &Path,
    observer: Observer<'_>,
) -> Result<DiagnosisReport, Error> {
    let Some(map) = &arguments.map else {
        return Err(Error::Option {
            option: "--fmu",
            reason: format!(
                "expected --map MAP.toml with it; `shakebench diagnose --fmu {} --template map` prints \
                 one to fill in",
                fmu.display()
            ),
        });
    };
    let files = arguments.cases.iter().chain(&arguments.data);
    foreign::diagnose(
        fmu,
        map,
        &files.cloned().collect::<Vec<_>>(),
        folder,
        arguments.isolate,
        observer,
    )
}

fn with_model(arguments: &Arguments, path: &Path) -> Result<ExitCode, Error> {
    let asked = model::Asked {
        model: path,
        columns: arguments.columns.as_deref(),
        fmu: arguments.fmu.as_deref(),
        map: arguments.map.as_deref(),
        isolate: arguments.isolate,
    };
    if let Some(file) = &arguments.predict {
        let out = arguments.out.clone();
        let out = out.unwrap_or_else(|| PathBuf::from("prediction.csv"));
        let found = model::predict(&asked, file, arguments.periodic, &out)?;
        if arguments.json {
            println!("{}", serde_json::json!(found));
        } else {
            println!(
                "{} in {} for {} rows, {} of them given: {}",
                found.channel,
                found.unit,
                found.rows,
                found.given,
                found.prediction.display()
            );
        }
    } else if arguments.validate.is_empty() {
        return Err(Error::Option {
            option: "--model",
            reason: "expected --validate FILE... or --predict FILE with it".into(),
        });
    } else {
        let found = model::validate(&asked, &arguments.validate)?;
        if arguments.json {
            println!("{}", serde_json::json!(found));
        } else {
            print!("{}", found.text());
        }
    }
    Ok(ExitCode::SUCCESS)
}

//! `shakebench diagnose`: a case of the shake table, or the description of a rig; and what a model
//! that came out of it makes of further records.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use identification::diagnosis::DiagnosisReport;
use identification::diagnosis::engine::{Deadline, Observer, Progress};

use super::out::{given, installation, units, unused};
use super::{multivariable, progress};
use fmi_import::Isolation;
use identification::diagnosis::rigs::guess::Guess;
use laboratory::diagnosis::{diagnose_files, diagnose_with, files, foreign, model, template, text};
use laboratory::error::Error;
use laboratory::results::Out;

/// What `diagnose` takes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench diagnose motion_1.csv motion_2.csv --out results\n  \
    shakebench diagnose cases/dev-03 --out results/dev-03 --json\n  \
    shakebench diagnose identification/rigs/positioning_drive.toml --out results\n  \
    shakebench diagnose rig.toml --effects mine.toml\n  \
    shakebench diagnose --template oscillator > rig.toml\n  \
    shakebench diagnose --model results/extended_model.toml --validate later.csv\n  \
    shakebench diagnose --model results/extended_model.toml --predict input.csv --out prediction.csv\n  \
    shakebench diagnose --fmu Theirs.fmu --template map > map.toml\n  \
    shakebench diagnose --fmu Theirs.fmu --map map.toml test.csv\n\n\
    A case is a folder with nominal.toml, identification.csv and validation.csv, and may have\n\
    small.csv and baseline.csv. Each header cell is `name [unit]`, in any order and unit; columns\n\
    of other names are ignored.")]
pub struct Arguments {
    /// Data files (kind and columns are guessed and shown), description of a rig (.toml), folder of a case
    /// (nominal.toml and records), or data files of an FMU
    #[arg(value_name = "CASE", required_unless_present_any = ["template", "model"])]
    cases: Vec<PathBuf>,
    /// Data files to use instead of those in the description of a rig
    #[arg(long, value_name = "FILE")]
    data: Vec<PathBuf>,
    /// Names of the columns, one per line: `channel = "header"` or `channel = { column = "header",
    /// unit = "mm" }`; replaces the usual names or the description's
    #[arg(long, value_name = "MAP.toml")]
    columns: Option<PathBuf>,
    /// Effects of your own to search beside those of the kind: expressions at its input, its output or inside
    /// of it, each with parameters and a sentence
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["model", "fmu", "template"])]
    effects: Option<PathBuf>,
    /// Print a commented description to fill in: table, actuator, drive, axis, hysteretic device, material,
    /// oscillator, damper, transfer system or two actuators; with --fmu, `map`
    #[arg(long, value_name = "KIND", conflicts_with_all = ["cases", "model", "data"])]
    template: Option<String>,
    /// Extended model from a diagnosis of a table, a rig or an FMU; nothing is fitted
    #[arg(long, value_name = "EXTENDED.toml", conflicts_with_all = ["cases", "data"])]
    model: Option<PathBuf>,
    /// Diagnose an FMU by effects at its inputs and outputs and drifts of its parameters; give data
    /// files instead of CASE
    #[arg(long, value_name = "MODEL.fmu", conflicts_with = "columns")]
    fmu: Option<PathBuf>,
    /// Map from columns of the data to inputs and outputs of the FMU; with --model, replaces the
    /// map next to it
    #[arg(long, value_name = "MAP.toml")]
    map: Option<PathBuf>,
    /// FMUs to run in a separate process [default: foreign ones; the many simulations of a
    /// diagnosis run in this process after the nominal model has completed]
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
    /// The predicted file is one period of a periodic motion: predict its steady state
    #[arg(long, requires = "predict")]
    periodic: bool,
    /// Folder for report, JSON and extended model [default: shakebench-results/diagnosis-NAME], or file
    /// for a prediction [default: prediction.csv]
    #[arg(short, long, value_name = "DIR|FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Time after which the search ends with the best that it has found; effects that it could not check are
    /// candidates then
    #[arg(long, value_name = "T", default_value = "10 min")]
    time_limit: String,
}

/// Diagnoses, writes the files and prints what was found; or does what `--template` and `--model` ask
/// for.
///
/// # Errors
/// What is at fault, by file and place; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    if let Some(kind) = &arguments.template {
        let text = match &arguments.fmu {
            Some(fmu) if kind.eq_ignore_ascii_case("map") => {
                foreign::template(fmu, installation())?
            }
            Some(_) => {
                return Err(Error::Option {
                    option: "--template",
                    reason: format!("`{kind}` with --fmu: expected `map`"),
                });
            }
            None => match multivariable::template(kind) {
                Some(text) => text.into(),
                None => template(kind)?,
            },
        };
        match arguments.json {
            true => println!("{}", serde_json::json!({"kind": kind, "template": text})),
            false => print!("{text}"),
        }
        return Ok(ExitCode::SUCCESS);
    }
    for files in [&arguments.cases, &arguments.data] {
        if let Some(path) = super::settings::twice(files) {
            return Err(Error::File {
                path: path.clone(),
                reason: "is given twice, and a fit cannot be tested on its own data; expected \
                         different files"
                    .to_string(),
            });
        }
    }
    if let Some(path) = &arguments.model {
        return with_model(arguments, path);
    }
    if arguments.map.is_some() && arguments.fmu.is_none() {
        return Err(Error::Option {
            option: "--map",
            reason: "it maps columns to inputs and outputs of an FMU: expected --fmu MODEL.fmu or \
                --model with it"
                .into(),
        });
    }
    if let (None, [case]) = (&arguments.fmu, arguments.cases.as_slice())
        && multivariable::is_description(case)
    {
        if arguments.effects.is_some() {
            return Err(Error::Option {
                option: "--effects",
                reason: format!(
                    "{} is a rig of several actuators; effects of your own apply to the kinds of rigs with \
                     one output",
                    case.display()
                ),
            });
        }
        return multivariable::diagnosed(
            case,
            &arguments.data,
            arguments.columns.as_deref(),
            arguments.out.as_deref(),
            arguments.json,
        );
    }
    let is_data = |path: &PathBuf| {
        path.is_file() && path.extension().is_none_or(|extension| extension != "toml")
    };
    let guesses = arguments.fmu.is_none() && arguments.cases.iter().all(is_data);
    let case = match (&arguments.fmu, arguments.cases.as_slice()) {
        (Some(fmu), _) => fmu,
        (None, [case, ..]) if guesses => case,
        (None, [case]) => case,
        (None, _) => {
            return Err(Error::Option {
                option: "CASE",
                reason:
                    "expected data files, or one case or description; pass data files other than \
                    the description's with --data"
                        .into(),
            });
        }
    };
    let limit = units::value_in(&arguments.time_limit, "s")
        .map_err(|error| error.to_string())
        .and_then(|limit| match Duration::try_from_secs_f64(limit) {
            Ok(limit) if !limit.is_zero() => Ok(limit),
            _ => Err(format!(
                "`{}`: expected more than 0 s",
                arguments.time_limit
            )),
        })
        .map_err(|reason| Error::Option {
            option: "--time-limit",
            reason,
        })?;
    let folder = arguments.out.clone().map(given).unwrap_or_else(|| {
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
    let guessed = RefCell::new(String::new());
    let tell = |event: &Progress| match progress::is_verbose() {
        true => eprintln!("{event}"),
        false => bar.set_message(short(event)),
    };
    let columns = arguments.columns.as_deref();
    let effects = arguments.effects.as_deref();
    let deadline = Deadline::after(limit);
    let observer = Observer::new(&tell).until(&deadline);
    let report = match &arguments.fmu {
        Some(fmu) => of_fmu(arguments, fmu, &folder, observer),
        None if guesses => {
            let files: Vec<PathBuf> = arguments
                .cases
                .iter()
                .chain(&arguments.data)
                .cloned()
                .collect();
            let tell = |guess: &Guess| {
                bar.suspend(|| note!("guessed from the files\n  {}", guess.sentences.join("\n  ")));
                guessed.replace(guess.text.clone());
            };
            diagnose_files(&files, columns, effects, &folder, &tell, observer)
        }
        None => diagnose_with(
            case,
            &arguments.data,
            columns,
            effects,
            &folder,
            installation(),
            observer,
        ),
    };
    bar.finish_and_clear();
    let report = report?;
    if arguments.json {
        super::print_json(serde_json::json!(report), &folder);
    } else {
        if guesses {
            println!(
                "description, to change where it is wrong:\n\n{}",
                guessed.take()
            );
        }
        print!("{}", text::text(&report, units()));
        println!("\nwritten ({:.1} s):", report.wall_s);
        for file in files(&report, &folder) {
            println!("  {}", file.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What happens, in a few words without figures.
fn short(event: &Progress) -> String {
    match event {
        Progress::Fitting(_) | Progress::Trying(_) => event.to_string().trim().to_string(),
        Progress::Noise { .. } => "learning the noise".to_string(),
        Progress::Model { effects, .. } if effects.is_empty() => "fitted the nominal model".into(),
        Progress::Model { effects, .. } => {
            let names: Vec<&str> = effects.iter().map(|(name, _)| *name).collect();
            format!("fitted {}", names.join(" and "))
        }
    }
}

fn of_fmu(
    arguments: &Arguments,
    fmu: &Path,
    folder: &Out,
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
        (arguments.isolate, installation()),
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
        installation: installation(),
    };
    if let Some(file) = &arguments.predict {
        let out = arguments.out.clone();
        let out = out.unwrap_or_else(|| PathBuf::from("prediction.csv"));
        let found = model::predict(&asked, file, arguments.periodic, &super::out::given(out))?;
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

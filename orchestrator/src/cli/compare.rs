//! `shakebench compare`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::out::{given, installation, units, unused};
use super::quantity::{if_given, whole};
use super::rig::RigArguments;
use super::{figures, print_files, progress};
use laboratory::comparison::{self, Plan, Played, Progress};
use laboratory::error::Error;
use laboratory::results::Out;
use laboratory::run::experiment::{Request, is_file};
use laboratory::run::perform;
use laboratory::run_comparison::{self, RunComparison};
use laboratory::systems::built_in;
use pages::report::columns::aligned;

/// Differences between runs that are printed; the files hold all.
const MOST_PRINTED: usize = 40;

/// Options of `shakebench compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench compare --records NGA --specimen none\n  \
    shakebench compare three-variable sliding-mode my-rig.toml --duration \"10 s\" --json\n  \
    shakebench compare first second                    # folders of finished runs\n  \
    shakebench compare first preview                   # a finished run, and preview control on its motion\n  \
    shakebench compare --figures 3-6,5-5               # the thesis's figures of runs")]
pub struct Arguments {
    /// Built-in systems, system files, and folders of finished runs (or folders that contain some) [default: all
    /// built-in systems]
    #[arg(value_name = "SYSTEM|RUN_DIR")]
    what: Vec<String>,
    /// Systems, separated by commas; a name here is never a folder
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    controllers: Vec<String>,
    /// Records, or folders of them [default: the built-in motion with eight seeds]
    #[arg(long, value_name = "FILE|DIR", num_args = 1.., conflicts_with = "reference")]
    records: Vec<PathBuf>,
    /// Records along the second axis of a biaxial table, one for each of --records in their order; without them that
    /// axis rests
    #[arg(long, value_name = "FILE|DIR", num_args = 1.., requires = "records")]
    records_y: Vec<PathBuf>,
    /// Reference: .csv with time, displacement, velocity, acceleration, played as given
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Reference along the second axis of a biaxial table
    #[arg(long, value_name = "FILE", requires = "reference")]
    reference_y: Option<PathBuf>,
    /// Built-in motion with this seed alone
    #[arg(long, value_name = "N", value_parser = whole::<u64>, conflicts_with_all = ["records", "reference"])]
    seed: Option<u64>,
    /// Play only the beginning of each motion, such as "10 s"
    #[arg(long, value_name = "T")]
    duration: Option<String>,
    /// Parameter of every system that has the instance, such as table.added_payload="10 kg"; repeatable
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    rig: RigArguments,
    /// Draw these figures of the thesis instead, such as 3-6,5-5 [default: all figures of runs]
    #[arg(long, value_name = "N-N", num_args = 0.., value_delimiter = ',', conflicts_with_all = ["what", "controllers"])]
    figures: Option<Vec<String>>,
    /// Folder for report.html, comparison.json and errors.csv, or runs.json and runs.csv [default:
    /// shakebench-results/comparison or runs]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Arguments {
    /// The folder of the results.
    fn out(&self, usual: &str) -> Out {
        let usual = Path::new("shakebench-results").join(usual);
        let own = self.out.clone().map(given);
        own.unwrap_or_else(|| unused(&usual, |_| false))
    }

    /// The first option that describes new runs.
    fn asks_for_runs(&self) -> Option<&'static str> {
        let rig = &self.rig;
        [
            ("--records", !self.records.is_empty()),
            ("--reference", self.reference.is_some()),
            ("--seed", self.seed.is_some()),
            ("--duration", self.duration.is_some()),
            ("--set", !self.set.is_empty()),
            ("--plant", rig.plant.is_some()),
            ("--specimen", rig.specimen.is_some()),
            ("--tuning", rig.tuning.is_some()),
            ("--control-model", rig.control_model.is_some()),
        ]
        .into_iter()
        .find_map(|(option, is_given)| is_given.then_some(option))
    }
}

/// Compares systems on motions, finished runs, or both.
///
/// # Errors
/// Unknown names, a motion at fault, a folder that holds no run: nothing is run or written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    if let Some(only) = &arguments.figures {
        let record = match arguments.records.as_slice() {
            [] => None,
            [one] => Some(one.as_path()),
            _ => {
                return Err(Error::Option {
                    option: "--records",
                    reason: "figures are drawn on one record; expected one file".into(),
                });
            }
        };
        let kind = figures::Kind::Runs;
        return figures::draw(only, kind, record, arguments.out.as_deref(), arguments.json);
    }
    let (folders, named): (Vec<&String>, Vec<&String>) = arguments
        .what
        .iter()
        .partition(|what| Path::new(what).is_dir());
    let folders: Vec<PathBuf> = folders.iter().map(PathBuf::from).collect();
    for (option, files) in [("compare", &folders), ("--records", &arguments.records)] {
        if let Some(path) = super::settings::twice(files) {
            return Err(Error::Option {
                option,
                reason: format!("{}: is given twice; expected it once", path.display()),
            });
        }
    }
    for folder in folders.iter().filter_map(|folder| folder.to_str()) {
        if built_in::check(folder).is_ok() {
            note!("note: `{folder}` is a folder here; --controllers {folder} runs the system");
        }
    }
    let mut systems = Vec::new();
    for name in named.into_iter().chain(&arguments.controllers) {
        let name = system(name.trim())?;
        if systems.contains(&name) {
            return Err(Error::Option {
                option: "compare",
                reason: format!("system `{name}` is given twice; expected it once"),
            });
        }
        systems.push(name);
    }
    if let (Some(file), true) = (
        systems.first(),
        systems.iter().all(|system| is_file(system)),
    ) {
        arguments.rig.refuse_of_file(file, None)?;
    }
    if folders.is_empty() {
        return systems_on_motions(arguments, systems);
    }
    if !systems.is_empty() {
        return with_new_runs(arguments, &folders, &systems);
    }
    if let Some(option) = arguments.asks_for_runs() {
        return Err(Error::Option {
            option,
            reason: "the runs in these folders are finished; name a system too, such as \
                three-variable, to run it with this option"
                .into(),
        });
    }
    let found = run_comparison::read(&folders, units())?;
    report_runs(arguments, &found, &arguments.out("runs"))
}

/// The system of this name, or of this file as an absolute path.
fn system(name: &str) -> Result<String, Error> {
    let fault = |reason| Error::Option {
        option: "compare",
        reason,
    };
    if !is_file(name) {
        let known = built_in::check(name);
        known.map_err(|error| {
            fault(format!(
                "{error}; a system file ends in .toml or .ssp, and there is no folder `{name}`"
            ))
        })?;
        return Ok(name.to_string());
    }
    if !Path::new(name).is_file() {
        return Err(fault(format!("{name}: no such file")));
    }
    Ok(super::run::absolute(Path::new(name)).display().to_string())
}

/// Plays every motion under every controller, in parallel, and prints the errors next to those of
/// the thesis.
fn systems_on_motions(arguments: &Arguments, systems: Vec<String>) -> Result<ExitCode, Error> {
    let systems = match systems.is_empty() {
        true => built_in::names().map(String::from).collect(),
        false => systems,
    };
    let plan = Plan {
        systems,
        motions: played(arguments)?,
        base: base(
            arguments,
            Request {
                installation: installation().clone(),
                ..Request::built_in(built_in::DEFAULT_SYSTEM)
            },
        )?,
    };
    let bar = progress::hidden_bar("{bar:40} {pos} of {len} runs, {eta} left");
    let found = comparison::compare(&plan, &|Progress { done, of }| {
        if done == 0 {
            progress::show(&bar, of);
        } else {
            bar.inc(1);
            if progress::is_verbose() {
                eprintln!("{done} of {of} runs");
            }
        }
    });
    bar.finish_and_clear();
    let found = found?;

    let folder = arguments.out("comparison");
    let files = comparison::write(&found, &folder)?;
    if arguments.json {
        super::print_json(serde_json::json!(found), &folder);
    } else {
        println!("plant {}, specimen {}\n", found.plant, found.specimen);
        for table in comparison::tables(&found) {
            println!("{}", table.text());
        }
        print_files(&files);
    }
    for row in found.ended_early() {
        eprintln!(
            "error: {} on {} ended early ({}): {}",
            row.controller,
            row.record,
            row.ended.word(),
            row.ended_because.as_deref().unwrap_or_default()
        );
    }
    Ok(match found.ended_early().next() {
        None => ExitCode::SUCCESS,
        Some(_) => ExitCode::from(1),
    })
}

/// What was asked of runs, on top of `request`.
fn base(arguments: &Arguments, request: Request) -> Result<Request, Error> {
    let rig = &arguments.rig;
    let mut set = request.set;
    set.extend(arguments.set.iter().cloned());
    Ok(Request {
        plant: rig.plant.as_ref().map_or(request.plant, |_| rig.plant()),
        specimen: rig
            .specimen
            .as_ref()
            .map_or(request.specimen, |_| rig.specimen()),
        tuning: rig.tuning.or(request.tuning),
        control_model: rig
            .control_model
            .as_deref()
            .map(super::run::absolute)
            .or(request.control_model),
        duration_s: if_given("--duration", &arguments.duration, "s")?.or(request.duration_s),
        set,
        ..request
    })
}

/// Runs systems on the motion and the rig of the first finished run, and compares all.
fn with_new_runs(
    arguments: &Arguments,
    folders: &[PathBuf],
    systems: &[String],
) -> Result<ExitCode, Error> {
    let finished = run_comparison::find(folders)?;
    let first = finished.first().map(|run| run.join("manifest.json"));
    let first = first.unwrap_or_else(|| PathBuf::from("manifest.json"));
    // The parameters that were set are those of another system, unless the rig has them too.
    let before = super::run::read_manifest(&first)?.request;
    let is_of_rig = |set: &String| set.starts_with("table.") || set.starts_with("specimen.");
    let request = Request {
        set: before
            .set
            .iter()
            .filter(|set| is_of_rig(set))
            .cloned()
            .collect(),
        ..before
    };
    let request = base(arguments, request)?;
    let is_asked =
        !arguments.records.is_empty() || arguments.reference.is_some() || arguments.seed.is_some();
    let motions = match is_asked {
        true => played(arguments)?,
        false => vec![Played::of(&request)],
    };
    let folder = arguments.out("runs");
    let bar = progress::spinner("running");
    let mut all = finished;
    for (system, name) in systems.iter().zip(comparison::labels(systems)) {
        for (n, motion) in motions.iter().enumerate() {
            let request = comparison::request(&request, system, motion)?;
            progress::say(&bar, name.clone());
            let place = match motions.len() {
                1 => folder.join(&name),
                _ => folder.join(format!("{name}-{}", n + 1)),
            };
            perform(&request, &folder.at(&place))?;
            all.push(place);
        }
    }
    bar.finish_and_clear();
    report_runs(arguments, &run_comparison::read(&all, units())?, &folder)
}

/// Overlays runs and lists their differences.
fn report_runs(
    arguments: &Arguments,
    comparison: &RunComparison,
    folder: &Out,
) -> Result<ExitCode, Error> {
    let files = comparison.write(folder)?;
    if arguments.json {
        super::print_json(serde_json::json!(comparison), folder);
        return Ok(ExitCode::SUCCESS);
    }
    println!("{}", aligned(&comparison.figures(units())));
    let mut rows = vec![vec!["differs".to_string()]];
    rows[0].extend(comparison.runs.iter().map(|run| run.label.clone()));
    let differences = comparison.differences.iter();
    rows.extend(differences.take(MOST_PRINTED).map(|difference| {
        let mut row = vec![difference.what.clone()];
        row.extend(difference.values.iter().cloned());
        row
    }));
    println!("{}", aligned(&rows));
    if let Some(more) = comparison.differences.len().checked_sub(MOST_PRINTED + 1) {
        println!(
            "and {} more differences in {}\n",
            more + 1,
            run_comparison::RUNS
        );
    }
    print_files(&files);
    Ok(ExitCode::SUCCESS)
}

fn played(arguments: &Arguments) -> Result<Vec<Played>, Error> {
    match (&arguments.reference, &arguments.reference_y) {
        (Some(x), Some(y)) => return Ok(vec![Played::References([x.clone(), y.clone()])]),
        (Some(x), None) => return Ok(vec![Played::Reference(x.clone())]),
        (None, _) => {}
    }
    if let Some(seed) = arguments.seed {
        return Ok(vec![Played::Seed(seed)]);
    }
    if arguments.records.is_empty() {
        return Ok((1..=8).map(Played::Seed).collect());
    }
    let first = record_files(&arguments.records)?;
    if arguments.records_y.is_empty() {
        return Ok(first.into_iter().map(Played::Record).collect());
    }
    let second = record_files(&arguments.records_y)?;
    if first.len() != second.len() {
        return Err(Error::Option {
            option: "--records-y",
            reason: format!(
                "{} records along y and {} along x; expected one of each for a pair",
                second.len(),
                first.len()
            ),
        });
    }
    let pairs = first.into_iter().zip(second);
    Ok(pairs.map(|(x, y)| Played::Records([x, y])).collect())
}

/// The files among `records`, and those in the folders among them.
fn record_files(records: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let mut found = Vec::new();
    for path in records {
        match path.is_dir() {
            true => found.extend(Played::records_in(path)?),
            false => found.push(path.clone()),
        }
    }
    Ok(found)
}

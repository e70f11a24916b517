//! `shakebench run`

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;

use super::OneVersion;
use super::interrupt;
use super::motion::MotionArguments;
use super::out::{given, installation, is_forced, units, unused};
use super::quantity::{at_least_one, if_given, percent, positive};
use super::rig::RigArguments;
use super::watch::watch;
use super::{print_files, progress};
use fmi_import::{Isolation, Options, Trace};
use fmi_master::{Algorithm, Ended, Ending, KeepCheckpoint, Pace, Simulation};
use identification::data::why;
use laboratory::error::Error;
use laboratory::results::{Out, Results};
use laboratory::run::checkpoint::{self, Checkpoints, Unfinished};
use laboratory::run::experiment::{Prepared, Request, is_file, prepare};
use laboratory::run::manifest::Manifest;
use laboratory::run::page;
use laboratory::run::refinement::refine;
use laboratory::run::summary::Summary;
use laboratory::run::text::text;
use laboratory::systems::built_in;

/// Options of `shakebench run`.
#[derive(Debug, Default, Args)]
#[command(after_help = "Examples:\n  \
    shakebench run three-variable --record NGA/RSN1633_MANJIL_ABBAR--L.AT2\n  \
    shakebench run displacement-pid --specimen none --pga 0.2 --set control.integral_gain=\"0.5 V/(in s)\"\n  \
    shakebench run my-rig.toml --algorithm jacobi --step 1ms --json\n  \
    shakebench run system.ssp --duration \"10 s\"\n  \
    shakebench run Theirs.fmu --input forces.csv\n  \
    shakebench run my-system.toml --step 10ms --variable-step 0.1%\n  \
    shakebench run long.toml --duration \"2 h\" --checkpoint-every \"1 min\" --out long\n  \
    shakebench run --resume long\n  \
    shakebench run --manifest shakebench-results/three-variable-synthetic-1/manifest.json")]
pub struct Arguments {
    /// Built-in system, .toml file, .ssp archive or single .fmu [default: three-variable]
    #[arg(value_name = "SYSTEM")]
    system: Option<String>,
    #[command(flatten)]
    motion: MotionArguments,
    #[command(flatten)]
    rig: RigArguments,
    /// Hybrid simulation: a computed structure between the ground motion and the specimen of a
    /// built-in system: none, two-storeys [default: none]
    #[arg(long, value_name = "NAME")]
    structure: Option<String>,
    /// Parameter, such as control.valve_limit="5 V"; repeatable
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set: Vec<String>,
    /// FMI version of the components
    #[arg(long, value_enum, default_value_t)]
    fmi: OneVersion,
    /// Order of calls [default: from the system, otherwise gauss-seidel]
    #[arg(long, value_enum)]
    algorithm: Option<Algorithm>,
    /// Input table: .csv with a column `time`, then columns named as inputs (component.input), with
    /// units; repeatable
    #[arg(long, value_name = "FILE")]
    input: Vec<PathBuf>,
    /// Coupling step, such as "0.5 ms"; controllers keep their own period [default: 2 ms]
    #[arg(long, value_name = "T")]
    step: Option<String>,
    /// Choose each coupling step by the estimated error of coupled values, relative to their
    /// largest magnitude so far, such as "0.1 %"; --step is then the longest step
    #[arg(long, value_name = "PERCENT")]
    variable_step: Option<String>,
    /// Shortest step with --variable-step [default: 1/1024 of the longest]
    #[arg(long, value_name = "T")]
    least_step: Option<String>,
    /// Halve the coupling step until the estimated coupling error of each signal is at most this
    /// share of its peak, such as "0.05 %"
    #[arg(long, value_name = "PERCENT", conflicts_with_all = ["manifest", "resume", "variable_step"])]
    coupling_error: Option<String>,
    /// Play only the beginning of the motion, such as "10 s"
    #[arg(long, value_name = "T")]
    duration: Option<String>,
    /// Keep pace with real time and report missed deadlines
    #[arg(long)]
    real_time: bool,
    /// Keep every Nth sample in the results
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = at_least_one)]
    record_every: usize,
    /// Also write the signals to results.parquet
    #[arg(long)]
    parquet: bool,
    /// Show the run live on a local page at this port (default: any free port); the run keeps pace
    /// with real time
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    watch: Option<u16>,
    /// Parameter that the page of --watch may change during the run, with its bounds, such as
    /// control.proportional_gain="2 V/in..8 V/in" [default bounds: half and twice its value]; `all`
    /// for all tunable ones; repeatable
    #[arg(
        long,
        value_name = "INSTANCE.VARIABLE[=LOW..HIGH]",
        requires = "watch",
        conflicts_with = "manifest"
    )]
    tune: Vec<String>,
    /// Folder for the results [default: shakebench-results/SYSTEM-MOTION]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// FMUs to run in a separate process; foreign FMUs are those given as files
    #[arg(long, value_enum, default_value_t = Isolation::Foreign)]
    isolate: Isolation,
    /// Longest time of a call to an FMU in a separate process [default: 120 s]
    #[arg(long, value_name = "T")]
    call_limit: Option<String>,
    /// Write every call of every FMU, with its values, to this file
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Request debug messages from the FMUs: all, or those of these categories
    #[arg(long, value_name = "CATEGORY", num_args = 0.., value_delimiter = ',')]
    log: Option<Vec<String>>,
    /// Save a checkpoint at this interval of simulated time, from which an interrupted or killed
    /// run continues with identical results; the FMUs must be able to save their states
    #[arg(long, value_name = "T")]
    checkpoint_every: Option<String>,
    /// Continue the run in this folder from its last checkpoint
    #[arg(long, value_name = "DIR", conflicts_with_all = [
        "system", "record", "record_y", "reference", "reference_y", "input", "plant", "specimen", "structure", "tuning", "control_model", "set", "fmi", "algorithm", "step",
        "variable_step", "least_step", "duration", "scaling", "seed", "manifest", "out", "record_every", "checkpoint_every",
    ])]
    resume: Option<PathBuf>,
    /// Repeat the run of a manifest.json and check that it agrees to the bit
    #[arg(long, value_name = "FILE", conflicts_with_all = [
        "system", "record", "record_y", "reference", "reference_y", "input", "plant", "specimen", "structure", "tuning", "control_model", "set", "fmi", "algorithm", "step",
        "variable_step", "least_step", "duration", "scaling", "seed",
    ])]
    manifest: Option<PathBuf>,
}

impl Arguments {
    /// A run of a system on a motion, otherwise as usual.
    pub(super) fn of(
        system: Option<String>,
        motion: MotionArguments,
        rig: RigArguments,
        set: Vec<String>,
    ) -> Self {
        Self {
            system,
            motion,
            rig,
            set,
            ..Self::default()
        }
    }
}

/// Runs a system on a motion and writes the results.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let written = arguments
        .manifest
        .as_deref()
        .map(read_manifest)
        .transpose()?;
    let unfinished = arguments.resume.as_deref().map(unfinished).transpose()?;
    let known = written.as_ref();
    let known = known.or(unfinished.as_ref().map(|run| &run.manifest));
    let mut request = match known {
        Some(manifest) => manifest.request.clone(),
        None => request(arguments)?,
    };
    let mut prepared = prepare(&request)?;
    prepared.options = fmu_options(arguments)?;
    let coupling_error = match &arguments.coupling_error {
        Some(wanted) => {
            let error = refine(&mut prepared, percent("--coupling-error", wanted)?)?;
            request.step_s = Some(prepared.step);
            Some(error)
        }
        None => None,
    };
    let Prepared {
        system,
        motion,
        step,
        samples,
        ..
    } = &prepared;
    let is_same = |place: &Path| {
        let before = read_manifest(&place.join("manifest.json"));
        before.is_ok_and(|before| {
            // A run whose parameters were changed by hand is not repeated by its request alone.
            let same = match known {
                Some(known) => before.changes == known.changes,
                None => before.changes.is_empty() && arguments.tune.is_empty(),
            };
            same && before.request == request
        })
    };
    let folder = arguments.resume.as_ref().or(arguments.out.as_ref());
    let mut folder = folder.cloned().map(given).unwrap_or_else(|| {
        let name = match motion.is_empty() {
            true => system.name.clone(),
            false => format!("{}-{}", system.name, motion.name),
        };
        let name = name.replace(['/', '\\', ' '], "-");
        unused(&Path::new("shakebench-results").join(name), is_same)
    });
    Results::check(&folder)?;
    let plan = (prepared.algorithm, *step, *samples);
    let mut manifest = Manifest::new(&request, system, motion, plan);
    let mut simulation = prepared.simulation(prepared.algorithm)?;
    simulation.heed(interrupt::heed());
    let has_checkpoints = unfinished.is_some() || arguments.checkpoint_every.is_some();
    match unfinished {
        Some(unfinished) => go_on(&mut simulation, &mut folder, &manifest, unfinished)?,
        None => {
            checkpoint::refuse_unfinished(&folder)?;
            simulation.keep_every(arguments.record_every);
            if let Some(every) = &arguments.checkpoint_every {
                let every = positive("--checkpoint-every", every, "s")? / motion.dt;
                let every = (every.round() as usize).max(1);
                let plan = (arguments.record_every, every);
                simulation.check_checkpoints()?;
                let checkpoints = Checkpoints::begin(&folder, &manifest, plan, None)?;
                keep(&mut simulation, checkpoints, every)?;
            }
        }
    }
    if let Some(written) = &written {
        simulation.repeat(&written.changes)?;
    }
    let live = match arguments.watch {
        Some(port) => Some(watch(&prepared, &mut simulation, port, &arguments.tune)?),
        None => None,
    };
    let bar = progress::bar(*samples, "{bar:40} {percent} %, {eta} left");
    let pace = if arguments.real_time || arguments.watch.is_some() {
        Pace::RealTime
    } else {
        Pace::Fastest
    };
    let mut outcome = simulation.run(*samples, pace, &mut |sample| {
        bar.set_position(sample as u64)
    });
    bar.finish_and_clear();
    prepared.judge(&mut outcome);

    let mut summary = Summary::new(&prepared, &outcome, &manifest);
    if let Some(error) = coupling_error.as_ref().filter(|error| !error.is_reached()) {
        summary.warnings.push(format!(
            "the estimated coupling error is {:.3} % of the peak of `{}` at the smallest step \
             tried, {} ms; the target is {} %",
            error.percent,
            error.signal,
            1e3 * prepared.step,
            error.wanted_percent
        ));
    }
    summary.coupling_error = coupling_error;
    let files = page::write(
        &folder,
        &prepared,
        &outcome,
        &summary,
        &mut manifest,
        arguments.parquet,
    )?;
    let can_go_on = has_checkpoints
        && matches!(outcome.ended.kind(), Ending::Interrupted | Ending::Failed)
        && checkpoint::is_there(&folder);
    if has_checkpoints && !can_go_on {
        checkpoint::remove(&folder);
    }
    for line in &summary.warnings {
        eprintln!("warning: {line}");
    }
    if arguments.json {
        super::print_json(serde_json::json!(summary), &folder);
    } else {
        print!("{}", text(&summary, &outcome.record, motion, units()));
        println!();
        print_files(&files);
    }
    if let Some((server, tap)) = live {
        tap.finish(&outcome.ended.message());
        server.farewell();
    }
    if let Some(written) = written {
        let differences = written.differences(&manifest);
        if !differences.is_empty() {
            eprintln!("error: the run was not repeated to the bit");
            differences.iter().for_each(|line| eprintln!("  {line}"));
            return Ok(ExitCode::from(1));
        }
        note!("the run was repeated to the bit");
    }
    if outcome.ended.is_regular() {
        if let Ended::Terminated { .. } = outcome.ended {
            note!("note: {}", outcome.ended.message());
        }
        return Ok(ExitCode::SUCCESS);
    }
    eprintln!("error: the run ended early: {}", outcome.ended.message());
    eprintln!("the results so far are saved");
    if can_go_on {
        eprintln!(
            "to continue from its last checkpoint: shakebench run --resume {}",
            folder.display()
        );
    }
    Ok(ExitCode::from(1))
}

/// The manifest in a file, to be repeated with this command's components.
///
/// # Errors
/// A file that is not one.
pub(super) fn read_manifest(path: &Path) -> Result<Manifest, Error> {
    let mut manifest = Manifest::read(path)?;
    manifest.request.installation = installation().clone();
    Ok(manifest)
}

fn unfinished(folder: &Path) -> Result<Unfinished, Error> {
    let mut run = checkpoint::read(folder)?;
    run.manifest.request.installation = installation().clone();
    Ok(run)
}

/// Continues an interrupted run.
///
/// # Errors
/// A checkpoint of a run that has changed, or that cannot be continued.
fn go_on(
    simulation: &mut Simulation,
    folder: &mut Out,
    manifest: &Manifest,
    unfinished: Unfinished,
) -> Result<(), Error> {
    let differences = unfinished.manifest.differences(manifest);
    if !differences.is_empty() {
        return Err(Error::File {
            path: folder.to_path_buf(),
            reason: format!(
                "the run cannot be continued, because it has changed: {}",
                differences.join("; ")
            ),
        });
    }
    let plan = (unfinished.record_every, unfinished.every);
    let checkpoints = Checkpoints::begin(folder, manifest, plan, Some(&unfinished))?;
    simulation.keep_every(unfinished.record_every);
    simulation.resume(&unfinished.checkpoint, unfinished.record)?;
    keep(simulation, checkpoints, plan.1)?;
    // What the run saved when it was interrupted is a part of what it saves now.
    let before = read_manifest(&folder.join("manifest.json"));
    if before.is_ok_and(|before| before.request == manifest.request) {
        *folder = folder.clone().replacing(true);
    }
    Ok(())
}

/// Saves checkpoints during the run.
///
/// # Errors
/// A component that cannot write its state.
fn keep(
    simulation: &mut Simulation,
    mut checkpoints: Checkpoints,
    every: usize,
) -> Result<(), Error> {
    let keep: KeepCheckpoint =
        Box::new(move |moment, record| Ok(checkpoints.keep(moment, record)?));
    Ok(simulation.keep_checkpoints(every, keep)?)
}

/// Whether nothing is lost if `path` is written: it is not a file, an empty one, or `is_own` of its
/// first bytes, as an earlier command left it.
pub(super) fn may_be_replaced(path: &Path, is_own: impl Fn(&[u8]) -> bool) -> bool {
    if !path.is_file() {
        return true;
    }
    let mut begin = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(4096).read_to_end(&mut begin));
    read.is_ok() && (begin.is_empty() || is_own(&begin))
}

fn holds(bytes: &[u8], word: &str) -> bool {
    bytes
        .windows(word.len())
        .any(|part| part == word.as_bytes())
}

/// How FMUs are run.
///
/// # Errors
/// A trace that cannot be written.
fn fmu_options(arguments: &Arguments) -> Result<Options, Error> {
    let trace = arguments.trace.as_deref().map(|path| {
        let fault = |reason: String| Error::File {
            path: path.to_path_buf(),
            reason,
        };
        if !is_forced() && !may_be_replaced(path, |begin| holds(begin, "Instantiate")) {
            let reason = "exists and is not a trace; name another file for --trace, or add --force";
            return Err(fault(reason.to_string()));
        }
        let created = Trace::create(path).map_err(|error| fault(why(&error)));
        created.map(std::sync::Arc::new)
    });
    let limit = arguments.call_limit.as_deref();
    let limit = limit.map(|text| {
        let seconds = positive("--call-limit", text, "s")?;
        Duration::try_from_secs_f64(seconds).map_err(|error| Error::Option {
            option: "--call-limit",
            reason: error.to_string(),
        })
    });
    Ok(Options {
        isolation: arguments.isolate,
        guest: installation().guest(),
        call_limit: limit.transpose()?.unwrap_or(Options::CALL_LIMIT),
        trace: trace.transpose()?,
        log_categories: arguments.log.clone(),
    })
}

/// Reads the options; relative paths become absolute, so that a manifest stays true elsewhere.
///
/// # Errors
/// Values that cannot be read.
pub(super) fn request(arguments: &Arguments) -> Result<Request, Error> {
    let system = arguments
        .system
        .clone()
        .unwrap_or(built_in::DEFAULT_SYSTEM.to_string());
    let is_file = is_file(&system);
    if is_file {
        arguments
            .rig
            .refuse_of_file(&system, arguments.structure.as_ref())?;
    }
    Ok(Request {
        system: if is_file {
            absolute(Path::new(&system)).display().to_string()
        } else {
            system
        },
        plant: arguments.rig.plant(),
        specimen: arguments.rig.specimen(),
        structure: arguments.structure.clone(),
        tuning: arguments.rig.tuning,
        control_model: arguments.rig.control_model.as_deref().map(absolute),
        record: arguments.motion.record.as_deref().map(absolute),
        record_y: arguments.motion.record_y.as_deref().map(absolute),
        reference: arguments.motion.reference.as_deref().map(absolute),
        reference_y: arguments.motion.reference_y.as_deref().map(absolute),
        seed: arguments.motion.seed(),
        scaling: arguments.motion.scaling()?,
        set: arguments.set.clone(),
        fmi: arguments.fmi.into(),
        algorithm: arguments.algorithm,
        step_s: if_given("--step", &arguments.step, "s")?,
        variable_step_percent: match &arguments.variable_step {
            Some(share) => Some(percent("--variable-step", share)?),
            None => None,
        },
        least_step_s: if_given("--least-step", &arguments.least_step, "s")?,
        duration_s: if_given("--duration", &arguments.duration, "s")?,
        installation: installation().clone(),
        inputs: arguments.input.iter().map(|path| absolute(path)).collect(),
    })
}

pub(super) fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())
}

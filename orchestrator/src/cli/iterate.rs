//! `shakebench iterate`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::motion::MotionArguments;
use super::out::{given, unused};
use super::quantity::{band, if_given};
use super::rig::RigArguments;
use super::{print_files, progress, run};
use identification::diagnosis::called;
use identification::diagnosis::rigs::{DriveSearch, RigDrive};
use laboratory::error::Error;
use laboratory::iteration::circle::{self, Circle};
use laboratory::iteration::on_model::Search;
use laboratory::iteration::on_rig;
use laboratory::iteration::replay::{self, Replay};
use laboratory::iteration::{self, Iteration, Plan};
use laboratory::results::Results;
use pages::report::columns::aligned;

/// Options of `shakebench iterate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench iterate three-variable --plant servohydraulic --specimen yielding --record NGA/RSN1633_MANJIL_ABBAR--L.AT2\n  \
    shakebench iterate mpc --plant servohydraulic --dummy-mass \"25 lbm\" --exposure 3\n  \
    shakebench iterate three-variable --drive shakebench-results/iteration-three-variable-synthetic-1/drive.csv --iterations 0\n\n\
    Of a diagnosed rig, on its extended model and without a run:\n  \
    shakebench diagnose my-case --out results\n  \
    shakebench iterate my-case --model results/extended_model.toml --pga 0.15\n  \
    shakebench iterate --model results/extended_model.toml --reference wanted.csv --command-limit \"10 V\"\n\n\
    Of a laboratory's recorded rounds, without a system of ours:\n  \
    shakebench iterate --replay round_0.csv round_1.csv --command-limit \"10 V\" --out next")]
pub struct Arguments {
    /// Built-in system or .toml file [default: three-variable]; with --model, the case of the diagnosis, a folder
    /// with nominal.toml, which states the control law
    #[arg(value_name = "SYSTEM|CASE")]
    system: Option<String>,
    /// Compute the drive on this extended model from `shakebench diagnose`, instead of from runs; of a described rig
    /// without a case, for the output in the file of --reference
    #[arg(long, value_name = "MODEL.toml", conflicts_with_all = [
        "plant", "specimen", "tuning", "control_model", "set", "gain", "target", "exposure", "measurement_delay", "dummy_mass", "drive",
        "record_y", "reference_y", "drive_y",
    ])]
    model: Option<PathBuf>,
    #[command(flatten)]
    motion: MotionArguments,
    #[command(flatten)]
    rig: RigArguments,
    /// Parameter, such as control.valve_limit="5 V"; repeatable
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set: Vec<String>,
    /// Largest number of corrections [default: 3; with --model 20]
    #[arg(long, value_name = "N", alias = "corrections")]
    iterations: Option<usize>,
    /// Fraction of the inverse that a correction applies, above 0 and at most 1
    #[arg(long, default_value_t = 0.8)]
    gain: f64,
    /// Measured error at which to stop, %
    #[arg(long, value_name = "PERCENT", default_value_t = 0.3)]
    target: f64,
    /// Lowest and highest corrected frequency, Hz [default: 0.3 20; with --model 0.1 30]
    #[arg(long, value_names = ["LOW", "HIGH"], num_args = 2)]
    band: Vec<f64>,
    /// Limit of the motion energy on the specimen, relative to one run [default: none]
    #[arg(long, value_name = "TIMES")]
    exposure: Option<f64>,
    /// Delay of the measurements, such as "2 ms" [default: from the model for tuning]
    #[arg(long, value_name = "T")]
    measurement_delay: Option<String>,
    /// Rigid mass that replaces the specimen while the transfer function is measured, such as "25
    /// lbm"
    #[arg(long, value_name = "MASS")]
    dummy_mass: Option<String>,
    /// Initial drive: the drive.csv of an earlier iteration
    #[arg(long, value_name = "FILE")]
    drive: Option<PathBuf>,
    /// Initial drive along the second axis of a biaxial table: the drive_y.csv of an earlier iteration
    #[arg(long, value_name = "FILE")]
    drive_y: Option<PathBuf>,
    /// Recorded rounds in their order, with the drive that was played (`reference`) and the measured displacement:
    /// the next drive and its predicted error, without a run
    #[arg(long, value_name = "ROUND.csv", num_args = 1.., conflicts_with_all = [
        "model", "record", "plant", "specimen", "tuning", "control_model", "set", "iterations", "target", "exposure",
        "measurement_delay", "dummy_mass", "drive", "record_y", "reference_y", "drive_y",
    ])]
    replay: Vec<PathBuf>,
    /// Names of the columns of the rounds, one per line: `channel = "header"` or `channel = { column = "header",
    /// unit = "mm" }`
    #[arg(long, value_name = "MAP.toml", requires = "replay")]
    columns: Option<PathBuf>,
    /// Rail of the command, such as "10 V" [default: with --replay where the record stays at its largest value]
    #[arg(long, value_name = "U")]
    command_limit: Option<String>,
    /// Folder for drive.csv, iteration.json and report.html; with --model for drive.csv and drive.json [default:
    /// shakebench-results/iteration-SYSTEM-MOTION or drive-CASE-MOTION]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Iterates and writes the best drive.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    if !arguments.replay.is_empty() {
        return replayed(arguments);
    }
    if let (Some(case), Some(model)) = (&arguments.system, &arguments.model) {
        if arguments.command_limit.is_some() {
            return Err(Error::Option {
                option: "--command-limit",
                reason: "the case's control law states the limit; omit the option".into(),
            });
        }
        return on_model(arguments, case, model);
    }
    if let Some(model) = &arguments.model {
        return on_rig(arguments, model);
    }
    if arguments.command_limit.is_some() {
        return Err(Error::Option {
            option: "--command-limit",
            reason: "also pass --replay, or --model with a described rig".into(),
        });
    }
    let plan = plan(arguments)?;
    if let Some(folder) = &arguments.out {
        Results::check(folder)?;
    }
    let bar = progress::bar(plan.iterations + 2, "{bar:40} {pos} of {len} runs");
    let found = iteration::iterate(&plan, &mut |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let found = found?;
    let folder = arguments.out.clone().map(given).unwrap_or_else(|| {
        let name = format!("iteration-{}-{}", found.system, found.motion);
        let name = name.replace(['/', '\\', ' '], "-");
        unused(&Path::new("shakebench-results").join(name), |_| false)
    });
    let files = iteration::write(&plan, &found, &folder)?;
    if arguments.json {
        super::print_json(serde_json::json!(found), &folder);
    } else {
        print!("{}", text(&found));
        println!();
        print_files(&files);
    }
    if found.stop == iteration::Stop::EndedEarly {
        let reason = found
            .runs
            .last()
            .and_then(|run| run.ended_because.as_deref());
        eprintln!(
            "error: a run ended early: {}",
            reason.unwrap_or("no reason given")
        );
        return Ok(ExitCode::from(1));
    }
    Ok(ExitCode::SUCCESS)
}

/// Computes the next drive of recorded rounds and writes it.
fn replayed(arguments: &Arguments) -> Result<ExitCode, Error> {
    if let Some(folder) = &arguments.out {
        Results::check(folder)?;
    }
    let columns = arguments.columns.as_deref().map(called).transpose();
    let columns = columns.map_err(|error| Error::Option {
        option: "--columns",
        reason: error.to_string(),
    })?;
    let gain = part(arguments.gain)?;
    let found = replay::replay(&replay::Plan {
        rig: arguments.system.clone(),
        rounds: arguments.replay.clone(),
        columns: columns.unwrap_or_default(),
        wanted: arguments.motion.reference.clone(),
        scale: arguments.motion.scale,
        band: match arguments.band.as_slice() {
            [] => [0.1, 30.0],
            given => band(given)?,
        },
        gain,
        limit: if_given("--command-limit", &arguments.command_limit, "V")?,
    })?;
    let folder = arguments.out.clone().map(given).unwrap_or_else(|| {
        let name = arguments.replay.first().and_then(|path| path.file_stem());
        let name = format!("replay-{}", name.unwrap_or_default().to_string_lossy());
        unused(&Path::new("shakebench-results").join(name), |_| false)
    });
    let files = replay::write(&found, &folder)?;
    if arguments.json {
        super::print_json(serde_json::json!(found), &folder);
    } else {
        print!("{}", text_of_rounds(&found));
        println!();
        print_files(&files);
    }
    Ok(ExitCode::SUCCESS)
}

/// A part of the inverse.
fn part(gain: f64) -> Result<f64, Error> {
    if gain > 0.0 && gain <= 1.0 {
        return Ok(gain);
    }
    Err(Error::Option {
        option: "--gain",
        reason: format!("{gain} is not above 0 and at most 1"),
    })
}

/// Computes the drive of a diagnosed rig on its extended model and writes it.
fn on_model(arguments: &Arguments, case: &str, model: &Path) -> Result<ExitCode, Error> {
    if let Some(folder) = &arguments.out {
        Results::check(folder)?;
    }
    let usual = Search::default();
    let plan = circle::Plan {
        case: PathBuf::from(case),
        model: model.to_path_buf(),
        record: arguments.motion.record.clone(),
        reference: arguments.motion.reference.clone(),
        scaling: arguments.motion.scaling()?,
        seed: arguments.motion.seed(),
        search: Search {
            corrections: arguments.iterations.unwrap_or(usual.corrections),
            band: match arguments.band.as_slice() {
                [] => usual.band,
                given => band(given)?,
            },
        },
    };
    let found = circle::close(&plan)?;
    let folder = arguments.out.clone().map(given).unwrap_or_else(|| {
        let name = format!("drive-{}-{}", found.case, found.motion);
        let name = name.replace(['/', '\\', ' '], "-");
        unused(&Path::new("shakebench-results").join(name), |_| false)
    });
    let files = circle::write(&found, &folder)?;
    if arguments.json {
        super::print_json(serde_json::json!(found), &folder);
    } else {
        print!("{}", text_on_model(&found));
        println!();
        print_files(&files);
    }
    Ok(ExitCode::SUCCESS)
}

/// Computes the drive of a described rig on its extended model and writes it.
fn on_rig(arguments: &Arguments, model: &Path) -> Result<ExitCode, Error> {
    let Some(wanted) = &arguments.motion.reference else {
        return Err(Error::Option {
            option: "--model",
            reason: "expected --reference with a file of the wanted output, under the headings of the model's \
                     columns; or a case, whose nominal.toml states the control law of a shake table"
                .into(),
        });
    };
    if let Some(folder) = &arguments.out {
        Results::check(folder)?;
    }
    let [_, highest] = match arguments.band.as_slice() {
        [] => [0.1, 10.0],
        given => band(given)?,
    };
    let usual = Search::default();
    let plan = on_rig::Plan {
        model: model.to_path_buf(),
        wanted: wanted.clone(),
        search: DriveSearch {
            limit: if_given("--command-limit", &arguments.command_limit, "V")?,
            highest,
            corrections: arguments.iterations.unwrap_or(usual.corrections),
        },
    };
    let found = on_rig::drive(&plan)?;
    let folder = arguments.out.clone().map(given).unwrap_or_else(|| {
        let name = wanted.file_stem().unwrap_or_default().to_string_lossy();
        let name = format!("drive-{}-{name}", found.rig).replace(['/', '\\', ' '], "-");
        unused(&Path::new("shakebench-results").join(name), |_| false)
    });
    let files = on_rig::write(&plan, &found, &folder)?;
    if arguments.json {
        super::print_json(serde_json::json!(on_rig::figures(&plan, &found)), &folder);
    } else {
        print!("{}", text_on_rig(&found));
        println!();
        print_files(&files);
    }
    Ok(ExitCode::SUCCESS)
}

fn plan(arguments: &Arguments) -> Result<Plan, Error> {
    let fault = |option, reason: String| Err(Error::Option { option, reason });
    let gain = part(arguments.gain)?;
    let band = match arguments.band.as_slice() {
        [] => [0.3, 20.0],
        given => band(given)?,
    };
    if !arguments.target.is_finite() || arguments.target < 0.0 {
        return fault(
            "--target",
            format!("{} is not an error in %", arguments.target),
        );
    }
    if let Some(exposure) = arguments
        .exposure
        .filter(|most| most.is_nan() || *most < 1.0)
    {
        return fault(
            "--exposure",
            format!(
                "{exposure} is less than the exposure of the first run, which measures the \
                error"
            ),
        );
    }
    Ok(Plan {
        request: run::request(&run::Arguments::of(
            arguments.system.clone(),
            arguments.motion.clone(),
            arguments.rig.clone(),
            arguments.set.clone(),
        ))?,
        iterations: arguments.iterations.unwrap_or(3),
        gain,
        target_percent: arguments.target,
        band,
        exposure: arguments.exposure,
        measurement_delay: if_given("--measurement-delay", &arguments.measurement_delay, "s")?,
        dummy_mass: if_given("--dummy-mass", &arguments.dummy_mass, "kg")?,
        drive: arguments.drive.clone(),
        drive_y: arguments.drive_y.clone(),
    })
}

fn text(found: &Iteration) -> String {
    let head = [
        "corrections",
        "measured",
        "RMS error",
        "Fourier error",
        "spectrum",
        "exposure",
        "",
    ];
    let along_y = ["measured y", "RMS error y"];
    let is_biaxial = found.runs.iter().any(|run| run.along_y.is_some());
    let mut rows = vec![head.map(str::to_string).to_vec()];
    if is_biaxial {
        rows[0].splice(3..3, along_y.map(str::to_string));
    }
    let percent =
        |value: Option<f64>| value.map_or("-".to_string(), |value| format!("{value:.3} %"));
    for (n, run) in found.runs.iter().enumerate() {
        let mut row = vec![
            run.iteration.to_string(),
            percent(run.measured_percent),
            percent(run.time_domain_percent),
            percent(run.frequency_domain_percent),
            percent(run.response_spectrum_percent),
            format!("{:.2}", run.exposure),
            if n == found.best { "best" } else { "" }.to_string(),
        ];
        if let Some(own) = run.along_y {
            row.splice(
                3..3,
                [own.measured_percent, own.time_domain_percent].map(percent),
            );
        }
        rows.push(row);
    }
    format!(
        "{} on {}, transfer function with a mean coherence of {:.3}\n\n{}\n{}\n",
        found.system,
        found.motion,
        found.coherence,
        aligned(&rows),
        found.stop.sentence()
    )
}

fn text_of_rounds(found: &Replay) -> String {
    let head = [
        "round",
        "error",
        "delay",
        "beyond linear",
        "predicted",
        "missed",
        "largest command",
    ];
    let mut rows = vec![head.map(str::to_string).to_vec()];
    let none = || "-".to_string();
    let volts = |value: Option<f64>| value.map_or_else(none, |value| format!("{value:.2} V"));
    for (n, round) in found.rounds.iter().enumerate() {
        let check = n.checked_sub(1).and_then(|place| found.checks.get(place));
        let percent = |value: f64| format!("{value:.2} %");
        rows.push(vec![
            round.file.display().to_string(),
            percent(round.error_percent),
            format!("{:.1} ms", 1e3 * round.delay_s),
            percent(round.unexplained_percent),
            check.map_or_else(none, |own| percent(own.predicted_percent)),
            check.map_or_else(none, |own| percent(own.displacement_percent)),
            volts(round.peak_command),
        ]);
    }
    let next = &found.next;
    let limit = next
        .limited_by
        .as_ref()
        .map_or_else(String::new, |why| format!("; limited by {why}"));
    let command = match next.peak_command {
        Some(volts) => format!(", largest command {volts:.2} V"),
        None => String::new(),
    };
    format!(
        "next drive: predicted error {:.2} % ({:.2} % if the rig were linear), {:.2} of the correction of {}, {:.2} \
         to {:.2} Hz{command}{limit}\n\nwanted: {}; mean coherence {:.3}\n{}",
        next.predicted_percent,
        next.linear_percent,
        next.gain,
        next.corrected.display(),
        next.band_hz[0],
        next.band_hz[1],
        found.wanted,
        found.coherence,
        aligned(&rows),
    )
}

fn text_on_rig(found: &RigDrive) -> String {
    let named = match found.effects.as_slice() {
        [] => "which has no effect".to_string(),
        some => format!("with {}", some.join(", ")),
    };
    let last = found.errors.last().copied().unwrap_or(f64::NAN);
    let first = found.errors.first().copied().unwrap_or(f64::NAN);
    let (head, unit) = &found.columns[1];
    let rail = if found.at_rail > 0.0 {
        format!(
            ", at its limit for {:.1} % of the time",
            100.0 * found.at_rail
        )
    } else {
        String::new()
    };
    format!(
        "drive of {} on the extended model, {named}: the error of {} falls from {first:.2} to {last:.2} % in {} \
         corrections; largest `{head}` {:.4} {unit}{rail}\n\
         The model's own error on other records comes on top: shakebench diagnose --model MODEL --validate OTHER.csv\n",
        found.rig,
        found.columns[2].0,
        found.errors.len() - 1,
        found.peak,
    )
}

fn text_on_model(found: &Circle) -> String {
    let head = ["drive", "RMS error", "spectrum", "largest command"];
    let mut rows = vec![head.map(str::to_string).to_vec()];
    for (name, expected) in found.expected() {
        rows.push(vec![
            name.to_string(),
            format!("{:.3} %", expected.time_domain_percent),
            expected
                .response_spectrum_percent
                .map_or("-".into(), |value| format!("{value:.3} %")),
            format!("{:.2} V", expected.peak_command_v),
        ]);
    }
    let named = match found.effects.as_slice() {
        [] => "which has no effect".to_string(),
        some => format!("with {}", some.join(", ")),
    };
    let warnings: String = found
        .warnings
        .iter()
        .map(|line| format!("warning: {line}\n"))
        .collect();
    format!(
        "{} on the extended model, {named}\n\n{}\n{warnings}",
        found.motion,
        aligned(&rows)
    )
}

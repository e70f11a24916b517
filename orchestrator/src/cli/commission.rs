//! `shakebench commission`

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::OneVersion;
use super::out::{given, installation};
use super::quantity::whole;
use laboratory::commission::{self, Request, Verdict};
use laboratory::error::Error;
use laboratory::results::Results;
use laboratory::systems::built_in;
use pages::report::columns::aligned;
use units::{self, STANDARD_GRAVITY};

/// Options of `shakebench commission`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench commission --plant servohydraulic --out RIG\n  \
    shakebench commission --plant servohydraulic --set \"table.added_payload=10 kg\" --out RIG\n  \
    shakebench run RIG/mpc.toml --record RECORD.AT2\n\n\
    On a real rig: record displacement control with its reference, then\n  \
    shakebench identify RECORDING.csv --out model.toml\n  \
    shakebench design --model model.toml\n  \
    shakebench run mpc --control-model model.toml ...")]
pub struct Arguments {
    /// Plant: identified, servohydraulic, or a .toml file [default: servohydraulic]
    #[arg(long)]
    plant: Option<String>,
    /// Specimen on the table: none, linear, yielding [default: none]
    #[arg(long)]
    specimen: Option<String>,
    /// Parameter of the rig, such as table.added_payload="10 kg"; repeatable
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set: Vec<String>,
    /// Peak acceleration of the table for the excitation, such as "0.3 g" (a plain number is in g)
    #[arg(long, value_name = "G", default_value = "0.3 g")]
    level: String,
    /// Half of the stroke; the excitation uses at most 40 % of it
    #[arg(long, value_name = "L", default_value = "1.5 in")]
    stroke: String,
    /// Length of the recording for the identification
    #[arg(long, value_name = "T", default_value = "60 s")]
    duration: String,
    /// Seed of the motions
    #[arg(long, default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// Part of the loop's delay that is the sensors'; the valve's is the rest, and the motion leads by it
    #[arg(long, value_name = "T", default_value = "2 ms")]
    sensor_delay: String,
    /// Record that will be played, on which the tracking error is predicted [default: the built-in motion]
    #[arg(long, value_name = "FILE", conflicts_with = "reference")]
    record: Option<PathBuf>,
    /// Reference that will be played, used exactly as it is
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Duration of the motion on which the tracking error is predicted
    #[arg(long, value_name = "T", default_value = "20 s")]
    played: String,
    /// FMI version of the components
    #[arg(long, value_enum, default_value_t)]
    fmi: OneVersion,
    /// Folder for recordings, model, systems and report
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Commissions a rig and writes the results.
///
/// # Errors
/// Input at fault, or a rig that gives no model; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let quantity = |option, text: &str, unit: &str, least: f64, most: f64| {
        let fault = |reason: String| Error::Option { option, reason };
        let value = units::value_in(text, unit).map_err(|error| fault(error.to_string()))?;
        if (least..=most).contains(&value) {
            return Ok(value);
        }
        Err(fault(format!(
            "`{text}`; expected {least} to {most} {unit}"
        )))
    };
    let request = Request {
        plant: built_in::plant_path(arguments.plant.as_deref().unwrap_or("servohydraulic")),
        specimen: arguments.specimen.clone().unwrap_or("none".to_string()),
        set: arguments.set.clone(),
        level: quantity("--level", &arguments.level, "g", 0.02, 2.0)? * STANDARD_GRAVITY,
        stroke: quantity("--stroke", &arguments.stroke, "m", 1e-3, 2.0)?,
        duration: quantity("--duration", &arguments.duration, "s", 20.0, 600.0)?,
        seed: arguments.seed,
        sensor_delay: quantity("--sensor-delay", &arguments.sensor_delay, "s", 0.0, 0.1)?,
        record: arguments.record.clone(),
        reference: arguments.reference.clone(),
        played: quantity("--played", &arguments.played, "s", 1.0, 600.0)?,
        fmi: arguments.fmi.into(),
        installation: installation().clone(),
    };
    Results::check(&arguments.out)?;
    let tell = |step: &str| {
        if std::io::stderr().is_terminal() {
            eprintln!("{step}");
        }
    };
    let mut done = commission::commission(&request, &tell)?;
    done.write(&given(&arguments.out))?;
    let status = match done.verdict {
        Verdict::Robust => ExitCode::from(1),
        Verdict::Used | Verdict::Extended => ExitCode::SUCCESS,
    };
    if arguments.json {
        let mut json = serde_json::json!(done);
        json["folder"] = arguments.out.display().to_string().into();
        json["model"] = arguments
            .out
            .join("model.toml")
            .display()
            .to_string()
            .into();
        println!("{json}");
        return Ok(status);
    }
    print!("{}", done.words());
    if !done.design.loops.is_empty() {
        println!("\n{}", aligned(&done.design.table()));
    }
    if done.warnings.len() > 1 {
        println!("warnings");
        for warning in &done.warnings[1..] {
            println!("  {warning}");
        }
        println!();
    }
    println!("seed {}\nwritten:", done.seed);
    for file in &done.files {
        println!("  {}", arguments.out.join(file).display());
    }
    Ok(status)
}

//! `shakebench commission`

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::OneVersion;
use crate::commission::{self, Request};
use crate::error::Error;
use crate::report::columns::aligned;
use crate::results::Results;
use crate::system::built_in;
use crate::units::{self, STANDARD_GRAVITY};

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
    /// Plant: identified, servohydraulic, or a .toml file of one [default: servohydraulic]
    #[arg(long)]
    plant: Option<String>,
    /// Specimen on the table: none, linear, yielding [default: none]
    #[arg(long)]
    specimen: Option<String>,
    /// Parameter of the rig, such as table.added_payload="10 kg"; may be given several times
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set: Vec<String>,
    /// Peak of the table's acceleration that the excitation grows to, such as "0.3 g" (a number
    /// alone is in g)
    #[arg(long, value_name = "G", default_value = "0.3 g")]
    level: String,
    /// Half of the stroke; the excitation uses four tenths of it at most
    #[arg(long, value_name = "L", default_value = "1.5 in")]
    stroke: String,
    /// Length of the recording that is identified
    #[arg(long, value_name = "T", default_value = "60 s")]
    duration: String,
    /// Seed of the motions
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Version of FMI of the components
    #[arg(long, value_enum, default_value_t)]
    fmi: OneVersion,
    /// Folder for recordings, model, systems and report
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Commissions a rig and writes what came of it.
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
        fmi: arguments.fmi.into(),
    };
    Results::check(&arguments.out)?;
    let tell = |step: &str| {
        if std::io::stderr().is_terminal() {
            eprintln!("{step}");
        }
    };
    let mut done = commission::commission(&request, &tell)?;
    done.write(&arguments.out)?;
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
        return Ok(ExitCode::SUCCESS);
    }
    print!("{}", done.words());
    println!("\n{}", aligned(&done.design.table()));
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
    Ok(ExitCode::SUCCESS)
}

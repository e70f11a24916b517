//! `shakebench export`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};

use super::motion::MotionArguments;
use super::quantity::if_given;
use super::rig::RigArguments;
use super::run;
use crate::error::Error;
use crate::fmu::FmiVersion;
use crate::master::Algorithm;
use crate::results::Results;
use crate::run::experiment::{Request, prepare};
use crate::ssp::export::{Experiment, write};

/// Options of `shakebench export`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench export mpc --ssp mpc.ssp\n  \
    shakebench export my-rig.toml --ssp rig.ssp --record NGA/RSN1633_MANJIL_ABBAR--L.AT2")]
pub struct Arguments {
    /// Built-in system, .toml file or .ssp archive
    #[arg(value_name = "SYSTEM")]
    system: String,
    /// Archive to write (System Structure and Parameterization)
    #[arg(long, value_name = "FILE")]
    ssp: PathBuf,
    #[command(flatten)]
    motion: MotionArguments,
    #[command(flatten)]
    rig: RigArguments,
    /// Parameter, such as control.valve_limit="5 V"; may be given several times
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set: Vec<String>,
    /// Version of FMI of the components: 2 for an archive of SSP 1.0, 3 for one of SSP 2.0
    #[arg(long, value_enum, default_value_t = Version::Two)]
    fmi: Version,
    /// Order of calls that the parameters are for; programs that read SSP mostly step all
    /// components from the same values
    #[arg(long, value_enum, default_value_t = Algorithm::Jacobi)]
    algorithm: Algorithm,
    /// How much of the motion goes into the archive, such as "10 s"
    #[arg(long, value_name = "T")]
    duration: Option<String>,
}

/// Version of FMI of an archive's components.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Version {
    /// FMI 2.0
    #[value(name = "2")]
    Two,
    /// FMI 3.0
    #[value(name = "3")]
    Three,
}

/// Writes a system as an SSP archive.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let fmi = match arguments.fmi {
        Version::Two => FmiVersion::V2,
        Version::Three => FmiVersion::V3,
    };
    let request = Request {
        fmi,
        algorithm: Some(arguments.algorithm),
        duration_s: if_given("--duration", &arguments.duration, "s")?,
        ..run::request(&run::Arguments::of(
            Some(arguments.system.clone()),
            arguments.motion.clone(),
            arguments.rig.clone(),
            arguments.set.clone(),
        ))?
    };
    let prepared = prepare(&request)?;
    let parent = arguments
        .ssp
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    Results::check(parent.unwrap_or(Path::new(".")))?;
    if let Some(parent) = parent {
        std::fs::create_dir_all(parent).map_err(|error| Error::File {
            path: parent.to_path_buf(),
            reason: error.to_string(),
        })?;
    }
    let motion = (!prepared.motion.is_empty()).then_some(&prepared.motion);
    let experiment = Experiment {
        motion,
        step: prepared.step,
        duration: prepared.samples as f64 * prepared.motion.dt,
        algorithm: prepared.algorithm.to_string(),
        fmi,
    };
    let mut notes = write(&prepared.system, &experiment, &arguments.ssp)?;
    if motion.is_none() {
        notes.push("the system follows no motion, so none is in the archive".to_string());
    }
    for note in notes {
        eprintln!("note: {note}");
    }
    println!("{}", arguments.ssp.display());
    Ok(ExitCode::SUCCESS)
}

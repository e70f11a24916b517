//! `shakebench export`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use bridges::opensees;
use clap::{Args, ValueEnum};

use super::motion::MotionArguments;
use super::out::{installation, is_forced};
use super::quantity::if_given;
use super::rig::RigArguments;
use super::run;
use fmi_import::FmiVersion;
use fmi_master::Algorithm;
use laboratory::error::Error;
use laboratory::export::{Experiment, write, write_model};
use laboratory::results::Results;
use laboratory::run::experiment::{Request, prepare};

/// Options of `shakebench export`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench export mpc --ssp mpc.ssp\n  \
    shakebench export my-rig.toml --ssp rig.ssp --record NGA/RSN1633_MANJIL_ABBAR--L.AT2\n  \
    shakebench export opensees:frame.py --fmu frame.fmu --fmi 3")]
pub struct Arguments {
    /// Built-in system, .toml file or .ssp archive; opensees:MODEL.py for --fmu
    #[arg(value_name = "SYSTEM")]
    system: String,
    /// Archive to write (System Structure and Parameterization)
    #[arg(long, value_name = "FILE", required_unless_present = "fmu")]
    ssp: Option<PathBuf>,
    /// FMU to write, of a structure that OpenSees computes
    #[arg(long, value_name = "FILE", conflicts_with = "ssp")]
    fmu: Option<PathBuf>,
    #[command(flatten)]
    motion: MotionArguments,
    #[command(flatten)]
    rig: RigArguments,
    /// Parameter, such as control.valve_limit="5 V"; repeatable
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set: Vec<String>,
    /// FMI version of the components: 2 for an archive of SSP 1.0, 3 for one of SSP 2.0
    #[arg(long, value_enum, default_value_t = Version::Two)]
    fmi: Version,
    /// Order of calls for which the parameters are computed; most SSP importers step all components
    /// from the same values
    #[arg(long, value_enum, default_value_t = Algorithm::Jacobi)]
    algorithm: Algorithm,
    /// Length of the motion in the archive, such as "10 s"
    #[arg(long, value_name = "T")]
    duration: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// FMI version of an archive's components.
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
    if let Some(out) = &arguments.fmu {
        let Some(model) = opensees::model_of(&arguments.system) else {
            return Err(Error::Option {
                option: "--fmu",
                reason: format!(
                    "`{}` is not a model in OpenSees; expected opensees:MODEL.py (a system is \
                     exported with --ssp)",
                    arguments.system
                ),
            });
        };
        write_model(model, fmi, installation(), &super::out::given(out))?;
        let note = "files that the model reads are not included, and it needs openseespy";
        return Ok(exported(arguments, out, &[note.to_string()]));
    }
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
    let ssp = arguments.ssp.as_deref().unwrap_or(Path::new("system.ssp"));
    check_archive(ssp, Path::new(&arguments.system))?;
    let parent = ssp.parent().filter(|parent| !parent.as_os_str().is_empty());
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
        installation: installation().clone(),
    };
    let mut notes = write(&prepared.system, &experiment, ssp)?;
    if motion.is_none() {
        notes.push("the system does not use a motion, so the archive has none".to_string());
    }
    Ok(exported(arguments, ssp, &notes))
}

/// Refuses a file for the archive that is another thing.
fn check_archive(ssp: &Path, system: &Path) -> Result<(), Error> {
    let fault = |reason: &str| {
        Err(Error::Option {
            option: "--ssp",
            reason: format!("{}{reason}", ssp.display()),
        })
    };
    if ssp.extension().is_none_or(|ending| ending != "ssp") {
        return fault("; expected a file name that ends in .ssp");
    }
    if matches!((ssp.canonicalize(), system.canonicalize()), (Ok(a), Ok(b)) if a == b) {
        return fault(" is the system to export; expected another file for the archive");
    }
    if !is_forced() && !run::may_be_replaced(ssp, |begin| begin.starts_with(b"PK")) {
        return fault(" exists and is not an archive; name another file, or add --force");
    }
    Ok(())
}

/// Prints what was written.
fn exported(arguments: &Arguments, file: &Path, notes: &[String]) -> ExitCode {
    if arguments.json {
        println!("{}", serde_json::json!({"file": file, "notes": notes}));
        return ExitCode::SUCCESS;
    }
    for note in notes {
        note!("note: {note}");
    }
    println!("{}", file.display());
    ExitCode::SUCCESS
}

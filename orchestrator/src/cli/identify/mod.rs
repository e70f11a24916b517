//! `shakebench identify`

pub mod measured;
mod printed;
mod responses;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::Args;
use identification::data::Recording;
use identification::identify::model_file::ModelFile;
use identification::identify::rig::{self, Options, RigIdentification};
use identification::identify::specimen_file;
use serde::Serialize;

use crate::error::Error;
use crate::report;

/// Options of `shakebench identify`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    shakebench identify bare.csv payload.csv --out MODEL.toml\n\n\
    Columns: time, valve_command, displacement, acceleration, actuator_force and, with a specimen\n\
    on the table, specimen_acceleration; each header cell is `name [unit]`. A bare table alone\n\
    does not determine the actuator: measure with a specimen or two payloads.")]
pub struct Arguments {
    /// Recordings of one rig
    #[arg(value_name = "DATA.csv", required = true)]
    data: Vec<PathBuf>,
    /// Where the model goes; a report with plots goes beside it
    #[arg(long, value_name = "MODEL.toml")]
    out: PathBuf,
    /// Part of each recording that is fitted before the rest validates it
    #[arg(long, value_name = "PART", default_value_t = 0.75)]
    fit_part: f64,
    /// Known specimen, held: TOML with [specimen] mass, damping, stiffness and units. One recording
    /// with it is enough; `specimen_acceleration` may then be missing
    #[arg(long, value_name = "FILE")]
    specimen: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// The model file.
    pub model: PathBuf,
    /// Poles of G1 and G2, `[re, im]` in 1/s; empty where the data do not determine them.
    pub actuator_poles_rad_s: Vec<[f64; 2]>,
    /// Poles of the table.
    pub table_poles_rad_s: Vec<[f64; 2]>,
    /// Fit of each channel on the validation part; the worst of several recordings.
    pub fit_percent: BTreeMap<String, Option<f64>>,
    /// Whether the data determine the actuator.
    pub identifiable: bool,
    /// Everything the reader should know.
    pub warnings: Vec<String>,
    /// Time taken, s.
    pub wall_s: f64,
}

/// Identifies a rig and writes its model.
///
/// # Errors
/// Data at fault, or a file that cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let started = Instant::now();
    if !(0.3..=0.95).contains(&arguments.fit_part) {
        return Err(Error::Option {
            option: "--fit-part",
            reason: format!("{}; expected 0.3 to 0.95", arguments.fit_part),
        });
    }
    let folder = output_folder(arguments)?;
    let mut recordings = Vec::new();
    let mut warnings = Vec::new();
    for path in &arguments.data {
        let (pieces, findings) = measured::read(path)?;
        warnings.extend(findings.iter().map(ToString::to_string));
        recordings.extend(long_enough(pieces, &mut warnings));
    }
    let specimen = match &arguments.specimen {
        Some(path) => Some(specimen_file::read(path)?),
        None => None,
    };
    let options = Options {
        fit_part: arguments.fit_part,
        specimen,
        ..Options::default()
    };
    let found = rig::identify(&recordings, options)?;
    warnings.extend(found.warnings.iter().cloned());
    let model = ModelFile::from_identification(&found);
    let summary = summary(arguments, &found, warnings, started);
    write(
        arguments,
        &folder,
        &model.to_toml()?,
        &printed::report(&found, &recordings, &summary),
    )?;
    if arguments.json {
        println!(
            "{}",
            serde_json::to_string_pretty(&summary).unwrap_or_default()
        );
    } else {
        print!("{}", printed::text(&found, &summary));
    }
    Ok(ExitCode::SUCCESS)
}

/// Leaves out pieces between gaps that are too short to fit, where longer ones remain.
fn long_enough(pieces: Vec<Recording>, warnings: &mut Vec<String>) -> Vec<Recording> {
    const SHORTEST: f64 = 5.0;
    let longest = pieces.iter().map(Recording::duration).fold(0.0, f64::max);
    let (kept, dropped): (Vec<_>, Vec<_>) = pieces
        .into_iter()
        .partition(|piece| piece.duration() >= SHORTEST.min(longest));
    for piece in dropped {
        warnings.push(format!(
            "{}: left out, {:.2} s are too short",
            piece.name,
            piece.duration()
        ));
    }
    kept
}

fn summary(
    arguments: &Arguments,
    found: &RigIdentification,
    warnings: Vec<String>,
    started: Instant,
) -> Summary {
    let pairs = |poles: Vec<nalgebra::Complex<f64>>| poles.iter().map(|p| [p.re, p.im]).collect();
    let mut fit_percent = BTreeMap::new();
    for fit in &found.fits {
        let own = fit.simulated.is_finite().then_some(fit.simulated);
        let slot = fit_percent.entry(fit.channel.to_string()).or_insert(own);
        if let (Some(before), Some(own)) = (*slot, own) {
            *slot = Some(before.min(own));
        }
    }
    Summary {
        model: arguments.out.clone(),
        actuator_poles_rad_s: if found.identifiable {
            pairs(found.actuator_poles())
        } else {
            Vec::new()
        },
        table_poles_rad_s: pairs(found.table_poles()),
        fit_percent,
        identifiable: found.identifiable,
        warnings,
        wall_s: started.elapsed().as_secs_f64(),
    }
}

/// The folder of the model file, after checks that it can be written and overwrites no data.
fn output_folder(arguments: &Arguments) -> Result<PathBuf, Error> {
    let out = &arguments.out;
    let fault = |reason: String| Error::Option {
        option: "--out",
        reason,
    };
    if out.extension().is_none_or(|extension| extension != "toml") {
        return Err(fault(format!(
            "{}; expected a file name that ends in .toml",
            out.display()
        )));
    }
    let folder = match out.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    };
    if !folder.is_dir() {
        return Err(fault(format!(
            "{}: the folder does not exist; expected one that does",
            folder.display()
        )));
    }
    let same =
        |path: &Path| matches!((path.canonicalize(), out.canonicalize()), (Ok(a), Ok(b)) if a == b);
    let read = arguments.data.iter().chain(&arguments.specimen);
    if let Some(path) = read.into_iter().find(|path| same(path)) {
        return Err(fault(format!(
            "{} is read from; expected another file",
            path.display()
        )));
    }
    Ok(folder)
}

/// Writes model and report beside each other, each whole or not at all.
fn write(
    arguments: &Arguments,
    folder: &Path,
    model: &str,
    page: &report::Report,
) -> Result<(), Error> {
    let fault = |path: &Path, reason: String| Error::File {
        path: path.to_path_buf(),
        reason,
    };
    let beside = arguments.out.with_extension("html");
    let html = report::html(page).map_err(|error| fault(&beside, error.to_string()))?;
    let staging = tempfile::Builder::new()
        .prefix(".shakebench")
        .tempdir_in(folder)
        .map_err(|error| fault(folder, error.to_string()))?;
    let files = [
        (staging.path().join("model"), &arguments.out, model),
        (staging.path().join("report"), &beside, html.as_str()),
    ];
    for (draft, path, text) in &files {
        std::fs::write(draft, text).map_err(|error| fault(path, error.to_string()))?;
    }
    for (draft, path, _) in &files {
        std::fs::rename(draft, path).map_err(|error| fault(path, error.to_string()))?;
    }
    Ok(())
}

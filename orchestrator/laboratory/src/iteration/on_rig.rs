//! The drive of a described rig, such as an axis on a voltage, computed on its extended model.

use std::io;
use std::path::PathBuf;

use identification::diagnosis::rigs::{DriveSearch, ExtendedRig, RigDrive};
use serde::Serialize;

use crate::error::Error;
use crate::results::{Out, Results};

const DRIVE: &str = "drive.csv";
const FIGURES: &str = "drive.json";

/// What is looked for.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The extended model.
    pub model: PathBuf,
    /// The wanted output, under the headings of the model's columns.
    pub wanted: PathBuf,
    /// How to look.
    pub search: DriveSearch,
}

/// What is printed with `--json` and written as `drive.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// The rig.
    pub rig: String,
    /// The wanted motion.
    pub wanted: PathBuf,
    /// Effects of the extended model.
    pub effects: Vec<String>,
    /// Error of the first drive and after each correction on the model, %.
    pub errors_percent: Vec<f64>,
    /// Largest drive, in its column's unit.
    pub peak_drive: f64,
    /// That unit.
    pub unit: String,
    /// Share of the samples at the rail, %.
    pub at_rail_percent: f64,
}

/// Computes the drive.
///
/// # Errors
/// A model that is not of a described rig, a file without the wanted output, a search that has no end.
pub fn drive(plan: &Plan) -> Result<RigDrive, Error> {
    let failed = |error: &dyn std::fmt::Display| Error::Option {
        option: "--model",
        reason: error.to_string(),
    };
    let model = ExtendedRig::read(&plan.model).map_err(|error| {
        failed(&format!(
            "{error}; for the model of a shake table also name its case, whose nominal.toml states the control law"
        ))
    })?;
    model
        .drive(&plan.wanted, &plan.search)
        .map_err(|error| failed(&error))
}

/// The figures of `found`.
#[must_use]
pub fn figures(plan: &Plan, found: &RigDrive) -> Figures {
    Figures {
        rig: found.rig.clone(),
        wanted: plan.wanted.clone(),
        effects: found.effects.clone(),
        errors_percent: found.errors.clone(),
        peak_drive: found.peak,
        unit: found.columns[1].1.clone(),
        at_rail_percent: 100.0 * found.at_rail,
    }
}

/// Writes `drive.csv`, with drive and expected output under the headings of the rig's files, and `drive.json`.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(plan: &Plan, found: &RigDrive, folder: &Out) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    let figures = serde_json::json!(figures(plan, found)).to_string();
    results.write_text(FIGURES, &(figures + "\n"))?;
    results.write(DRIVE, |file| write_csv(found, file))?;
    Ok(results.finish()?)
}

fn write_csv(found: &RigDrive, file: impl io::Write) -> io::Result<()> {
    let heading = |(head, unit): &(String, String)| match head.contains(unit.as_str()) {
        true => head.clone(),
        false => format!("{head} [{unit}]"),
    };
    let mut csv = csv::Writer::from_writer(file);
    csv.write_record(found.columns.each_ref().map(heading))?;
    let second = if found.columns[0].1 == "ms" { 1e3 } else { 1.0 };
    for (k, (u, y)) in found.drive.iter().zip(&found.expected).enumerate() {
        let time = second * found.period * k as f64;
        csv.write_record([time, *u, *y].map(|value| value.to_string()))?;
    }
    csv.flush()
}

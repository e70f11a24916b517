//! An extended model on further records, without a fit: what it misses, and what it predicts.

use std::io::Write;
use std::path::{Path, PathBuf};

use identification::diagnosis::rigs::{DescriptionError, ExtendedRig, FileErrors, renamed};
use serde::Serialize;

use super::{fault, file_fault};
use crate::error::Error;
use crate::report::columns::aligned;
use crate::results::Results;

/// Column of the file of [`predict`].
const PREDICTION: &str = "prediction";

/// What `diagnose --validate` tells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Validation {
    /// The model.
    pub model: PathBuf,
    /// A record for each file.
    pub records: Vec<FileErrors>,
}

/// What `diagnose --predict` tells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Predicted {
    /// The model.
    pub model: PathBuf,
    /// The file that was predicted.
    pub file: PathBuf,
    /// Where the prediction was written.
    pub prediction: PathBuf,
    /// What was predicted.
    pub channel: String,
    /// Its unit, that of the file.
    pub unit: String,
    /// Rows.
    pub rows: usize,
    /// Rows in which the output was given; they told how the file begins.
    pub given: usize,
}

/// Errors of the model in the file `model` on `files`, whose columns the file `columns` may name
/// otherwise.
///
/// # Errors
/// A file that cannot be read or understood, by place.
pub fn validate(
    model: &Path,
    columns: Option<&Path>,
    files: &[PathBuf],
) -> Result<Validation, Error> {
    let read = read(model, columns)?;
    let records = read
        .validate(files)
        .map_err(|error| fault(model, error.into()))?;
    Ok(Validation {
        model: model.into(),
        records,
    })
}

/// Writes what the model in the file `model` puts out for every row of `file` to `out`; the output's
/// cells may be empty. A file without a given output begins at rest, or in the steady state of a
/// motion that repeats it where it `is_periodic`.
///
/// # Errors
/// As [`validate`]; a file that cannot be written.
pub fn predict(
    model: &Path,
    columns: Option<&Path>,
    file: &Path,
    is_periodic: bool,
    out: &Path,
) -> Result<Predicted, Error> {
    let read = read(model, columns)?;
    let found = read
        .predict(file, is_periodic)
        .map_err(|error| fault(model, error.into()))?;
    let name = out
        .file_name()
        .ok_or_else(|| file_fault(out, "expected the name of a file to write"))?;
    let folder = out.parent().filter(|parent| !parent.as_os_str().is_empty());
    let mut results = Results::begin(folder.unwrap_or(Path::new(".")))?;
    results.write(&name.to_string_lossy(), |file| {
        writeln!(file, "{PREDICTION}")?;
        found
            .rows
            .iter()
            .try_for_each(|row| writeln!(file, "{row}"))
    })?;
    results.finish()?;
    Ok(Predicted {
        model: model.into(),
        file: file.into(),
        prediction: out.into(),
        channel: found.channel.into(),
        unit: found.unit,
        rows: found.rows.len(),
        given: found.given,
    })
}

fn read(model: &Path, columns: Option<&Path>) -> Result<ExtendedRig, Error> {
    let failed = |error: DescriptionError| fault(model, error.into());
    let mut read = ExtendedRig::read(model).map_err(failed)?;
    if let Some(map) = columns {
        read.columns = renamed(&read.columns, map).map_err(failed)?;
    }
    Ok(read)
}

impl Validation {
    /// What is printed without `--json`.
    pub fn text(&self) -> String {
        let heading = [
            "file",
            "channel",
            "as described",
            "refitted",
            "extended",
            "rms error",
        ];
        let mut rows = vec![heading.map(String::from).to_vec()];
        for one in &self.records {
            let percent = |value: f64| format!("{value:.2} %");
            rows.push(vec![
                one.file.display().to_string(),
                one.channel.clone(),
                percent(one.described_percent),
                percent(one.nominal_percent),
                percent(one.extended_percent),
                format!("{:.3e} {}", one.extended_rms, one.unit),
            ]);
        }
        let mut text = format!(
            "error over variation, nothing fitted but what a file has for itself\n{}",
            aligned(&rows)
        );
        for one in &self.records {
            let own: Vec<String> = one
                .session
                .iter()
                .map(|(name, value)| format!("{name} {value:.3e}"))
                .collect();
            if !own.is_empty() {
                text += &format!("{}: {} (SI)\n", one.file.display(), own.join(", "));
            }
            for note in &one.notes {
                text += &format!("note: {note}\n");
            }
        }
        text
    }
}

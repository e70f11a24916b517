//! An extended model on further records, without a fit: what it misses, and what it predicts.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use identification::data::{Called, Channel, named_columns};
use identification::diagnosis::DiagnosisError;
use identification::diagnosis::called;
use identification::diagnosis::rigs::shake_table::{ExtendedTable, TableErrors};
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
    /// A record for each file, of a shake table for each of its channels; no refit stands between its
    /// model as described and the extended one.
    pub records: Vec<FileErrors>,
    /// Of a shake table, all channels of a file together.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<TableErrors>,
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
    let (records, tables) = match read(model, columns)? {
        Read::Rig(rig) => {
            let found = rig.validate(files);
            let found = found.map_err(|error| fault(model, error.into()))?;
            (found, Vec::new())
        }
        Read::Table(table, called) => {
            let found = table.validate(files, &called);
            let found = found.map_err(|error| fault(model, error.into()))?;
            (found.iter().flat_map(by_channel).collect(), found)
        }
    };
    Ok(Validation {
        model: model.into(),
        records,
        tables,
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
    let read = match read(model, columns)? {
        Read::Rig(read) => read,
        Read::Table(table, called) => {
            return predict_table(&table, &called, file, is_periodic, out);
        }
    };
    let found = read
        .predict(file, is_periodic)
        .map_err(|error| fault(model, error.into()))?;
    write(out, |file| {
        writeln!(file, "{PREDICTION}")?;
        found
            .rows
            .iter()
            .try_for_each(|row| writeln!(file, "{row}"))
    })?;
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

fn by_channel(table: &TableErrors) -> impl Iterator<Item = FileErrors> + '_ {
    table.channels.iter().map(|own| FileErrors {
        file: table.file.clone(),
        channel: own.channel.clone(),
        nominal_percent: own.described_percent,
        described_percent: own.described_percent,
        extended_percent: own.extended_percent,
        extended_rms: own.extended_rms,
        unit: own.unit.clone(),
        session: BTreeMap::from([(format!("{}_zero", own.channel), own.zero)]),
        notes: Vec::new(),
    })
}

/// As [`predict`], of a table: the output that was asked for in the file's unit, and, SI, all four beside the time.
fn predict_table(
    table: &ExtendedTable,
    called: &[Called],
    file: &Path,
    is_periodic: bool,
    out: &Path,
) -> Result<Predicted, Error> {
    if is_periodic {
        return Err(Error::Option {
            option: "--periodic",
            reason: format!(
                "{} is a shake table's, which begins at rest",
                table.path.display()
            ),
        });
    }
    let found = table
        .predict(file, called)
        .map_err(|error| fault(file, error.into()))?;
    let wanted = Channel::OUTPUTS[found.wanted];
    let heads = named_columns(file).unwrap_or_default();
    let in_file = heads.into_iter().find(|head| head.channel == wanted);
    let unit = in_file.map_or_else(|| wanted.unit().to_owned(), |head| head.unit);
    let factor = units::convert(1.0, wanted.unit(), &unit)
        .map_err(|why| file_fault(file, format!("`{}`: {why}", wanted.name())))?;
    write(out, |file| {
        let heads = Channel::OUTPUTS.map(|own| format!("{} [{}]", own.name(), own.unit()));
        writeln!(file, "{PREDICTION},time [s],{}", heads.join(","))?;
        found.time.iter().zip(&found.rows).try_for_each(|(t, row)| {
            let [x, a, f, s] = row;
            let wanted = factor * row[found.wanted];
            writeln!(file, "{wanted},{t},{x:.9e},{a:.9e},{f:.9e},{s:.9e}")
        })
    })?;
    Ok(Predicted {
        model: table.path.clone(),
        file: file.into(),
        prediction: out.into(),
        channel: wanted.name().into(),
        unit,
        rows: found.rows.len(),
        given: found.given,
    })
}

/// Writes the file `out`, all or nothing.
fn write(
    out: &Path,
    text: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), Error> {
    let name = out
        .file_name()
        .ok_or_else(|| file_fault(out, "expected the name of a file to write"))?;
    let folder = out.parent().filter(|parent| !parent.as_os_str().is_empty());
    let mut results = Results::begin(folder.unwrap_or(Path::new(".")))?;
    results.write(&name.to_string_lossy(), |file| text(file))?;
    results.finish()?;
    Ok(())
}

enum Read {
    Rig(Box<ExtendedRig>),
    Table(Box<ExtendedTable>, Vec<Called>),
}

fn read(model: &Path, columns: Option<&Path>) -> Result<Read, Error> {
    let is_table = std::fs::read_to_string(model).is_ok_and(|text| ExtendedTable::is_one(&text));
    if is_table {
        let table = ExtendedTable::read(model).map_err(|error| fault(model, error.into()))?;
        let called = columns.map(called).transpose();
        let called = called.map_err(|error: DiagnosisError| fault(model, error))?;
        return Ok(Read::Table(Box::new(table), called.unwrap_or_default()));
    }
    let failed = |error: DescriptionError| fault(model, error.into());
    let mut read = ExtendedRig::read(model).map_err(failed)?;
    if let Some(map) = columns {
        read.columns = renamed(&read.columns, map).map_err(failed)?;
    }
    Ok(Read::Rig(Box::new(read)))
}

impl Validation {
    /// What is printed without `--json`.
    pub fn text(&self) -> String {
        if !self.tables.is_empty() {
            return self.text_of_tables();
        }
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

    fn text_of_tables(&self) -> String {
        let heading = ["file", "channel", "as described", "extended", "noise alone"];
        let mut rows = vec![heading.map(String::from).to_vec()];
        let percent = |value: f64| format!("{value:.2} %");
        let times = |value: f64| format!("{value:.2} times");
        for one in &self.tables {
            let file = one.file.display().to_string();
            for own in &one.channels {
                rows.push(vec![
                    file.clone(),
                    own.channel.clone(),
                    percent(own.described_percent),
                    percent(own.extended_percent),
                    percent(own.floor_percent),
                ]);
            }
            rows.push(vec![
                file,
                "all, in the noise".into(),
                times(one.described_in_noise),
                times(one.extended_in_noise),
                times(1.0),
            ]);
        }
        let mut text = format!(
            "one-step error over variation, nothing fitted but the sensors' zeros of a file\n{}",
            aligned(&rows)
        );
        for one in &self.tables {
            let own: Vec<String> = one
                .channels
                .iter()
                .map(|own| format!("{} {:.2e} {}", own.channel, own.zero, own.unit))
                .collect();
            text += &format!("{}: zeros {}\n", one.file.display(), own.join(", "));
        }
        text
    }
}

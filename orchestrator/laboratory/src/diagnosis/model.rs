//! An extended model on further records, without a fit: what it misses, and what it predicts.

use pack::Installation;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use identification::data::{Called, Channel, named_columns};
use identification::diagnosis::DiagnosisError;
use identification::diagnosis::called;
use identification::diagnosis::rigs::shake_table::{ExtendedTable, TableErrors};
use identification::diagnosis::rigs::{DescriptionError, ExtendedRig, FileErrors, renamed};
use serde::Serialize;

use super::{fault, file_fault, foreign};
use crate::error::Error;
use crate::results::{Out, Results};
use fmi_import::Isolation;
use pages::report::columns::aligned;

/// Column of the file of [`predict`].
const PREDICTION: &str = "prediction";

/// What `diagnose --validate` tells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Validation {
    /// The model.
    pub model: PathBuf,
    /// A record for each file, of a shake table for each of its channels; there is no refitted
    /// model between the described and the extended one.
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

/// An extended model that a diagnosis wrote, and what is stated next to it.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// The file.
    pub model: &'a Path,
    /// File that names the columns otherwise; not of an FMU.
    pub columns: Option<&'a Path>,
    /// Of an FMU, where it is now, if not where the file says.
    pub fmu: Option<&'a Path>,
    /// Of an FMU, the map of the data, if not the one beside the file.
    pub map: Option<&'a Path>,
    /// Of an FMU, whether it runs in a process of its own; absent: it does.
    pub isolate: Option<Isolation>,
    /// Of an FMU, where a component of the project comes from.
    pub installation: &'a Installation,
}

/// Errors of the model that is `asked` for on `files`.
///
/// # Errors
/// A file that cannot be read or understood, by place.
pub fn validate(asked: &Asked<'_>, files: &[PathBuf]) -> Result<Validation, Error> {
    let model = asked.model;
    let (records, tables) = match read(asked)? {
        Read::Foreign(foreign) => (foreign.validate(files)?, Vec::new()),
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

/// Writes what the model that is `asked` for puts out for every row of `file` to `out`; the output's
/// cells may be empty. A file without a given output begins at rest, or in the steady state of a
/// motion that repeats it where it `is_periodic`.
///
/// # Errors
/// As [`validate`]; a file that cannot be written.
pub fn predict(
    asked: &Asked<'_>,
    file: &Path,
    is_periodic: bool,
    out: &Out,
) -> Result<Predicted, Error> {
    let model = asked.model;
    let read = match read(asked)? {
        Read::Rig(read) => read,
        Read::Foreign(foreign) => return predict_foreign(&foreign, file, is_periodic, out),
        Read::Table(table, called) => {
            return predict_table(&table, &called, file, is_periodic, out);
        }
    };
    let found = read
        .predict(file, is_periodic)
        .map_err(|error| fault(model, error.into()))?;
    let Some((first, also)) = found.columns.split_first() else {
        return Err(file_fault(file, "the model has no output"));
    };
    write(out, |file| {
        let heads = also
            .iter()
            .map(|own| format!(",{} [{}]", own.channel, own.unit));
        writeln!(file, "{PREDICTION}{}", heads.collect::<String>())?;
        first.rows.iter().enumerate().try_for_each(|(k, row)| {
            let others = also.iter().map(|own| format!(",{}", own.rows[k]));
            writeln!(file, "{row}{}", others.collect::<String>())
        })
    })?;
    Ok(Predicted {
        model: model.into(),
        file: file.into(),
        prediction: out.to_path_buf(),
        channel: first.channel.into(),
        unit: first.unit.clone(),
        rows: first.rows.len(),
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
    out: &Out,
) -> Result<Predicted, Error> {
    if is_periodic {
        return Err(Error::Option {
            option: "--periodic",
            reason: format!(
                "{} is a model of a shake table, which begins at rest",
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
        prediction: out.to_path_buf(),
        channel: wanted.name().into(),
        unit,
        rows: found.rows.len(),
        given: found.given,
    })
}

/// As [`predict`], of an FMU: the output that was asked for in the file's unit, and all in the model's beside
/// the time.
fn predict_foreign(
    model: &foreign::Extended,
    file: &Path,
    is_periodic: bool,
    out: &Out,
) -> Result<Predicted, Error> {
    if is_periodic {
        return Err(Error::Option {
            option: "--periodic",
            reason: format!(
                "{} is a model of an FMU, which begins with its start values",
                model.path.display()
            ),
        });
    }
    let found = model.predict(file)?;
    let (unit, factor) = &found.in_file;
    write(out, |file| {
        let mut csv = csv::Writer::from_writer(file);
        let heads = found.outputs.iter().map(foreign::head);
        let first = [PREDICTION.to_owned(), "time [s]".to_owned()];
        csv.write_record(first.into_iter().chain(heads))?;
        for (k, time) in found.time.iter().enumerate() {
            let wanted = found.values[found.wanted][k] / factor;
            let own = found.values.iter().map(|own| own[k]);
            let row = [wanted, *time].into_iter().chain(own);
            csv.write_record(row.map(|value| value.to_string()))?;
        }
        csv.flush()
    })?;
    Ok(Predicted {
        model: model.path.clone(),
        file: file.into(),
        prediction: out.to_path_buf(),
        channel: found.outputs[found.wanted].name.clone(),
        unit: unit.clone(),
        rows: found.time.len(),
        given: found.given,
    })
}

/// Writes the file `out`, all or nothing.
fn write(out: &Out, text: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<(), Error> {
    let name = out
        .file_name()
        .ok_or_else(|| file_fault(out, "expected the name of an output file"))?;
    let mut results = Results::begin(&out.folder())?;
    results.write(&name.to_string_lossy(), |file| text(file))?;
    results.finish()?;
    Ok(())
}

enum Read {
    Rig(Box<ExtendedRig>),
    Table(Box<ExtendedTable>, Vec<Called>),
    Foreign(Box<foreign::Extended>),
}

fn read(asked: &Asked<'_>) -> Result<Read, Error> {
    let (model, columns) = (asked.model, asked.columns);
    let text = identification::data::read_written(model).unwrap_or_default();
    if foreign::is_one(&text) {
        if columns.is_some() {
            return Err(Error::Option {
                option: "--columns",
                reason: format!(
                    "{} is a model of an FMU: expected --map, the map of its data",
                    model.display()
                ),
            });
        }
        let read = foreign::Extended::read(
            model,
            asked.fmu,
            asked.map,
            (asked.isolate, asked.installation),
        )?;
        return Ok(Read::Foreign(Box::new(read)));
    }
    for (option, given) in [("--fmu", asked.fmu), ("--map", asked.map)] {
        if given.is_some() {
            return Err(Error::Option {
                option,
                reason: format!("{} is not the model of an FMU", model.display()),
            });
        }
    }
    if ExtendedTable::is_one(&text) {
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
        // Between the model as described and the extended one of an FMU stands no refitted one.
        let refitted = |one: &FileErrors| one.nominal_percent != one.described_percent;
        let has_refitted = self.records.iter().any(refitted);
        let row = |cells: [String; 6]| -> Vec<String> {
            let cells = cells.into_iter().enumerate();
            let cells = cells.filter(|(place, _)| has_refitted || *place != 3);
            cells.map(|(_, cell)| cell).collect()
        };
        let heading = [
            "file",
            "channel",
            "as described",
            "refitted",
            "extended",
            "rms error",
        ];
        let mut rows = vec![row(heading.map(String::from))];
        for one in &self.records {
            let percent = |value: f64| format!("{value:.2} %");
            rows.push(row([
                one.file.display().to_string(),
                one.channel.clone(),
                percent(one.described_percent),
                percent(one.nominal_percent),
                percent(one.extended_percent),
                format!("{:.3e} {}", one.extended_rms, one.unit),
            ]));
        }
        let has_own = self.records.iter().any(|one| !one.session.is_empty());
        let but = if has_own {
            "  except parameters of a file"
        } else {
            ""
        };
        let mut text = format!(
            "error relative to variation, nothing fitted{but}\n{}",
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
            "one-step error relative to variation, nothing fitted except the sensors' zeros of a \
             file\n{}",
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

#[cfg(test)]
mod tests {
    use identification::diagnosis::rigs::shake_table::ChannelErrors;

    use super::*;

    fn errors(file: &str, refitted: f64, session: &[(&str, f64)]) -> FileErrors {
        let session = session
            .iter()
            .map(|(name, value)| ((*name).to_string(), *value));
        FileErrors {
            file: file.into(),
            channel: "position".into(),
            nominal_percent: refitted,
            described_percent: 12.3,
            extended_percent: 1.2,
            extended_rms: 3.4e-5,
            unit: "m".into(),
            session: session.collect(),
            notes: Vec::new(),
        }
    }

    fn validation(records: Vec<FileErrors>, tables: Vec<TableErrors>) -> Validation {
        Validation {
            model: "extended_model.toml".into(),
            records,
            tables,
        }
    }

    #[test]
    fn errors_of_a_rig_are_a_row_per_file_with_what_is_the_files_own() {
        let mut second = errors("b.csv", 5.6, &[("zero", 2e-3)]);
        second.notes.push("the record is short".into());
        let all = validation(vec![errors("a.csv", 5.6, &[]), second], Vec::new());
        assert_eq!(
            all.text(),
            "error relative to variation, nothing fitted  except parameters of a file\n\
             file    channel  as described  refitted  extended   rms error\n\
             a.csv  position       12.30 %    5.60 %    1.20 %  3.400e-5 m\n\
             b.csv  position       12.30 %    5.60 %    1.20 %  3.400e-5 m\n\
             b.csv: zero 2.000e-3 (SI)\n\
             note: the record is short\n"
        );
        // Of an FMU there is no refitted model.
        let foreign = validation(vec![errors("a.csv", 12.3, &[])], Vec::new()).text();
        assert!(
            !foreign.contains("refitted") && !foreign.contains("except"),
            "{foreign}"
        );
    }

    #[test]
    fn errors_of_a_table_are_a_row_per_channel_and_one_of_all() {
        let table = TableErrors {
            file: "v.csv".into(),
            channels: vec![ChannelErrors {
                channel: "displacement".into(),
                described_percent: 7.0,
                extended_percent: 2.0,
                extended_rms: 4e-5,
                unit: "m".into(),
                zero: -1.5e-4,
                floor_percent: 1.5,
            }],
            described_in_noise: 4.5,
            extended_in_noise: 1.25,
        };
        let records: Vec<FileErrors> = by_channel(&table).collect();
        let own = &records[0];
        assert_eq!(
            (
                own.described_percent,
                own.extended_percent,
                own.extended_rms
            ),
            (7.0, 2.0, 4e-5)
        );
        assert_eq!(own.session["displacement_zero"], -1.5e-4);
        let text = validation(records, vec![table]).text();
        let rows: Vec<String> = text
            .lines()
            .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
            .collect();
        assert_eq!(
            rows[1..],
            [
                "file channel as described extended noise alone",
                "v.csv displacement 7.00 % 2.00 % 1.50 %",
                "v.csv all, in the noise 4.50 times 1.25 times 1.00 times",
                "v.csv: zeros displacement -1.50e-4 m",
            ]
        );
    }

    #[test]
    fn options_that_are_not_for_the_model_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let foreign = write("foreign.toml", "[components.a]\nfmu = \"a.fmu\"\n");
        let rig = write("rig.toml", "kind = \"arm\"\n");
        let other = Path::new("other");
        let installation = Installation::default();
        let asked = |model| Asked {
            model,
            columns: None,
            fmu: None,
            map: None,
            isolate: None,
            installation: &installation,
        };
        let told = |asked: &Asked<'_>| validate(asked, &[]).unwrap_err().to_string();
        let own = Asked {
            columns: Some(other),
            ..asked(&foreign)
        };
        assert!(told(&own).contains("expected --map, the map of its data"));
        for (option, own) in [
            (
                "--fmu",
                Asked {
                    fmu: Some(other),
                    ..asked(&rig)
                },
            ),
            (
                "--map",
                Asked {
                    map: Some(other),
                    ..asked(&rig)
                },
            ),
        ] {
            let told = told(&own);
            assert!(
                told.contains(option) && told.contains("is not the model of an FMU"),
                "{told}"
            );
        }
        assert!(told(&asked(&foreign)).contains("map.toml is missing"));
    }
}

//! `results.csv`: the recorded signals of a run, and `columns.csv`: what its columns are.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use crate::error::Error;
use crate::results::parquet_file::{self, Values};
use fmi_import::Datum;
use fmi_master::Record;
use fmi_system::System;

/// File with the recorded signals.
pub const RESULTS: &str = "results.csv";
/// The same as Parquet, where it is asked for.
pub const PARQUET: &str = "results.parquet";
/// File that names the columns' units.
pub const COLUMNS: &str = "columns.csv";

/// So many bytes of a file are written at once.
const BLOCK: usize = 64 << 10;

/// A column of `results.csv`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// Unit of its numbers; empty for none.
    pub unit: String,
    /// What it is.
    pub description: String,
}

/// Whether a column is written: not what lies ahead of the reference, which is the same history
/// some samples later.
fn is_kept(name: &str) -> bool {
    !(name.starts_with("reference.") && name.ends_with(']'))
}

/// The columns of `record` that are written.
pub fn columns(system: &System, record: &Record) -> Vec<Column> {
    let names = record.columns.iter().chain(&record.exact_columns);
    names
        .filter(|name| is_kept(name))
        .map(|name| {
            let (unit, description) = about(system, name);
            Column {
                name: name.clone(),
                unit,
                description,
            }
        })
        .collect()
}

/// Unit and description of a signal.
fn about(system: &System, name: &str) -> (String, String) {
    let own = |unit: &str, text: &str| (unit.to_string(), text.to_string());
    match name {
        "time" => return own("s", "time"),
        "reference.displacement" => return own("m", "displacement asked for"),
        "reference.velocity" => return own("m/s", "velocity asked for"),
        "reference.acceleration" => return own("m/s2", "acceleration asked for"),
        "reference.displacement_y" => return own("m", "displacement asked for along y"),
        "reference.velocity_y" => return own("m/s", "velocity asked for along y"),
        "reference.acceleration_y" => return own("m/s2", "acceleration asked for along y"),
        _ => {}
    }
    let (component, variable) = name.split_once('.').unwrap_or(("", name));
    let component = system.components.iter().find(|own| own.name == component);
    let found = component.and_then(|component| {
        let description = &component.fmu.description;
        description
            .position(variable)
            .map(|at| &description.variables[at])
    });
    found.map_or((String::new(), String::new()), |variable| {
        let unit = variable.unit.clone().unwrap_or_default();
        (unit, variable.description.clone())
    })
}

/// Writes the columns' names, units and descriptions.
///
/// # Errors
/// A disk that is full, and the like.
pub fn write_columns(columns: &[Column], file: impl Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(file);
    csv.write_record(["column", "unit", "description"])?;
    for column in columns {
        csv.write_record([&column.name, &column.unit, &column.description])?;
    }
    csv.flush()
}

/// Writes a record as CSV: a line of names, then one line per sample; every number reads back to
/// the same bits.
///
/// # Errors
/// A disk that is full, and the like.
pub fn write_csv(record: &Record, mut file: impl Write) -> io::Result<()> {
    let kept: Vec<bool> = record.columns.iter().map(|name| is_kept(name)).collect();
    fn only<'a, T>(kept: &'a [bool], all: &'a [T]) -> impl Iterator<Item = &'a T> {
        all.iter()
            .zip(kept)
            .filter_map(|(one, keep)| keep.then_some(one))
    }
    let mut csv = csv::Writer::from_writer(&mut file);
    csv.write_record(only(&kept, &record.columns).chain(&record.exact_columns))?;
    csv.flush()?;
    drop(csv);
    let (mut text, mut number) = (Vec::with_capacity(2 * BLOCK), ryu::Buffer::new());
    for (place, row) in record.rows().enumerate() {
        // Numbers need no quotes, which `csv` would look for in each of them.
        for value in only(&kept, row) {
            text.extend_from_slice(number.format(*value).as_bytes());
            text.push(b',');
        }
        text.pop();
        let exact = record.exact(place);
        if exact.is_empty() {
            text.push(b'\n');
        } else {
            // An empty field first, so that a comma precedes them.
            let exact = exact.iter().map(Datum::to_string);
            let mut csv = csv::Writer::from_writer(&mut text);
            csv.write_record(std::iter::once(String::new()).chain(exact))?;
            csv.flush()?;
        }
        if text.len() > BLOCK {
            file.write_all(&text)?;
            text.clear();
        }
    }
    file.write_all(&text)?;
    file.flush()
}

/// Writes a record as Parquet, with the columns and units of [`columns`]: numbers as doubles, other values
/// as texts.
///
/// # Errors
/// A disk that is full, and the like.
pub fn write_parquet(
    record: &Record,
    columns: &[Column],
    file: impl Write + Send,
) -> io::Result<()> {
    let place = |name: &str, of: &[String]| of.iter().position(|own| own == name);
    let number = |column: &Column| place(&column.name, &record.columns);
    let written = columns.iter().map(|column| parquet_file::Column {
        name: column.name.clone(),
        unit: Some(column.unit.clone()).filter(|unit| !unit.is_empty()),
        kind: match number(column) {
            Some(_) => parquet_file::Kind::Number,
            None => parquet_file::Kind::Text,
        },
    });
    let written: Vec<_> = written.collect();
    parquet_file::write(&written, record.len(), file, |column, rows| {
        let column = &columns[column];
        match number(column) {
            Some(place) => {
                let rows = record.rows().skip(rows.start).take(rows.len());
                Values::Numbers(rows.map(|row| row[place]).collect())
            }
            None => {
                let place = place(&column.name, &record.exact_columns);
                let text = |row| Some(record.exact(row).get(place?)?.to_string());
                Values::Texts(rows.map(text).collect())
            }
        }
    })
}

/// Reads a record that [`write_csv`] wrote.
///
/// # Errors
/// A file that cannot be read or holds anything but a line of names, `time` first, and numbers, with
/// the line.
pub fn read_csv(path: &Path) -> Result<Record, Error> {
    let fault = |reason: String| Error::File {
        path: path.to_path_buf(),
        reason,
    };
    let file = File::open(path).map_err(|error| fault(error.to_string()))?;
    let mut csv = csv::Reader::from_reader(file);
    let names = csv.headers().map_err(|error| fault(error.to_string()))?;
    let names: Vec<String> = names.iter().map(String::from).collect();
    if names.first().is_none_or(|first| first != "time") {
        return Err(fault("the first column is not `time`".into()));
    }
    let mut record = Record::with_capacity(names, 0);
    for (row, line) in csv.records().zip(2..) {
        let row = row.map_err(|error| fault(error.to_string()))?;
        let number = |cell: &str| {
            let wrong = |_| fault(format!("line {line}: `{cell}` is not a number"));
            cell.trim().parse::<f64>().map_err(wrong)
        };
        let values: Vec<f64> = row.iter().map(number).collect::<Result<_, _>>()?;
        // Every row is as long as the line of names, the reader sees to it.
        if let Some((time, signals)) = values.split_first() {
            record.push(*time, signals, &[]);
        }
    }
    Ok(record)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_written_as_the_crate_csv_writes_them() {
        let numbers = [0.0, -0.0, 0.1, -1e-7, 1e16, 1.5e300, f64::MIN_POSITIVE];
        let texts = ["plain", "", "a,b", "say \"it\"", "two\nlines", " ", "ü"];
        let names = ["time", "a.x"].map(String::from).to_vec();
        for exact_names in [&[][..], &["a.text".to_string()]] {
            let mut record = Record::with_capacity(names.clone(), 7).beside(exact_names);
            let mut csv = csv::Writer::from_writer(Vec::new());
            csv.write_record(names.iter().chain(exact_names)).unwrap();
            for (number, text) in numbers.iter().zip(texts) {
                let exact = Datum::Text(text.as_bytes().to_vec());
                let exact = &[exact][..exact_names.len()];
                record.push(1.0 / 3.0, &[*number], exact);
                let exact: Vec<String> = exact.iter().map(Datum::to_string).collect();
                csv.serialize((1.0 / 3.0, number, exact)).unwrap();
            }
            let mut written = Vec::new();
            write_csv(&record, &mut written).unwrap();
            let expected = csv.into_inner().unwrap();
            assert_eq!(
                String::from_utf8(written).unwrap(),
                String::from_utf8(expected).unwrap()
            );
        }
    }

    #[test]
    fn columns_have_the_units_and_descriptions_of_their_variables() {
        use crate::made;
        let names = [
            "time",
            "reference.displacement",
            "reference.velocity_y",
            "reference.acceleration[3]",
            "specimen.drift",
            "specimen.other",
            "none.x",
        ];
        let record = Record::with_capacity(names.map(String::from).to_vec(), 0)
            .beside(&["specimen.text".into()]);
        let columns = columns(&made::rig(), &record);
        let mut text = Vec::new();
        write_columns(&columns, &mut text).unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            "column,unit,description\ntime,s,time\nreference.displacement,m,displacement asked for\n\
             reference.velocity_y,m/s,velocity asked for along y\nspecimen.drift,m,about drift\nspecimen.other,,\n\
             none.x,,\nspecimen.text,,\n"
        );
    }

    #[test]
    fn what_lies_ahead_of_the_reference_is_not_written_and_a_record_reads_back() {
        let names = ["time", "reference.x[1]", "a.x"].map(String::from).to_vec();
        let record = Record::of(
            names,
            vec![0.0, 9.0, 1.5, 0.5, 9.0, -0.1],
            Vec::new(),
            Vec::new(),
        )
        .unwrap();
        let mut text = Vec::new();
        write_csv(&record, &mut text).unwrap();
        assert_eq!(
            String::from_utf8_lossy(&text),
            "time,a.x\n0.0,1.5\n0.5,-0.1\n"
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(RESULTS);
        let told = |text: &[u8]| {
            std::fs::write(&path, text).unwrap();
            read_csv(&path).map_err(|error| error.to_string())
        };
        let read = told(&text).unwrap();
        assert_eq!(
            (read.columns.len(), read.column("a.x").unwrap()),
            (2, vec![1.5, -0.1])
        );
        let wrong = told(b"time,a\n0,1\n1,b\n").unwrap_err();
        assert!(wrong.contains("line 3: `b` is not a number"), "{wrong}");
        let wrong = told(b"t,a\n0,1\n").unwrap_err();
        assert!(wrong.contains("the first column is not `time`"), "{wrong}");
        assert!(told(b"time,a\n0\n").is_err());
    }
}

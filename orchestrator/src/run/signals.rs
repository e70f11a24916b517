//! `results.csv`: the recorded signals of a run.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use crate::error::Error;
use crate::fmu::Datum;
use crate::master::Record;

/// Writes a record as CSV: a line of names, then a line a sample; every number reads back to the
/// same bits.
///
/// # Errors
/// A disk that is full, and the like.
pub fn write_csv(record: &Record, file: impl Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(file);
    if record.exact_columns.is_empty() {
        csv.write_record(&record.columns)?;
        for row in record.rows() {
            csv.serialize(row).map_err(io::Error::other)?;
        }
        return csv.flush();
    }
    csv.write_record(record.columns.iter().chain(&record.exact_columns))?;
    for (number, row) in record.rows().enumerate() {
        let exact: Vec<String> = record.exact(number).iter().map(Datum::to_string).collect();
        csv.serialize((row, exact)).map_err(io::Error::other)?;
    }
    csv.flush()
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
    let Some(("time", names)) = names
        .split_first()
        .map(|(time, rest)| (time.as_str(), rest))
    else {
        return Err(fault("the first column is not `time`".into()));
    };
    let mut record = Record::with_capacity(names, 0);
    for (row, line) in csv.records().zip(2..) {
        let row = row.map_err(|error| fault(error.to_string()))?;
        let number = |cell: &str| {
            let wrong = |_| fault(format!("line {line}: `{cell}` is no number"));
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

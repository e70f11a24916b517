//! Reading a record of ground acceleration.

use std::path::Path;

use recordings::{Channel, DataError, Text, read_text};

use super::accelerogram::{Record, file_name, stem};
use super::at2;
use super::csv_file::{CsvFile, Kind};
use super::error::MotionError;

/// Longest record that is accepted, s: one hour.
const LONGEST: f64 = 3600.0;
/// Fewest points that can be detrended and filtered with any meaning.
const FEWEST: usize = 16;

/// Reads a record: PEER AT2 when the name ends in `.at2` (either case), CSV otherwise.
///
/// # Errors
/// A file that is missing, empty, truncated, not numeric, without a time step, unevenly sampled,
/// or with a column that is unknown or of the wrong unit.
pub fn read_record(path: &Path) -> Result<Record, MotionError> {
    read(path, Kind::Record)
}

/// As [`read_record`], of a reference, too: its acceleration.
///
/// # Errors
/// As [`read_record`].
pub fn read_acceleration(path: &Path) -> Result<Record, MotionError> {
    let record = read(path, Kind::Record);
    match read(path, Kind::Reference) {
        Ok(reference) if record.is_err() => Ok(reference),
        _ => record,
    }
}

fn read(path: &Path, kind: Kind) -> Result<Record, MotionError> {
    let text = read_text(path)?;
    let is_at2 = path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("at2"));
    let record = if is_at2 {
        at2::parse(path, &text.text)?
    } else {
        from_csv(path, text, kind)?
    };
    if record.acceleration.len() < FEWEST {
        let reason = format!(
            "only {} points, a record needs {FEWEST} or more",
            record.acceleration.len()
        );
        return Err(DataError::file(path, reason).into());
    }
    let duration = record.dt * record.acceleration.len() as f64;
    if duration > LONGEST {
        let reason = format!(
            "lasts {duration:.0} s (dt = {} s), records of up to {LONGEST:.0} s are played",
            record.dt
        );
        return Err(DataError::file(path, reason).into());
    }
    Ok(record)
}

fn from_csv(path: &Path, text: Text, kind: Kind) -> Result<Record, MotionError> {
    let file = CsvFile::parse(path, text, kind)?;
    let dt = file.sample_time()?;
    Ok(Record {
        name: stem(path),
        dt,
        acceleration: file.column(Channel::Acceleration)?,
        origin: format!("{} (CSV)", file_name(path)),
        seed: None,
    })
}

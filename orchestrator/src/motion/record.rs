//! A record of ground acceleration, as read.

use std::path::{Path, PathBuf};

use identification::data::{Channel, DataError, Text, read_text};

use super::csv_file::{CsvFile, Kind};
use super::{MotionError, at2};

/// An accelerogram: evenly sampled ground acceleration, not processed.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Short name: the stem of the file.
    pub name: String,
    /// Sample time, s.
    pub dt: f64,
    /// Acceleration, m/s^2.
    pub acceleration: Vec<f64>,
    /// Where it comes from, for people.
    pub origin: String,
    /// The seed, when it was generated.
    pub seed: Option<u64>,
}

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
    let text = read_text(path)?;
    let is_at2 = path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("at2"));
    let record = if is_at2 {
        at2::parse(path, &text.text)?
    } else {
        from_csv(path, text)?
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

/// The stem of a file name.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(
        || "motion".to_string(),
        |stem| stem.to_string_lossy().into(),
    )
}

fn from_csv(path: &Path, text: Text) -> Result<Record, MotionError> {
    let file = CsvFile::parse(path, text, Kind::Record)?;
    let dt = file.sample_time()?;
    Ok(Record {
        name: stem(path),
        dt,
        acceleration: file.column(Channel::Acceleration)?,
        origin: format!("{} (CSV)", file_name(path)),
        seed: None,
    })
}

/// The last part of a path, for people.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(
        || PathBuf::from(path).display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}

//! The errors of a comparison over time, on the first motion, as a file.

use std::path::Path;

use super::result::{History, Row};
use crate::error::Error;

/// Name of the file.
pub(super) const FILE: &str = "errors.csv";
/// Its columns, after the controller's name.
const COLUMNS: [&str; 2] = ["displacement_error", "acceleration_error"];

/// Errors over time on the first motion as CSV: `time`, then two columns a controller; a run that
/// ended early leaves cells empty.
pub(super) fn written(rows: &[Row]) -> String {
    let kept: Vec<(&str, &History)> = rows
        .iter()
        .filter_map(|row| Some((row.controller.as_str(), row.history.as_ref()?)))
        .collect();
    let mut text = "time".to_string();
    for (controller, _) in &kept {
        text += &format!(",{controller}.{},{controller}.{}", COLUMNS[0], COLUMNS[1]);
    }
    text += "\n";
    let dt = kept.first().map_or(0.0, |(_, history)| history.dt);
    let lengths = kept
        .iter()
        .map(|(_, history)| history.displacement_error.len());
    for sample in 0..lengths.max().unwrap_or(0) {
        text += &(sample as f64 * dt).to_string();
        for (_, history) in &kept {
            for values in [&history.displacement_error, &history.acceleration_error] {
                text += ",";
                if let Some(value) = values.get(sample) {
                    text += &value.to_string();
                }
            }
        }
        text += "\n";
    }
    text
}

/// The columns of a controller in the file at `path`; none where they are missing.
///
/// # Errors
/// A file that cannot be read or a cell that is no number, with its line.
pub(super) fn read(path: &Path, controller: &str) -> Result<Option<History>, Error> {
    let fault = |reason: String| Error::File {
        path: path.to_path_buf(),
        reason,
    };
    let mut csv = csv::Reader::from_path(path).map_err(|error| fault(error.to_string()))?;
    let names = csv.headers().map_err(|error| fault(error.to_string()))?;
    let place = |column: &str| names.iter().position(|name| name == column);
    let [Some(x), Some(a)] = COLUMNS.map(|column| place(&format!("{controller}.{column}"))) else {
        return Ok(None);
    };
    let mut columns = [Vec::new(), Vec::new(), Vec::new()];
    for (row, line) in csv.records().zip(2..) {
        let row = row.map_err(|error| fault(error.to_string()))?;
        for (column, at) in columns.iter_mut().zip([0, x, a]) {
            let cell = row.get(at).unwrap_or_default();
            if !cell.is_empty() {
                let wrong = |_| fault(format!("line {line}: `{cell}` is no number"));
                column.push(cell.parse::<f64>().map_err(wrong)?);
            }
        }
    }
    let [time, displacement_error, acceleration_error] = columns;
    Ok(time.get(1).map(|dt| History {
        dt: *dt,
        displacement_error,
        acceleration_error,
    }))
}

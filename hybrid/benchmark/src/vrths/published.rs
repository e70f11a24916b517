//! The published scores of the sample controller.

use std::path::Path;

use laboratory::error::Error;

/// Rows are the cases, columns `J1..J9`: ms, then percent.
pub type PublishedTable = [[f64; 9]; 4];

/// Reads `table3.csv` of the benchmark's folder; none where there is no such file.
///
/// # Errors
/// A file with other than four rows of a case and nine numbers.
pub fn read(folder: &Path) -> Result<Option<PublishedTable>, Error> {
    let path = folder.join("table3.csv");
    if !path.exists() {
        return Ok(None);
    }
    let fault = |reason: String| Error::File {
        path: path.clone(),
        reason,
    };
    let text = std::fs::read_to_string(&path).map_err(|error| fault(error.to_string()))?;
    let mut table = [[f64::NAN; 9]; 4];
    let mut rows = 0;
    for (index, line) in text.lines().enumerate().skip(1) {
        let cells: Result<Vec<f64>, _> = line.split(',').map(|cell| cell.trim().parse()).collect();
        match (cells, table.get_mut(rows)) {
            (Ok(cells), Some(row)) if cells.len() == 10 => row.copy_from_slice(&cells[1..]),
            _ => {
                return Err(fault(format!(
                    "line {}: expected a case number and nine scores, for four cases",
                    index + 1
                )));
            }
        }
        rows += 1;
    }
    if rows == table.len() {
        return Ok(Some(table));
    }
    Err(fault(format!("{rows} rows, expected four")))
}

/// Largest magnitude of the difference, or none where a number is missing.
#[must_use]
pub fn largest_difference(ours: &PublishedTable, published: &PublishedTable) -> f64 {
    ours.as_flattened()
        .iter()
        .zip(published.as_flattened())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

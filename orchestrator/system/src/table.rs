//! Input tables: columns over time from a CSV file, as sources of connections.

use std::path::{Path, PathBuf};

use recordings::{Sheet, Wanted};
use serde::Deserialize;

use units::{hint, split_header};

/// A table in a system file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableFile {
    /// The CSV file, relative to the system file: a column `time`, then one for each signal, with
    /// units as in `force [kN]`.
    pub file: String,
    /// What the signals are between two rows.
    #[serde(default)]
    pub between: Between,
}

/// What a table's signals are between two rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Between {
    /// On the straight line between the two.
    #[default]
    Linear,
    /// What they were at the first.
    Hold,
}

/// Columns over time. Before its first row a table holds that row, after its last row the last.
#[derive(Debug, Clone, PartialEq)]
pub struct InputTable {
    /// Its name in the system.
    pub name: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Their units, where the header gives them.
    pub units: Vec<Option<String>>,
    /// Time of each row, s, not falling.
    pub times: Vec<f64>,
    /// The columns' values, in their units.
    pub values: Vec<Vec<f64>>,
    /// What holds between two rows.
    pub between: Between,
}

/// Why a table is not read, or a column not found.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The file, or a cell of it, cannot be read.
    #[error(transparent)]
    Data(#[from] recordings::DataError),
    /// A line of the file is wrong.
    #[error("{}:{line}: {reason}", file.display())]
    Line {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: u64,
        /// What is wrong.
        reason: String,
    },
    /// There is no such column.
    #[error("the table `{table}` has no column `{column}`{hint}")]
    NoColumn {
        /// The table.
        table: String,
        /// What was looked for.
        column: String,
        /// The nearest name.
        hint: String,
    },
}

impl InputTable {
    /// Reads a table.
    ///
    /// # Errors
    /// A file that cannot be read, with line and column; no column of time, or a time that falls.
    pub fn read(name: &str, path: &Path, between: Between) -> Result<Self, TableError> {
        let wanted = Wanted {
            is_column: &|cell| is_time(cell),
            header: "`time [s],force [kN]` (any names and units)",
        };
        let sheet = Sheet::read(path, wanted)?;
        let fault = |line: u64, reason: String| TableError::Line {
            file: path.to_path_buf(),
            line,
            reason,
        };
        let mut table = Self {
            name: name.to_string(),
            columns: Vec::new(),
            units: Vec::new(),
            times: Vec::new(),
            values: Vec::new(),
            between,
        };
        for (place, head) in sheet.heads().iter().enumerate() {
            let (column, unit) = parts(head);
            let below = sheet.unit_below(place).map(|(_, unit)| unit.to_string());
            let unit = unit.map(str::to_string).or(below);
            let values = sheet.full_column(place, head)?;
            if table.times.is_empty() && is_time(head) {
                let factor = match &unit {
                    Some(unit) => units::convert(1.0, unit, "s")
                        .map_err(|error| fault(sheet.header_line(), error.to_string()))?,
                    None => 1.0,
                };
                table.times = values.iter().map(|time| factor * time).collect();
                continue;
            }
            if column.is_empty() || table.columns.iter().any(|known| known == column) {
                let reason = format!(
                    "column {}: the name `{column}` is empty or taken",
                    place + 1
                );
                return Err(fault(sheet.header_line(), reason));
            }
            table.columns.push(column.to_string());
            table.units.push(unit);
            table.values.push(values);
        }
        if let Some(row) =
            (1..table.times.len()).find(|&row| table.times[row] < table.times[row - 1])
        {
            let (now, before) = (table.times[row], table.times[row - 1]);
            let reason = format!("the time falls from {before} s to {now} s");
            return Err(fault(sheet.line(row), reason));
        }
        Ok(table)
    }

    /// The column of that name.
    ///
    /// # Errors
    /// There is none; the nearest is named.
    pub fn find(&self, column: &str) -> Result<usize, TableError> {
        let found = self.columns.iter().position(|known| known == column);
        found.ok_or_else(|| {
            let known = self.columns.iter().map(String::as_str);
            TableError::NoColumn {
                table: self.name.clone(),
                column: column.to_string(),
                hint: hint(column, known),
            }
        })
    }

    /// A column's value at a time, s; where two rows have the same time, the later one counts from
    /// then on. `row` is where the last look-up ended and is kept.
    pub fn at(&self, column: usize, time: f64, row: &mut usize) -> f64 {
        let values = &self.values[column];
        // Times of ticks are rounded: a row counts as reached a little before its time.
        let reached = time + 1e-9 * time.abs().max(1e-3);
        let times = &self.times;
        if *row >= times.len() || times[*row] > reached {
            *row = 0;
        }
        while *row + 1 < times.len() && times[*row + 1] <= reached {
            *row += 1;
        }
        let (Some(&here), Some(&value)) = (times.get(*row), values.get(*row)) else {
            return 0.0;
        };
        let next = times.get(*row + 1).zip(values.get(*row + 1));
        match (self.between, next) {
            (Between::Linear, Some((&there, &other))) if time > here && there > here => {
                let share = ((time - here) / (there - here)).clamp(0.0, 1.0);
                value + share * (other - value)
            }
            _ => value,
        }
    }

    /// Time of the last row, s.
    pub fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }
}

/// Name and unit of a column; `u[2]` is an element of an array and no unit.
fn parts(head: &str) -> (&str, Option<&str>) {
    match split_header(head) {
        (_, Some(unit)) if unit.chars().all(|c| c.is_ascii_digit() || c == ',') && unit != "1" => {
            (head.trim(), None)
        }
        (name, Some("1")) if head.contains(&format!("{name}[1]")) => (head.trim(), None),
        parts => parts,
    }
}

fn is_time(head: &str) -> bool {
    let (name, _) = split_header(head);
    ["time", "t", "t_s"].contains(&name.to_lowercase().as_str())
}

//! Recordings as CSV: `#` comment lines, a header of `name [unit]` cells, numbers. An empty cell
//! or `nan` is a missing sample; columns in any order; columns of other names are left alone.

use std::path::Path;

use identification::data::{Finding, Recording};

use crate::error::Error;
use crate::units::{Unit, split_header};

/// Channels a rig's recording may have, with their SI units.
const CHANNELS: [(&str, &str); 8] = [
    ("time", "s"),
    ("valve_command", "V"),
    ("displacement", "m"),
    ("velocity", "m/s"),
    ("acceleration", "m/s^2"),
    ("actuator_force", "N"),
    ("specimen_acceleration", "m/s^2"),
    ("reference", "m"),
];

/// Reads a file into recordings in SI (several where samples are missing) and what was found
/// wrong with it.
///
/// # Errors
/// A file that cannot be read; a header or cell that cannot be understood, with its line.
pub fn read(path: &Path) -> Result<(Vec<Recording>, Vec<Finding>), Error> {
    let fault = |reason: String| Error::File {
        path: path.to_path_buf(),
        reason,
    };
    let text = std::fs::read_to_string(path).map_err(|error| fault(error.to_string()))?;
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim_start_matches('\u{feff}').trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let (header_line, header) = lines
        .next()
        .ok_or_else(|| fault("no header; expected cells such as `time [s]`".into()))?;
    let cells: Vec<&str> = header.split(',').collect();
    let mut columns = Vec::new();
    for (index, cell) in cells.iter().enumerate() {
        let (name, unit) = split_header(cell);
        let Some((name, si)) = CHANNELS.iter().find(|channel| channel.0 == name) else {
            continue;
        };
        let unit = unit.ok_or_else(|| {
            fault(format!(
                "line {header_line}: `{name}` has no unit; expected for example `{name} [{si}]`"
            ))
        })?;
        let factor = Unit::parse(unit)
            .and_then(|unit| unit.factor_to(&Unit::parse(si)?))
            .map_err(|error| fault(format!("line {header_line}: `{name}`: {error}")))?;
        if columns.iter().any(|column: &Column| column.name == *name) {
            return Err(fault(format!("line {header_line}: `{name}` stands twice")));
        }
        columns.push(Column {
            index,
            name,
            factor,
            values: Vec::new(),
        });
    }
    for (line, row) in lines {
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        if fields.len() != cells.len() {
            return Err(fault(format!(
                "line {line}: {} cells; expected {}, as in the header",
                fields.len(),
                cells.len()
            )));
        }
        for column in &mut columns {
            let field = fields[column.index];
            let value = match field {
                "" => f64::NAN,
                _ => field.parse::<f64>().map_err(|_| {
                    fault(format!(
                        "line {line}: `{}` is \"{field}\"; expected a number, or nothing for a \
                         missing sample",
                        column.name
                    ))
                })?,
            };
            column.values.push(value * column.factor);
        }
    }
    let time = columns.iter().position(|column| column.name == "time");
    let Some(time) = time else {
        return Err(fault(format!(
            "line {header_line}: no column `time`; expected for example `time [s]`"
        )));
    };
    let time = columns.remove(time).values;
    let channels = columns
        .into_iter()
        .map(|column| (column.name.to_string(), column.values))
        .collect();
    let name = path.display().to_string();
    Ok(Recording::from_columns(&name, &time, channels)?)
}

struct Column {
    index: usize,
    name: &'static str,
    factor: f64,
    values: Vec<f64>,
}

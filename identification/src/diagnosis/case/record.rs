//! One record: columns with units, in any order.

use units::convert;

/// Columns of a record, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Its name, without extension.
    pub name: String,
    /// s.
    pub time: Vec<f64>,
    /// Recorded valve command, V.
    pub valve_command: Vec<f64>,
    /// Displacement (m), acceleration (m/s²), actuator force (N), specimen acceleration (m/s²);
    /// empty where the column is missing.
    pub channels: [Vec<f64>; 4],
    /// Reference displacement, m; empty where missing.
    pub reference: Vec<f64>,
}

/// Names of [`Record::channels`].
pub const CHANNELS: [&str; 4] = [
    "displacement",
    "acceleration",
    "actuator_force",
    "specimen_acceleration",
];

const COLUMNS: [(&str, &str); 7] = [
    ("time", "s"),
    ("valve_command", "V"),
    ("displacement", "m"),
    ("acceleration", "m/s^2"),
    ("actuator_force", "N"),
    ("specimen_acceleration", "m/s^2"),
    ("reference", "m"),
];

impl Record {
    /// Reads a CSV with header cells `name [unit]`; a sentence says what is wrong and where.
    pub fn parse(name: &str, text: &str) -> Result<Self, String> {
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let header = reader.headers().map_err(|error| error.to_string())?.clone();
        let mut place = [None; 7];
        let mut factor = [1.0; 7];
        for (index, cell) in header.iter().enumerate() {
            let (label, unit) = match cell.split_once('[') {
                Some((label, rest)) => (label.trim(), Some(rest.trim_end_matches(']').trim())),
                None => (cell.trim(), None),
            };
            let Some(column) = COLUMNS.iter().position(|(known, _)| *known == label) else {
                continue;
            };
            let Some(unit) = unit.filter(|unit| !unit.is_empty()) else {
                return Err(format!(
                    "column `{label}` has no unit: write it as `{label} [{}]`",
                    COLUMNS[column].1
                ));
            };
            if place[column].is_some() {
                return Err(format!("column `{label}` stands twice"));
            }
            factor[column] = convert(1.0, unit, COLUMNS[column].1)
                .map_err(|reason| format!("column `{label}`: {reason}"))?;
            place[column] = Some(index);
        }
        let mut columns: [Vec<f64>; 7] = Default::default();
        for row in reader.records() {
            let row = row.map_err(|error| error.to_string())?;
            let line = row.position().map_or(0, csv::Position::line);
            for (column, index) in place.iter().enumerate() {
                let Some(index) = *index else { continue };
                let cell = row.get(index).unwrap_or("");
                let value = match cell {
                    "" => f64::NAN,
                    _ => cell.parse::<f64>().map_err(|_| {
                        format!(
                            "line {line}, column `{}`: `{cell}` is no number",
                            COLUMNS[column].0
                        )
                    })?,
                };
                columns[column].push(value * factor[column]);
            }
        }
        let [time, valve_command, x, a, f, specimen, reference] = columns;
        Ok(Self {
            name: name.into(),
            time,
            valve_command,
            channels: [x, a, f, specimen],
            reference,
        })
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time.len().max(self.valve_command.len())
    }

    /// True without a sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

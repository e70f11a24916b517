//! CSV files of motions: `#` comment lines, one header line, numbers.
//!
//! The header is `t_s,a_g`, or cells with units: `time [s], acceleration [in/s^2]`.

use std::path::{Path, PathBuf};

use super::MotionError;
use crate::units::{Unit, nearest, split_header};

/// What the file is read as, which says what columns it may have.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Time and acceleration.
    Record,
    /// Time, displacement, velocity and acceleration.
    Reference,
}

impl Kind {
    /// Name and unit of the columns.
    fn columns(self) -> &'static [(&'static str, &'static str)] {
        const ALL: &[(&str, &str)] = &[
            ("time", "s"),
            ("acceleration", "m/s^2"),
            ("displacement", "m"),
            ("velocity", "m/s"),
        ];
        match self {
            Kind::Record => &ALL[..2],
            Kind::Reference => ALL,
        }
    }

    fn header(self) -> &'static str {
        match self {
            Kind::Record => "`t_s,a_g` or `time [s],acceleration [g]`",
            Kind::Reference => {
                "`time [s],displacement [in],velocity [in/s],acceleration [g]` (any units)"
            }
        }
    }
}

/// The numbers of a CSV file, in SI units, a vector a column.
pub(super) struct CsvFile {
    path: PathBuf,
    kind: Kind,
    /// Line of the header, counted from 1.
    header_line: usize,
    /// Name and SI values of each column.
    columns: Vec<(&'static str, Vec<f64>)>,
    /// Line of each row, counted from 1.
    lines: Vec<usize>,
}

impl CsvFile {
    /// Reads the text of a file.
    pub(super) fn parse(path: &Path, text: &str, kind: Kind) -> Result<Self, MotionError> {
        let mut rows = text
            .lines()
            .enumerate()
            .map(|(index, line)| (index + 1, line.trim_start_matches('\u{feff}').trim()))
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let file = |reason: String| MotionError::File {
            path: path.to_path_buf(),
            reason,
        };
        let (header_line, header) = rows.next().ok_or_else(|| {
            file(format!(
                "only comments; expected a header {}",
                kind.header()
            ))
        })?;
        let heads = read_header(path, header_line, header, kind)?;

        let mut columns: Vec<_> = heads.iter().map(|head| (head.0, Vec::new())).collect();
        let mut lines = Vec::new();
        for (line, row) in rows {
            let fields: Vec<&str> = row.split(',').map(str::trim).collect();
            if fields.len() != heads.len() {
                return Err(MotionError::Line {
                    path: path.to_path_buf(),
                    line,
                    reason: format!("{} fields, expected {}", fields.len(), heads.len()),
                });
            }
            for (index, text) in fields.into_iter().enumerate() {
                let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
                let value = value.ok_or_else(|| MotionError::NotANumber {
                    path: path.to_path_buf(),
                    line,
                    column: index + 1,
                    text: text.to_string(),
                })?;
                columns[index].1.push(value * heads[index].1);
            }
            lines.push(line);
        }
        if lines.is_empty() {
            return Err(file("a header and no data".to_string()));
        }
        if let Some(announced) = announced_points(text)
            && lines.len() < announced
        {
            return Err(MotionError::Truncated {
                path: path.to_path_buf(),
                found: lines.len(),
                announced,
            });
        }
        Ok(Self {
            path: path.to_path_buf(),
            kind,
            header_line,
            columns,
            lines,
        })
    }

    /// The values of a column, SI.
    pub(super) fn column(&self, name: &str) -> Result<Vec<f64>, MotionError> {
        let found = self.columns.iter().find(|column| column.0 == name);
        found
            .map(|column| column.1.clone())
            .ok_or_else(|| MotionError::Line {
                path: self.path.clone(),
                line: self.header_line,
                reason: format!("no column `{name}`; expected {}", self.kind.header()),
            })
    }

    /// The time step, s, of evenly spaced time stamps.
    pub(super) fn sample_time(&self) -> Result<f64, MotionError> {
        let Some((_, time)) = self.columns.iter().find(|column| column.0 == "time") else {
            return Err(MotionError::Line {
                path: self.path.clone(),
                line: self.header_line,
                reason: format!(
                    "dt is missing: no column of time; expected {}",
                    self.kind.header()
                ),
            });
        };
        let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        let Some(&usual) = steps.get(steps.len() / 2) else {
            return Err(MotionError::File {
                path: self.path.clone(),
                reason: "one point only; no time step can be told".to_string(),
            });
        };
        for (index, pair) in time.windows(2).enumerate() {
            let step = pair[1] - pair[0];
            // Printed times are rounded: a twentieth of a step is not yet uneven.
            if !(usual > 0.0 && (step - usual).abs() <= 0.05 * usual) {
                return Err(MotionError::Line {
                    path: self.path.clone(),
                    line: self.lines[index + 1],
                    reason: format!(
                        "uneven time stamps: a step of {} s, expected {} s",
                        rounded(step),
                        rounded(usual)
                    ),
                });
            }
        }
        let mean = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
        Ok(if (mean - usual).abs() < 1e-6 * usual {
            rounded(usual)
        } else {
            mean
        })
    }
}

/// Nine significant digits: 0.005, not 0.0049999999999954525.
pub(super) fn rounded(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}

/// Name and SI factor of every column of a header line.
fn read_header(
    path: &Path,
    line: usize,
    header: &str,
    kind: Kind,
) -> Result<Vec<(&'static str, f64)>, MotionError> {
    let fault = |reason: String| MotionError::Line {
        path: path.to_path_buf(),
        line,
        reason,
    };
    let cells: Vec<&str> = header.split(',').map(str::trim).collect();
    if cells.iter().all(|cell| cell.parse::<f64>().is_ok()) {
        return Err(fault(format!(
            "numbers where a header should be; expected {}",
            kind.header()
        )));
    }
    let mut heads: Vec<(&'static str, f64)> = Vec::new();
    for (index, cell) in cells.iter().enumerate() {
        let (name, unit) = match *cell {
            "t_s" => ("time", Some("s")),
            "a_g" => ("acceleration", Some("g")),
            other => split_header(other),
        };
        let columns = kind.columns();
        let Some(&(known, si)) = columns.iter().find(|column| column.0 == name) else {
            let known = columns.iter().map(|column| column.0).chain(["t_s", "a_g"]);
            let hint = match (kind, name, nearest(name, known)) {
                (Kind::Record, "displacement" | "velocity", _) => {
                    "a file with it is a reference (--reference)".to_string()
                }
                (_, _, Some(near)) => format!("did you mean `{near}`? Expected {}", kind.header()),
                (_, _, None) => format!("expected {}", kind.header()),
            };
            return Err(fault(format!(
                "unknown column `{name}` (column {}); {hint}",
                index + 1
            )));
        };
        if heads.iter().any(|head| head.0 == known) {
            return Err(fault(format!("column `{known}` stands there twice")));
        }
        let Some(unit) = unit else {
            return Err(fault(format!(
                "column `{name}` has no unit; expected for example `{name} [{si}]`"
            )));
        };
        let factor = Unit::parse(unit)
            .and_then(|unit| unit.factor_to(&Unit::parse(si)?))
            .map_err(|source| MotionError::Unit {
                path: path.to_path_buf(),
                line,
                column: index + 1,
                name: name.to_string(),
                source: Box::new(source),
            })?;
        heads.push((known, factor));
    }
    Ok(heads)
}

/// The number after `npts=` in a comment line, when one says it.
fn announced_points(text: &str) -> Option<usize> {
    let comments = text
        .lines()
        .take_while(|line| line.trim_start().starts_with('#'));
    comments.into_iter().find_map(|line| {
        let (_, rest) = line.split_once("npts=")?;
        let digits: String = rest
            .trim_start()
            .chars()
            .take_while(char::is_ascii_digit)
            .collect();
        digits.parse().ok()
    })
}

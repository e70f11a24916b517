//! PEER's AT2 format: a few lines of header, then numbers filling the lines.
//!
//! The line with the number of points and the time step is written in one of two ways:
//! `NPTS=   2676, DT=   .0200 SEC` (NGA) or `4113  0.0050  NPTS, DT` (before).

use std::path::Path;

use recordings::DataError;

use super::accelerogram::{Record, file_name, stem};
use super::error::MotionError;
use units::{STANDARD_GRAVITY, Unit};

/// Lines within which the header must end.
const LONGEST_HEADER: usize = 12;

/// Reads the text of an AT2 file.
pub(super) fn parse(path: &Path, text: &str) -> Result<Record, MotionError> {
    let lines: Vec<&str> = text.lines().collect();
    let header = lines
        .iter()
        .take(LONGEST_HEADER)
        .position(|line| line.to_ascii_uppercase().contains("NPTS"))
        .ok_or_else(|| {
            let reason = format!(
                "no line with NPTS and DT among the first {LONGEST_HEADER}; \
                 expected `NPTS=   2676, DT=   .0200 SEC` or `2676  0.0200  NPTS, DT`"
            );
            DataError::file(path, reason)
        })?;
    let (announced, dt, style) = points_and_step(path, header as u64 + 1, lines[header])?;
    let factor = unit_of_header(path, &lines[..header])?;

    let mut acceleration = Vec::new();
    for (number, line) in (1..).zip(&lines).skip(header + 1) {
        for (column, text) in line.split_whitespace().enumerate() {
            let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
            let value = value.ok_or_else(|| DataError::NotANumber {
                file: path.to_path_buf(),
                line: number,
                column: column + 1,
                name: String::new(),
                text: text.to_string(),
                hint: "",
            })?;
            if acceleration.len() == announced {
                let reason = format!("more numbers than the {announced} points of the header");
                return Err(DataError::line(path, number, reason).into());
            }
            acceleration.push(value * factor);
        }
    }
    if acceleration.len() < announced {
        return Err(MotionError::Truncated {
            path: path.to_path_buf(),
            found: acceleration.len(),
            announced,
        });
    }
    let origin = format!("{} (PEER AT2, {style} header)", file_name(path));
    Ok(Record {
        name: stem(path),
        dt,
        acceleration,
        origin,
        seed: None,
    })
}

/// Number of points, time step in s, and which of the two headers it was.
fn points_and_step(
    path: &Path,
    line: u64,
    text: &str,
) -> Result<(usize, f64, &'static str), DataError> {
    let fault = |reason: String| DataError::line(path, line, reason);
    let upper = text.to_ascii_uppercase();
    let (points, step, style) = if upper.contains('=') {
        (
            value_after(&upper, "NPTS"),
            value_after(&upper, "DT"),
            "NGA",
        )
    } else {
        let mut words = upper
            .split([' ', '\t', ','])
            .filter(|word| !word.is_empty());
        let mut number = || words.next().filter(|word| word.parse::<f64>().is_ok());
        (
            number().map(str::to_string),
            number().map(str::to_string),
            "old",
        )
    };
    let points = points.ok_or_else(|| fault("NPTS, the number of points, is missing".into()))?;
    let step = step.ok_or_else(|| {
        fault("dt is missing; expected the time step in s, as in `DT= .005 SEC`".into())
    })?;
    let announced = points
        .parse::<usize>()
        .ok()
        .filter(|&announced| announced > 0)
        .ok_or_else(|| fault(format!("NPTS = \"{points}\" is not a number of points")))?;
    let dt = step
        .parse::<f64>()
        .ok()
        .filter(|dt| dt.is_finite() && *dt > 0.0)
        .ok_or_else(|| {
            fault(format!(
                "dt = \"{step}\" is not a positive number of seconds"
            ))
        })?;
    Ok((announced, dt, style))
}

/// The word after `KEY =`, if there is one.
fn value_after(text: &str, key: &str) -> Option<String> {
    let (_, rest) = text.split_once(key)?;
    let rest = rest.trim_start().strip_prefix('=')?;
    let word = rest.split([',', ' ', '\t']).find(|word| !word.is_empty())?;
    // `DT=,` or `NPTS= DT=` leave the next key, not a value.
    word.starts_with(|c: char| !c.is_ascii_alphabetic())
        .then(|| word.to_string())
}

/// The SI factor of the unit that the header names; g when it names none.
fn unit_of_header(path: &Path, header: &[&str]) -> Result<f64, DataError> {
    for (number, line) in (1..).zip(header) {
        let fault = |reason: String| DataError::line(path, number, reason);
        let upper = line.to_ascii_uppercase();
        for other in ["VELOCITY TIME", "DISPLACEMENT TIME"] {
            if upper.contains(other) {
                return Err(fault(
                    "not an acceleration; expected an AT2 record of one".into(),
                ));
            }
        }
        let Some((_, unit)) = upper.split_once("UNITS OF ") else {
            continue;
        };
        // What follows is prose: `UNITS OF G. FILTER POINTS: HP=0.1 Hz LP=46.0 Hz`.
        let word = unit.split_whitespace().next().unwrap_or("");
        let unit = word.trim_end_matches(['.', ',', ';', ':']);
        if unit == "G" {
            return Ok(STANDARD_GRAVITY);
        }
        let text = unit
            .to_ascii_lowercase()
            .replace("sec/sec", "s^2")
            .replace("s/s", "s^2");
        return match Unit::parse(&text).and_then(|unit| unit.factor_to(&Unit::parse("m/s^2")?)) {
            Ok(factor) => Ok(factor),
            Err(error) => Err(fault(error.to_string())),
        };
    }
    Ok(STANDARD_GRAVITY)
}

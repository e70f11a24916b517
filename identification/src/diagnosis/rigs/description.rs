//! The description of a rig and its measurements, as people write it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{KINDS, Named, Rig, of_kind};
use units::convert;

/// A set of measurements of one rig.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// What the rig is called.
    pub name: String,
    /// Kind of rig, one of [`KINDS`].
    pub kind: String,
    /// Data files (CSV), relative to the description.
    pub data: Vec<PathBuf>,
    /// Time between samples, for data without a uniform `time` column.
    pub time_step: Option<Quantity>,
    /// Column of each input, of the output and of `time`.
    pub columns: BTreeMap<String, Column>,
    /// Parameters of the nominal model.
    pub nominal: BTreeMap<String, Quantity>,
    /// What is left out of the fit.
    pub left_out: LeftOut,
    /// Where the description stands.
    #[serde(skip)]
    pub path: PathBuf,
}

/// A column of the data.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// Its name in the header.
    pub column: String,
    /// Unit of its numbers.
    pub unit: String,
}

/// A value, how sure it is, and its unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantity {
    /// The value.
    pub value: f64,
    /// One standard deviation; without it the value is exact.
    #[serde(default)]
    pub plus_minus: f64,
    /// Unit of both.
    pub unit: String,
}

/// Which samples are not fitted.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum LeftOut {
    /// Every second block of this length.
    EverySecondBlock(Quantity),
    /// The second half of each file; false is refused, since something must be left out.
    SecondHalf(bool),
    /// These files.
    Files(Vec<PathBuf>),
}

/// Why a description or its data cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// A file cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The description is not what is expected.
    #[error("{path}: {what}")]
    Description {
        /// The file.
        path: PathBuf,
        /// What is wrong and what was expected.
        what: String,
    },
    /// The data are not what is expected.
    #[error("{path}, line {line}: {what}")]
    Data {
        /// The file.
        path: PathBuf,
        /// The line.
        line: u64,
        /// What is wrong and what was expected.
        what: String,
    },
}

/// One file of data, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name.
    pub name: String,
    /// s.
    pub step: f64,
    /// The rig's inputs in its order.
    pub inputs: Vec<Vec<f64>>,
    /// The measured output.
    pub output: Vec<f64>,
    /// The first input without what a median of five samples takes out.
    pub cleaned: Vec<f64>,
    /// True where the first input lies half way between its neighbours to rounding: such a sample
    /// was interpolated, not measured.
    pub between: Vec<bool>,
    /// Middle of the first input's range.
    pub middle: f64,
    /// True where a sample is left out.
    pub left_out: Vec<bool>,
}

/// All data of a rig, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// One per file.
    pub series: Vec<Series>,
}

impl Series {
    /// A record with inputs and output in SI, of which nothing is left out.
    pub fn new(name: &str, step: f64, inputs: Vec<Vec<f64>>, output: Vec<f64>) -> Self {
        let first = inputs.first().map_or(&[][..], Vec::as_slice);
        let low = first.iter().copied().fold(f64::INFINITY, f64::min);
        let high = first.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self {
            name: name.to_owned(),
            step,
            cleaned: median_of_five(first),
            between: half_way(first, high - low),
            middle: 0.5 * (low + high),
            left_out: vec![false; output.len()],
            inputs,
            output,
        }
    }
}

/// Rows without a time are points of a path, where a row that repeats the one before to rounding
/// says nothing new.
fn read_repeats_once(columns: &mut [Vec<f64>]) {
    let rows = columns.first().map_or(0, Vec::len);
    let near: Vec<f64> = columns
        .iter()
        .map(|column| 1e-10 * column.iter().fold(0.0, |size: f64, c| size.max(c.abs())))
        .collect();
    let new: Vec<bool> = (0..rows)
        .map(|k| {
            let mut pairs = columns.iter().zip(&near);
            k == 0 || pairs.any(|(column, near)| (column[k] - column[k - 1]).abs() > *near)
        })
        .collect();
    for column in columns {
        let mut keep = new.iter();
        column.retain(|_| keep.next() == Some(&true));
    }
}

/// Single samples half way between two that differ.
fn half_way(values: &[f64], range: f64) -> Vec<bool> {
    let mut between = vec![false; values.len()];
    for (k, v) in values.windows(3).enumerate() {
        let step = v[2] - v[0];
        between[k + 1] = !between[k]
            && (v[1] - v[0] - 0.5 * step).abs() < 1e-10 * range
            && step.abs() > 1e-10 * range;
    }
    between
}

fn median_of_five(values: &[f64]) -> Vec<f64> {
    let mut cleaned = values.to_vec();
    for (window, middle) in values.windows(5).zip(cleaned.iter_mut().skip(2)) {
        let mut sorted = [window[0], window[1], window[2], window[3], window[4]];
        sorted.sort_by(f64::total_cmp);
        *middle = sorted[2];
    }
    cleaned
}

impl Description {
    /// Reads a description.
    ///
    /// # Errors
    /// A file that cannot be read; what is no TOML or has an unknown key, with line and column; an
    /// unknown kind.
    pub fn read(path: &Path) -> Result<Self, DescriptionError> {
        let text = std::fs::read_to_string(path).map_err(|source| DescriptionError::Read {
            path: path.to_owned(),
            source,
        })?;
        let wrong = |what: String| DescriptionError::Description {
            path: path.to_owned(),
            what,
        };
        let mut description: Self =
            toml::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        description.path = path.to_owned();
        description.rig()?;
        Ok(description)
    }

    fn wrong(&self, what: String) -> DescriptionError {
        DescriptionError::Description {
            path: self.path.clone(),
            what,
        }
    }

    fn si(
        &self,
        what: &str,
        quantity: &Quantity,
        si: &str,
    ) -> Result<(f64, f64), DescriptionError> {
        let factor = convert(1.0, &quantity.unit, si)
            .map_err(|why| self.wrong(format!("`{what}`: {why}")))?;
        if !quantity.value.is_finite() || quantity.plus_minus.is_nan() || quantity.plus_minus < 0.0
        {
            return Err(self.wrong(format!(
                "`{what}` is no number with an uncertainty from 0 up"
            )));
        }
        Ok((quantity.value * factor, quantity.plus_minus * factor))
    }

    /// The rig's equations.
    ///
    /// # Errors
    /// An unknown kind.
    pub fn rig(&self) -> Result<&'static dyn Rig, DescriptionError> {
        of_kind(&self.kind).ok_or_else(|| {
            let kinds: Vec<&str> = KINDS.into_iter().map(Rig::kind).collect();
            self.wrong(format!(
                "kind `{}` is unknown: expected one of {}",
                self.kind,
                kinds.join(", ")
            ))
        })
    }

    /// Nominal values and standard deviations in the rig's order, SI.
    ///
    /// # Errors
    /// A parameter that is missing, unknown, or in a unit of another quantity.
    pub fn nominal(&self, rig: &dyn Rig) -> Result<Vec<(f64, f64)>, DescriptionError> {
        let known = rig.parameters();
        if let Some(extra) = self
            .nominal
            .keys()
            .find(|name| !known.iter().any(|(k, _)| k == name))
        {
            let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
            return Err(self.wrong(format!(
                "`nominal.{extra}` is unknown: expected {}",
                names.join(", ")
            )));
        }
        known
            .iter()
            .map(|(name, si)| match self.nominal.get(*name) {
                Some(quantity) => self.si(&format!("nominal.{name}"), quantity, si),
                None => Err(self.wrong(format!("`nominal.{name}` is missing: a value in {si}"))),
            })
            .collect()
    }

    /// Reads the data: the description's own files, or `files` in their place.
    ///
    /// # Errors
    /// A file that cannot be read, by place; too little data on either side of what is left out.
    pub fn measurement(&self, files: &[PathBuf]) -> Result<Measurement, DescriptionError> {
        let rig = self.rig()?;
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let own: Vec<PathBuf> = self.data.iter().map(|file| folder.join(file)).collect();
        let files = if files.is_empty() { &own } else { files };
        if files.is_empty() {
            return Err(self.wrong("`data` names no file".to_owned()));
        }
        let mut series = files
            .iter()
            .map(|file| self.series(file, rig))
            .collect::<Result<Vec<_>, _>>()?;
        self.leave_out(&mut series, files)?;
        Ok(Measurement { series })
    }

    fn leave_out(&self, series: &mut [Series], files: &[PathBuf]) -> Result<(), DescriptionError> {
        match &self.left_out {
            LeftOut::EverySecondBlock(length) => {
                let (length, _) = self.si("left_out.every_second_block", length, "s")?;
                for one in series.iter_mut() {
                    let block = (length / one.step).round().max(1.0) as usize;
                    for (k, out) in one.left_out.iter_mut().enumerate() {
                        *out = (k / block) % 2 == 1;
                    }
                }
            }
            LeftOut::SecondHalf(false) => {
                return Err(self.wrong(
                    "`left_out.second_half` = false leaves nothing out to test on: expected true, \
                     or `every_second_block` or `files` in its place"
                        .to_owned(),
                ));
            }
            LeftOut::SecondHalf(true) => {
                for one in series.iter_mut() {
                    let half = one.left_out.len() / 2;
                    one.left_out[half..].fill(true);
                }
            }
            LeftOut::Files(names) => {
                for name in names {
                    let place = files
                        .iter()
                        .position(|file| file.file_name() == name.file_name());
                    let Some(place) = place else {
                        let what = format!(
                            "`left_out.files` names {}, which is no data file",
                            name.display()
                        );
                        return Err(self.wrong(what));
                    };
                    series[place].left_out.fill(true);
                }
            }
        }
        let count = |out: bool| -> usize {
            series
                .iter()
                .map(|s| s.left_out.iter().filter(|o| **o == out).count())
                .sum()
        };
        if count(true) < 64 || count(false) < 64 {
            return Err(
                self.wrong("`left_out` leaves fewer than 64 samples on one side".to_owned())
            );
        }
        Ok(())
    }

    fn series(&self, path: &Path, rig: &dyn Rig) -> Result<Series, DescriptionError> {
        let text = std::fs::read_to_string(path).map_err(|source| DescriptionError::Read {
            path: path.to_owned(),
            source,
        })?;
        let data = |line: u64, what: String| DescriptionError::Data {
            path: path.to_owned(),
            line,
            what,
        };
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let header = reader
            .headers()
            .map_err(|error| data(1, error.to_string()))?
            .clone();
        let mut wanted: Vec<Named> = rig.inputs().to_vec();
        wanted.push(rig.output());
        let timed = self.columns.contains_key("time");
        if timed {
            wanted.push(("time", "s"));
        }
        let mut places = Vec::new();
        for (name, si) in &wanted {
            let column = self.columns.get(*name).ok_or_else(|| {
                self.wrong(format!("`columns.{name}` is missing: a column in {si}"))
            })?;
            let factor = convert(1.0, &column.unit, si)
                .map_err(|why| self.wrong(format!("`columns.{name}`: {why}")))?;
            let place = header
                .iter()
                .position(|cell| cell == column.column)
                .ok_or_else(|| {
                    let cells: Vec<&str> = header.iter().collect();
                    data(
                        1,
                        format!("no column `{}` among {}", column.column, cells.join(", ")),
                    )
                })?;
            places.push((place, factor));
        }
        let mut columns = vec![Vec::new(); places.len()];
        for row in reader.records() {
            let row = row.map_err(|error| {
                data(
                    error.position().map_or(0, csv::Position::line),
                    error.to_string(),
                )
            })?;
            let line = row.position().map_or(0, csv::Position::line);
            for ((place, factor), column) in places.iter().zip(&mut columns) {
                let cell = row.get(*place).unwrap_or("");
                let value: f64 = cell
                    .parse()
                    .ok()
                    .filter(|value: &f64| value.is_finite())
                    .ok_or_else(|| data(line, format!("`{cell}` is no number")))?;
                column.push(value * factor);
            }
        }
        let time = if timed { columns.pop() } else { None };
        if time.is_none() {
            read_repeats_once(&mut columns);
        }
        let output = columns.pop().unwrap_or_default();
        if output.len() < 128 {
            return Err(data(
                1,
                format!("{} samples: expected at least 128", output.len()),
            ));
        }
        let step = match (time, &self.time_step) {
            (Some(time), _) => {
                let step = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
                let uneven = time
                    .windows(2)
                    .position(|t| ((t[1] - t[0]) / step - 1.0).abs() > 0.5);
                if let Some(k) = uneven.or((step <= 0.0).then_some(0)) {
                    return Err(data(
                        k as u64 + 3,
                        "the times are not evenly spaced".to_owned(),
                    ));
                }
                step
            }
            (None, Some(step)) => self.si("time_step", step, "s")?.0,
            (None, None) => {
                return Err(
                    self.wrong("neither `columns.time` nor `time_step` is given".to_owned())
                );
            }
        };
        let name = path
            .file_stem()
            .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        Ok(Series::new(&name, step, columns, output))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_half_way_between_two_readings_are_told_from_readings() {
        let between = half_way(&[0.0, 1.0, 2.0, 4.0, 6.0, 6.5, 9.0, 9.0], 9.0);
        assert_eq!(
            between,
            [false, true, false, true, false, false, false, false]
        );
    }

    #[test]
    fn rows_that_repeat_are_read_once() {
        let mut columns = vec![
            vec![0.0, 1.0, 1.0, 1.0, 2.0, 2.0 + 1e-14],
            vec![0.0, 5.0, 5.0, 6.0, 7.0, 7.0],
        ];
        read_repeats_once(&mut columns);
        assert_eq!(columns[0], [0.0, 1.0, 1.0, 2.0]);
        assert_eq!(columns[1], [0.0, 5.0, 6.0, 7.0]);
    }
}

//! The records that a map leads to.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use identification::data::{DataError, Sheet, Wanted, is_called, name_and_unit};
use identification::diagnosis::rigs::foreign::{Signal, Trial};
use identification::diagnosis::rigs::{LeftOut, Quantity, even_period};

use super::map::{Map, Named};
use crate::diagnosis::file_fault;
use crate::error::Error;
use fmi_system::Between;
use units::convert;

/// Samples that a file must have at least.
const SHORTEST: usize = 128;
/// Least number of samples in the fitted and in the held-out part.
const FEWEST: usize = 64;
/// Steps of the model from sample to sample at most.
const MOST_STEPS: f64 = 1000.0;

/// Reads the `files`: the `inputs` and `outputs`, in this order, in the units of the model.
///
/// # Errors
/// A file that cannot be read, a column that is not there, a cell without a number, by place; too
/// little data in the fitted or the held-out part.
pub(super) fn trials(
    map: &Map,
    place: &Path,
    files: &[PathBuf],
    inputs: &[Signal],
    outputs: &[Signal],
) -> Result<Vec<Trial>, Error> {
    let mut all = Vec::new();
    for file in files {
        let read = trial(map, place, file, inputs, outputs, &TO_FIT)?;
        all.push(read.trial);
    }
    leave_out(map, place, files, &mut all)?;
    Ok(all)
}

fn seconds(place: &Path, what: &str, quantity: &Quantity) -> Result<f64, Error> {
    let value = convert(quantity.value, &quantity.unit, "s")
        .map_err(|why| file_fault(place, format!("`{what}`: {why}")))?;
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(file_fault(
            place,
            format!("`{what}`: {value} s, expected more than 0 s"),
        ))
    }
}

/// The factor that brings a column into `unit`; what is in no unit is in that one.
fn factor(sheet: &Sheet, place: usize, given: Option<&str>, unit: &str) -> Result<f64, Error> {
    let head = &sheet.heads()[place];
    let below = sheet.unit_below(place).map(|(_, unit)| unit);
    let own = given.or(name_and_unit(head).1).or(below);
    let Some(own) = own.filter(|own| *own != unit && !unit.is_empty()) else {
        return Ok(1.0);
    };
    convert(1.0, own, unit).map_err(|why| {
        let reason = format!("column `{head}`: {why}");
        DataError::line(sheet.file(), sheet.header_line(), reason).into()
    })
}

/// What a file must hold.
pub(super) struct Needs {
    rows: usize,
    /// Whether a column of every output must be there.
    outputs: bool,
}

/// To be fitted.
const TO_FIT: Needs = Needs {
    rows: SHORTEST,
    outputs: true,
};
/// To be scored.
pub(super) const TO_SCORE: Needs = Needs {
    rows: 2,
    outputs: true,
};
/// To be predicted.
pub(super) const TO_PREDICT: Needs = Needs {
    rows: 2,
    outputs: false,
};

/// A file's record.
pub(super) struct Record {
    pub trial: Trial,
    /// Of every output its unit in the file and what brings that into the model's; none where the file has
    /// no such column.
    pub in_file: Vec<Option<(String, f64)>>,
}

/// Reads one file, as [`trials`] does, without leaving anything out.
///
/// # Errors
/// As [`trials`].
pub(super) fn trial(
    map: &Map,
    place: &Path,
    file: &Path,
    inputs: &[Signal],
    outputs: &[Signal],
    needs: &Needs,
) -> Result<Record, Error> {
    let named = map.inputs.values().chain(map.outputs.values());
    let wanted: Vec<&str> = named
        .chain(&map.time)
        .map(|named| named.parts().0)
        .collect();
    let is_column = |cell: &str| wanted.iter().any(|head| is_called(cell, head));
    let sheet = Sheet::read(
        file,
        Wanted {
            is_column: &is_column,
            header: &wanted.join(","),
        },
    )?;
    if sheet.len() < needs.rows {
        let what = format!("{} rows: expected at least {}", sheet.len(), needs.rows);
        return Err(DataError::file(file, what).into());
    }
    let column = |named: &Named, unit: &str, is_full: bool| -> Result<Vec<f64>, Error> {
        let (head, given) = named.parts();
        let at = sheet.place(head)?;
        let factor = factor(&sheet, at, given, unit)?;
        let values = match is_full {
            true => sheet.full_column(at, head)?,
            false => sheet.column(at, head)?,
        };
        Ok(values.into_iter().map(|value| factor * value).collect())
    };
    let usual = || {
        let mut names = ["time", "t"].iter();
        let is_there = |name: &&&str| {
            sheet
                .heads()
                .iter()
                .any(|own| name_and_unit(own).0 == **name)
        };
        names
            .find(is_there)
            .map(|name| Named::Header((*name).to_owned()))
    };
    let time = map.time.clone().or_else(usual);
    let period = match (&map.time_step, time) {
        (Some(step), _) => seconds(place, "time_step", step)?,
        (None, Some(time)) => {
            let stamps = column(&time, "s", true)?;
            even_period(&stamps).map_err(|row| {
                DataError::line(file, sheet.line(row), "the times are not evenly spaced")
            })?
        }
        (None, None) => {
            let reason = format!(
                "no column `time` among {}: expected `time` in the map with its column, or \
                 `time_step`",
                sheet.heads().join(", ")
            );
            return Err(DataError::line(file, sheet.header_line(), reason).into());
        }
    };
    let stride = match &map.step {
        None => 1,
        Some(step) => {
            let steps = period / seconds(place, "step", step)?;
            if (steps.round() / steps - 1.0).abs() > 1e-6 || !(0.5..MOST_STEPS).contains(&steps) {
                let reason = format!(
                    "`step` is contained {steps:.4} times in the {period} s between samples of \
                     {}: expected a whole number below {MOST_STEPS}",
                    file.display()
                );
                return Err(file_fault(place, reason));
            }
            steps.round() as usize
        }
    };
    // The signals are those of the map.
    let named = |by: &BTreeMap<String, Named>, signal: &Signal| {
        let named = by.get(&signal.name);
        named
            .cloned()
            .unwrap_or_else(|| Named::Header(signal.name.clone()))
    };
    let inputs = inputs
        .iter()
        .map(|signal| column(&named(&map.inputs, signal), &signal.unit, true))
        .collect::<Result<Vec<_>, Error>>()?;
    let mut measured = Vec::new();
    let mut in_file = Vec::new();
    for signal in outputs {
        let named = named(&map.outputs, signal);
        let (head, given) = named.parts();
        let at = match sheet.place(head) {
            Err(_) if !needs.outputs => {
                measured.push(vec![f64::NAN; sheet.len()]);
                in_file.push(None);
                continue;
            }
            found => found?,
        };
        measured.push(column(&named, &signal.unit, false)?);
        let own = given.or(name_and_unit(&sheet.heads()[at]).1);
        let own = own.or(sheet.unit_below(at).map(|(_, unit)| unit));
        let factor = factor(&sheet, at, given, &signal.unit)?;
        in_file.push(Some((own.unwrap_or(&signal.unit).to_owned(), factor)));
    }
    let trial = Trial {
        name: file
            .file_stem()
            .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
        step: period / stride as f64,
        stride,
        inputs: inputs
            .iter()
            .map(|own| finer(own, stride, map.between))
            .collect(),
        outputs: measured,
        left_out: vec![false; sheet.len()],
    };
    Ok(Record { trial, in_file })
}

/// One value per step, from one per sample.
fn finer(samples: &[f64], stride: usize, between: Between) -> Vec<f64> {
    let at = |k: usize| samples.get(k).or(samples.last()).copied().unwrap_or(0.0);
    let steps = samples.len().saturating_sub(1) * stride + 1;
    let step = |step: usize| {
        let (k, share) = (step / stride, (step % stride) as f64 / stride as f64);
        match between {
            Between::Hold => at(k),
            // What is held over the step is the middle of it.
            Between::Linear if stride > 1 => {
                at(k) + (share + 0.5 / stride as f64) * (at(k + 1) - at(k))
            }
            Between::Linear => at(k),
        }
    };
    (0..steps).map(step).collect()
}

fn leave_out(
    map: &Map,
    place: &Path,
    files: &[PathBuf],
    trials: &mut [Trial],
) -> Result<(), Error> {
    match map.left_out.as_ref().unwrap_or(&LeftOut::SecondHalf(true)) {
        LeftOut::SecondHalf(true) => {
            for trial in trials.iter_mut() {
                let half = trial.samples() / 2;
                trial.left_out[half..].fill(true);
            }
        }
        LeftOut::SecondHalf(false) => {
            return Err(file_fault(
                place,
                "`left_out.second_half` = false holds out no data for the test: expected true, \
                 `every_second_block` or `files`",
            ));
        }
        LeftOut::EverySecondBlock(length) => {
            let length = seconds(place, "left_out.every_second_block", length)?;
            for trial in trials.iter_mut() {
                let sample = trial.step * trial.stride as f64;
                let block = (length / sample).round().max(1.0) as usize;
                for (k, out) in trial.left_out.iter_mut().enumerate() {
                    *out = (k / block) % 2 == 1;
                }
            }
        }
        LeftOut::Files(names) => {
            for name in names {
                let found = files
                    .iter()
                    .position(|file| file.file_name() == name.file_name());
                let found = found.ok_or_else(|| {
                    let reason = format!(
                        "`left_out.files` names {}, which is not one of the data files",
                        name.display()
                    );
                    file_fault(place, reason)
                })?;
                trials[found].left_out.fill(true);
            }
        }
    }
    let measured = |out: bool| -> usize {
        let own = trials.iter().map(|trial| {
            let samples = trial.left_out.iter().enumerate();
            let is_there = |k: usize| trial.outputs.iter().any(|y| y[k].is_finite());
            samples
                .filter(|(k, own)| **own == out && is_there(*k))
                .count()
        });
        own.sum()
    };
    if measured(true) < FEWEST || measured(false) < FEWEST {
        return Err(file_fault(
            place,
            format!("`left_out` leaves fewer than {FEWEST} measured samples on one side"),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_between_samples_have_the_mean_of_what_is_between() {
        let samples = [0.0, 4.0, 2.0];
        assert_eq!(
            finer(&samples, 4, Between::Linear),
            [0.5, 1.5, 2.5, 3.5, 3.75, 3.25, 2.75, 2.25, 2.0]
        );
        let held = [0.0, 0.0, 0.0, 0.0, 4.0, 4.0, 4.0, 4.0, 2.0];
        assert_eq!(finer(&samples, 4, Between::Hold), held);
        for between in [Between::Hold, Between::Linear] {
            assert_eq!(finer(&samples, 1, between), samples);
            assert_eq!(finer(&[], 3, between), [0.0]);
        }
    }

    /// Files of `rows` samples 10 ms apart: time in ms, a force in kN and a displacement with gaps.
    fn files(folder: &Path, rows: usize) -> Vec<PathBuf> {
        let names = ["a.csv", "b.csv"].into_iter();
        let files = names.map(|name| {
            let mut text = String::from("t [ms],force [kN],x\n");
            for n in 0..rows {
                let x = if n % 10 == 3 {
                    String::new()
                } else {
                    format!("{}", 0.5 * n as f64)
                };
                text += &format!("{},{},{x}\n", 10 * n, n % 4);
            }
            let path = folder.join(name);
            std::fs::write(&path, text).unwrap();
            path
        });
        files.collect()
    }

    fn map(more: &str) -> Map {
        let text = format!(
            "{more}\n[inputs]\nu = \"force\"\n[outputs]\ny = {{ column = \"x\", unit = \"mm\" }}\n"
        );
        toml::from_str(&text).unwrap()
    }

    fn signal(name: &str, unit: &str) -> [Signal; 1] {
        [Signal {
            name: name.into(),
            unit: unit.into(),
        }]
    }

    fn read(more: &str, rows: usize) -> Result<Vec<Trial>, String> {
        let folder = tempfile::tempdir().unwrap();
        let files = files(folder.path(), rows);
        let found = trials(
            &map(more),
            Path::new("map.toml"),
            &files,
            &signal("u", "N"),
            &signal("y", "m"),
        );
        found.map_err(|error| error.to_string())
    }

    #[test]
    fn columns_are_read_in_the_units_of_the_model() {
        let step = "step = { value = 5.0, unit = \"ms\" }\nbetween = \"hold\"";
        let all = read(step, 200).unwrap();
        let own = &all[0];
        assert_eq!((&*own.name, own.stride, own.samples()), ("a", 2, 200));
        assert!((own.step - 0.005).abs() < 1e-12);
        assert_eq!(own.inputs[0][..5], [0.0, 0.0, 1000.0, 1000.0, 2000.0]);
        assert!((own.outputs[0][2] - 0.001).abs() < 1e-15 && own.outputs[0][3].is_nan());
        // By default the second half is held out.
        assert_eq!(own.left_out.iter().position(|out| *out), Some(100));
    }

    #[test]
    fn data_are_held_out_by_blocks_or_files() {
        let blocks = read(
            "left_out = { every_second_block = { value = 0.5, unit = \"s\" } }",
            200,
        )
        .unwrap();
        let out: Vec<usize> = (0..200).filter(|&k| blocks[1].left_out[k]).collect();
        assert_eq!((out[0], out[49], out[50], out.len()), (50, 99, 150, 100));
        let by_file = read("left_out = { files = [\"b.csv\"] }", 200).unwrap();
        let all = |trial: &Trial, is_out| trial.left_out.iter().all(|out| *out == is_out);
        assert!(all(&by_file[0], false) && all(&by_file[1], true));
    }

    #[test]
    fn data_and_maps_at_fault_are_refused_by_place() {
        for (more, rows, expected) in [
            ("", 100, "100 rows: expected at least 128"),
            (
                "left_out = { second_half = false }",
                200,
                "holds out no data",
            ),
            (
                "left_out = { files = [\"c.csv\"] }",
                200,
                "`left_out.files` names c.csv",
            ),
            (
                "left_out = { files = [\"a.csv\", \"b.csv\"] }",
                200,
                "fewer than 64 measured samples",
            ),
            (
                "step = { value = 3.0, unit = \"ms\" }",
                200,
                "`step` is contained 3.3333 times",
            ),
            (
                "step = { value = 0.0, unit = \"ms\" }",
                200,
                "`step`: 0 s, expected more than 0 s",
            ),
            ("step = { value = 1.0, unit = \"m\" }", 200, "`step`:"),
            ("time = \"clock\"", 200, "clock"),
        ] {
            let told = read(more, rows).err().unwrap_or_default();
            assert!(told.contains(expected), "{more}: {told}");
        }
        // A step that is stated needs no column of the time.
        let own = read("time_step = { value = 20.0, unit = \"ms\" }", 200).unwrap();
        assert!((own[0].step - 0.02).abs() < 1e-12);
    }

    #[test]
    fn an_output_that_was_not_measured_can_be_predicted() {
        let folder = tempfile::tempdir().unwrap();
        let file = &files(folder.path(), 4)[0];
        let outputs = [signal("y", "m"), signal("z", "m")].concat();
        let trial = |needs| {
            trial(
                &map(""),
                Path::new("map.toml"),
                file,
                &signal("u", "N"),
                &outputs,
                needs,
            )
        };
        let own = trial(&TO_PREDICT).unwrap();
        assert_eq!(
            own.in_file[0].as_ref().map(|(unit, _)| unit.as_str()),
            Some("mm")
        );
        assert!(
            own.in_file[1].is_none() && own.trial.outputs[1].iter().all(|value| value.is_nan())
        );
        assert!(trial(&TO_SCORE).is_err());
    }
}

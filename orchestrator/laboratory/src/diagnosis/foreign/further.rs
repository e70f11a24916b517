//! The extended model of an FMU, read back, on further records without a fit.

use pack::Installation;
use std::path::{Path, PathBuf};

use identification::data::mean_and_deviation;
use identification::diagnosis::rigs::FileErrors;
use identification::diagnosis::rigs::foreign::{Signal, Trial};

use super::MAP;
use super::data::{self, Needs, Record};
use super::map::Map;
use super::simulator::{Alone, Mapped, TABLE, is_file, mapped};
use super::written::PATH;
use crate::diagnosis::file_fault;
use crate::error::Error;
use fmi_import::Isolation;
use fmi_system::{ComponentFile, Link, Origin, Setting, SystemFile, VariableName};

/// The extended model of an FMU: a system of the FMU with paths on the way of its signals.
pub struct Extended {
    /// The file it came from.
    pub path: PathBuf,
    system: SystemFile,
    map: Map,
    map_path: PathBuf,
    nominal: Mapped,
}

/// What the extended model puts out for a file.
pub struct Prediction {
    /// Time of every row, s.
    pub time: Vec<f64>,
    /// The outputs in the model's units.
    pub outputs: Vec<Signal>,
    /// Their values, a row of the file each.
    pub values: Vec<Vec<f64>>,
    /// Place of the output that was asked for: the first that the file has not in every row.
    pub wanted: usize,
    /// Its unit in the file, and what brings a value in it into the model's unit.
    pub in_file: (String, f64),
    /// Rows in which it was given.
    pub given: usize,
}

/// Whether a text is that of a system, as the extended model of an FMU is.
pub fn is_one(text: &str) -> bool {
    let table: Result<toml::Table, _> = toml::from_str(text);
    table.is_ok_and(|table| table.contains_key("components"))
}

impl Extended {
    /// Reads the system in the file `path`, with the map next to it if no other is given. Its
    /// FMU is looked for where the system says, unless `fmu` says where it is now, and runs in a process of its
    /// own unless `isolate` says otherwise.
    ///
    /// # Errors
    /// Files that cannot be read; a system that no diagnosis of an FMU wrote.
    pub fn read(
        path: &Path,
        fmu: Option<&Path>,
        map: Option<&Path>,
        (isolate, installation): (Option<Isolation>, &Installation),
    ) -> Result<Self, Error> {
        let mut system = SystemFile::read(path)?;
        let map_path = match map {
            Some(map) => map.to_path_buf(),
            None => path.parent().unwrap_or(Path::new("")).join(MAP),
        };
        if map.is_none() && !map_path.is_file() {
            return Err(file_fault(
                path,
                format!(
                    "it is the model of an FMU, and {} is missing: pass the map of the data with \
                     --map MAP.toml",
                    map_path.display()
                ),
            ));
        }
        let map = Map::read(&map_path)?;
        let mut models = system.components.values_mut();
        let model = models
            .find(|part| part.fmu != PATH)
            .ok_or_else(|| file_fault(path, "[components] contains no model"))?;
        if let Some(fmu) = fmu {
            model.fmu = fmu.display().to_string();
        }
        let place = match &system.directory {
            Some(folder) if is_file(Path::new(&model.fmu)) && fmu.is_none() => {
                folder.join(&model.fmu)
            }
            _ => PathBuf::from(&model.fmu),
        };
        if is_file(&place) && !place.is_file() {
            let missing = place.display();
            return Err(match fmu {
                Some(_) => Error::Option {
                    option: "--fmu",
                    reason: format!("{missing}: no such file"),
                },
                None => file_fault(
                    path,
                    format!("its FMU {missing} was not found: pass its present path with --fmu"),
                ),
            });
        }
        // Relative paths in a system count from its folder, those of the command line do not.
        let place = match is_file(&place) {
            true => std::path::absolute(&place).map_err(|error| file_fault(&place, error))?,
            false => place,
        };
        model.fmu = place.display().to_string();
        let nominal = mapped(
            &place,
            &map,
            &map_path,
            (isolate.unwrap_or(Isolation::Foreign), installation),
        )?;
        Ok(Self {
            path: path.into(),
            system,
            map,
            map_path,
            nominal,
        })
    }

    fn record(&self, file: &Path, needs: &Needs) -> Result<Record, Error> {
        let Mapped {
            inputs, outputs, ..
        } = &self.nominal;
        data::trial(&self.map, &self.map_path, file, inputs, outputs, needs)
    }

    fn is_path(&self, name: &str) -> bool {
        let part = self.system.components.get(name);
        part.is_some_and(|part| part.fmu == PATH)
    }

    /// The component after the output `name` of the model.
    fn behind(&self, name: &str) -> Option<&str> {
        let mut links = self.system.connections.iter();
        let found = links.find(|link| {
            link.from == Origin::Output(VariableName::new(self.model(), name))
                && self.is_path(&link.to.component)
        });
        found.map(|link| link.to.component.as_str())
    }

    fn model(&self) -> &str {
        let mut names = self.system.components.keys();
        names
            .find(|name| !self.is_path(name))
            .map_or("", String::as_str)
    }

    /// The system with paths that are sampled as `trial` is.
    fn system(&self, trial: &Trial) -> SystemFile {
        let mut system = self.system.clone();
        let is_input =
            |link: &Link| matches!(&link.from, Origin::Output(from) if from.component == TABLE);
        let inputs = self.system.connections.iter().filter(|link| is_input(link));
        let inputs: Vec<&str> = inputs.map(|link| link.to.component.as_str()).collect();
        let paths = system.components.iter_mut();
        for (name, part) in paths.filter(|(_, part)| part.fmu == PATH) {
            let stride = if inputs.contains(&name.as_str()) {
                1
            } else {
                trial.stride
            };
            sample(part, trial.step * stride as f64);
        }
        system
    }

    /// The outputs of nominal and extended model on `trial`, one value per sample; `name` is the
    /// file's.
    fn simulate(&self, trial: &Trial, name: &Path) -> Result<[Vec<Vec<f64>>; 2], Error> {
        let columns = self.nominal.outputs.iter().map(|output| {
            let behind = self.behind(&output.name).map(|path| format!("{path}.y"));
            behind.unwrap_or_else(|| format!("{}.{}", self.model(), output.name))
        });
        let extended = self.nominal.alone.within(
            self.system(trial),
            &self.nominal.inputs,
            columns.collect(),
        )?;
        let inputs: Vec<&[f64]> = trial.inputs.iter().map(Vec::as_slice).collect();
        let steps = trial.samples().saturating_sub(1) * trial.stride + 1;
        let run = |model: &Alone| -> Result<Vec<Vec<f64>>, Error> {
            let outcome = model.run(&inputs, &[], trial.step, steps)?;
            let found = model.outputs(&outcome, steps).ok_or_else(|| {
                let why = outcome.ended.message();
                let what = format!("the simulation of this record ends early: {why}");
                file_fault(name, what)
            })?;
            let sampled = found
                .iter()
                .map(|own| own.iter().step_by(trial.stride).copied().collect());
            Ok(sampled.collect())
        };
        Ok([run(&self.nominal.alone)?, run(&extended)?])
    }

    /// Errors of nominal and extended model on `files`, for every output that was measured; nothing is
    /// fitted.
    ///
    /// # Errors
    /// A file that cannot be read or in which no output was measured; a model whose simulation ends
    /// early.
    pub fn validate(&self, files: &[PathBuf]) -> Result<Vec<FileErrors>, Error> {
        let mut all = Vec::new();
        for file in files {
            let trial = self.record(file, &data::TO_SCORE)?.trial;
            let [nominal, extended] = self.simulate(&trial, file)?;
            let before = all.len();
            for (j, output) in self.nominal.outputs.iter().enumerate() {
                let rms = |model: &[f64]| {
                    let pairs = trial.outputs[j].iter().zip(model);
                    let missed = pairs.map(|(y, model)| y - model).filter(|e| e.is_finite());
                    let (count, sum) =
                        missed.fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e * e));
                    f64::sqrt(sum / count)
                };
                let measured = trial.outputs[j].iter().copied().filter(|y| y.is_finite());
                let measured: Vec<f64> = measured.collect();
                let deviation = mean_and_deviation(&measured).1;
                if measured.len() < 2 || deviation == 0.0 {
                    continue;
                }
                let percent = |model: &[f64]| 100.0 * rms(model) / deviation;
                all.push(FileErrors {
                    file: file.clone(),
                    channel: output.name.clone(),
                    nominal_percent: percent(&nominal[j]),
                    described_percent: percent(&nominal[j]),
                    extended_percent: percent(&extended[j]),
                    extended_rms: rms(&extended[j]),
                    unit: output.unit.clone(),
                    session: Default::default(),
                    notes: Vec::new(),
                });
            }
            if all.len() == before {
                let what =
                    "no output of the map varies in it: expected measured values for the score";
                return Err(file_fault(file, what));
            }
        }
        Ok(all)
    }

    /// What the extended model puts out for every row of `file`, whose output cells may be empty or whose
    /// outputs' columns may be missing. It begins with the model's start values.
    ///
    /// # Errors
    /// As [`Self::validate`].
    pub fn predict(&self, file: &Path) -> Result<Prediction, Error> {
        let Record { trial, in_file } = self.record(file, &data::TO_PREDICT)?;
        let [_, values] = self.simulate(&trial, file)?;
        let given = |j: usize| trial.outputs[j].iter().filter(|y| y.is_finite()).count();
        let outputs = &self.nominal.outputs;
        let wanted = (0..outputs.len()).find(|j| given(*j) < trial.samples());
        let wanted = wanted.unwrap_or(0);
        let own = in_file.get(wanted).cloned().flatten();
        Ok(Prediction {
            time: (0..trial.samples())
                .map(|k| (k * trial.stride) as f64 * trial.step)
                .collect(),
            in_file: own.unwrap_or_else(|| (outputs[wanted].unit.clone(), 1.0)),
            outputs: outputs.clone(),
            values,
            wanted,
            given: given(wanted),
        })
    }
}

/// Gives a path the sampling period `period`, s.
fn sample(path: &mut ComponentFile, period: f64) {
    path.period = Some(Setting::Number(period));
    path.set("period", period);
}

//! The extended model of a table as a file, and what it makes of further records without a fit.

use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector};
use plant::identified::rig::IdentifiedRig;
use serde::{Deserialize, Serialize};

use super::command;
use super::predictor::{Disturbance, Noise, Predictor, Samples};
use crate::case::{CaseError, Nominal, problems};
use recordings::{Called, Channel, OUTPUT_NAMES, Recording, mean_and_deviation};

/// Section of the file with the nominal model that was diagnosed.
pub const DESCRIBED: &str = "described";
/// What the nominal model does not say twice.
const SHARED: [&str; 5] = ["units", "sample_rate", "controller", "noise", "uncertainty"];
/// How far a sensor's zero may have moved between files, in standard deviations of its noise.
const SPREAD_OF_A_ZERO: f64 = 100.0;

/// A table before and after a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtendedTable {
    /// As it was described.
    pub described: Nominal,
    /// With its effects and corrected parameters.
    pub extended: Nominal,
    /// Where it stands.
    pub path: PathBuf,
}

/// One-step errors of both models on a file, of which only the sensors' zeros were fitted, for both
/// alike.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TableErrors {
    /// The file.
    pub file: PathBuf,
    /// By channel.
    pub channels: Vec<ChannelErrors>,
    /// Error of the model as described, all channels together: 1 where the stated noise is all.
    pub described_in_noise: f64,
    /// And of the extended model.
    pub extended_in_noise: f64,
}

/// Errors of a channel over its variation, per cent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelErrors {
    /// Its name.
    pub channel: String,
    /// Model as described.
    pub described_percent: f64,
    /// Extended model.
    pub extended_percent: f64,
    /// Root mean square of the extended model's error, SI.
    pub extended_rms: f64,
    /// SI unit.
    pub unit: String,
    /// Zero of the sensor on this file, by the extended model, SI.
    pub zero: f64,
    /// What a perfect model would leave with the stated noise.
    pub floor_percent: f64,
}

/// What the extended model shows in place of a file's empty cells.
#[derive(Debug, Clone, PartialEq)]
pub struct TablePrediction {
    /// Time of every row, s.
    pub time: Vec<f64>,
    /// Displacement, acceleration, actuator force, specimen acceleration of every row, SI.
    pub rows: Vec<[f64; 4]>,
    /// Rows in which an output was given.
    pub given: usize,
    /// The first output whose cells are empty in a row, by its place; displacement where none is.
    pub wanted: usize,
}

fn rig(model: &Nominal) -> IdentifiedRig {
    IdentifiedRig {
        shake_table: model.shake_table,
        specimen: model.specimen,
        effects: model.effects,
        sensors: model.sensors,
    }
}

impl ExtendedTable {
    /// True where `text` is a model of a table rather than of another rig.
    pub fn is_one(text: &str) -> bool {
        toml::from_str::<toml::Table>(text).is_ok_and(|all| all.contains_key("table"))
    }

    /// Reads a file that a diagnosis of a case wrote.
    ///
    /// # Errors
    /// A file that cannot be read or is not an extended model of a table, with the key that is at
    /// fault.
    pub fn read(path: &Path) -> Result<Self, CaseError> {
        let fail = |reason: String| CaseError::File {
            file: path.to_owned(),
            reason,
        };
        let text = recordings::read_written(path).map_err(|error| fail(error.to_string()))?;
        let extended = Nominal::parse(&text).map_err(|error| fail(error.to_string()))?;
        let mut all: toml::Table =
            toml::from_str(&text).map_err(|error| fail(error.to_string()))?;
        let Some(toml::Value::Table(mut described)) = all.remove(DESCRIBED) else {
            return Err(fail(format!(
                "no [{DESCRIBED}]: expected the diagnosed nominal model, which `shakebench \
                 diagnose` writes with the extended one"
            )));
        };
        for key in SHARED {
            if let (None, Some(value)) = (described.get(key), all.remove(key)) {
                described.insert(key.to_owned(), value);
            }
        }
        let described = toml::to_string(&described).map_err(|error| fail(error.to_string()))?;
        let described =
            Nominal::parse(&described).map_err(|why| fail(format!("[{DESCRIBED}]: {why}")))?;
        Ok(Self {
            described,
            extended,
            path: path.to_owned(),
        })
    }

    fn recording(&self, file: &Path, called: &[Called]) -> Result<Recording, CaseError> {
        Ok(Recording::read_called(
            file,
            &file.display().to_string(),
            called,
        )?)
    }

    /// Errors on `files`, whose channels may be `called` otherwise. Nothing is fitted but the zero of
    /// every sensor.
    ///
    /// # Errors
    /// A file that cannot be read, or would mislead, by place.
    pub fn validate(
        &self,
        files: &[PathBuf],
        called: &[Called],
    ) -> Result<Vec<TableErrors>, CaseError> {
        files.iter().map(|file| self.errors(file, called)).collect()
    }

    fn errors(&self, file: &Path, called: &[Called]) -> Result<TableErrors, CaseError> {
        let recording = self.recording(file, called)?;
        let found = problems(&recording, &self.extended);
        if !found.is_empty() {
            return Err(CaseError::Unfit { problems: found });
        }
        let samples = Samples::of(
            &recording,
            command::shown(&recording, 1.0 / self.extended.sample_rate),
        );
        let there = Channel::OUTPUTS.map(|channel| recording.channel(channel).is_some());
        let before = self.one_step(&self.described, &samples, there, file)?;
        let after = self.one_step(&self.extended, &samples, there, file)?;
        let deviation = |i: usize| {
            let values = recording.samples(Channel::OUTPUTS[i]);
            mean_and_deviation(values).1.max(f64::MIN_POSITIVE)
        };
        let live = || (0..4).filter(|&i| there[i] && after.floor[i] > 0.0);
        let channels = live().map(|i| ChannelErrors {
            channel: OUTPUT_NAMES[i].to_owned(),
            described_percent: 100.0 * before.rms[i] / deviation(i),
            extended_percent: 100.0 * after.rms[i] / deviation(i),
            extended_rms: after.rms[i],
            unit: Channel::OUTPUTS[i].unit().to_owned(),
            zero: after.zeros[i],
            floor_percent: 100.0 * after.floor[i] / deviation(i),
        });
        Ok(TableErrors {
            file: file.to_owned(),
            channels: channels.collect(),
            described_in_noise: before.in_noise,
            extended_in_noise: after.in_noise,
        })
    }

    /// One-step errors of `model` with the sensors' zeros that fit the record best.
    fn one_step(
        &self,
        model: &Nominal,
        samples: &Samples,
        there: [bool; 4],
        file: &Path,
    ) -> Result<OneStep, CaseError> {
        let (predictor, rig) = self.predictor(model, there)?;
        let walk = |zeros: [f64; 4]| {
            let mut shifted = samples.clone();
            for row in &mut shifted.channels {
                for i in 0..4 {
                    row[i] -= zeros[i];
                }
            }
            let mut out = vec![0.0; 4 * shifted.len()];
            let is_finite = predictor.innovations(&rig, &shifted, &mut out);
            is_finite.then_some(out).ok_or_else(|| CaseError::File {
                file: file.to_owned(),
                reason: format!(
                    "the model of {} gives no finite output on it: check that its units and those \
                     of the columns match",
                    self.path.display()
                ),
            })
        };
        let mut zeros = [0.0; 4];
        let start = walk(zeros)?;
        let live: Vec<usize> = (0..4).filter(|&i| there[i]).collect();
        let mut columns = Vec::new();
        for &i in &live {
            let mut moved = [0.0; 4];
            moved[i] = model.noise[i];
            let moved = walk(moved)?;
            columns.push(moved.iter().zip(&start).map(|(a, b)| a - b).collect());
        }
        let columns: Vec<DVector<f64>> = columns.into_iter().map(DVector::from_vec).collect();
        let residuals = DVector::from_column_slice(&start);
        let ridge = SPREAD_OF_A_ZERO.powi(-2);
        let normal = DMatrix::from_fn(live.len(), live.len(), |i, j| {
            columns[i].dot(&columns[j]) + if i == j { ridge } else { 0.0 }
        });
        let slope = DVector::from_fn(live.len(), |i, _| -columns[i].dot(&residuals));
        if let Some(step) = normal.cholesky().map(|factor| factor.solve(&slope)) {
            for (&i, step) in live.iter().zip(step.iter()) {
                zeros[i] = step * model.noise[i];
            }
        }
        let whitened = walk(zeros)?;
        let mut squares = [0.0; 4];
        for row in whitened.chunks_exact(4) {
            let error = predictor.physical(&[row[0], row[1], row[2], row[3]]);
            for i in 0..4 {
                squares[i] += error[i] * error[i];
            }
        }
        let n = samples.len().max(1) as f64;
        let floor = predictor.floor();
        let seen = floor.iter().filter(|floor| **floor > 0.0).count().max(1) as f64;
        let all: f64 = whitened.iter().map(|r| r * r).sum();
        Ok(OneStep {
            rms: squares.map(|sum| (sum / n).sqrt()),
            floor,
            in_noise: (all / (n * seen)).sqrt(),
            zeros,
        })
    }

    fn predictor(
        &self,
        model: &Nominal,
        there: [bool; 4],
    ) -> Result<(Predictor, plant::identified::rig::SampledRig), CaseError> {
        let fail = |error: plant::ModelError| CaseError::File {
            file: self.path.clone(),
            reason: error.to_string(),
        };
        let period = 1.0 / model.sample_rate;
        let mut white = model.noise;
        for i in 0..4 {
            if !there[i] {
                white[i] = f64::INFINITY;
            }
        }
        let unseen = Disturbance::beside_command(model.command_noise, period);
        let rig = rig(model);
        let predictor =
            Predictor::design(&rig, period, &Noise::new(white, unseen)).map_err(fail)?;
        let sampled = predictor.sample(&rig).map_err(fail)?;
        Ok((predictor, sampled))
    }

    /// The outputs for every row of `file`, in which their cells, or the columns, may be empty. What is
    /// given corrects the model up to there. The command is the recorded one where it and a measured
    /// output are given, else what the stated law makes of `reference`: without its controller the
    /// table drifts away.
    ///
    /// # Errors
    /// A file that cannot be read; neither a command with outputs nor a law with its reference; a model
    /// that leaves the finite.
    pub fn predict(&self, file: &Path, called: &[Called]) -> Result<TablePrediction, CaseError> {
        let fail = |reason: String| CaseError::File {
            file: file.to_owned(),
            reason,
        };
        let recording = self.recording(file, called)?;
        let n = recording.len();
        let period = 1.0 / self.extended.sample_rate;
        let time: Vec<f64> = (0..n).map(|k| recording.time_at(k)).collect();
        let uneven = time
            .windows(2)
            .position(|pair| ((pair[1] - pair[0]) / period - 1.0).abs() > 0.1);
        if n == 0 || !time.iter().all(|t| t.is_finite()) || uneven.is_some() {
            let place = uneven.map_or(String::new(), |k| format!(" after {:.4} s", time[k]));
            return Err(fail(format!(
                "time stamps are irregular{place}: expected a column `time` of {} Hz, the rate of \
                 the model",
                self.extended.sample_rate
            )));
        }
        let values = |channel| recording.channel(channel);
        let at = |channel, k: usize| {
            values(channel)
                .and_then(|own: &[f64]| own.get(k).copied())
                .unwrap_or(f64::NAN)
        };
        let measured: Vec<[f64; 4]> = (0..n)
            .map(|k| Channel::OUTPUTS.map(|channel| at(channel, k)))
            .collect();
        let is_given = |row: &[f64; 4]| row.iter().any(|value| value.is_finite());
        let there = [0, 1, 2, 3].map(|i| measured.iter().any(|row| row[i].is_finite()));
        let whole = values(Channel::Reference).filter(|own| own.iter().all(|r| r.is_finite()));
        let law = self.extended.controller.zip(whole);
        let lost = |k: usize| !is_given(&measured[k]) || at(Channel::ValveCommand, k).is_nan();
        if let (None, Some(k)) = (law, (0..n).find(|k| lost(*k))) {
            return Err(fail(format!(
                "nothing drives the table after {:.4} s: there is neither a command with an \
                 output nor a law with its reference. Give a complete column `reference` and a \
                 [controller] in {}",
                time[k],
                self.path.display()
            )));
        }
        // A gain for channels of which there is nothing would be none: then all of them serve.
        let seen = if there.contains(&true) {
            there
        } else {
            [true; 4]
        };
        let (predictor, rig) = self.predictor(&self.extended, seen)?;
        let mut state = law.map(|(law, reference)| (law.start(period), reference));
        let rows = predictor.simulate(&rig, &measured, |k, shown| {
            let by_law = state
                .as_mut()
                .map(|(state, reference)| state.command(reference, k, shown[0], shown[1]));
            let recorded = at(Channel::ValveCommand, k);
            match by_law {
                Some(by_law) if lost(k) => by_law,
                _ => recorded,
            }
        });
        let has_column = |i: usize| values(Channel::OUTPUTS[i]).is_some();
        let is_wanted = |i: usize| has_column(i) && measured.iter().any(|row| row[i].is_nan());
        if !rows.iter().flatten().all(|value| value.is_finite()) {
            return Err(fail(format!(
                "the model of {} gives no finite output on it",
                self.path.display()
            )));
        }
        Ok(TablePrediction {
            time,
            rows,
            given: measured.iter().filter(|row| is_given(row)).count(),
            wanted: (0..4).find(|&i| is_wanted(i)).unwrap_or(0),
        })
    }
}

struct OneStep {
    rms: [f64; 4],
    floor: [f64; 4],
    in_noise: f64,
    zeros: [f64; 4],
}

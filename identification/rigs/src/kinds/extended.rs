//! The extended model of a rig as a file, and what it makes of further records without a fit.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::description::{
    Column, Description, DescriptionError, LeftOut, Made, Quantity, Windows, listed,
};
use super::diagnosis::RigDiagnosis;
use super::hypotheses::Hypotheses;
use super::measured::Measured;
use super::named_value::NamedValue;
use super::parts::{EVERYTHING, InParts};
use super::reading::compare_all;
use super::{Measurement, Rig, SessionParameter, SessionRole};
use diagnosis::{Free, Point, SimulatedModel, completed, least_squares};
use units::convert;

/// What the data say of a rig: parameters of three models as a description's `[nominal]` has them (SI
/// values with their standard errors), and how its files are read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExtendedRig {
    /// What the rig is called.
    pub name: String,
    /// Its kind.
    pub kind: String,
    /// Time between samples, for data without a `time` column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_step: Option<Quantity>,
    /// Where it is restarted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub windows: Option<Windows>,
    /// Columns of its files.
    pub columns: BTreeMap<String, Column>,
    /// Nominal parameters as they were described.
    pub described: BTreeMap<String, Quantity>,
    /// Nominal parameters refitted, without an effect.
    pub refitted: BTreeMap<String, Quantity>,
    /// Nominal parameters with the effects.
    pub nominal: BTreeMap<String, Quantity>,
    /// The effects' parameters.
    #[serde(default)]
    pub effects: BTreeMap<String, BTreeMap<String, Quantity>>,
    /// Those of the effects that are the user's own, as they were written.
    #[serde(default, skip_serializing_if = "Hypotheses::is_empty")]
    pub hypotheses: Hypotheses,
    /// What a file has for itself, such as the zero of a transducer: the mean of the files that were
    /// fitted.
    #[serde(default)]
    pub session: BTreeMap<String, Quantity>,
    /// Where it stands.
    #[serde(skip)]
    pub path: PathBuf,
    #[serde(skip)]
    made: Made,
}

/// Errors `||y - m|| / ||m - mean||` of one file, of which only what a file has for itself was fitted,
/// for every model alike.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileErrors {
    /// The file.
    pub file: PathBuf,
    /// What is simulated.
    pub channel: String,
    /// Per cent, nominal model refitted to the data of the diagnosis.
    pub nominal_percent: f64,
    /// Nominal model as it was described.
    pub described_percent: f64,
    /// Extended model.
    pub extended_percent: f64,
    /// Root mean square of the extended model's error, SI.
    pub extended_rms: f64,
    /// SI unit of the output.
    pub unit: String,
    /// What the file has for itself, by the extended model, SI; with its first output.
    pub session: BTreeMap<String, f64>,
    /// What else was read out of it, a sentence each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// What the extended model puts out for a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// The kind's output, and after it what else the file has a column for.
    pub columns: Vec<PredictedColumn>,
    /// Rows whose output was given.
    pub given: usize,
}

/// An output of a [`Prediction`].
#[derive(Debug, Clone, PartialEq)]
pub struct PredictedColumn {
    /// What is simulated.
    pub channel: &'static str,
    /// Unit of the file's column for it.
    pub unit: String,
    /// A value for each row of the file, in that unit.
    pub rows: Vec<f64>,
}

fn quantities(values: &[NamedValue]) -> BTreeMap<String, Quantity> {
    let quantity = |p: &NamedValue| Quantity {
        value: p.value,
        plus_minus: if p.standard_error.is_finite() {
            p.standard_error
        } else {
            0.0
        },
        unit: p.unit.clone(),
    };
    values
        .iter()
        .map(|p| (p.name.clone(), quantity(p)))
        .collect()
}

impl ExtendedRig {
    /// The model with the effects that `found` names.
    ///
    /// # Errors
    /// A description that does not fit its kind.
    pub fn new(
        description: &Description,
        measurement: &Measurement,
        found: &RigDiagnosis,
    ) -> Result<Self, DescriptionError> {
        let rig = description.rig()?;
        let stated = description.nominal(rig)?;
        let exact = |fitted: &[NamedValue]| {
            let mut all = quantities(fitted);
            for ((name, unit), (value, plus_minus)) in rig.parameters().iter().zip(&stated) {
                all.entry((*name).to_owned()).or_insert(Quantity {
                    value: *value,
                    plus_minus: *plus_minus,
                    unit: (*unit).to_owned(),
                });
            }
            all
        };
        let confirmed = &found.confirmed;
        let measured = Measured::new(rig, measurement, stated.clone());
        let files = measurement.recordings.len();
        let sessions: Vec<Vec<f64>> = (0..files)
            .map(|s| measured.session_values(&confirmed.point, s))
            .collect();
        let session = rig.session().iter().enumerate();
        let session = session
            .filter(|(_, own)| own.role != SessionRole::Start)
            .map(|(i, own)| {
                let values: Vec<f64> = sessions.iter().map(|s| s[i]).collect();
                let (value, deviation) = recordings::mean_and_deviation(&values);
                let quantity = Quantity {
                    value,
                    plus_minus: deviation,
                    unit: own.unit.to_owned(),
                };
                (own.name.to_owned(), quantity)
            })
            .collect();
        let effects = confirmed.effects.iter();
        Ok(Self {
            name: found.name.clone(),
            kind: found.kind.clone(),
            time_step: description.time_step.clone(),
            windows: description.windows.clone(),
            columns: description.columns.clone(),
            described: exact(&[]),
            refitted: exact(&confirmed.refitted),
            nominal: exact(&confirmed.parameters),
            effects: effects
                .map(|(effect, values)| (effect.clone(), quantities(values)))
                .collect(),
            hypotheses: {
                let all = description.hypotheses.iter();
                let is_found =
                    |name: &&String| confirmed.effects.iter().any(|(own, _)| own == *name);
                all.filter(|(name, _)| is_found(name))
                    .map(|(name, own)| (name.clone(), own.clone()))
                    .collect()
            },
            session,
            path: PathBuf::new(),
            made: Made::default(),
        })
    }

    /// A description by itself, such as an identification writes: no effect is known.
    fn described(description: &Description) -> Result<Self, DescriptionError> {
        let rig = description.rig()?;
        let values = rig.parameters().iter().zip(description.nominal(rig)?);
        let nominal: BTreeMap<String, Quantity> = values
            .map(|((name, unit), (value, plus_minus))| {
                let quantity = Quantity {
                    value,
                    plus_minus,
                    unit: (*unit).to_owned(),
                };
                ((*name).to_owned(), quantity)
            })
            .collect();
        Ok(Self {
            name: description.name.clone(),
            kind: description.kind.clone(),
            time_step: description.time_step.clone(),
            windows: description.windows.clone(),
            columns: description.columns.clone(),
            described: nominal.clone(),
            refitted: nominal.clone(),
            nominal,
            effects: BTreeMap::new(),
            hypotheses: description.hypotheses.clone(),
            session: BTreeMap::new(),
            path: description.path.clone(),
            made: description.made.clone(),
        })
    }

    /// The text of the file.
    ///
    /// # Errors
    /// Numbers that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        Ok(format!(
            "# Estimates for this rig: value and standard error, SI. Predict with it:\n\
             # shakebench diagnose --model FILE --validate DATA.csv\n{}",
            toml::to_string(self)?
        ))
    }

    /// Reads a file of [`Self::to_toml`], or a description, which has no effect.
    ///
    /// # Errors
    /// A file that cannot be read; what is not an extended model, with line and column; an unknown
    /// kind, effect or parameter, a unit of another quantity.
    pub fn read(path: &Path) -> Result<Self, DescriptionError> {
        let text = recordings::read_written(path).map_err(|source| DescriptionError::Read {
            path: path.to_owned(),
            source,
        })?;
        let is_description =
            toml::from_str::<toml::Table>(&text).is_ok_and(|table| table.contains_key("left_out"));
        let mut model: Self = if is_description {
            Self::described(&Description::parse(path, &text)?)?
        } else {
            toml::from_str(&text).map_err(|error| DescriptionError::Description {
                path: path.to_owned(),
                what: format!("not an extended model of a rig: {error}"),
            })?
        };
        model.path = path.to_owned();
        let rig = model.description(&model.nominal).rig()?;
        model.effect_values(rig)?;
        model.session_values(rig)?;
        for values in [&model.described, &model.refitted, &model.nominal] {
            model.description(values).nominal(rig)?;
        }
        Ok(model)
    }

    /// A description with these nominal values, all of them exact.
    pub(super) fn description(&self, nominal: &BTreeMap<String, Quantity>) -> Description {
        let mut nominal = nominal.clone();
        for quantity in nominal.values_mut() {
            quantity.plus_minus = 0.0;
        }
        Description {
            name: self.name.clone(),
            kind: self.kind.clone(),
            data: Vec::new(),
            time_step: self.time_step.clone(),
            reduced_to: None,
            columns: self.columns.clone(),
            nominal,
            left_out: LeftOut::SecondHalf(true),
            windows: self.windows.clone(),
            hypotheses: self.hypotheses.clone(),
            hypotheses_path: None,
            transfer_function: None,
            path: self.path.clone(),
            made: self.made.clone(),
        }
    }

    pub(super) fn wrong(&self, what: String) -> DescriptionError {
        DescriptionError::Description {
            path: self.path.clone(),
            what,
        }
    }

    fn si(&self, place: &str, quantity: &Quantity, unit: &str) -> Result<f64, DescriptionError> {
        let value = convert(quantity.value, &quantity.unit, unit)
            .map_err(|why| self.wrong(format!("`{place}`: {why}")))?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.wrong(format!("`{place}` is not a finite number")))
        }
    }

    /// Values of the effects that are there, by their place among those of `rig`.
    fn effect_values(&self, rig: &dyn Rig) -> Result<Vec<(usize, Vec<f64>)>, DescriptionError> {
        let known = rig.effects();
        let all = self.effects.iter().map(|(name, values)| {
            let place = known.iter().position(|e| e.candidate.effect == name);
            let names = known.iter().map(|e| e.candidate.effect);
            let place = place.ok_or_else(|| {
                let hint = units::hint(name, names);
                self.wrong(format!(
                    "`effects.{name}` is unknown to {}{hint}",
                    self.kind
                ))
            })?;
            let parameters = &known[place].candidate.parameters;
            if let Some(extra) = values
                .keys()
                .find(|k| parameters.iter().all(|p| p.name != **k))
            {
                let names: Vec<&str> = parameters.iter().map(|p| p.name).collect();
                return Err(self.wrong(format!(
                    "`effects.{name}.{extra}` is unknown: expected {}",
                    listed(&names)
                )));
            }
            let own = parameters.iter().map(|p| {
                let at = format!("effects.{name}.{}", p.name);
                let quantity = values.get(p.name);
                let missing = || self.wrong(format!("`{at}` is missing: a value in {}", p.unit));
                self.si(&at, quantity.ok_or_else(missing)?, p.unit)
            });
            Ok((place, own.collect::<Result<Vec<f64>, _>>()?))
        });
        all.collect()
    }

    fn session_values(&self, rig: &dyn Rig) -> Result<Vec<f64>, DescriptionError> {
        let known = rig.session();
        if let Some(extra) = self
            .session
            .keys()
            .find(|k| known.iter().all(|own| own.name != **k))
        {
            let names: Vec<&str> = known.iter().map(|own| own.name).collect();
            return Err(self.wrong(format!(
                "`session.{extra}` is unknown to {}: expected {}",
                self.kind,
                listed(&names)
            )));
        }
        let own = known.iter().map(|own| match self.session.get(own.name) {
            Some(quantity) => self.si(&format!("session.{}", own.name), quantity, own.unit),
            None => Ok(0.0),
        });
        own.collect()
    }

    /// The model as the engine sees it, and its point. `nominal` are its values of the nominal
    /// parameters; without `with_effects` there is none.
    pub(super) fn measured<'a>(
        &self,
        measurement: &'a Measurement,
        nominal: &BTreeMap<String, Quantity>,
        with_effects: bool,
    ) -> Result<(Measured<'a>, Point), DescriptionError> {
        let description = self.description(nominal);
        let rig = description.rig()?;
        let measured = Measured::new(rig, measurement, description.nominal(rig)?).of_later_files();
        let mut point = measured.origin();
        let session = self.session_values(rig)?;
        measured.set_session(&mut point, &session);
        if with_effects {
            for (place, values) in self.effect_values(rig)? {
                let internal = measured.candidates()[place].internal(&values);
                point.effects.push((place, internal));
            }
        }
        Ok((measured, point))
    }

    /// Errors on `files` without a fit but of what every file has for itself.
    ///
    /// # Errors
    /// A file that cannot be read or has not the columns, by place.
    pub fn validate(&self, files: &[PathBuf]) -> Result<Vec<FileErrors>, DescriptionError> {
        let description = self.description(&self.nominal);
        let rig = description.rig()?;
        let mut all = Vec::new();
        for file in files {
            let mut measurement = Measurement {
                recordings: vec![description.recording(file, rig, false)?.0],
            };
            compare_all(rig, &mut measurement.recordings);
            let errors = |nominal, with_effects| {
                let (measured, point) = self.measured(&measurement, nominal, with_effects)?;
                let point = completed(&measured, &point, None, EVERYTHING);
                let session = measured.session_values(&point, 0);
                let errors = measured.errors_by_output(&point, EVERYTHING);
                let notes = measured.notes(&point);
                Ok::<_, DescriptionError>((errors, session, notes))
            };
            let (extended, session, mut notes) = errors(&self.nominal, true)?;
            let nominal = errors(&self.refitted, false)?.0;
            let described = errors(&self.described, false)?.0;
            let named = rig.session().iter().zip(session);
            let mut session: BTreeMap<String, f64> = named
                .map(|(own, value)| (own.name.to_owned(), value))
                .collect();
            let models = extended.into_iter().zip(nominal).zip(described);
            all.extend(models.map(|((extended, nominal), described)| FileErrors {
                file: file.clone(),
                channel: extended.0.name().to_owned(),
                nominal_percent: 100.0 * nominal.1,
                described_percent: 100.0 * described.1,
                extended_percent: 100.0 * extended.1,
                extended_rms: extended.2,
                notes: std::mem::take(&mut notes),
                unit: extended.0.unit().to_owned(),
                session: std::mem::take(&mut session),
            }));
        }
        Ok(all)
    }

    /// The output for `file`, in which cells of the output may be empty. Given ones tell how the
    /// file begins, and nothing else; without them it begins at rest, or, where it `is_periodic`, in
    /// the steady state of a motion that repeats the file.
    ///
    /// # Errors
    /// As [`Self::validate`]; a model that leaves the finite.
    pub fn predict(&self, file: &Path, is_periodic: bool) -> Result<Prediction, DescriptionError> {
        let description = self.description(&self.nominal);
        let rig = description.rig()?;
        let (mut recording, rows) = description.recording(file, rig, true)?;
        recording.is_periodic = is_periodic;
        let given = recording.output().iter().filter(|y| y.is_finite()).count();
        let (samples, mut recordings) = (recording.len(), vec![recording]);
        compare_all(rig, &mut recordings);
        let measurement = Measurement { recordings };
        let (measured, mut point) = self.measured(&measurement, &self.nominal, true)?;
        let is_told = |own: &SessionParameter| own.role == SessionRole::Start;
        if given > 0 && rig.session().iter().any(is_told) {
            // The rest of what a file has for itself stays as the model's files had it.
            let starts: Vec<bool> = rig.session().iter().map(is_told).collect();
            let is_start = |i: usize| starts.get(i).copied().unwrap_or(false);
            let free = Free::Chosen(&is_start);
            let found = least_squares(&measured, &point, EVERYTHING, &free, 30);
            point = found.map_or(point, |found| found.point);
        }
        let simulated = measured.simulate(&point, 0);
        if !simulated.iter().all(|y| y.is_finite()) {
            return Err(self.wrong(format!(
                "the simulation is not finite on {}",
                file.display()
            )));
        }
        let outputs = measurement.recordings[0].outputs();
        let columns = outputs.enumerate().map(|(i, (channel, size))| {
            let unit = self.columns.get(channel.name());
            let unit = unit.map_or(channel.unit(), |column| column.unit.as_str());
            let factor = convert(size, channel.unit(), unit)
                .map_err(|why| self.wrong(format!("`columns.{}`: {why}", channel.name())))?;
            let rows = rows.iter().map(|&k| factor * simulated[i * samples + k]);
            Ok(PredictedColumn {
                channel: channel.name(),
                unit: unit.to_owned(),
                rows: rows.collect(),
            })
        });
        Ok(Prediction {
            columns: columns.collect::<Result<_, DescriptionError>>()?,
            given,
        })
    }
}

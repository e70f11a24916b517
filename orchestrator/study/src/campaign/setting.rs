//! What a study may fix or vary: the keys of its file, and what each does to a request.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use fmi_import::FmiVersion;
use fmi_master::Algorithm;
use fmi_system::{Setting, SystemError, SystemFile};
use laboratory::error::Error;
use laboratory::run::experiment::{Request, is_file};
use laboratory::systems::built_in;
use laboratory::systems::tuning::Tuning;
use motion::Scaling;
use units::{STANDARD_GRAVITY, UnitError, hint, value_in};

/// Why a study cannot fix or vary something.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// No such key.
    #[error(
        "is an unknown key{hint}; expected one of {}, or a variable as \"instance.variable\"",
        KEYS.map(|(known, _)| known).join(", ")
    )]
    Unknown {
        /// The nearest key.
        hint: String,
    },
    /// Variables under a name that means something else.
    #[error("a factor with `of` needs its own name; expected a name without a point")]
    NameTaken,
    /// Variables under a name, and none of them.
    #[error("`of` is empty; expected variables")]
    NoVariables,
    /// Something else in place of a variable.
    #[error("`{0}` is not a variable; expected \"instance.variable\"")]
    NotAVariable(String),
    /// A value of another kind.
    #[error("`{value}` is not {expected}")]
    Value {
        /// What was written.
        value: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A name that is not among those that there are.
    #[error("`{name}` is unknown{hint}; expected one of {known}")]
    Name {
        /// What was written.
        name: String,
        /// The nearest one.
        hint: String,
        /// All of them.
        known: String,
    },
    /// A choice that is not among those of an option.
    #[error("`{name}` is none of {known}")]
    Choice {
        /// What was written.
        name: String,
        /// All of them.
        known: String,
    },
    /// A built-in system that there is not.
    #[error(transparent)]
    System(#[from] SystemError),
    /// A number or unit that cannot be read.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// One record in place of several.
    #[error("a record is a file; expected a list of files or folders")]
    NotFiles,
    /// A folder of records that cannot be read.
    #[error(transparent)]
    Records(#[from] Error),
    /// One key in both tables.
    #[error("`{0}` is fixed and varies; expected one of the two")]
    FixedAndVaries(String),
    /// Two names of one key.
    #[error("`{first}` and `{second}` are synonyms; expected one of them")]
    Synonyms {
        /// The one.
        first: String,
        /// The other.
        second: String,
    },
    /// Keys of which a run can have one only.
    #[error("`{first}` and `{second}` exclude each other")]
    Exclusive {
        /// The one.
        first: String,
        /// The other.
        second: String,
    },
}

/// A value that is not what was expected.
pub(super) fn misfit(value: &Setting, expected: &'static str) -> KeyError {
    KeyError::Value {
        value: value.to_string(),
        expected,
    }
}

/// A key of `[fixed]` or `[factors]`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Key {
    /// `controller` or `system`.
    System,
    /// `plant`
    Plant,
    /// `specimen`
    Specimen,
    /// `structure`
    Structure,
    /// `tuning`
    Tuning,
    /// `control_model`
    ControlModel,
    /// `fmi`
    Fmi,
    /// `record`
    Record,
    /// `reference`
    Reference,
    /// `seed` of the built-in motion.
    Seed,
    /// `scale`
    Scale,
    /// `pga`
    PeakAcceleration,
    /// `peak`
    PeakDisplacement,
    /// `duration`
    Duration,
    /// `step`
    Step,
    /// `algorithm`
    Algorithm,
    /// A variable of an instance.
    Variable(String),
    /// Variables of instances that are the same, or the same times what each of them is.
    Variables(Vec<String>),
}

/// The keys that are not variables.
const KEYS: [(&str, Key); 17] = [
    ("controller", Key::System),
    ("system", Key::System),
    ("plant", Key::Plant),
    ("specimen", Key::Specimen),
    ("structure", Key::Structure),
    ("tuning", Key::Tuning),
    ("control_model", Key::ControlModel),
    ("fmi", Key::Fmi),
    ("record", Key::Record),
    ("reference", Key::Reference),
    ("seed", Key::Seed),
    ("scale", Key::Scale),
    ("pga", Key::PeakAcceleration),
    ("peak", Key::PeakDisplacement),
    ("duration", Key::Duration),
    ("step", Key::Step),
    ("algorithm", Key::Algorithm),
];

/// The value of `control_model` with which controllers are designed on recordings of each run's own rig.
pub const OWN_MODEL: &str = "own";
/// The value of `control_model` with which they are designed as without it.
pub const USUAL_MODEL: &str = "usual";

impl Key {
    /// The key of that name.
    ///
    /// # Errors
    /// An unknown name, with the nearest one.
    pub fn of(name: &str) -> Result<Self, KeyError> {
        if let Some((_, key)) = KEYS.iter().find(|(known, _)| *known == name) {
            return Ok(key.clone());
        }
        if name
            .split_once('.')
            .is_some_and(|(a, b)| !a.is_empty() && !b.is_empty())
        {
            return Ok(Self::Variable(name.to_string()));
        }
        let known = KEYS.map(|(known, _)| known);
        Err(KeyError::Unknown {
            hint: hint(name, known),
        })
    }

    /// The key of several variables under a name of their own.
    ///
    /// # Errors
    /// A name that a key or a variable has, variables that are none.
    pub fn together(name: &str, variables: Vec<String>) -> Result<Self, KeyError> {
        if Self::of(name).is_ok() {
            return Err(KeyError::NameTaken);
        }
        if variables.is_empty() {
            return Err(KeyError::NoVariables);
        }
        for variable in &variables {
            if !matches!(Self::of(variable), Ok(Self::Variable(_))) {
                return Err(KeyError::NotAVariable(variable.clone()));
            }
        }
        Ok(Self::Variables(variables))
    }

    /// The variables that it sets.
    #[must_use]
    pub fn variables(&self) -> &[String] {
        match self {
            Self::Variable(name) => std::slice::from_ref(name),
            Self::Variables(names) => names,
            _ => &[],
        }
    }

    /// The unit in which a number alone is, and in which it is put into the table; none for texts.
    pub(super) fn unit(&self) -> Option<&'static str> {
        match self {
            Self::Seed | Self::Scale | Self::Variables(_) => Some(""),
            Self::PeakAcceleration => Some("g"),
            Self::PeakDisplacement => Some("m"),
            Self::Duration | Self::Step => Some("s"),
            _ => None,
        }
    }

    /// Whether its values are files.
    pub(super) fn is_path(&self, value: &str) -> bool {
        match self {
            Self::Record | Self::Reference => true,
            Self::ControlModel => ![OWN_MODEL, USUAL_MODEL].contains(&value),
            Self::System => is_file(value),
            Self::Plant => value.ends_with(".toml"),
            _ => false,
        }
    }

    /// Whether it chooses components, not their values.
    pub(super) fn is_structural(&self) -> bool {
        matches!(
            self,
            Self::System
                | Self::Plant
                | Self::Specimen
                | Self::Structure
                | Self::Tuning
                | Self::ControlModel
                | Self::Fmi
        )
    }

    /// Puts a value into a request; paths count from `folder`.
    ///
    /// # Errors
    /// What is wrong and what was expected.
    pub(super) fn apply(
        &self,
        value: &Setting,
        folder: &Path,
        request: &mut Request,
    ) -> Result<(), KeyError> {
        let text = || match value {
            Setting::Text(text) => Ok(text.clone()),
            other => Err(misfit(other, "text")),
        };
        let path = || text().map(|text| folder.join(text));
        let number = || -> Result<f64, KeyError> {
            let number = self.number(value)?;
            match number > 0.0 && number.is_finite() {
                true => Ok(number),
                false => Err(misfit(value, "positive")),
            }
        };
        let known = |name: String, known: Vec<&str>| {
            if known.contains(&name.as_str()) {
                return Ok(name);
            }
            Err(KeyError::Name {
                hint: hint(&name, known.iter().copied()),
                known: known.join(", "),
                name,
            })
        };
        match self {
            Self::System => {
                let name = text()?;
                request.system = match is_file(&name) {
                    true => folder.join(name).display().to_string(),
                    false => {
                        built_in::check(&name)?;
                        name
                    }
                };
            }
            Self::Plant => {
                let name = text()?;
                request.plant = match name.ends_with(".toml") {
                    true => folder.join(name).display().to_string(),
                    false => known(name, built_in::plants().collect())?,
                };
            }
            Self::Specimen => request.specimen = known(text()?, built_in::specimens().collect())?,
            Self::Structure => {
                request.structure = Some(known(text()?, built_in::structures().collect())?);
            }
            Self::Tuning => request.tuning = Some(choice::<Tuning>(&text()?)?),
            Self::ControlModel => {
                let name = text()?;
                request.control_model = self.is_path(&name).then(|| folder.join(name));
            }
            Self::Fmi => {
                request.fmi = match value {
                    Setting::Integer(2) => FmiVersion::V2,
                    Setting::Integer(3) => FmiVersion::V3,
                    other => return Err(misfit(other, "a version; expected 2 or 3")),
                };
            }
            Self::Record => request.record = Some(path()?),
            Self::Reference => request.reference = Some(path()?),
            Self::Seed => {
                request.seed = match value {
                    Setting::Integer(seed) if *seed >= 0 => *seed as u64,
                    other => return Err(misfit(other, "a seed; expected 0, 1, 2, ...")),
                };
            }
            Self::Scale => request.scaling = Some(Scaling::Factor(number()?)),
            Self::PeakAcceleration => {
                request.scaling = Some(Scaling::PeakAcceleration(number()? * STANDARD_GRAVITY));
            }
            Self::PeakDisplacement => request.scaling = Some(Scaling::PeakDisplacement(number()?)),
            Self::Duration => request.duration_s = Some(number()?),
            Self::Step => request.step_s = Some(number()?),
            Self::Algorithm => request.algorithm = Some(choice::<Algorithm>(&text()?)?),
            Self::Variable(_) | Self::Variables(_) => {
                let set = self
                    .variables()
                    .iter()
                    .map(|name| format!("{name}={value}"));
                request.set.extend(set);
            }
        }
        Ok(())
    }

    /// The value as a number in [`Key::unit`].
    ///
    /// # Errors
    /// No number, or a unit that does not fit.
    pub(super) fn number(&self, value: &Setting) -> Result<f64, KeyError> {
        match value {
            Setting::Number(number) => Ok(*number),
            Setting::Integer(number) => Ok(*number as f64),
            Setting::Text(text) => Ok(value_in(text, self.unit().unwrap_or_default())?),
            other => Err(misfit(other, "a number")),
        }
    }
}

fn choice<T: ValueEnum>(name: &str) -> Result<T, KeyError> {
    T::from_str(name, false).map_err(|_| {
        let known: Vec<String> = T::value_variants()
            .iter()
            .filter_map(|one| Some(one.to_possible_value()?.get_name().to_string()))
            .collect();
        KeyError::Choice {
            name: name.to_string(),
            known: known.join(", "),
        }
    })
}

/// The files that a value of a key needs: itself, and what a system file refers to.
pub(super) fn files(key: &Key, value: &Setting, folder: &Path) -> Vec<PathBuf> {
    let Setting::Text(name) = value else {
        return Vec::new();
    };
    if !key.is_path(name) {
        return Vec::new();
    }
    let path = folder.join(name);
    let mut all = vec![path.clone()];
    if matches!(key, Key::System | Key::Plant) && name.ends_with(".toml") {
        // One that cannot be read is at fault when its system is assembled.
        if let Ok(file) = SystemFile::read(&path) {
            all.extend(file.files());
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_put_values_into_a_request_or_refuse_them() {
        let mut request = Request::built_in("mpc");
        let text = |own: &str| Setting::Text(own.to_string());
        let mut apply = |key: Key, value: Setting| {
            let done = key.apply(&value, Path::new("folder"), &mut request);
            done.map(|()| request.clone())
                .map_err(|error| error.to_string())
        };
        assert_eq!(apply(Key::Seed, Setting::Integer(7)).unwrap().seed, 7);
        assert_eq!(apply(Key::Seed, Setting::Integer(0)).unwrap().seed, 0);
        for wrong in [Setting::Integer(-1), Setting::Number(1.5), text("1")] {
            let told = apply(Key::Seed, wrong).unwrap_err();
            assert!(told.contains("expected 0, 1, 2"), "{told}");
        }
        assert_eq!(
            apply(Key::Fmi, Setting::Integer(2)).unwrap().fmi,
            FmiVersion::V2
        );
        assert!(apply(Key::Fmi, Setting::Integer(4)).is_err());
        assert_eq!(
            apply(Key::Duration, text("250 ms")).unwrap().duration_s,
            Some(0.25)
        );
        assert_eq!(
            apply(Key::Step, Setting::Number(0.001)).unwrap().step_s,
            Some(0.001)
        );
        assert!(apply(Key::Duration, Setting::Number(0.0)).is_err());
        let Some(Scaling::PeakAcceleration(peak)) =
            apply(Key::PeakAcceleration, text("0.3 g")).unwrap().scaling
        else {
            panic!("no peak");
        };
        assert!((peak - 0.3 * STANDARD_GRAVITY).abs() < 1e-12, "{peak}");
        let record = apply(Key::Record, text("a.csv")).unwrap().record;
        assert_eq!(record, Some(Path::new("folder").join("a.csv")));
        assert_eq!(
            apply(Key::Plant, text("own.toml")).unwrap().plant,
            "folder/own.toml"
        );
        let told = apply(Key::Specimen, text("yeilding")).unwrap_err();
        assert!(told.contains("yielding"), "{told}");
    }
}

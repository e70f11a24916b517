//! The description of a rig and its measurements, as people write it.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use super::hypotheses::{self, Hypotheses};
use super::{KINDS, Rig, like, of_kind};
use recordings::DataError;
use units::convert;

/// The equations of a description once they were asked for; clones share them.
#[derive(Clone, Default)]
pub(super) struct Made(Arc<OnceLock<&'static dyn Rig>>);

/// They follow from the rest of the description.
impl PartialEq for Made {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Made {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Made")
            .field(&self.0.get().map(|rig| rig.kind()))
            .finish()
    }
}

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
    /// Records that are sampled at twice this rate or faster are reduced towards it, by means of
    /// neighbouring samples.
    #[serde(default)]
    pub reduced_to: Option<Quantity>,
    /// Column of each input, of the output and of `time`.
    pub columns: BTreeMap<String, Column>,
    /// Parameters of the nominal model.
    pub nominal: BTreeMap<String, Quantity>,
    /// What is left out of the fit.
    pub left_out: LeftOut,
    /// Where a rig without a restoring force is restarted.
    #[serde(default)]
    pub windows: Option<Windows>,
    /// Effects of the user's own, beside those of the kind.
    #[serde(default)]
    pub hypotheses: Hypotheses,
    /// Other results of an identification, which a diagnosis does not use.
    #[serde(default)]
    pub transfer_function: Option<IgnoredAny>,
    /// Where the description stands.
    #[serde(skip)]
    pub path: PathBuf,
    /// Where its hypotheses do, if not in the description.
    #[serde(skip)]
    pub hypotheses_path: Option<PathBuf>,
    #[serde(skip)]
    pub(super) made: Made,
}

/// A column of the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

/// Windows of a record, each simulated by itself from the outputs at its begin, which are not compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Windows {
    /// How long each is.
    pub length: Quantity,
    /// How long the output is known at its begin.
    pub known: Quantity,
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
    #[error(transparent)]
    Data(#[from] DataError),
}

/// A column as a map names it: by its header, or with a unit of its own.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected \"header\", or { column = \"header\", unit = \"mm\" }"
)]
enum Renamed {
    Header(String),
    Column(Column),
}

/// The names that the file `map` gives channels: `channel = "header"` or
/// `channel = { column = "header", unit = "mm" }` a line; header and unit by channel.
///
/// # Errors
/// A file that cannot be read or is not such a map.
pub fn column_map(
    map: &Path,
) -> Result<BTreeMap<String, (String, Option<String>)>, DescriptionError> {
    let text = recordings::read_written(map).map_err(|source| DescriptionError::Read {
        path: map.to_owned(),
        source,
    })?;
    let names: BTreeMap<String, Renamed> =
        toml::from_str(&text).map_err(|error| DescriptionError::Description {
            path: map.to_owned(),
            what: format!("not a map of columns: {}", error.to_string().trim_end()),
        })?;
    let parts = |renamed| match renamed {
        Renamed::Header(header) => (header, None),
        Renamed::Column(column) => (column.column, Some(column.unit)),
    };
    let all = names.into_iter();
    Ok(all.map(|(channel, name)| (channel, parts(name))).collect())
}

/// `columns` with the names that the file `map` gives them, as [`column_map`] reads it.
///
/// # Errors
/// As [`column_map`]; a channel without a unit, by name.
pub fn renamed(
    columns: &BTreeMap<String, Column>,
    map: &Path,
) -> Result<BTreeMap<String, Column>, DescriptionError> {
    let mut all = columns.clone();
    for (channel, (column, unit)) in column_map(map)? {
        let known = columns.get(&channel).map(|known| known.unit.clone());
        let unit = unit.or(known).ok_or_else(|| {
            let names: Vec<&str> = columns.keys().map(String::as_str).collect();
            DescriptionError::Description {
                path: map.to_owned(),
                what: format!(
                    "`{channel}` is not a channel of the description, which has {}; a new one \
                     needs its unit",
                    listed(&names)
                ),
            }
        })?;
        all.insert(channel, Column { column, unit });
    }
    Ok(all)
}

/// Names for a message.
pub(super) fn listed(names: &[&str]) -> String {
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

impl Description {
    /// Reads a description.
    ///
    /// # Errors
    /// A file that cannot be read; what is not TOML or has an unknown key, with line and column; an
    /// unknown kind.
    pub fn read(path: &Path) -> Result<Self, DescriptionError> {
        let text = recordings::read_written(path).map_err(|source| DescriptionError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(path, &text)
    }

    /// Reads the text of a description; `path` is where it stands.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, DescriptionError> {
        let wrong = |what: String| DescriptionError::Description {
            path: path.to_owned(),
            what,
        };
        let mut description: Self =
            toml::from_str(text).map_err(|error| wrong(error.to_string()))?;
        description.path = path.to_owned();
        description.rig()?;
        Ok(description)
    }

    pub(super) fn wrong(&self, what: String) -> DescriptionError {
        DescriptionError::Description {
            path: self.path.clone(),
            what,
        }
    }

    pub(super) fn si(
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
                "`{what}` is not a number with an uncertainty of at least 0"
            )));
        }
        Ok((quantity.value * factor, quantity.plus_minus * factor))
    }

    /// The same with the effects of the file `effects` beside its own.
    ///
    /// # Errors
    /// A file that cannot be read; an effect that does not fit the kind, or whose name is taken; by line.
    pub fn with_effects(mut self, effects: &Path) -> Result<Self, DescriptionError> {
        for (name, own) in hypotheses::read(effects)? {
            if self.hypotheses.insert(name.clone(), own).is_some() {
                return Err(DescriptionError::Description {
                    path: effects.to_owned(),
                    what: format!(
                        "`{name}` is in {} already: choose another name",
                        self.path.display()
                    ),
                });
            }
        }
        self.hypotheses_path = Some(effects.to_owned());
        self.made = Made::default();
        self.rig()?;
        Ok(self)
    }

    /// The rig's equations, with the effects of the user's own.
    ///
    /// # Errors
    /// An unknown kind; an effect that does not fit it.
    pub fn rig(&self) -> Result<&'static dyn Rig, DescriptionError> {
        if let Some(rig) = self.made.0.get() {
            return Ok(*rig);
        }
        let path = self.hypotheses_path.as_deref().unwrap_or(&self.path);
        let rig = hypotheses::extended(self.base()?, &self.hypotheses, path)?;
        Ok(*self.made.0.get_or_init(|| rig))
    }

    fn base(&self) -> Result<&'static dyn Rig, DescriptionError> {
        of_kind(&self.kind)
            .or_else(|| like(&self.kind))
            .ok_or_else(|| {
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
                "`nominal.{extra}` is unknown: expected {}{}",
                names.join(", "),
                units::hint(extra, names.iter().copied())
            )));
        }
        known
            .iter()
            .zip(rig.defaults())
            .map(
                |((name, si), default)| match (self.nominal.get(*name), default) {
                    (Some(quantity), _) => self.si(&format!("nominal.{name}"), quantity, si),
                    (None, Some(default)) => Ok((*default, 0.0)),
                    (None, None) => {
                        let found: Vec<&str> = self.nominal.keys().map(String::as_str).collect();
                        Err(self.wrong(format!(
                            "`nominal.{name}` is missing: a value in {si}; found {}",
                            listed(&found)
                        )))
                    }
                },
            )
            .collect()
    }
}

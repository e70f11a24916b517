//! One way from data on disk to a diagnosis.

use std::path::{Path, PathBuf};

use super::case::{Case, CaseError};
use super::kinds::shake_table;
use super::kinds::{Description, DescriptionError, Measurement, RigDiagnosis, column_map, renamed};
use super::report::DiagnosisReport;
use diagnosis::Observer;
use recordings::{Called, Channel};

/// What is diagnosed.
#[derive(Debug, Clone, PartialEq)]
pub enum Subject {
    /// The shake table: a nominal model and records.
    Case(Box<Case>),
    /// Another rig: its description and its measurements.
    Rig(Box<(Description, Measurement)>),
}

/// Why there is no diagnosis.
#[derive(Debug, thiserror::Error)]
pub enum DiagnosisError {
    /// A case is at fault.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The description of a rig, or its data, are at fault.
    #[error(transparent)]
    Rig(#[from] DescriptionError),
    /// Data files were given with a case.
    #[error(
        "a case has its own records, identification.csv and validation.csv; other data files \
         apply only to the description of a rig (.toml)"
    )]
    DataOfACase,
    /// Effects of the user's own were given with a case.
    #[error(
        "effects of your own apply to the kinds of rigs, whose description is a .toml file or is guessed \
         from data files, and not to a case of a table with its nominal.toml"
    )]
    EffectsOfACase,
    /// A map of columns names a channel that no case has.
    #[error(
        "{}: `{channel}` is not a channel of a case, which has {}{}",
        map.display(), channels(), units::hint(channel, names())
    )]
    Channel {
        /// The map.
        map: PathBuf,
        /// The name.
        channel: String,
    },
}

/// Names of the channels that a case may have.
fn names() -> impl Iterator<Item = &'static str> {
    Channel::KNOWN.into_iter().map(Channel::name)
}

fn channels() -> String {
    names().collect::<Vec<_>>().join(", ")
}

/// What a map of columns calls the channels of a case.
///
/// # Errors
/// A map that cannot be read, or that names a channel which no case has.
pub fn called(map: &Path) -> Result<Vec<Called>, DiagnosisError> {
    let all = column_map(map)?.into_iter();
    all.map(|(name, (head, unit))| {
        let mut known = Channel::KNOWN.into_iter();
        match known.find(|channel| channel.name() == name) {
            Some(channel) => Ok(Called {
                channel,
                head,
                unit,
            }),
            None => Err(DiagnosisError::Channel {
                map: map.to_owned(),
                channel: name,
            }),
        }
    })
    .collect()
}

/// What came out, in full.
#[derive(Debug, Clone, PartialEq)]
pub enum Diagnosis<'a> {
    /// Of a case.
    Case {
        /// The case.
        case: &'a Case,
        /// What came out.
        found: Box<shake_table::Diagnosis>,
    },
    /// Of a rig.
    Rig {
        /// Its description.
        description: &'a Description,
        /// Its measurements.
        measurement: &'a Measurement,
        /// What came out.
        found: Box<RigDiagnosis>,
    },
}

impl Subject {
    /// The same with the effects of the file `effects` beside those of its kind.
    ///
    /// # Errors
    /// A file that cannot be read, or that does not fit the kind, by line; a case.
    pub fn with_effects(self, effects: &Path) -> Result<Self, DiagnosisError> {
        match self {
            Self::Rig(rig) => {
                let (description, measurement) = *rig;
                let description = description.with_effects(effects)?;
                Ok(Self::Rig(Box::new((description, measurement))))
            }
            Self::Case(_) => Err(DiagnosisError::EffectsOfACase),
        }
    }

    /// Reads the description of a rig where `path` ends in `.toml`, with `data` in place of the files
    /// that it names if there are any; a case folder elsewhere. The file `columns` may name the columns
    /// otherwise.
    ///
    /// # Errors
    /// Files that cannot be read or understood, by name and place; `data` with a case.
    pub fn read(
        path: &Path,
        data: &[PathBuf],
        columns: Option<&Path>,
    ) -> Result<Self, DiagnosisError> {
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let mut description = Description::read(path)?;
            if let Some(map) = columns {
                description.columns = renamed(&description.columns, map)?;
            }
            let measurement = description.measurement(data)?;
            Ok(Self::Rig(Box::new((description, measurement))))
        } else if data.is_empty() {
            let called = columns.map(called).transpose()?.unwrap_or_default();
            Ok(Self::Case(Box::new(Case::read_called(path, &called)?)))
        } else {
            Err(DiagnosisError::DataOfACase)
        }
    }
}

/// Diagnoses `subject`; `observer` receives each attempt.
///
/// # Errors
/// Records that would mislead, by record, column and place; a nominal model that cannot be simulated.
pub fn diagnose<'a>(
    subject: &'a Subject,
    observer: Observer<'_>,
) -> Result<Diagnosis<'a>, DiagnosisError> {
    Ok(match subject {
        Subject::Case(case) => Diagnosis::Case {
            case,
            found: Box::new(shake_table::diagnose(case, observer)?),
        },
        Subject::Rig(rig) => {
            let (description, measurement) = rig.as_ref();
            Diagnosis::Rig {
                description,
                measurement,
                found: Box::new(super::kinds::diagnose(description, measurement, observer)?),
            }
        }
    })
}

impl Diagnosis<'_> {
    /// The report, of which the files are still to be named.
    pub fn report(&self) -> DiagnosisReport {
        match self {
            Self::Case { found, .. } => found.as_ref().into(),
            Self::Rig { found, .. } => found.as_ref().into(),
        }
    }
}

//! One way from data on disk to a diagnosis.

use std::path::{Path, PathBuf};

use super::case::{Case, CaseError};
use super::engine::Observer;
use super::report::DiagnosisReport;
use super::rigs::shake_table;
use super::rigs::{self, Description, DescriptionError, Measurement, RigDiagnosis, renamed};

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
        "a case brings its own records, identification.csv and validation.csv; other data files go \
         with the description of a rig (.toml) only"
    )]
    DataOfACase,
    /// Names of columns were given with a case.
    #[error(
        "the columns of a case have the names of docs/data-files.md, or others that it lists; a map \
         goes with the description of a rig (.toml) only"
    )]
    ColumnsOfACase,
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
    /// Reads the description of a rig where `path` ends in `.toml`, with `data` in place of the files
    /// that it names if there are any, whose columns the file `columns` may name otherwise; a case
    /// folder elsewhere.
    ///
    /// # Errors
    /// Files that cannot be read or understood, by name and place; `data` or `columns` with a case.
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
        } else if columns.is_some() {
            Err(DiagnosisError::ColumnsOfACase)
        } else if data.is_empty() {
            Ok(Self::Case(Box::new(Case::read(path)?)))
        } else {
            Err(DiagnosisError::DataOfACase)
        }
    }
}

/// Diagnoses `subject`; `observer` is told what is tried.
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
                found: Box::new(rigs::diagnose(description, measurement, observer)?),
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

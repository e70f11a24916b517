//! What a laboratory hands in: a nominal model and recordings.

mod checks;
mod model;
mod nominal;
mod nominal_error;
mod template;

pub use checks::{blind_spot, noise_ratios, problems, too_little_excitation, unstated_rail};
pub use model::rig_of;
pub use nominal::{ControlLaw, Nominal};
pub use nominal_error::NominalError;
pub use template::template;

use std::path::{Path, PathBuf};

use recordings::{Called, DataError, Recording};

/// A folder with `nominal.toml`, `identification.csv`, `validation.csv` and, if there,
/// `small.csv` and `baseline.csv`.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The nominal model.
    pub nominal: Nominal,
    /// For fitting.
    pub identification: Recording,
    /// Another excitation, held out.
    pub validation: Recording,
    /// At low level.
    pub small: Option<Recording>,
    /// The same rig without the effect.
    pub baseline: Option<Recording>,
}

/// Why a case cannot be diagnosed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// A file that cannot be read or understood.
    #[error("{}: {reason}", .file.display())]
    File {
        /// Which.
        file: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A recording that cannot be read or understood.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Recordings that would mislead a diagnosis.
    #[error("the records cannot be diagnosed: {}", .problems.join("; "))]
    Unfit {
        /// One sentence for each problem.
        problems: Vec<String>,
    },
}

impl Case {
    /// The recordings that there are.
    pub fn recordings(&self) -> impl Iterator<Item = &Recording> {
        let optional = [self.small.as_ref(), self.baseline.as_ref()];
        [&self.identification, &self.validation]
            .into_iter()
            .chain(optional.into_iter().flatten())
    }

    /// Reads a case folder.
    ///
    /// # Errors
    /// A file that is missing or cannot be understood.
    pub fn read(folder: &Path) -> Result<Self, CaseError> {
        Self::read_called(folder, &[])
    }

    /// As [`Self::read`], where the files call some channels otherwise.
    ///
    /// # Errors
    /// As [`Self::read`]; a column that is not there.
    pub fn read_called(folder: &Path, called: &[Called]) -> Result<Self, CaseError> {
        let file = folder.join("nominal.toml");
        let fail = |reason: String| CaseError::File {
            file: file.clone(),
            reason,
        };
        if !folder.is_dir() {
            return Err(CaseError::File {
                file: folder.into(),
                reason:
                    "not the folder of a case; expected one with nominal.toml, identification.csv \
                     and \
                         validation.csv, or the description of a rig (.toml)"
                        .into(),
            });
        }
        let text = recordings::read_written(&file).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => fail(
                "not found; it describes the nominal rig. `shakebench diagnose --template table` \
                 prints one to fill in"
                    .into(),
            ),
            _ => fail(error.to_string()),
        })?;
        let nominal = Nominal::parse(&text).map_err(|error| fail(error.to_string()))?;
        let recording =
            |name: &str| Recording::read_called(&folder.join(format!("{name}.csv")), name, called);
        let optional = |name: &str| {
            let there = folder.join(format!("{name}.csv")).exists();
            there.then(|| recording(name)).transpose()
        };
        Ok(Self {
            nominal,
            identification: recording("identification")?,
            validation: recording("validation")?,
            small: optional("small")?,
            baseline: optional("baseline")?,
        })
    }
}

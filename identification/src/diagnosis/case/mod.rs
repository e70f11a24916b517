//! What a laboratory hands in: a nominal model and records.

mod checks;
mod nominal;
mod record;

pub use checks::{blind_spot, deviation, noise_ratios, problems, too_little_excitation};
pub use nominal::{ControlLaw, Nominal};
pub use record::{CHANNELS, Record};

use std::path::{Path, PathBuf};

/// A folder with `nominal.toml`, `identification.csv`, `validation.csv` and, if there,
/// `small.csv` and `baseline.csv`.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The nominal model.
    pub nominal: Nominal,
    /// For fitting.
    pub identification: Record,
    /// Another excitation, held out.
    pub validation: Record,
    /// At low level.
    pub small: Option<Record>,
    /// The same rig without the effect.
    pub baseline: Option<Record>,
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
    /// Records that would mislead a diagnosis.
    #[error("the records cannot be diagnosed: {}", .problems.join("; "))]
    Unfit {
        /// One sentence for each problem.
        problems: Vec<String>,
    },
}

impl Case {
    /// The records that there are.
    pub fn records(&self) -> impl Iterator<Item = &Record> {
        let optional = [self.small.as_ref(), self.baseline.as_ref()];
        [&self.identification, &self.validation]
            .into_iter()
            .chain(optional.into_iter().flatten())
    }

    /// Reads a case folder.
    pub fn read(folder: &Path) -> Result<Self, CaseError> {
        let text = |name: &str| {
            let file = folder.join(name);
            std::fs::read_to_string(&file).map_err(|error| CaseError::File {
                file,
                reason: error.to_string(),
            })
        };
        let fail = |name: &str, reason: String| CaseError::File {
            file: folder.join(name),
            reason,
        };
        let nominal = Nominal::parse(&text("nominal.toml")?)
            .map_err(|reason| fail("nominal.toml", reason))?;
        let record = |name: &str| {
            let file = format!("{name}.csv");
            Record::parse(name, &text(&file)?).map_err(|reason| fail(&file, reason))
        };
        let optional = |name: &str| {
            if folder.join(format!("{name}.csv")).exists() {
                record(name).map(Some)
            } else {
                Ok(None)
            }
        };
        Ok(Self {
            nominal,
            identification: record("identification")?,
            validation: record("validation")?,
            small: optional("small")?,
            baseline: optional("baseline")?,
        })
    }
}

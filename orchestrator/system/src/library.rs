//! Where the FMUs of a system come from.

use std::collections::HashMap;
use std::error::Error;
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use fmi_import::{Description, Fmu};

use super::file::SystemFile;
use super::value::Value;

/// What a system file names: FMUs, and sets of parameters.
pub trait Library {
    /// The FMU of a component, by what the system file calls it.
    ///
    /// # Errors
    /// It is not there or at fault.
    fn fmu(&mut self, name: &str) -> Result<Arc<Fmu>, Box<dyn Error>>;

    /// What the set of parameters `set` gives to a component, by position of the variable; paths
    /// are relative to `directory`.
    ///
    /// # Errors
    /// What is wrong and what was expected. A library of files has no sets.
    fn parameters(
        &mut self,
        set: &str,
        component: &Description,
        directory: Option<&Path>,
    ) -> Result<Vec<(usize, Value)>, Box<dyn Error + Send + Sync>> {
        let _ = (component, directory);
        Err(format!("`{set}`: no set of parameters is known here").into())
    }
}

/// An archive that a system came from, with its FMUs.
pub trait Archive: Debug + Send + Sync {
    /// What messages call a file in it.
    fn shown(&self, file: &str) -> PathBuf;
}

/// One FMU by whatever name.
impl Library for Arc<Fmu> {
    fn fmu(&mut self, _name: &str) -> Result<Arc<Fmu>, Box<dyn Error>> {
        Ok(self.clone())
    }
}

/// FMUs that are files, each opened once.
#[derive(Debug, Default)]
pub struct Files {
    /// Paths in the system file count from here.
    directory: Option<PathBuf>,
    /// The archive in which files lie.
    archive: Option<Arc<dyn Archive>>,
    open: HashMap<PathBuf, Arc<Fmu>>,
}

impl Files {
    /// Files whose paths count from a directory.
    #[must_use]
    pub fn in_directory(directory: Option<&Path>) -> Self {
        Self {
            directory: directory.map(Path::to_path_buf),
            ..Self::default()
        }
    }

    /// The files of a system: those in its directory, or its archive.
    #[must_use]
    pub fn of(file: &SystemFile) -> Self {
        Self {
            archive: file.package.clone(),
            ..Self::in_directory(file.directory.as_deref())
        }
    }

    /// Whether a name is that of a file: a path that ends in `.fmu`, and whatever lies in an archive.
    #[must_use]
    pub fn is_file(&self, name: &str) -> bool {
        name.ends_with(".fmu") || self.archive.is_some()
    }
}

impl Library for Files {
    fn fmu(&mut self, name: &str) -> Result<Arc<Fmu>, Box<dyn Error>> {
        let directory = self.directory.as_deref().unwrap_or(Path::new(""));
        let path = directory.join(name);
        if let Some(fmu) = self.open.get(&path) {
            return Ok(fmu.clone());
        }
        let fmu = match &self.archive {
            Some(archive) => Fmu::open_within(&path, &archive.shown(name))?,
            None => Fmu::open(&path)?,
        };
        self.open.insert(path, fmu.clone());
        Ok(fmu)
    }
}

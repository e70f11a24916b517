//! Where the FMUs of a system come from: files, or the components of this project.

use std::collections::HashMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use fmi_import::{CURE, Description, FmiVersion, Fmu, FmuError};
use fmi_system::{Files, Library, SystemFile, Value};

use crate::{Installation, parameter_sets};

/// FMUs by the name that a system file gives them, each opened once.
pub struct FmuLibrary {
    version: FmiVersion,
    installation: Installation,
    files: Files,
    /// Components of this project.
    own: HashMap<PathBuf, Arc<Fmu>>,
    /// FMUs that are not files, by name.
    given: HashMap<String, Arc<Fmu>>,
}

impl FmuLibrary {
    /// A library whose own components are of the given version.
    pub fn new(version: FmiVersion, directory: Option<&Path>) -> Self {
        Self {
            version,
            installation: Installation::default(),
            files: Files::in_directory(directory),
            own: HashMap::new(),
            given: HashMap::new(),
        }
    }

    /// The same with own components of an installation.
    #[must_use]
    pub fn from(self, installation: &Installation) -> Self {
        Self {
            installation: installation.clone(),
            ..self
        }
    }

    /// Adds an FMU that is not a file, under a name that no file or component has.
    pub fn give(&mut self, name: &str, fmu: Arc<Fmu>) {
        self.given.insert(name.to_string(), fmu);
    }

    /// The library of a system file: with its directory, or its archive.
    pub fn of(version: FmiVersion, file: &SystemFile) -> Self {
        Self {
            files: Files::of(file),
            ..Self::new(version, None)
        }
    }
}

impl Library for FmuLibrary {
    /// The FMU called `name`: a path that ends in `.fmu`, or a component of this project.
    ///
    /// # Errors
    /// An unknown name (with the nearest one), a component that does not build, an FMU at fault.
    fn fmu(&mut self, name: &str) -> Result<Arc<Fmu>, Box<dyn Error>> {
        if let Some(fmu) = self.given.get(name) {
            return Ok(fmu.clone());
        }
        if self.files.is_file(name) {
            return self.files.fmu(name);
        }
        let path = &self.installation.component(name, self.version)?.path;
        if let Some(fmu) = self.own.get(path) {
            return Ok(fmu.clone());
        }
        let fmu = Fmu::open_own(path).map_err(|error| match error {
            // The file is not to blame.
            FmuError::Temporary { .. } => error.to_string(),
            _ => format!("{error}; {CURE}"),
        })?;
        self.own.insert(path.clone(), fmu.clone());
        Ok(fmu)
    }

    fn parameters(
        &mut self,
        set: &str,
        component: &Description,
        directory: Option<&Path>,
    ) -> Result<Vec<(usize, Value)>, Box<dyn Error + Send + Sync>> {
        Ok(parameter_sets::parameters(set, component, directory)?)
    }
}

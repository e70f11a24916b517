//! Where the FMUs of a system come from: files, or the components of this project.

use std::collections::HashMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::fmu::{CURE, FmiVersion, Fmu};
use crate::pack::{self, PackedFmu};
use crate::ssp::Package;
use crate::system::SystemFile;
use crate::units::hint;

/// FMUs by the name that a system file gives them, each opened once.
pub struct FmuLibrary {
    version: FmiVersion,
    /// Paths in the system file count from here.
    directory: Option<PathBuf>,
    /// The archive in which files lie.
    package: Option<Arc<Package>>,
    open: HashMap<PathBuf, Arc<Fmu>>,
}

impl FmuLibrary {
    /// A library whose own components are of the given version.
    pub fn new(version: FmiVersion, directory: Option<&Path>) -> Self {
        Self {
            version,
            directory: directory.map(Path::to_path_buf),
            package: None,
            open: HashMap::new(),
        }
    }

    /// The library of a system file: with its directory, or its archive.
    pub fn of(version: FmiVersion, file: &SystemFile) -> Self {
        Self {
            package: file.package.clone(),
            ..Self::new(version, file.directory.as_deref())
        }
    }

    /// The FMU called `name`: a path that ends in `.fmu`, or a component of this project.
    ///
    /// # Errors
    /// An unknown name (with the nearest one), a component that does not build, an FMU at fault.
    pub fn find(&mut self, name: &str) -> Result<Arc<Fmu>, Box<dyn Error>> {
        // Whatever lies in an archive is a file.
        let is_file = name.ends_with(".fmu") || self.package.is_some();
        let path = if is_file {
            self.directory
                .as_deref()
                .unwrap_or(Path::new(""))
                .join(name)
        } else {
            component(name, self.version)?.path.clone()
        };
        if let Some(fmu) = self.open.get(&path) {
            return Ok(fmu.clone());
        }
        let fmu = if let Some(package) = &self.package {
            Fmu::open_within(&path, &package.shown(name))?
        } else if is_file {
            Fmu::open(&path)?
        } else {
            Fmu::open_own(&path).map_err(|error| format!("{error}; {CURE}"))?
        };
        self.open.insert(path, fmu.clone());
        Ok(fmu)
    }
}

/// The packed FMU of a component of this project, checked.
///
/// # Errors
/// An unknown name (with the nearest one), components that cannot be found or built, an FMU that is
/// damaged or of another version.
pub fn component(name: &str, version: FmiVersion) -> Result<&'static PackedFmu, Box<dyn Error>> {
    let packed: Vec<&PackedFmu> = pack::all_fmus()?
        .iter()
        .filter(|fmu| fmu.version == version)
        .collect();
    let Some(&found) = packed.iter().find(|fmu| fmu.name == name) else {
        let known = packed.iter().map(|fmu| fmu.name.as_str());
        let hint = hint(name, known);
        return Err(format!(
            "`{name}` is no path to an .fmu file and no component in {}{hint}",
            pack::supply::folder()?
                .path
                .join(version.folder())
                .display()
        )
        .into());
    };
    pack::supply::check(found)?;
    Ok(found)
}

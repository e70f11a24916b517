//! Building the components and packing them as FMUs.
//!
//! A component is a library crate of type `cdylib` under `fmus/`; nothing else lists it. Cargo
//! builds it, and the built library tells its own name, model descriptions and documentation.

mod archive;
pub(crate) mod error;
mod variant;
mod workspace;

use std::{
    path::{Path, PathBuf},
    sync::OnceLock,
};

use crate::component_library::{ComponentLibrary, Descriptions};
pub use crate::fmu::FmiVersion;
pub use archive::PackedFmu;
pub use error::PackError;
pub(crate) use error::file_error;
pub(crate) use archive::write_archive;
pub use variant::{StartValue, write_variant};
pub(crate) use variant::with_resource;
use workspace::{Component, Workspace};

/// Builds every component and packs it as `out/fmi2/NAME.fmu` and `out/fmi3/NAME.fmu`, as far as
/// it is not there already. Sorted by name, then version.
///
/// # Errors
/// When the workspace, cargo or the folder is not usable, or a component does not compile.
pub fn build_fmus(out: &Path, versions: &[FmiVersion]) -> Result<Vec<PackedFmu>, PackError> {
    Workspace::find()?.pack(Workspace::published, out, versions)
}

/// Builds and packs the component whose crate lies in a folder of the workspace, also one that
/// [`build_fmus`] does not list, such as `tests/importers/faulty`.
///
/// # Errors
/// As [`build_fmus`].
pub fn build_component(
    folder: &str,
    out: &Path,
    versions: &[FmiVersion],
) -> Result<Vec<PackedFmu>, PackError> {
    let component = |workspace: &Workspace| Ok(vec![workspace.component_in(folder)?]);
    Workspace::find()?.pack(component, out, versions)
}

/// All FMUs of both versions in `target/fmus`, built at most once in a process.
///
/// # Errors
/// As [`build_fmus`].
pub fn all_fmus() -> Result<&'static [PackedFmu], PackError> {
    static FMUS: OnceLock<Result<Vec<PackedFmu>, String>> = OnceLock::new();
    let fmus = FMUS.get_or_init(|| {
        let out = default_folder().map_err(|e| e.to_string())?;
        build_fmus(&out, &FmiVersion::ALL).map_err(|e| e.to_string())
    });
    fmus.as_deref().map_err(|e| PackError::Earlier(e.clone()))
}

/// The folder of packed FMUs, `target/fmus` of the workspace.
///
/// # Errors
/// When the program does not run inside its workspace.
pub fn default_folder() -> Result<PathBuf, PackError> {
    Ok(Workspace::find()?.root.join("target/fmus"))
}

/// Model descriptions of all components with their places below `modelDescription/`, such as
/// `fmi2/ShakeTable.xml`.
///
/// # Errors
/// As [`build_fmus`].
pub fn model_descriptions() -> Result<Vec<(PathBuf, String)>, PackError> {
    let mut files = Vec::new();
    for Component { library, .. } in Workspace::find()?.published()? {
        let Descriptions {
            name, fmi2, fmi3, ..
        } = ComponentLibrary::open(&library)?.describe()?;
        files.push((PathBuf::from(format!("fmi2/{name}.xml")), fmi2));
        files.push((PathBuf::from(format!("fmi3/{name}.xml")), fmi3));
    }
    files.sort();
    Ok(files)
}

/// The folder of the project's workspace.
///
/// # Errors
/// When the program does not run inside its workspace.
pub fn workspace_root() -> Result<PathBuf, PackError> {
    Ok(Workspace::find()?.root)
}

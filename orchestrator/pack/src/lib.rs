//! Building the components and packing them as FMUs, and finding those that were packed.
//!
//! A component is a library crate of type `cdylib` in a folder `fmus/`; nothing else lists it. Cargo
//! builds it, and the built library tells its own name, model descriptions and documentation.

mod annotation;
mod archive;
pub mod component_library;
pub mod doctor;
mod error;
pub mod extended_model;
pub mod library;
mod merge;
mod notices;
mod packing;
pub mod parameter_sets;
mod platform;
pub mod program;
pub mod supply;
mod up_to_date;
mod variant;
mod workspace;

use std::path::{Path, PathBuf};

use crate::component_library::{ComponentLibrary, Descriptions};
pub use annotation::build_of;
pub use archive::PackedFmu;
pub use archive::write_archive;
pub(crate) use error::file_error;
pub use error::{Difference, PackError, VariantFault};
pub use fmi_import::FmiVersion;
pub use merge::merge;
use notices::Notices;
use packing::Form;
pub use platform::{Platform, UnknownPlatform};
pub use supply::{Installation, all_fmus};
pub use variant::{StartValue, variant_bytes, with_resource, write_variant};
use workspace::{Component, Workspace};

/// Builds every component and packs it as `out/fmi2/NAME.fmu` and `out/fmi3/NAME.fmu`, as far as
/// it is not there already. Sorted by name, then version.
///
/// # Errors
/// When the workspace, cargo or the folder is not usable, or a component does not compile.
pub fn build_fmus(out: &Path, versions: &[FmiVersion]) -> Result<Vec<PackedFmu>, PackError> {
    let form = Form {
        versions,
        revision: None,
        smallest: false,
    };
    packing::pack(&Workspace::find()?, Workspace::published, out, form)
}

/// Packs every component from compiled libraries: one folder per platform, including this one.
/// `revision` says which build of the sources they are; `smallest` compresses them as far as
/// deflate goes, which takes seconds a library.
///
/// # Errors
/// Libraries that are missing, and as [`build_fmus`].
pub fn pack_libraries(
    libraries: &[(Platform, PathBuf)],
    out: &Path,
    versions: &[FmiVersion],
    revision: Option<&str>,
    smallest: bool,
) -> Result<Vec<PackedFmu>, PackError> {
    let form = Form {
        versions,
        revision,
        smallest,
    };
    let components = |workspace: &Workspace| workspace.published_from(libraries);
    packing::pack(&Workspace::find()?, components, out, form)
}

/// Another program of the project: in a checkout built when it is asked for, else beside this one.
///
/// # Errors
/// There is none beside this program, or it does not compile.
pub fn companion(name: &str, package: &str) -> Result<PathBuf, PackError> {
    let own = program::file().ok();
    if let Ok(workspace) = Workspace::find()
        && own
            .as_ref()
            .is_none_or(|own| own.starts_with(&workspace.root))
    {
        return workspace.program(name, package);
    }
    beside(name).ok_or_else(|| PackError::NoCompanion(name.into()))
}

/// Another program in the folder of this one, if it is there.
pub fn beside(name: &str) -> Option<PathBuf> {
    let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
    let path = program::file().ok()?.with_file_name(file);
    path.is_file().then_some(path)
}

/// The licences of everything that this program is linked with.
///
/// # Errors
/// When the workspace or cargo is not usable.
pub fn notices_of_the_program() -> Result<String, PackError> {
    let workspace = Workspace::find()?;
    Notices::read(&workspace.metadata()?)?.of(&workspace.root.join("orchestrator"))
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
    let form = Form {
        versions,
        revision: None,
        smallest: false,
    };
    packing::pack(&Workspace::find()?, component, out, form)
}

/// The folder of packed FMUs, `target/fmus` of the workspace.
///
/// # Errors
/// When the program does not run inside its workspace.
pub fn default_folder() -> Result<PathBuf, PackError> {
    Ok(Workspace::find()?.fmus())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_beside_this_one_is_found_by_its_name() {
        let own = program::file().unwrap();
        let name = own.file_stem().unwrap().to_string_lossy();
        assert_eq!(beside(&name), Some(own.clone()));
        assert_eq!(beside("no-such-program"), None);
    }

    #[test]
    fn the_notices_of_the_program_are_those_of_all_that_it_is_linked_with() {
        let text = notices_of_the_program().unwrap();
        // Linked directly and by a dependency; linked into tests or run at a build only.
        for (name, is_linked) in [
            ("clap", true),
            ("nalgebra", true),
            ("proptest", false),
            ("syn", false),
        ] {
            assert_eq!(text.contains(&format!("\n{name} ")), is_linked, "{name}");
        }
    }

    #[test]
    fn packed_fmus_are_below_the_workspace() {
        let root = workspace_root().unwrap();
        assert!(root.join("fmus/kit/Cargo.toml").is_file());
        assert_eq!(default_folder().unwrap(), root.join("target/fmus"));
    }

    #[test]
    fn fmus_are_not_packed_into_a_file() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let told = build_fmus(file.path(), &FmiVersion::ALL).unwrap_err();
        assert!(matches!(told, PackError::File { .. }), "{told}");
        let told = build_component("fmus/shake_table", file.path(), &FmiVersion::ALL).unwrap_err();
        assert!(matches!(told, PackError::File { .. }), "{told}");
        let told = pack_libraries(&[], file.path(), &FmiVersion::ALL, None, false).unwrap_err();
        assert!(matches!(told, PackError::File { .. }), "{told}");
    }
}

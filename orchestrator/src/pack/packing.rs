//! From built libraries to FMUs on disk.

use std::{
    fs::{self, File},
    path::Path,
    sync::{Mutex, PoisonError},
};

use super::archive::{Compression, Contents, PackedFmu, write_archive};
use super::error::{PackError, file_error};
use super::notices::Notices;
use super::workspace::{Component, Workspace};
use crate::component_library::ComponentLibrary;
use crate::fmu::FmiVersion;

/// What FMUs are packed as.
#[derive(Debug, Clone, Copy)]
pub(super) struct Form<'a> {
    /// Versions of FMI.
    pub(super) versions: &'a [FmiVersion],
    /// Which build of the sources it is, written into the description.
    pub(super) revision: Option<&'a str>,
    /// How hard they are compressed.
    pub(super) compression: Compression,
}

/// Packs what `components` gives, as far as it is not there already.
pub(super) fn pack(
    workspace: &Workspace,
    components: impl FnOnce(&Workspace) -> Result<Vec<Component>, PackError>,
    out: &Path,
    form: Form,
) -> Result<Vec<PackedFmu>, PackError> {
    // One process at a time builds and packs: the first does the work, the others find it
    // done. Threads of one process share the lock of the file, so they need one of their own.
    static THREADS: Mutex<()> = Mutex::new(());
    let _turn = THREADS.lock().unwrap_or_else(PoisonError::into_inner);
    fs::create_dir_all(out).map_err(file_error(out))?;
    let lock_path = out.join(".lock");
    let lock = File::create(&lock_path).map_err(file_error(&lock_path))?;
    lock.lock().map_err(file_error(&lock_path))?;
    let licences = workspace.licences()?;
    let notices = Notices::read(&workspace.metadata()?)?;
    let mut packed = Vec::new();
    for component in components(workspace)? {
        let read = |library: &Path| fs::read(library).map_err(file_error(library));
        let libraries: Result<Vec<_>, _> = component
            .libraries
            .iter()
            .map(|(platform, library)| Ok((platform.clone(), read(library)?)))
            .collect();
        let contents = Contents {
            libraries: libraries?,
            descriptions: ComponentLibrary::open(&component.library)?.describe()?,
            licences: licences.clone(),
            notices: notices.of(&component.folder)?,
            revision: form.revision,
        };
        for version in form.versions {
            let folder = out.join(version.folder());
            fs::create_dir_all(&folder).map_err(file_error(&folder))?;
            let name = contents.descriptions.name.clone();
            let path = folder.join(format!("{name}.fmu"));
            write_archive(&path, &contents.entries(*version), form.compression)?;
            packed.push(PackedFmu {
                name,
                version: *version,
                path,
            });
        }
    }
    packed.sort_by(|a, b| (&a.name, a.version).cmp(&(&b.name, b.version)));
    Ok(packed)
}

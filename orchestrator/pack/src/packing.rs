//! From built libraries to FMUs on disk.

use std::{
    fs::{self, File},
    path::Path,
};

use rayon::prelude::*;

use super::archive::{Contents, PackedFmu, Smallest, write_archive};
use super::error::{PackError, file_error};
use super::notices::Notices;
use super::platform::Platform;
use super::workspace::{Component, Workspace};
use crate::component_library::ComponentLibrary;
use fmi_import::FmiVersion;

/// What FMUs are packed as.
#[derive(Debug, Clone, Copy)]
pub(super) struct Form<'a> {
    /// Versions of FMI.
    pub(super) versions: &'a [FmiVersion],
    /// Which build of the sources it is, written into the description.
    pub(super) revision: Option<&'a str>,
    /// Whether libraries are compressed as far as it goes.
    pub(super) smallest: bool,
}

/// Packs what `components` gives, as far as it is not there already.
pub(super) fn pack(
    workspace: &Workspace,
    components: impl FnOnce(&Workspace) -> Result<Vec<Component>, PackError>,
    out: &Path,
    form: Form,
) -> Result<Vec<PackedFmu>, PackError> {
    // One at a time builds and packs: the first does the work, the others find it done. Each opens the file of the
    // lock anew, so that it holds between threads too.
    fs::create_dir_all(out).map_err(file_error(out))?;
    let lock_path = out.join(".lock");
    let lock = File::create(&lock_path).map_err(file_error(&lock_path))?;
    lock.lock().map_err(file_error(&lock_path))?;
    let licences = workspace.licences()?;
    let notices = Notices::read(&workspace.metadata()?)?;
    let mut packed = Vec::new();
    let components = components(workspace)?;
    // In parallel only where it is slow: a pool's thread that waits here might take up work that
    // waits for the lock.
    let read: Result<Vec<_>, PackError> = match form.smallest {
        true => components.par_iter().map(|c| read(c, true)).collect(),
        false => components.iter().map(|c| read(c, false)).collect(),
    };
    for (component, (libraries, mut smallest)) in components.iter().zip(read?) {
        let contents = Contents {
            libraries,
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
            write_archive(&path, &contents.entries(*version), smallest.as_mut())?;
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

/// The libraries of a component, and on demand compressed as far as it goes.
type Libraries = (Vec<(Platform, Vec<u8>)>, Option<Smallest>);

fn read(component: &Component, smallest: bool) -> Result<Libraries, PackError> {
    let mut libraries = Vec::new();
    for (platform, library) in &component.libraries {
        let content = fs::read(library).map_err(file_error(library))?;
        libraries.push((platform.clone(), content));
    }
    let smallest = smallest
        .then(|| Smallest::of(&libraries).map_err(file_error(&component.library)))
        .transpose()?;
    Ok((libraries, smallest))
}

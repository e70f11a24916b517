//! A shared library and its functions.

use std::path::Path;

use libloading::Library;

use super::super::error::InstanceError;

/// A loaded library that names the functions it lacks.
pub(super) struct Functions {
    library: Library,
    prefix: &'static str,
    /// Functions that are needed and not there.
    pub missing: Vec<String>,
}

impl Functions {
    /// Loads the library at `path`, whose functions begin with `prefix`.
    ///
    /// # Errors
    /// The loader's own reason.
    pub(super) fn load(path: &Path, prefix: &'static str) -> Result<Self, InstanceError> {
        // SAFETY: an FMU's library runs code of its own when it is loaded; that is what it is for.
        let library = unsafe { open(path) }?;
        Ok(Self {
            library,
            prefix,
            missing: Vec::new(),
        })
    }

    /// A function that the standard lets a library be without, or that is seldom used.
    ///
    /// # Safety
    /// `F` is the type of that function.
    pub(super) unsafe fn optional<F: Copy>(&self, name: &str) -> Option<F> {
        let name = format!("{}{name}", self.prefix);
        // SAFETY: as above.
        let symbol = unsafe { self.library.get::<F>(name.as_str()) };
        symbol.ok().map(|symbol| *symbol)
    }

    /// A function that there must be; `missing` notes it if there is none.
    ///
    /// # Safety
    /// `F` is the type of that function.
    pub(super) unsafe fn needed<F: Copy>(&mut self, name: &str) -> Option<F> {
        // SAFETY: as above.
        let function = unsafe { self.optional(name) };
        if function.is_none() {
            self.missing.push(format!("{}{name}", self.prefix));
        }
        function
    }

    /// The library, once all its functions have been looked up.
    ///
    /// # Errors
    /// Needed functions that it lacks.
    pub(super) fn finish(self) -> Result<Library, InstanceError> {
        match self.missing.is_empty() {
            true => Ok(self.library),
            false => Err(InstanceError::Lacking(self.missing)),
        }
    }
}

#[cfg(unix)]
unsafe fn open(path: &Path) -> Result<Library, libloading::Error> {
    // SAFETY: the caller's.
    unsafe { Library::new(path) }
}

/// Libraries beside it in its folder are found.
#[cfg(windows)]
unsafe fn open(path: &Path) -> Result<Library, libloading::Error> {
    use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library as Windows};
    // SAFETY: the caller's.
    unsafe { Windows::load_with_flags(path, LOAD_WITH_ALTERED_SEARCH_PATH) }.map(Library::from)
}

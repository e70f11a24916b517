//! What a component's library says of itself, before it is packed.
#![allow(unsafe_code, reason = "functions of a library are called")]

use std::{
    ffi::{CStr, c_char},
    path::{Path, PathBuf},
};

use libloading::Library;

use crate::error::PackError;

/// Texts that go into an FMU.
#[derive(Debug, Clone)]
pub struct Descriptions {
    /// The component's name.
    pub name: String,
    /// `modelDescription.xml` of FMI 2.0.
    pub fmi2: String,
    /// `modelDescription.xml` of FMI 3.0.
    pub fmi3: String,
    /// `documentation/index.html`.
    pub documentation: String,
    /// `terminalsAndIcons.xml` of FMI 3.0.
    pub terminals: String,
}

/// A library built from a crate that exports a component with `fmu_kit::export!`.
pub struct ComponentLibrary {
    library: Library,
    path: PathBuf,
}

type Describe = unsafe extern "C" fn(i32) -> *mut c_char;
type FreeText = unsafe extern "C" fn(*mut c_char);

impl ComponentLibrary {
    /// Loads a library that this workspace's build has just made.
    ///
    /// # Errors
    /// When it cannot be loaded.
    pub fn open(path: &Path) -> Result<Self, PackError> {
        // SAFETY: the workspace's own code, which runs nothing when it is loaded.
        let library = unsafe { Library::new(path) }.map_err(|e| PackError::Library {
            library: path.into(),
            problem: e.to_string(),
        })?;
        Ok(Self {
            library,
            path: path.into(),
        })
    }

    /// Asks for the texts.
    ///
    /// # Errors
    /// The library is not a component, or its table of variables has a mistake.
    pub fn describe(&self) -> Result<Descriptions, PackError> {
        Ok(Descriptions {
            documentation: self.text(0)?,
            name: self.text(1)?,
            fmi2: self.text(2)?,
            fmi3: self.text(3)?,
            terminals: self.text(4)?,
        })
    }

    fn text(&self, what: i32) -> Result<String, PackError> {
        let fail = |problem: String| PackError::Library {
            library: self.path.clone(),
            problem,
        };
        // SAFETY: the signatures are those of `fmu_kit::export!`; the text is copied, then freed
        // by the library that made it.
        let text = unsafe {
            let describe = self.library.get::<Describe>(c"shakebench_describe");
            let free = self.library.get::<FreeText>(c"shakebench_free_text");
            let (Ok(describe), Ok(free)) = (describe, free) else {
                return Err(fail(
                    "is not a component: `fmu_kit::export!` is missing".into(),
                ));
            };
            let text = describe(what);
            if text.is_null() {
                return Err(fail("gave no description".into()));
            }
            let copy = CStr::from_ptr(text).to_string_lossy().into_owned();
            free(text);
            copy
        };
        match text.strip_prefix("error: ") {
            Some(problem) => Err(fail(problem.into())),
            None => Ok(text),
        }
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    /// A library of this source, as the compiler makes it.
    fn library(folder: &Path, name: &str, source: &str) -> PathBuf {
        let file = folder.join(format!("{name}.rs"));
        std::fs::write(&file, source).unwrap();
        let library = folder.join(format!("{name}.{}", std::env::consts::DLL_EXTENSION));
        let compiler = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_string());
        let made = Command::new(compiler)
            .args(["--edition", "2024", "--crate-type", "cdylib", "-o"])
            .arg(&library)
            .arg(&file)
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&made.stderr);
        assert!(made.status.success(), "{told}");
        library
    }

    /// Text 4 is missing, text 2 is a mistake if `is_wrong`; the library counts the texts that are not freed.
    fn source(is_wrong: bool) -> String {
        let xml = if is_wrong { "error: no unit" } else { "<two/>" };
        format!(
            r#"
use std::ffi::{{CString, c_char}};
use std::sync::atomic::{{AtomicI32, Ordering}};
static KEPT: AtomicI32 = AtomicI32::new(0);
#[unsafe(no_mangle)]
pub extern "C" fn shakebench_describe(what: i32) -> *mut c_char {{
    let text = match what {{
        0 => "<html/>".to_string(),
        1 => "Own".to_string(),
        2 => "{xml}".to_string(),
        3 => "<three/>".to_string(),
        4 => format!("{{}} are kept", KEPT.load(Ordering::Relaxed)),
        _ => return std::ptr::null_mut(),
    }};
    KEPT.fetch_add(1, Ordering::Relaxed);
    CString::new(text).unwrap().into_raw()
}}
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shakebench_free_text(text: *mut c_char) {{
    KEPT.fetch_sub(1, Ordering::Relaxed);
    drop(unsafe {{ CString::from_raw(text) }});
}}
"#
        )
    }

    #[test]
    fn a_component_describes_itself_and_frees_its_texts() {
        let folder = tempfile::tempdir().unwrap();
        let own = library(folder.path(), "own", &source(false));
        let own = ComponentLibrary::open(&own).unwrap();
        let texts = own.describe().unwrap();
        assert_eq!(
            [
                texts.name,
                texts.documentation,
                texts.fmi2,
                texts.fmi3,
                texts.terminals
            ],
            ["Own", "<html/>", "<two/>", "<three/>", "0 are kept"]
        );
        let told = own.text(5).unwrap_err().to_string();
        assert!(told.ends_with("gave no description"), "{told}");
    }

    #[test]
    fn a_library_that_is_not_a_component_is_refused_by_its_path() {
        let folder = tempfile::tempdir().unwrap();
        let told = |file: &Path| {
            let described = ComponentLibrary::open(file).and_then(|own| own.describe());
            let told = described.err().unwrap().to_string();
            let name = file.display().to_string();
            assert!(told.contains(&name), "{told}");
            told
        };
        let wrong = library(folder.path(), "wrong", &source(true));
        assert!(told(&wrong).ends_with(": no unit"));
        let other = library(folder.path(), "other", "");
        assert!(told(&other).contains("`fmu_kit::export!` is missing"));
        told(&folder.path().join("none"));
    }
}

//! Finding the project's workspace and letting cargo build its components.

use std::{
    fs::{self, File},
    io::{self, IsTerminal},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::{Mutex, PoisonError},
};

use super::archive::{PackedFmu, entries, write_archive};
use super::error::{PackError, file_error};
use crate::component_library::ComponentLibrary;
use crate::fmu::FmiVersion;

/// The project's folder.
pub(super) struct Workspace {
    pub(super) root: PathBuf,
}

/// A component as cargo has built it.
pub(super) struct Component {
    /// The folder of its crate.
    folder: PathBuf,
    /// Its dynamic library.
    pub(super) library: PathBuf,
}

impl Workspace {
    /// Looks upwards from the package that cargo runs, the present folder and the program.
    pub(super) fn find() -> Result<Self, PackError> {
        let here = std::env::current_dir().unwrap_or_default();
        let package = std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
        let program = std::env::current_exe().ok();
        let places = [package, Some(here.clone()), program];
        places
            .iter()
            .flatten()
            .flat_map(|place| place.ancestors())
            .find(|folder| folder.join("fmus/kit/Cargo.toml").is_file())
            .map(|root| Self { root: root.into() })
            .ok_or(PackError::NoWorkspace(here))
    }

    fn cargo(&self, arguments: &[&str]) -> Result<String, PackError> {
        let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
        // On a terminal people see cargo's progress; elsewhere it goes into the error, if any.
        let watched = io::stderr().is_terminal();
        let output = Command::new(&cargo)
            .args(arguments)
            .current_dir(&self.root)
            .stderr(if watched {
                Stdio::inherit()
            } else {
                Stdio::piped()
            })
            .output()
            .map_err(|error| PackError::NoCargo {
                cargo: cargo.clone(),
                error,
            })?;
        if !output.status.success() {
            return Err(PackError::Cargo {
                command: format!("cargo {}", arguments.join(" ")),
                output: String::from_utf8_lossy(&output.stderr).trim().into(),
            });
        }
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    /// Lets cargo build the libraries of every default member, and returns the dynamic ones.
    ///
    /// All of them, though components alone are asked for: cargo compiles a dependency once for
    /// every set of features that it is asked for, and only the selection of `cargo run` and
    /// `cargo test` finds what those have compiled.
    pub(super) fn build(&self) -> Result<Vec<Component>, PackError> {
        let answer = self.cargo(&[
            "build",
            "--release",
            "--lib",
            "--message-format",
            "json-render-diagnostics",
        ])?;
        let fail = |problem: String| PackError::Answer {
            command: "build",
            problem,
        };
        let mut components = Vec::new();
        for line in answer.lines() {
            let message: serde_json::Value =
                serde_json::from_str(line).map_err(|e| fail(e.to_string()))?;
            let manifest = message["manifest_path"].as_str().map(Path::new);
            let folder = manifest
                .and_then(Path::parent)
                .filter(|folder| folder.starts_with(&self.root));
            let (Some(folder), true) = (folder, kinds(&message["target"], "cdylib")) else {
                continue;
            };
            let files = message["filenames"].as_array().into_iter().flatten();
            let library = files
                .filter_map(|file| file.as_str().map(PathBuf::from))
                .find(|file| {
                    file.extension()
                        .is_some_and(|e| e == std::env::consts::DLL_EXTENSION)
                })
                .ok_or_else(|| fail(format!("no dynamic library of {}", folder.display())))?;
            components.push(Component {
                folder: folder.into(),
                library,
            });
        }
        Ok(components)
    }

    /// The components under `fmus/`: what the project publishes.
    pub(super) fn published(&self) -> Result<Vec<Component>, PackError> {
        let mut components = self.build()?;
        components.retain(|component| component.folder.parent() == Some(&self.root.join("fmus")));
        Ok(components)
    }

    /// The component whose crate lies in a folder, such as `tests/importers/faulty`.
    pub(super) fn component_in(&self, folder: &str) -> Result<Component, PackError> {
        let mut components = self.build()?.into_iter();
        components
            .find(|component| component.folder == self.root.join(folder))
            .ok_or_else(|| PackError::Answer {
                command: "build",
                problem: format!("no component in `{folder}`"),
            })
    }

    pub(super) fn pack(
        &self,
        components: impl FnOnce(&Self) -> Result<Vec<Component>, PackError>,
        out: &Path,
        versions: &[FmiVersion],
    ) -> Result<Vec<PackedFmu>, PackError> {
        // One process at a time builds and packs: the first does the work, the others find it
        // done. Threads of one process share the lock of the file, so they need one of their own.
        static THREADS: Mutex<()> = Mutex::new(());
        let _turn = THREADS.lock().unwrap_or_else(PoisonError::into_inner);
        fs::create_dir_all(out).map_err(file_error(out))?;
        let lock_path = out.join(".lock");
        let lock = File::create(&lock_path).map_err(file_error(&lock_path))?;
        lock.lock().map_err(file_error(&lock_path))?;
        let licences = self.licences()?;
        let mut packed = Vec::new();
        for Component { library, .. } in components(self)? {
            let binary = fs::read(&library).map_err(file_error(&library))?;
            let descriptions = ComponentLibrary::open(&library)?.describe()?;
            for version in versions {
                let folder = out.join(version.folder());
                fs::create_dir_all(&folder).map_err(file_error(&folder))?;
                let path = folder.join(format!("{}.fmu", descriptions.name));
                let entries = entries(*version, &descriptions, &binary, &licences);
                write_archive(&path, &entries)?;
                packed.push(PackedFmu {
                    name: descriptions.name.clone(),
                    version: *version,
                    path,
                });
            }
        }
        packed.sort_by(|a, b| (&a.name, a.version).cmp(&(&b.name, b.version)));
        Ok(packed)
    }

    fn licences(&self) -> Result<Vec<(String, Vec<u8>)>, PackError> {
        let mut licences = Vec::new();
        for name in ["LICENSE-APACHE", "LICENSE-MIT"] {
            let path = self.root.join(name);
            let text = fs::read(&path).map_err(file_error(&path))?;
            licences.push((format!("documentation/licenses/{name}.txt"), text));
        }
        Ok(licences)
    }
}

fn kinds(target: &serde_json::Value, kind: &str) -> bool {
    target["kind"]
        .as_array()
        .is_some_and(|kinds| kinds.iter().any(|k| k == kind))
}

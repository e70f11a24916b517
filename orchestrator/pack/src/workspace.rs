//! Finding the project's workspace and letting cargo build its components.

use std::{
    fs,
    io::{self, IsTerminal},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use super::error::{PackError, file_error};
use super::platform::Platform;
use crate::program;

/// The project's folder.
pub(super) struct Workspace {
    pub(super) root: PathBuf,
}

/// A component as cargo has built it.
pub(super) struct Component {
    /// The folder of its crate.
    pub(super) folder: PathBuf,
    /// Its dynamic library for this platform.
    pub(super) library: PathBuf,
    /// All its dynamic libraries.
    pub(super) libraries: Vec<(Platform, PathBuf)>,
}

/// The crate of a component, not built.
struct ComponentCrate {
    package: String,
    /// Its folder.
    folder: PathBuf,
    /// Name of its library, which is the FMU's.
    library: String,
}

impl Workspace {
    /// Looks upwards from the package that cargo runs, the present folder and the program.
    pub(super) fn find() -> Result<Self, PackError> {
        let here = std::env::current_dir().unwrap_or_default();
        let package = std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
        let program = program::file().ok();
        let places = [package, Some(here.clone()), program];
        places
            .iter()
            .flatten()
            .flat_map(|place| place.ancestors())
            .find(|folder| folder.join("fmus/kit/Cargo.toml").is_file())
            .map(|root| Self { root: root.into() })
            .ok_or(PackError::NoWorkspace(here))
    }

    /// The folder that FMUs are packed into unless another is asked for.
    pub(super) fn fmus(&self) -> PathBuf {
        self.root.join("target/fmus")
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

    /// Lets cargo build the libraries of packages and returns the dynamic ones.
    ///
    /// Cargo compiles a dependency once for every set of features that it is asked for. Every
    /// selection with the program in it asks for the same as `cargo run` and `cargo test`.
    fn build(&self, packages: &[&str]) -> Result<Vec<Component>, PackError> {
        let arguments = [
            "build",
            "--release",
            "--lib",
            "--message-format",
            "json-render-diagnostics",
        ];
        let answer = self.cargo(&[&arguments, packages].concat())?;
        let fail = |problem: String| PackError::Answer {
            command: "build",
            problem,
        };
        let here = Platform::here();
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
                libraries: here
                    .iter()
                    .map(|here| (here.clone(), library.clone()))
                    .collect(),
                library,
            });
        }
        Ok(components)
    }

    /// Lets cargo build a program of a package, and gives its file.
    pub(super) fn program(&self, name: &str, package: &str) -> Result<PathBuf, PackError> {
        let answer = self.cargo(&[
            "build",
            "--release",
            "--message-format",
            "json-render-diagnostics",
            "--bin",
            name,
            "-p",
            package,
            // For the features that everything else was compiled with.
            "-p",
            "shakebench",
        ])?;
        let mut messages = answer.lines().rev().filter_map(|line| {
            let message: serde_json::Value = serde_json::from_str(line).ok()?;
            let is_meant = message["target"]["name"] == name;
            let file = message["executable"].as_str().filter(|_| is_meant)?;
            Some(PathBuf::from(file))
        });
        messages.next().ok_or_else(|| PackError::Answer {
            command: "build",
            problem: format!("no program `{name}`"),
        })
    }

    /// Whether the crate in a folder is a component that the project publishes: of `fmus/`, or of the
    /// `fmus/` of a member of its own, such as `hybrid/`.
    fn publishes(&self, folder: &Path) -> bool {
        let parent = folder.strip_prefix(&self.root).ok().and_then(Path::parent);
        parent.and_then(Path::file_name) == Some("fmus".as_ref())
    }

    /// What the project publishes.
    pub(super) fn published(&self) -> Result<Vec<Component>, PackError> {
        let crates = self.crates()?;
        let mut packages = vec!["-p", "shakebench"];
        packages.extend(crates.iter().flat_map(|own| ["-p", &own.package]));
        let mut components = self.build(&packages)?;
        components.retain(|component| self.publishes(&component.folder));
        Ok(components)
    }

    /// The component whose crate lies in a folder, such as `tests/importers/faulty`.
    pub(super) fn component_in(&self, folder: &str) -> Result<Component, PackError> {
        let mut components = self.build(&["--workspace"])?.into_iter();
        components
            .find(|component| component.folder == self.root.join(folder))
            .ok_or_else(|| PackError::Answer {
                command: "build",
                problem: format!("no component in `{folder}`"),
            })
    }

    /// What the project publishes, from compiled libraries, one folder per platform.
    pub(super) fn published_from(
        &self,
        folders: &[(Platform, PathBuf)],
    ) -> Result<Vec<Component>, PackError> {
        let here = Platform::here();
        let own = folders
            .iter()
            .find(|(platform, _)| Some(platform) == here.as_ref());
        let Some((own_platform, own_folder)) = own else {
            let here = here.map_or("this platform".to_string(), |here| here.to_string());
            return Err(PackError::NoOwnLibraries(here));
        };
        let components = self.crates()?.into_iter().map(|own| {
            let name = &own.library;
            let file = |(platform, from): &(Platform, PathBuf)| {
                (platform.clone(), from.join(platform.library_file(name)))
            };
            Component {
                library: own_folder.join(own_platform.library_file(name)),
                libraries: folders.iter().map(file).collect(),
                folder: own.folder,
            }
        });
        Ok(components.collect())
    }

    /// The crates of the components that the project publishes.
    fn crates(&self) -> Result<Vec<ComponentCrate>, PackError> {
        let metadata: serde_json::Value =
            serde_json::from_str(&self.metadata()?).map_err(|error| PackError::Answer {
                command: "metadata",
                problem: error.to_string(),
            })?;
        let packages = metadata["packages"].as_array().into_iter().flatten();
        let crates = packages.filter_map(|package| {
            let folder = Path::new(package["manifest_path"].as_str()?).parent()?;
            let mut targets = package["targets"].as_array()?.iter();
            let library = targets.find(|target| kinds(target, "cdylib"))?;
            self.publishes(folder).then_some(ComponentCrate {
                package: package["name"].as_str()?.into(),
                folder: folder.into(),
                library: library["name"].as_str()?.into(),
            })
        });
        Ok(crates.collect())
    }

    /// What cargo tells of the packages and what they are built on.
    pub(super) fn metadata(&self) -> Result<String, PackError> {
        self.cargo(&["metadata", "--format-version", "1"])
    }

    /// The project's own licences, by file name.
    pub(super) fn licences(&self) -> Result<Vec<(String, Vec<u8>)>, PackError> {
        let mut licences = Vec::new();
        for name in ["LICENSE-APACHE", "LICENSE-MIT"] {
            let path = self.root.join(name);
            let text = fs::read(&path).map_err(file_error(&path))?;
            licences.push((format!("{name}.txt"), text));
        }
        Ok(licences)
    }
}

fn kinds(target: &serde_json::Value, kind: &str) -> bool {
    target["kind"]
        .as_array()
        .is_some_and(|kinds| kinds.iter().any(|k| k == kind))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn licences_are_those_of_the_project() {
        let licences = Workspace::find().unwrap().licences().unwrap();
        let [apache, mit] = &licences[..] else {
            panic!("{} licences", licences.len());
        };
        let holds = |text: &[u8], words: &str| String::from_utf8_lossy(text).contains(words);
        assert_eq!(apache.0, "LICENSE-APACHE.txt");
        assert!(holds(&apache.1, "Apache License"));
        assert_eq!(mit.0, "LICENSE-MIT.txt");
        assert!(holds(&mit.1, "WITHOUT WARRANTY OF ANY KIND"));
    }

    #[test]
    fn cargo_answers_or_its_command_is_named() {
        let workspace = Workspace::find().unwrap();
        let answer = workspace.cargo(&["--version"]).unwrap();
        assert!(answer.starts_with("cargo "), "{answer}");
        let told = workspace
            .cargo(&["no-such-command", "--quiet"])
            .unwrap_err();
        let told = told.to_string();
        assert!(
            told.starts_with("`cargo no-such-command --quiet` failed:"),
            "{told}"
        );
    }

    #[test]
    fn components_are_the_crates_in_a_folder_of_fmus() {
        let workspace = Workspace {
            root: "/project".into(),
        };
        let publishes = |folder: &str| workspace.publishes(Path::new(folder));
        assert!(publishes("/project/fmus/table") && publishes("/project/hybrid/fmus/ring"));
        for other in [
            "/project/fmus",
            "/project/plant",
            "/other/fmus/table",
            "/project/fmus/table/more",
        ] {
            assert!(!publishes(other), "{other}");
        }
        assert_eq!(workspace.fmus(), Path::new("/project/target/fmus"));
        let target = serde_json::json!({"kind": ["rlib", "cdylib"]});
        assert!(kinds(&target, "cdylib") && !kinds(&target, "bin"));
        assert!(!kinds(&serde_json::json!({}), "cdylib"));
    }

    #[test]
    fn compiled_libraries_are_looked_for_by_platform() {
        let workspace = Workspace::find().unwrap();
        let here = Platform::here().unwrap();
        let windows: Platform = "x86_64-windows".parse().unwrap();
        let folders = [
            (windows.clone(), PathBuf::from("/win")),
            (here.clone(), PathBuf::from("/here")),
        ];
        let components = workspace.published_from(&folders).unwrap();
        let folder = workspace.root.join("fmus/shake_table");
        let table = components.iter().find(|own| own.folder == folder).unwrap();
        assert_eq!(
            table.library,
            Path::new("/here").join(here.library_file("ShakeTable"))
        );
        assert_eq!(
            table.libraries,
            [
                (windows.clone(), PathBuf::from("/win/ShakeTable.dll")),
                (here, table.library.clone()),
            ]
        );
        assert!(
            components
                .iter()
                .all(|own| workspace.publishes(&own.folder))
        );
        let told = workspace
            .published_from(&[(windows, "/win".into())])
            .err()
            .unwrap();
        assert!(matches!(told, PackError::NoOwnLibraries(_)), "{told}");
    }
}

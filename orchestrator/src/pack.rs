//! Building the components and packing them as FMUs.
//!
//! A component is a library crate of type `cdylib` under `fmus/`; nothing else lists it. Cargo
//! builds it, and the built library tells its own name, model descriptions and documentation.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
    process::Command,
    sync::{Mutex, OnceLock, PoisonError},
};

use sha2::{Digest, Sha256};
use thiserror::Error;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter, write::SimpleFileOptions};

use crate::component_library::{ComponentLibrary, Descriptions};

/// Version of the FMI standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FmiVersion {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

impl FmiVersion {
    /// Both versions.
    pub const ALL: [Self; 2] = [Self::Two, Self::Three];

    /// The folder of this version: `fmi2` or `fmi3`.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Two => "fmi2",
            Self::Three => "fmi3",
        }
    }

    /// The folder inside an FMU that holds the library for this machine.
    pub fn binaries(self) -> String {
        let (os, arch) = (std::env::consts::OS, std::env::consts::ARCH);
        match (self, os, arch) {
            (Self::Two, "linux", "x86_64") => "binaries/linux64".into(),
            (Self::Two, "windows", "x86_64") => "binaries/win64".into(),
            (Self::Two, "macos", "x86_64") => "binaries/darwin64".into(),
            (_, "macos", arch) => format!("binaries/{arch}-darwin"),
            (_, os, arch) => format!("binaries/{arch}-{os}"),
        }
    }
}

/// An FMU that was packed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PackedFmu {
    /// The component's name.
    pub name: String,
    /// The version it is packed for.
    pub version: FmiVersion,
    /// The archive.
    pub path: PathBuf,
}

/// Why FMUs could not be built or packed.
#[derive(Debug, Error)]
pub enum PackError {
    /// The program does not run inside its workspace.
    #[error(
        "no workspace with `fmus/kit` found above {0}: components are built from source, so run \
         this inside the project's folder"
    )]
    NoWorkspace(PathBuf),
    /// Cargo could not be started.
    #[error("cannot start `{cargo}`, which builds the components: {error}")]
    NoCargo {
        /// The command.
        cargo: String,
        /// What the system says.
        error: io::Error,
    },
    /// Cargo failed.
    #[error("`{command}` failed:\n{output}")]
    Cargo {
        /// The command.
        command: String,
        /// What it wrote to standard error.
        output: String,
    },
    /// Cargo's answer has another form than expected.
    #[error("`cargo {command}` answered in an unexpected form: {problem}")]
    Answer {
        /// The subcommand.
        command: &'static str,
        /// What was missing.
        problem: String,
    },
    /// A library does not describe itself as a component does.
    #[error("{library}: {problem}")]
    Library {
        /// The library.
        library: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A file could not be read or written.
    #[error("{path}: {error}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// FMUs could not be packed earlier in this process.
    #[error("{0}")]
    Earlier(String),
}

pub(crate) fn file_error(path: &Path) -> impl FnOnce(io::Error) -> PackError {
    let path = path.to_path_buf();
    move |error| PackError::File { path, error }
}

/// Builds every component and packs it as `out/fmi2/NAME.fmu` and `out/fmi3/NAME.fmu`, as far as
/// it is not there already. Sorted by name, then version.
///
/// # Errors
/// When the workspace, cargo or the folder is not usable, or a component does not compile.
pub fn build_fmus(out: &Path, versions: &[FmiVersion]) -> Result<Vec<PackedFmu>, PackError> {
    let workspace = Workspace::find()?;
    let packages = workspace.packages_under("fmus")?;
    workspace.pack(&packages, out, versions)
}

/// Builds and packs one package of the workspace that [`build_fmus`] does not list, such as a
/// component made for tests.
///
/// # Errors
/// As [`build_fmus`].
pub fn build_package(
    package: &str,
    out: &Path,
    versions: &[FmiVersion],
) -> Result<Vec<PackedFmu>, PackError> {
    Workspace::find()?.pack(&[package.to_string()], out, versions)
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
    let workspace = Workspace::find()?;
    let packages = workspace.packages_under("fmus")?;
    let mut files = Vec::new();
    for library in workspace.build(&packages)? {
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

struct Workspace {
    root: PathBuf,
}

impl Workspace {
    /// Looks upwards from the package that cargo runs, the present folder and the program.
    fn find() -> Result<Self, PackError> {
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
        let output = Command::new(&cargo)
            .args(arguments)
            .current_dir(&self.root)
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

    /// Names of the packages under a folder that have a `cdylib`.
    fn packages_under(&self, folder: &str) -> Result<Vec<String>, PackError> {
        let answer = self.cargo(&["metadata", "--no-deps", "--format-version", "1"])?;
        let fail = |problem: String| PackError::Answer {
            command: "metadata",
            problem,
        };
        let metadata: serde_json::Value =
            serde_json::from_str(&answer).map_err(|e| fail(e.to_string()))?;
        let packages = metadata["packages"]
            .as_array()
            .ok_or_else(|| fail("no `packages`".into()))?;
        let within = |package: &&serde_json::Value| {
            let manifest = package["manifest_path"].as_str().map(Path::new);
            let above = manifest.and_then(|m| m.parent()?.parent()?.file_name());
            above.is_some_and(|above| above == folder)
        };
        Ok(packages
            .iter()
            .filter(within)
            .filter(|package| targets(&package["targets"]).any(|t| kinds(t, "cdylib")))
            .filter_map(|package| package["name"].as_str().map(String::from))
            .collect())
    }

    /// Builds packages and returns their dynamic libraries.
    fn build(&self, packages: &[String]) -> Result<Vec<PathBuf>, PackError> {
        let mut arguments = vec![
            "build",
            "--release",
            "--message-format",
            "json-render-diagnostics",
        ];
        for package in packages {
            arguments.extend(["-p", package]);
        }
        let answer = self.cargo(&arguments)?;
        let fail = |problem: String| PackError::Answer {
            command: "build",
            problem,
        };
        let mut libraries = Vec::new();
        for line in answer.lines() {
            let message: serde_json::Value =
                serde_json::from_str(line).map_err(|e| fail(e.to_string()))?;
            let manifest = message["manifest_path"].as_str().map(Path::new);
            let ours = manifest.is_some_and(|manifest| manifest.starts_with(&self.root));
            if !ours || !kinds(&message["target"], "cdylib") {
                continue;
            }
            let files = message["filenames"].as_array().into_iter().flatten();
            let extension = std::env::consts::DLL_EXTENSION;
            libraries.extend(
                files
                    .filter_map(|file| file.as_str().map(PathBuf::from))
                    .filter(|file| file.extension().is_some_and(|e| e == extension)),
            );
        }
        if libraries.len() != packages.len() {
            let (found, wanted) = (libraries.len(), packages.join(", "));
            return Err(fail(format!("{found} dynamic libraries for {wanted}")));
        }
        Ok(libraries)
    }

    fn pack(
        &self,
        packages: &[String],
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
        for library in self.build(packages)? {
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

fn targets(targets: &serde_json::Value) -> impl Iterator<Item = &serde_json::Value> {
    targets.as_array().into_iter().flatten()
}

fn kinds(target: &serde_json::Value, kind: &str) -> bool {
    target["kind"]
        .as_array()
        .is_some_and(|kinds| kinds.iter().any(|k| k == kind))
}

const LICENCE: &str = "This FMU is licensed under either of the Apache License, Version 2.0, or \
                       the MIT license, at your option; both texts lie beside this file.\n";

/// Names and contents of an FMU's files, sorted; a name that ends in a slash is a folder.
fn entries(
    version: FmiVersion,
    descriptions: &Descriptions,
    binary: &[u8],
    licences: &[(String, Vec<u8>)],
) -> Vec<(String, Vec<u8>)> {
    let description = match version {
        FmiVersion::Two => &descriptions.fmi2,
        FmiVersion::Three => &descriptions.fmi3,
    };
    let library = format!(
        "{}/{}{}",
        version.binaries(),
        descriptions.name,
        std::env::consts::DLL_SUFFIX
    );
    let mut entries = vec![
        (
            "modelDescription.xml".to_string(),
            description.clone().into_bytes(),
        ),
        (
            "documentation/index.html".into(),
            descriptions.documentation.clone().into_bytes(),
        ),
        ("documentation/licenses/license.txt".into(), LICENCE.into()),
        ("resources/".into(), Vec::new()),
        (library, binary.to_vec()),
    ];
    entries.extend_from_slice(licences);
    entries.sort();
    entries
}

/// Writes an archive unless it is there with the same contents. The same contents give the same
/// bytes; a reader never sees half an archive.
fn write_archive(path: &Path, entries: &[(String, Vec<u8>)]) -> Result<(), PackError> {
    let mut sum = Sha256::new();
    for (name, content) in entries {
        sum.update((name.len() as u64).to_le_bytes());
        sum.update(name);
        sum.update((content.len() as u64).to_le_bytes());
        sum.update(content);
    }
    let stamp: String = sum
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    let old = File::open(path)
        .ok()
        .and_then(|file| ZipArchive::new(file).ok());
    if old.is_some_and(|archive| archive.comment() == stamp.as_bytes()) {
        return Ok(());
    }
    let draft = path.with_extension(format!("fmu.{}", std::process::id()));
    let written = write_entries(&draft, entries, stamp);
    let moved = written.and_then(|()| fs::rename(&draft, path));
    if moved.is_err() {
        let _ = fs::remove_file(&draft);
    }
    moved.map_err(file_error(path))
}

fn write_entries(path: &Path, entries: &[(String, Vec<u8>)], stamp: String) -> io::Result<()> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default());
    let mut archive = ZipWriter::new(File::create(path)?);
    archive.set_comment(stamp).map_err(io::Error::from)?;
    for (name, content) in entries {
        if let Some(folder) = name.strip_suffix('/') {
            archive.add_directory(folder, options.unix_permissions(0o755))?;
            continue;
        }
        let mode = if name.starts_with("binaries/") {
            0o755
        } else {
            0o644
        };
        archive.start_file(name, options.unix_permissions(mode))?;
        archive.write_all(content)?;
    }
    archive.finish()?.sync_all()
}

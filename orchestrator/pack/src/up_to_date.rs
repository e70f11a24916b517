//! Whether the packed FMUs are still those of the sources, told without asking cargo.
//!
//! Next to the FMUs is a stamp of everything that they were made from. It holds length and time of
//! every file of the workspace's packages, of its manifest and lock, of the packing program, and of
//! the FMUs themselves. It also holds the settings of cargo and rustc in the environment. Whatever
//! differs, be it a new or a missing file, sends the question to cargo. Only another compiler under
//! the same sources goes unnoticed; `shakebench build` always asks.

use std::{
    collections::{BTreeMap, BTreeSet},
    env,
    ffi::OsStr,
    fmt::Write,
    fs, io,
    path::{Path, PathBuf},
    time::UNIX_EPOCH,
};

use serde::Deserialize;

use super::archive::{PackedFmu, fmus_in};
use super::workspace::Workspace;
use crate::program;

/// Where it is noted, for each program that packs; a test is one as well.
fn file(folder: &Path) -> io::Result<PathBuf> {
    let program = program::file()?;
    let name = program.file_name().unwrap_or_default().to_string_lossy();
    Ok(folder.join(format!(".made-from.{name}")))
}

/// What the packages were before they were built; a change while they are is thus noticed.
pub(super) struct Sources {
    packages: BTreeSet<PathBuf>,
    stamp: String,
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    source: Option<String>,
    manifest_path: PathBuf,
}

impl Sources {
    /// The workspace as it is; `None` if cargo does not list its packages or a file is unreadable;
    /// in this case there is no stamp.
    pub(super) fn read(workspace: &Workspace) -> Option<Self> {
        let metadata: Metadata = serde_json::from_str(&workspace.metadata().ok()?).ok()?;
        let own = metadata.packages.iter().filter(|p| p.source.is_none());
        let packages: BTreeSet<PathBuf> = own
            .filter_map(|package| package.manifest_path.parent().map(Path::to_path_buf))
            .collect();
        let stamp = stamp(&workspace.root, &packages).ok()?;
        Some(Self { packages, stamp })
    }

    /// Notes that the FMUs in a folder were made from these sources. Where that fails, cargo is asked
    /// again, which is all that is lost.
    pub(super) fn note(self, folder: &Path, fmus: &[PackedFmu]) {
        let write = || -> io::Result<()> {
            let file = file(folder)?;
            let draft = file.with_extension(format!("draft.{}", std::process::id()));
            let text = text(&self.packages, &self.stamp, fmus)?;
            let written = fs::write(&draft, text).and_then(|()| fs::rename(&draft, file));
            if written.is_err() {
                let _ = fs::remove_file(&draft);
            }
            written
        };
        let _ = write();
    }
}

/// The FMUs in a folder, if they are still those of the workspace's sources.
pub(super) fn packed(workspace: &Workspace, folder: &Path) -> Option<Vec<PackedFmu>> {
    let noted = fs::read_to_string(file(folder).ok()?).ok()?;
    let named = |what: &str| -> BTreeSet<PathBuf> {
        let lines = noted.lines().filter_map(|line| line.strip_prefix(what));
        lines.map(PathBuf::from).collect()
    };
    let (packages, made) = (named("package "), named("fmu "));
    // What else lies there is of components that are no more.
    let mut fmus = fmus_in(folder).ok()?;
    fmus.retain(|fmu| made.contains(&fmu.path));
    let stamp = stamp(&workspace.root, &packages).ok()?;
    let now = text(&packages, &stamp, &fmus).ok()?;
    (now == noted && !fmus.is_empty()).then_some(fmus)
}

/// What is noted: packages, their stamp, and the FMUs with theirs.
fn text(packages: &BTreeSet<PathBuf>, stamp: &str, fmus: &[PackedFmu]) -> io::Result<String> {
    let mut text = String::new();
    let mut files = BTreeMap::new();
    for package in packages {
        let _ = writeln!(text, "package {}", package.display());
    }
    for fmu in fmus {
        let _ = writeln!(text, "fmu {}", fmu.path.display());
        note(&fmu.path, &mut files)?;
    }
    Ok(text + &lines(&files) + stamp)
}

fn lines(files: &BTreeMap<PathBuf, String>) -> String {
    let lines = files.iter();
    lines
        .map(|(file, state)| format!("{} {state}\n", file.display()))
        .collect()
}

fn stamp(root: &Path, packages: &BTreeSet<PathBuf>) -> io::Result<String> {
    let mut files = BTreeMap::new();
    for name in ["Cargo.toml", "Cargo.lock", "LICENSE-APACHE", "LICENSE-MIT"] {
        note(&root.join(name), &mut files)?;
    }
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| env::home_dir().map(|home| home.join(".cargo")));
    let settings = [root.join(".cargo"), home.unwrap_or_default()].into_iter();
    let settings = settings.flat_map(|at| ["config.toml", "config"].map(|name| at.join(name)));
    let toolchains = ["rust-toolchain.toml", "rust-toolchain"].map(|name| root.join(name));
    for file in settings.chain(toolchains) {
        if file.is_file() {
            note(&file, &mut files)?;
        }
    }
    note(&program::file()?, &mut files)?;
    for package in packages {
        walk(package, packages, &mut files)?;
    }
    // A package that joins, by the pattern in the manifest, lies beside another.
    let beside: BTreeSet<&Path> = packages.iter().filter_map(|p| p.parent()).collect();
    for folder in beside {
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            if !packages.contains(&path) && path.join("Cargo.toml").is_file() && path != root {
                files.insert(path, "not a package of the workspace".into());
            }
        }
    }
    let mut text = lines(&files);
    let mut set: Vec<_> = env::vars_os()
        .filter(|(name, _)| changes_the_build(name))
        .collect();
    set.sort();
    for (name, value) in set {
        let _ = writeln!(text, "{}={}", name.display(), value.display());
    }
    Ok(text)
}

/// Environment variables that cargo and rustc heed; those that `cargo run` sets itself are others.
fn changes_the_build(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    ["RUSTFLAGS", "RUSTC", "CARGO_ENCODED_RUSTFLAGS"].contains(&&*name)
        || ["RUSTC_", "CARGO_BUILD_", "CARGO_PROFILE_", "CARGO_TARGET_"]
            .iter()
            .any(|begin| name.starts_with(begin))
}

fn walk(
    folder: &Path,
    packages: &BTreeSet<PathBuf>,
    files: &mut BTreeMap<PathBuf, String>,
) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let (path, name) = (entry.path(), entry.file_name());
        // A package within a package is walked by itself.
        let is_by_product = ["target", "__pycache__"]
            .iter()
            .any(|other| name == **other);
        if is_by_product || name.to_string_lossy().starts_with('.') || packages.contains(&path) {
            continue;
        }
        match fs::metadata(&path)?.is_dir() {
            true => walk(&path, packages, files)?,
            false => note(&path, files)?,
        }
    }
    Ok(())
}

fn note(path: &Path, files: &mut BTreeMap<PathBuf, String>) -> io::Result<()> {
    let of = fs::metadata(path)?;
    let time = of.modified()?.duration_since(UNIX_EPOCH);
    let time = time.map_err(io::Error::other)?.as_nanos();
    files.insert(path.into(), format!("{} {time}", of.len()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_may_change_an_fmu_changes_the_stamp() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let put = |name: &str, text: &str| {
            let path = root.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        for name in ["Cargo.toml", "Cargo.lock", "LICENSE-APACHE", "LICENSE-MIT"] {
            put(name, "");
        }
        put("fmus/a/Cargo.toml", "");
        put("fmus/a/src/lib.rs", "1");
        let packages = BTreeSet::from([root.join("fmus/a")]);
        let stamp = || stamp(root, &packages).unwrap();
        let mut before = stamp();
        assert_eq!(stamp(), before);
        for name in [
            "results/run.csv",
            "fmus/a/target/x",
            "fmus/a/.swp",
            "fmus/notes",
        ] {
            put(name, "by-product");
            assert_eq!(stamp(), before, "{name}");
        }
        for (name, text) in [
            ("fmus/a/src/lib.rs", "22"),
            ("fmus/a/src/new.rs", ""),
            ("Cargo.lock", "3"),
            ("rust-toolchain.toml", ""),
            (".cargo/config.toml", ""),
            ("fmus/b/Cargo.toml", ""),
        ] {
            put(name, text);
            let after = stamp();
            assert_ne!(after, before, "{name}");
            before = after;
        }
        fs::remove_file(root.join("fmus/a/src/new.rs")).unwrap();
        assert_ne!(stamp(), before);
    }

    #[test]
    fn fmus_are_up_to_date_until_a_source_or_one_of_them_changes() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for name in ["Cargo.toml", "Cargo.lock", "LICENSE-APACHE", "LICENSE-MIT"] {
            fs::write(root.join(name), "").unwrap();
        }
        let package = root.join("fmus/one");
        fs::create_dir_all(&package).unwrap();
        fs::write(package.join("lib.rs"), "1").unwrap();
        let out = root.join("target/fmus");
        fs::create_dir_all(out.join("fmi3")).unwrap();
        let path = out.join("fmi3/One.fmu");
        fs::write(&path, "an FMU").unwrap();
        let workspace = Workspace { root: root.into() };
        let fmus = fmus_in(&out).unwrap();
        assert_eq!(fmus.len(), 1);
        assert!(packed(&workspace, &out).is_none(), "nothing is noted");
        let note = || {
            let packages = BTreeSet::from([package.clone()]);
            let stamp = stamp(root, &packages).unwrap();
            Sources { packages, stamp }.note(&out, &fmus);
        };
        note();
        let noted = fs::read_to_string(file(&out).unwrap()).unwrap();
        let begin = format!("package {}\nfmu {}\n", package.display(), path.display());
        assert!(noted.starts_with(&begin), "{noted}");
        assert_eq!(fs::read_dir(&out).unwrap().count(), 2, "no draft is left");
        assert_eq!(packed(&workspace, &out).as_deref(), Some(&fmus[..]));
        // Another FMU in the folder is that of a component that is no more.
        fs::write(out.join("fmi3/Old.fmu"), "").unwrap();
        assert_eq!(packed(&workspace, &out).as_deref(), Some(&fmus[..]));
        fs::write(package.join("lib.rs"), "22").unwrap();
        assert!(packed(&workspace, &out).is_none());
        note();
        assert!(packed(&workspace, &out).is_some());
        fs::write(&path, "another FMU").unwrap();
        assert!(packed(&workspace, &out).is_none());
        fs::remove_file(&path).unwrap();
        assert!(packed(&workspace, &out).is_none());
    }

    #[test]
    fn settings_of_the_compiler_change_the_build() {
        let changes = |name: &str| changes_the_build(OsStr::new(name));
        for name in [
            "RUSTFLAGS",
            "RUSTC",
            "RUSTC_WRAPPER",
            "CARGO_PROFILE_RELEASE_LTO",
            "CARGO_BUILD_JOBS",
        ] {
            assert!(changes(name), "{name}");
        }
        for name in ["CARGO", "CARGO_PKG_NAME", "HOME", "MY_RUSTFLAGS"] {
            assert!(!changes(name), "{name}");
        }
    }
}

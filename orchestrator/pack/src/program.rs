//! This program: its version, and where its file lies.

use std::env;
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};

/// Its version, which is that of its components too.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The program's file, with links resolved where that can be done.
///
/// Where the system does not tell (no `/proc`, as in a bare chroot), it is looked for by the name
/// that the program was started with.
///
/// # Errors
/// It is not found either way.
pub fn file() -> io::Result<PathBuf> {
    let found = env::current_exe().or_else(|error| {
        let started = env::args_os().next();
        let path = env::var_os("PATH").unwrap_or_default();
        started.and_then(|name| by_name(&name, &path)).ok_or(error)
    })?;
    Ok(found.canonicalize().unwrap_or(found))
}

/// The program that carries out calls of FMUs in processes of their own: the one named in `SHAKEBENCH_PROGRAM`, this one
/// if it has the name, or one beside it. A test's program lies in a folder below.
#[must_use]
pub fn guest() -> Option<PathBuf> {
    if let Some(named) = env::var_os("SHAKEBENCH_PROGRAM") {
        return Some(named.into());
    }
    let name = format!("shakebench{}", env::consts::EXE_SUFFIX);
    let own = file().ok()?;
    let is_called = own.file_name().is_some_and(|file| file == name.as_str());
    if is_called {
        return Some(own);
    }
    own.ancestors()
        .skip(1)
        .take(2)
        .map(|folder| folder.join(&name))
        .find(|path| path.is_file())
}

/// The file that a shell starts under a name, which may be a path.
fn by_name(name: &OsStr, path: &OsStr) -> Option<PathBuf> {
    if Path::new(name).components().count() > 1 {
        return std::path::absolute(name).ok();
    }
    env::split_paths(path)
        .map(|folder| folder.join(name))
        .find(|file| file.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_is_found_by_the_name_it_was_started_with() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("program");
        std::fs::write(&own, "").unwrap();
        let path = env::join_paths([Path::new("/nowhere"), folder.path()]).unwrap();
        assert_eq!(
            by_name(OsStr::new("program"), &path).as_deref(),
            Some(&*own)
        );
        assert_eq!(by_name(OsStr::new("another"), &path), None);
        let relative = by_name(OsStr::new("./program"), OsStr::new("")).unwrap();
        assert!(relative.is_absolute() && relative.ends_with("program"));
        assert!(file().is_ok());
    }
}

//! Where FMUs are unpacked: a temporary folder that is locked while it is in use. Folders of
//! processes that were killed are removed by the next one.

use std::fs::{self, DirBuilder, File};
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

const PREFIX: &str = "shakebench-fmu-";
const LOCK: &str = ".shakebench-lock";
/// A folder may be younger than its lock.
const YOUNG: Duration = Duration::from_secs(60);

/// A temporary folder, removed with everything in it.
#[derive(Debug)]
pub struct Folder {
    // The lock goes first.
    _lock: File,
    directory: Removed,
}

/// A file or a folder, made by whoever owns this, that is removed when this is dropped.
#[derive(Debug)]
pub(crate) struct Removed(pub(crate) PathBuf);

/// A path in the folder for temporary files where nothing is.
pub(crate) fn unused(prefix: &str) -> PathBuf {
    std::env::temp_dir().join(format!("{prefix}{}", unique()))
}

impl Drop for Removed {
    fn drop(&mut self) {
        // A folder is not removed as a file is; what is gone already is no loss.
        let _ = fs::remove_file(&self.0).or_else(|_| fs::remove_dir_all(&self.0));
    }
}

/// A word that nothing else has, and that nobody else can foresee.
pub(crate) fn unique() -> String {
    // Two may be made at one reading of the clock.
    let random = RandomState::new().hash_one(());
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let now = now.map_or(0, |since| since.as_nanos());
    format!("{}-{random:x}-{now}", std::process::id())
}

impl Folder {
    /// Makes a folder.
    ///
    /// # Errors
    /// The system's.
    pub fn new() -> io::Result<Self> {
        static SWEPT: Once = Once::new();
        SWEPT.call_once(|| sweep(&std::env::temp_dir()));
        let path = unused(PREFIX);
        let mut builder = DirBuilder::new();
        builder.recursive(false);
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.create(&path)?;
        let directory = Removed(path);
        let lock = File::create(directory.0.join(LOCK))?;
        // Where there are no locks, nothing is swept either.
        let _ = lock.try_lock();
        Ok(Self {
            _lock: lock,
            directory,
        })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.directory.0
    }
}

/// Removes folders that no process holds any more.
fn sweep(temporary: &Path) {
    let entries = fs::read_dir(temporary).into_iter().flatten().flatten();
    for entry in entries {
        if !entry.file_name().to_string_lossy().starts_with(PREFIX) {
            continue;
        }
        let age = entry.metadata().and_then(|data| data.modified()).ok();
        let is_old = age.is_some_and(|then| then.elapsed().is_ok_and(|age| age > YOUNG));
        let lock = File::open(entry.path().join(LOCK));
        if is_old && lock.is_ok_and(|lock| lock.try_lock().is_ok()) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

    use super::*;

    #[test]
    fn folders_differ_and_go_with_what_is_in_them() {
        let [one, two] = [(); 2].map(|()| Folder::new().unwrap());
        assert_ne!(one.path(), two.path());
        let file = one.path().join("inner/file");
        fs::create_dir(file.parent().unwrap()).unwrap();
        fs::write(&file, "text").unwrap();
        let path = one.path().to_path_buf();
        assert!(path.starts_with(std::env::temp_dir()));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = fs::metadata(&path).unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o700);
        }
        drop(one);
        assert!(!path.exists() && two.path().exists());
        let path = unused("shakebench-test-");
        fs::write(&path, "text").unwrap();
        drop(Removed(path.clone()));
        assert!(!path.exists());
    }
}

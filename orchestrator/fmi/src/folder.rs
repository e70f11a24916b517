//! Where FMUs are unpacked: a temporary folder that is locked while it is in use. Folders of
//! processes that were killed are removed by the next one.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::Once;
use std::time::Duration;

const PREFIX: &str = "shakebench-fmu-";
const LOCK: &str = ".shakebench-lock";
/// A folder may be younger than its lock.
const YOUNG: Duration = Duration::from_secs(60);

/// A temporary folder, removed with everything in it.
#[derive(Debug)]
pub struct Folder {
    // The lock goes first.
    _lock: File,
    directory: tempfile::TempDir,
}

impl Folder {
    /// Makes a folder.
    ///
    /// # Errors
    /// The system's.
    pub fn new() -> io::Result<Self> {
        static SWEPT: Once = Once::new();
        SWEPT.call_once(|| sweep(&std::env::temp_dir()));
        let directory = tempfile::Builder::new().prefix(PREFIX).tempdir()?;
        let lock = File::create(directory.path().join(LOCK))?;
        // Where there are no locks, nothing is swept either.
        let _ = lock.try_lock();
        Ok(Self {
            _lock: lock,
            directory,
        })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.directory.path()
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

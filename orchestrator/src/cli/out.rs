//! Where a command's results go, and `--force`.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use laboratory::results::{self, Out};

static IS_FORCED: AtomicBool = AtomicBool::new(false);

/// Lets this command replace files that differ.
pub fn force() {
    IS_FORCED.store(true, Ordering::Relaxed);
}

/// Whether this command may replace files that differ.
pub fn is_forced() -> bool {
    IS_FORCED.load(Ordering::Relaxed)
}

/// The folder or file at `path`, for results.
pub fn given(path: impl Into<PathBuf>) -> Out {
    Out::new(path).replacing(is_forced())
}

/// As [`results::unused`].
pub fn unused(folder: &Path, is_same: impl Fn(&Path) -> bool) -> Out {
    results::unused(&given(folder), is_same)
}

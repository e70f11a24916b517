//! Where a command's results go, `--force`, `--units`, and where components come from.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use laboratory::results::{self, Out};
use pack::{Installation, program};
use pages::report::UnitSystem;

static INSTALLATION: OnceLock<Installation> = OnceLock::new();
static UNITS: OnceLock<UnitSystem> = OnceLock::new();
static IS_FORCED: AtomicBool = AtomicBool::new(false);

/// Lets this command replace files that differ.
pub fn force() {
    IS_FORCED.store(true, Ordering::Relaxed);
}

/// Whether this command may replace files that differ.
pub fn is_forced() -> bool {
    IS_FORCED.load(Ordering::Relaxed)
}

/// Reads this command's results in `units`.
pub fn choose(units: UnitSystem) {
    // The first holds; there is no second.
    let _ = UNITS.set(units);
}

/// Units that were asked for.
pub fn asked_units() -> Option<UnitSystem> {
    UNITS.get().copied()
}

/// Units of what this command prints.
pub fn units() -> UnitSystem {
    asked_units().unwrap_or_default()
}

/// The folder or file at `path`, for results.
pub fn given(path: impl Into<PathBuf>) -> Out {
    Out::new(path)
        .replacing(is_forced())
        .in_units(asked_units())
}

/// As [`results::unused`].
pub fn unused(folder: &Path, is_same: impl Fn(&Path) -> bool) -> Out {
    results::unused(&given(folder), is_same)
}

/// Takes components from the folder of `--fmus`, and this program for processes of FMUs whatever its file is called.
pub fn install(named: Option<PathBuf>) {
    let own = std::env::var_os("SHAKEBENCH_PROGRAM").map(PathBuf::from);
    let installation = Installation::new(named, own.or(program::file().ok()));
    // The first holds; there is no second.
    let _ = INSTALLATION.set(installation);
}

/// Where this command's components come from.
pub fn installation() -> &'static Installation {
    INSTALLATION.get_or_init(Installation::default)
}

//! Data that lie beside the project and are not part of it.

use std::path::PathBuf;

/// The shared folder; a test that uses it says so by `needs::shared`.
///
/// # Panics
/// When it is missing.
pub fn folder() -> PathBuf {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let folder = std::env::var_os("SHAKEBENCH_SHARED").map_or_else(beside, PathBuf::from);
    assert!(
        folder.is_dir(),
        "{} is missing (set SHAKEBENCH_SHARED)",
        folder.display()
    );
    folder
}

/// The records of earthquakes, in alphabetical order.
///
/// # Panics
/// When they are not all there.
pub fn records() -> Vec<PathBuf> {
    let folder = folder();
    let entries = std::fs::read_dir(folder.join("records"))
        .into_iter()
        .flatten();
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "csv" || e == "AT2"));
    files.sort();
    assert_eq!(files.len(), 8, "{} holds eight records", folder.display());
    files
}

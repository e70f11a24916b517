//! Data that lie beside the project and are not part of it.

use std::path::PathBuf;

/// The shared folder, or none (with a word on standard error) where it is missing.
pub fn folder() -> Option<PathBuf> {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let folder = std::env::var_os("SHAKEBENCH_SHARED").map_or_else(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!(
        "SKIPPED: {} is missing (set SHAKEBENCH_SHARED)",
        folder.display()
    );
    None
}

/// The records of earthquakes, in alphabetical order; none where they are missing.
pub fn records() -> Vec<PathBuf> {
    let Some(folder) = folder() else {
        return Vec::new();
    };
    let entries = std::fs::read_dir(folder.join("records"))
        .into_iter()
        .flatten();
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "csv" || e == "AT2"));
    files.sort();
    assert_eq!(files.len(), 8, "{} holds eight records", folder.display());
    files
}

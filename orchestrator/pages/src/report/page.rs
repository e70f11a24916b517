//! The page of a report, as a file.

use std::path::{Path, PathBuf};

use super::{Report, UnitSystem, html};

/// File with the report of a command.
pub const FILE: &str = "report.html";

/// The template of a page is at fault.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct PageError {
    /// The file that the page was to become.
    path: PathBuf,
    /// What is wrong.
    source: minijinja::Error,
}

/// The text of the page that becomes the file `path`, as [`html`].
///
/// # Errors
/// Only a fault of the template itself, by that file.
pub fn render(
    report: &Report,
    units: Option<UnitSystem>,
    path: &Path,
) -> Result<String, PageError> {
    html(report, units).map_err(|source| PageError {
        path: path.to_path_buf(),
        source,
    })
}

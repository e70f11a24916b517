//! The page of a report, as a file.

use std::path::{Path, PathBuf};

use super::{Report, html};
use crate::error::Error;
use crate::results::Results;

/// File with the report of a command.
pub const FILE: &str = "report.html";

/// The text of the page that becomes the file `path`.
///
/// # Errors
/// Only a fault of the template itself, by that file.
pub fn render(report: &Report, path: &Path) -> Result<String, Error> {
    html(report).map_err(|error| Error::File {
        path: path.to_path_buf(),
        reason: error.to_string(),
    })
}

/// Writes the page alone into `folder`; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(report: &Report, folder: &Path) -> Result<PathBuf, Error> {
    let path = folder.join(FILE);
    let page = render(report, &path)?;
    let mut results = Results::begin(folder)?;
    results.write_text(FILE, &page)?;
    results.finish()?;
    Ok(path)
}

//! JSON files that an earlier command wrote.

use std::path::Path;

use serde::de::DeserializeOwned;

use crate::error::Error;

/// Reads the file `path`, which holds `what`, such as "the summary of a run".
///
/// # Errors
/// A file that cannot be read or holds something else, by place.
pub fn read<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T, Error> {
    let fault = |reason: String| Error::File {
        path: path.to_path_buf(),
        reason,
    };
    let text =
        identification::data::read_written(path).map_err(|error| fault(error.to_string()))?;
    serde_json::from_str(&text).map_err(|error| fault(format!("not {what}: {error}")))
}

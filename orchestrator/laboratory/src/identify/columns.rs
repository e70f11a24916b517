//! Files whose columns have other names than the reader knows.

use std::path::Path;

use identification::data::{Called, Channel, Named, Recording, columns_called};
use identification::diagnosis::rigs::column_map;

use crate::error::Error;

/// Reads `file`; the map `columns` may name its columns.
///
/// # Errors
/// A file or a map at fault.
pub(super) fn read(file: &Path, columns: Option<&Path>) -> Result<Recording, Error> {
    let name = file.display().to_string();
    Ok(Recording::read_called(file, &name, &called(columns)?)?)
}

/// What `file` calls its channels.
///
/// # Errors
/// As [`read`].
pub(super) fn named(file: &Path, columns: Option<&Path>) -> Result<Vec<Named>, Error> {
    Ok(columns_called(file, &called(columns)?)?)
}

/// The columns of a map; units that it does not say are those of the header.
fn called(map: Option<&Path>) -> Result<Vec<Called>, Error> {
    let Some(map) = map else {
        return Ok(Vec::new());
    };
    let columns = column_map(map).map_err(|error| Error::Option {
        option: "--columns",
        reason: error.to_string(),
    })?;
    let columns = columns.into_iter().map(|(name, (head, unit))| {
        let channel = Channel::named(&name).ok_or_else(|| {
            let known = Channel::KNOWN.map(|channel| channel.name());
            Error::File {
                path: map.to_path_buf(),
                reason: format!(
                    "`{name}` is not a channel; expected {}{}",
                    known.join(", "),
                    units::hint(&name, known.into_iter())
                ),
            }
        })?;
        Ok(Called {
            channel,
            head,
            unit,
        })
    });
    columns.collect()
}

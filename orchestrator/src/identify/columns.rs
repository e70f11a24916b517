//! Files whose columns have other names than the reader knows.

use std::collections::BTreeMap;
use std::path::Path;

use identification::data::{
    Channel, Named, Pick, Recording, Sheet, Wanted, is_called, named_columns,
};
use identification::diagnosis::rigs::renamed;

use crate::error::Error;

/// Reads `file`; the map `columns` may name its columns.
///
/// # Errors
/// A file or a map at fault.
pub(super) fn read(file: &Path, columns: Option<&Path>) -> Result<Recording, Error> {
    let name = file.display().to_string();
    let Some(map) = columns else {
        return Ok(Recording::read(file, &name)?);
    };
    let all = mapped(map)?;
    let is_column = |cell: &str| all.iter().any(|own| is_called(cell, &own.head));
    let heads: Vec<&str> = all.iter().map(|own| own.head.as_str()).collect();
    let header = format!("with the columns {}", heads.join(", "));
    let wanted = Wanted {
        is_column: &is_column,
        header: &header,
    };
    let sheet = Sheet::read(file, wanted)?;
    let picks: Vec<Pick> = all
        .iter()
        .map(|own| Pick {
            channel: own.channel,
            head: &own.head,
            unit: &own.unit,
        })
        .collect();
    Ok(Recording::pick(&sheet, &name, &picks)?)
}

/// What `file` calls its channels.
///
/// # Errors
/// As [`read`].
pub(super) fn named(file: &Path, columns: Option<&Path>) -> Result<Vec<Named>, Error> {
    match columns {
        Some(map) => mapped(map),
        None => Ok(named_columns(file)?),
    }
}

/// The columns of a map.
fn mapped(map: &Path) -> Result<Vec<Named>, Error> {
    let fault = |reason: String| Error::File {
        path: map.to_path_buf(),
        reason,
    };
    let columns = renamed(&BTreeMap::new(), map).map_err(|error| Error::Option {
        option: "--columns",
        reason: error.to_string(),
    })?;
    let columns = columns.into_iter().map(|(name, column)| {
        let channel = Channel::named(&name).ok_or_else(|| {
            let known = Channel::KNOWN.map(|channel| channel.name());
            fault(format!(
                "`{name}` is no channel; expected {}{}",
                known.join(", "),
                crate::units::hint(&name, known.into_iter())
            ))
        })?;
        Ok(Named {
            channel,
            head: column.column,
            unit: column.unit,
        })
    });
    columns.collect()
}

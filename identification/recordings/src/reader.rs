//! From a sheet to a recording in SI units.

use std::path::Path;

use units::factor_meant;

use super::channel::Heading;
use super::text::Text;
use super::{
    Channel, DataError, Recording, Sheet, TimeBase, Wanted, is_called, name_and_unit, read_text,
};

/// The header that a shake table's recording should have, for messages.
const HEADER: &str = "such as `time [s],valve_command [V],displacement [in],acceleration \
                      [in/s^2],actuator_force [lbf]` (any units)";

/// A column that holds a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pick<'a> {
    /// The channel.
    pub channel: Channel,
    /// The header.
    pub head: &'a str,
    /// Its unit.
    pub unit: &'a str,
}

/// What the files of somebody call a channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Called {
    /// The channel.
    pub channel: Channel,
    /// The header, with or without its unit.
    pub head: String,
    /// Its unit, where the file does not say it.
    pub unit: Option<String>,
}

impl Called {
    fn is(&self, cell: &str) -> bool {
        is_called(cell, &self.head)
    }
}

/// The channel that a header cell names, if it is a known one, by `name [unit]`, `name (unit)`,
/// `name / unit`, `name_unit` or `name`.
pub fn known_column(cell: &str) -> Option<Channel> {
    Heading::parse(cell).map(|heading| heading.channel)
}

/// What a file calls a channel, and in which unit it has it.
#[derive(Debug, Clone, PartialEq)]
pub struct Named {
    /// The channel.
    pub channel: Channel,
    /// The header's cell.
    pub head: String,
    /// The unit.
    pub unit: String,
}

/// The columns that [`Recording::read`] takes from a file.
///
/// # Errors
/// As [`Recording::read`].
pub fn named_columns(file: &Path) -> Result<Vec<Named>, DataError> {
    columns_called(file, &[])
}

/// The columns that [`Recording::read_called`] takes from a file.
///
/// # Errors
/// As [`Recording::read_called`].
pub fn columns_called(file: &Path, called: &[Called]) -> Result<Vec<Named>, DataError> {
    let wanted = Wanted {
        is_column: &|cell| known_column(cell).is_some() || called.iter().any(|c| c.is(cell)),
        header: HEADER,
    };
    let sheet = Sheet::read(file, wanted)?;
    let found = columns(&sheet, called)?;
    let mut all = Vec::new();
    for channel in Channel::KNOWN {
        if let Some(column) = the_one(&found, channel, &sheet)? {
            factor(&sheet, column)?;
            let unit = column.unit.as_ref().map(|(_, unit)| unit.clone());
            all.push(Named {
                channel,
                head: sheet.heads()[column.place].clone(),
                unit: unit.unwrap_or_default(),
            });
        }
    }
    Ok(all)
}

/// A column of a sheet with its unit.
struct Column {
    channel: Channel,
    place: usize,
    /// As the header calls it.
    name: String,
    own_name: bool,
    unit: Option<(u64, String)>,
}

impl Recording {
    /// Reads a file of the known channels in SI; columns of other names are ignored. Time
    /// stamps stay as they are, empty cells are NaN.
    ///
    /// # Errors
    /// A file that is not a sheet of numbers; a known channel without a unit, or with one of
    /// another dimension; a cell that is not a number: file, line and column are named.
    pub fn read(file: &Path, name: &str) -> Result<Self, DataError> {
        Self::parse(file, read_text(file)?, name)
    }

    /// As [`Self::read`], of a file in which some channels are `called` otherwise.
    ///
    /// # Errors
    /// As [`Self::read`]; a column that is not there.
    pub fn read_called(file: &Path, name: &str, called: &[Called]) -> Result<Self, DataError> {
        let wanted = Wanted {
            is_column: &|cell| known_column(cell).is_some() || called.iter().any(|c| c.is(cell)),
            header: HEADER,
        };
        let sheet = Sheet::read(file, wanted)?;
        known(&sheet, Self::channels_of(&sheet, name, called)?)
    }

    /// Reads the text of a file, as [`Self::read`] does.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(file: &Path, text: Text, name: &str) -> Result<Self, DataError> {
        let wanted = Wanted {
            is_column: &|cell| known_column(cell).is_some(),
            header: HEADER,
        };
        let sheet = Sheet::parse(file, text, wanted)?;
        known(&sheet, Self::from_sheet(&sheet, name)?)
    }

    /// The known channels of a sheet, as [`Self::read`] has them.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_sheet(sheet: &Sheet, name: &str) -> Result<Self, DataError> {
        Self::channels_of(sheet, name, &[])
    }

    fn channels_of(sheet: &Sheet, name: &str, called: &[Called]) -> Result<Self, DataError> {
        let found = columns(sheet, called)?;
        let mut columns = Vec::new();
        for channel in Channel::KNOWN {
            if let Some(column) = the_one(&found, channel, sheet)? {
                let factor = factor(sheet, column)?;
                let mut values = sheet.column(column.place, &column.name)?;
                values.iter_mut().for_each(|value| *value *= factor);
                columns.push((column.place, channel, values));
            }
        }
        // As they stand in the file.
        columns.sort_by_key(|column| column.0);
        let places: Vec<usize> = columns.iter().map(|column| column.0).collect();
        let heads = sheet.heads().iter().enumerate();
        let left_alone = heads.filter(|(place, _)| !places.contains(place));
        let left_alone = left_alone.map(|(_, head)| head.clone()).collect();
        let columns = columns
            .into_iter()
            .map(|(_, channel, values)| (channel, values));
        let recording = assemble(sheet, name, columns.collect())?;
        Ok(Recording {
            left_alone,
            ..recording
        })
    }

    /// Channels of the columns that are asked for, in that order; `Time` becomes the time stamps.
    ///
    /// # Errors
    /// A column that is missing, a unit of another dimension or another one than the header's, a
    /// cell that is not a number.
    pub fn pick(sheet: &Sheet, name: &str, picks: &[Pick<'_>]) -> Result<Self, DataError> {
        let columns = picks.iter().map(|pick| {
            let place = sheet.place(pick.head)?;
            agree(sheet, place, pick)?;
            let unit = Some((sheet.header_line(), pick.unit.to_string()));
            let column = Column {
                channel: pick.channel,
                place,
                name: pick.head.to_string(),
                own_name: true,
                unit,
            };
            let factor = factor(sheet, &column)?;
            let mut values = sheet.column(place, pick.head)?;
            values.iter_mut().for_each(|value| *value *= factor);
            Ok((pick.channel, values))
        });
        let columns = columns.collect::<Result<_, DataError>>()?;
        assemble(sheet, name, columns)
    }
}

/// Refuses a column whose header names another unit of the same kind than the described one: one of
/// the two is wrong, by a factor that no fit would find.
fn agree(sheet: &Sheet, place: usize, pick: &Pick<'_>) -> Result<(), DataError> {
    let head = &sheet.heads()[place];
    let Some(own) = name_and_unit(head).1 else {
        return Ok(());
    };
    match units::convert(1.0, own, pick.unit) {
        Ok(factor) if (factor - 1.0).abs() > 1e-9 => Err(DataError::line(
            sheet.file(),
            sheet.header_line(),
            format!(
                "column `{head}` is described in {}; expected the unit of its header, {own}",
                pick.unit
            ),
        )),
        _ => Ok(()),
    }
}

/// The recording, if any column of the sheet is one.
fn known(sheet: &Sheet, recording: Recording) -> Result<Recording, DataError> {
    if recording.left_alone.len() < sheet.heads().len() {
        return Ok(recording);
    }
    let reason = format!(
        "no column with a known name among {}; expected a header {HEADER}, or a map of the names",
        sheet.heads().join(", ")
    );
    Err(DataError::line(sheet.file(), sheet.header_line(), reason))
}

fn assemble(
    sheet: &Sheet,
    name: &str,
    mut channels: Vec<(Channel, Vec<f64>)>,
) -> Result<Recording, DataError> {
    let time = channels.iter().position(|own| own.0 == Channel::Time);
    let time = time.map_or(TimeBase::Unknown, |at| {
        TimeBase::Stamps(channels.remove(at).1)
    });
    let mut recording = Recording::measured(name, time, channels)
        .map_err(|error| DataError::file(sheet.file(), error.to_string()))?;
    recording.notes.extend(sheet.note().map(String::from));
    Ok(recording)
}

/// The columns of known channels; those that are `called` otherwise take the place of others.
fn columns(sheet: &Sheet, called: &[Called]) -> Result<Vec<Column>, DataError> {
    let below = |place: usize| {
        let unit = sheet.unit_below(place);
        unit.map(|(line, unit)| (line, unit.to_string()))
    };
    let mut found = Vec::new();
    for own in called {
        let heads = sheet.heads();
        let exact = heads.iter().position(|cell| *cell == own.head);
        let place = exact.or_else(|| heads.iter().position(|cell| own.is(cell)));
        let place = place.map_or_else(|| sheet.place(&own.head), Ok)?;
        let given = own.unit.as_deref().or(name_and_unit(&heads[place]).1);
        let given = given.map(|unit| (sheet.header_line(), unit.to_string()));
        found.push(Column {
            channel: own.channel,
            place,
            name: own.head.clone(),
            own_name: true,
            unit: given.or_else(|| below(place)),
        });
    }
    let headings = sheet.heads().iter().enumerate();
    let known = headings.filter_map(|(place, cell)| {
        let heading = Heading::parse(cell)?;
        let in_header = heading.unit_text().map(|unit| (sheet.header_line(), unit));
        let unit = in_header.or_else(|| below(place));
        let channel = meant(heading.channel, heading.is_own_name(), unit.as_ref());
        let is_taken = called
            .iter()
            .any(|own| own.channel == channel || own.is(cell));
        (!is_taken).then(|| Column {
            channel,
            place,
            name: heading.name.to_string(),
            own_name: heading.is_own_name(),
            unit,
        })
    });
    found.extend(known);
    // A reference without a unit is a number for a controller; beside a voltage it is not needed.
    let has_voltage = found
        .iter()
        .any(|own| own.channel == Channel::ValveCommand && own.unit.is_some());
    let is_number = |own: &Column| own.channel == Channel::Reference && own.unit.is_none();
    found.retain(|own| !(has_voltage && is_number(own)));
    Ok(found)
}

/// A command in a unit of length is the displacement that was asked for.
fn meant(channel: Channel, own_name: bool, unit: Option<&(u64, String)>) -> Channel {
    let is_length =
        |(_, unit): &(u64, String)| factor_meant(unit, Channel::Reference.unit()).is_ok();
    if channel == Channel::ValveCommand && !own_name && unit.is_some_and(is_length) {
        Channel::Reference
    } else {
        channel
    }
}

/// The column of a channel: the one of its own name, else the one of another name whose unit fits.
fn the_one<'a>(
    columns: &'a [Column],
    channel: Channel,
    sheet: &Sheet,
) -> Result<Option<&'a Column>, DataError> {
    let twice = |found: &[&Column]| {
        let reason = match found {
            [first, second, ..] if first.name != second.name => format!(
                "columns `{}` and `{}` both mean {name}; expected one, named `{name}`",
                first.name,
                second.name,
                name = channel.name()
            ),
            _ => format!(
                "column `{}` occurs twice; rename or delete one",
                channel.name()
            ),
        };
        DataError::line(sheet.file(), sheet.header_line(), reason)
    };
    let of_channel = || columns.iter().filter(|column| column.channel == channel);
    let own: Vec<&Column> = of_channel().filter(|column| column.own_name).collect();
    let other: Vec<&Column> = of_channel()
        .filter(|column| !column.own_name && fits(column))
        .collect();
    match (own.as_slice(), other.as_slice()) {
        ([one], _) | ([], [one]) => Ok(Some(one)),
        ([], []) => Ok(None),
        ([], many) | (many, _) => Err(twice(many)),
    }
}

/// A column `velocity [mm]` of another name is not a velocity.
fn fits(column: &Column) -> bool {
    column
        .unit
        .as_ref()
        .is_none_or(|(_, unit)| factor_meant(unit, column.channel.unit()).is_ok())
}

fn factor(sheet: &Sheet, column: &Column) -> Result<f64, DataError> {
    let Column { channel, name, .. } = column;
    let Some((line, unit)) = &column.unit else {
        let meant = if column.own_name {
            String::new()
        } else {
            format!(" ({})", channel.name())
        };
        let reason = format!(
            "column `{name}`{meant} has no unit; expected for example `{name} [{}]`",
            channel.unit()
        );
        return Err(DataError::line(sheet.file(), sheet.header_line(), reason));
    };
    factor_meant(unit, channel.unit()).map_err(|source| DataError::Unit {
        file: sheet.file().to_path_buf(),
        line: *line,
        column: column.place + 1,
        name: name.clone(),
        source: Box::new(source),
    })
}

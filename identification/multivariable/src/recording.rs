//! Recordings of several commands and strokes.

use std::collections::BTreeMap;
use std::path::Path;

use recordings::{Channel, Sheet, TimeBase, Wanted, name_and_unit};

use crate::Error;

/// Motion of the joint that a coupler holds, as measured apart from the strokes.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Translation along the actuators, m.
    pub translation: Vec<f64>,
    /// Rotation, rad.
    pub rotation: Vec<f64>,
}

/// Commands and strokes on an even time base, m.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Its file.
    pub name: String,
    /// Sampling period, s.
    pub period: f64,
    /// One vector for each actuator.
    pub commands: Vec<Vec<f64>>,
    /// One vector for each actuator.
    pub strokes: Vec<Vec<f64>>,
    /// The joint, if its motion was measured.
    pub joint: Option<Joint>,
}

/// Most actuators.
const MOST: usize = 8;

const COMMANDS: [&str; MOST] = [
    "command_1",
    "command_2",
    "command_3",
    "command_4",
    "command_5",
    "command_6",
    "command_7",
    "command_8",
];
const STROKES: [&str; MOST] = [
    "stroke_1", "stroke_2", "stroke_3", "stroke_4", "stroke_5", "stroke_6", "stroke_7", "stroke_8",
];
const HEADER: &str = "time [s],command_1 [mm],command_2 [mm],stroke_1 [mm],stroke_2 [mm]";

/// Fewest samples.
const FEWEST: usize = 256;

/// Header and unit that a file has for a channel, where they are not the usual ones.
pub type Names = BTreeMap<String, (String, Option<String>)>;

/// Whether the head of a file has columns for two commands, `command_1` and `command_2` or what `names` calls them.
#[must_use]
pub fn is_multivariable(file: &Path, names: &Names) -> bool {
    let Ok(text) = recordings::read_text(file) else {
        return false;
    };
    let lines = text.text.lines().take(HEAD);
    let heads: Vec<&str> = lines
        .flat_map(|line| line.split([',', ';', '\t']))
        .map(str::trim)
        .collect();
    let has = |channel: &str| {
        let wanted = names
            .get(channel)
            .map_or(channel, |(head, _)| head.as_str());
        heads
            .iter()
            .any(|head| *head == wanted || name_and_unit(head).0 == wanted)
    };
    has("command_1") && has("command_2")
}

/// Lines in which a header is looked for.
const HEAD: usize = 60;

impl Recording {
    /// Reads `time`, `command_1`, `stroke_1`, and so on; `translation` and `rotation` of the joint if they are there.
    ///
    /// # Errors
    /// A column that is missing, a unit of another dimension, cells without a number, uneven time, with file and line.
    pub fn read(file: &Path) -> Result<Self, Error> {
        Self::read_called(file, &Names::new())
    }

    /// As [`Recording::read`], of a file that calls its columns by other names.
    ///
    /// # Errors
    /// As [`Recording::read`].
    pub fn read_called(file: &Path, names: &Names) -> Result<Self, Error> {
        let place = file.display().to_string();
        let wanted = Wanted {
            is_column: &|cell| {
                let name = name_and_unit(cell).0;
                let is_usual =
                    name == "time" || COMMANDS.contains(&name) || STROKES.contains(&name);
                is_usual
                    || names
                        .values()
                        .any(|(head, _)| head == cell.trim() || head == name)
            },
            header: HEADER,
        };
        let sheet = Sheet::read(file, wanted)
            .map_err(|error| Error::at(place.clone(), error.to_string()))?;
        let called = |name: &str| -> Option<(usize, Option<&str>)> {
            let given = names.get(name);
            let wanted = given.map_or(name, |(head, _)| head.as_str());
            let mut heads = sheet.heads().iter().enumerate();
            heads.find_map(|(i, head)| {
                let (own, unit) = name_and_unit(head);
                let unit = given.and_then(|(_, unit)| unit.as_deref()).or(unit);
                (own == wanted || head.trim() == wanted).then_some((i, unit))
            })
        };
        let column = |name: &str, si: &str| -> Result<Vec<f64>, Error> {
            let line = sheet.header_line();
            let (i, unit) = called(name).ok_or_else(|| {
                Error::at(
                    format!("{place}, line {line}"),
                    format!("no column `{name}`; expected a header such as {HEADER}"),
                )
            })?;
            let below = || sheet.unit_below(i).map(|(_, unit)| unit);
            let unit = unit.or_else(below).ok_or_else(|| {
                Error::at(
                    format!("{place}, line {line}, `{name}`"),
                    format!("no unit; expected `{name} [UNIT]` with a unit such as {si}"),
                )
            })?;
            let factor = units::convert(1.0, unit, si).map_err(|error| {
                Error::at(format!("{place}, line {line}, `{name}`"), error.to_string())
            })?;
            let values = sheet
                .full_column(i, name)
                .map_err(|error| Error::at(place.clone(), error.to_string()))?;
            Ok(values.into_iter().map(|value| factor * value).collect())
        };
        let count = COMMANDS
            .iter()
            .take_while(|name| called(name).is_some())
            .count();
        let actuators = count.max(2);
        let mut channels = Vec::new();
        for (names, i) in (0..actuators).flat_map(|i| [(COMMANDS, i), (STROKES, i)]) {
            channels.push((
                Channel::Other {
                    name: names[i],
                    unit: "m",
                },
                column(names[i], "m")?,
            ));
        }
        let has_joint = called("translation").is_some() && called("rotation").is_some();
        let joint = [("translation", "m"), ("rotation", "rad")];
        for (name, unit) in joint.into_iter().filter(|_| has_joint) {
            channels.push((Channel::Other { name, unit }, column(name, unit)?));
        }
        let stamps = TimeBase::Stamps(column("time", "s")?);
        let error =
            |error: recordings::IdentificationError| Error::at(place.clone(), error.to_string());
        let (pieces, _) = recordings::Recording::measured(&place, stamps, channels)
            .and_then(recordings::Recording::on_even_base)
            .map_err(error)?;
        let longest = pieces.into_iter().max_by_key(recordings::Recording::len);
        let Some(own) = longest.filter(|own| own.len() >= FEWEST) else {
            return Err(Error::at(
                place,
                format!("fewer than {FEWEST} samples on an even time base"),
            ));
        };
        let take = |name: &'static str, unit: &'static str| {
            own.samples(Channel::Other { name, unit }).to_vec()
        };
        Ok(Self {
            name: place.clone(),
            period: own.period(),
            commands: COMMANDS[..actuators]
                .iter()
                .map(|name| take(name, "m"))
                .collect(),
            strokes: STROKES[..actuators]
                .iter()
                .map(|name| take(name, "m"))
                .collect(),
            joint: has_joint.then(|| Joint {
                translation: take("translation", "m"),
                rotation: take("rotation", "rad"),
            }),
        })
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.commands.first().map_or(0, Vec::len)
    }

    /// True without samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The samples of a range.
    #[must_use]
    pub fn part(&self, range: std::ops::Range<usize>) -> Self {
        let of = |channels: &[Vec<f64>]| {
            channels
                .iter()
                .map(|own| own[range.clone()].to_vec())
                .collect()
        };
        Self {
            name: self.name.clone(),
            period: self.period,
            commands: of(&self.commands),
            strokes: of(&self.strokes),
            joint: self.joint.as_ref().map(|joint| Joint {
                translation: joint.translation[range.clone()].to_vec(),
                rotation: joint.rotation[range.clone()].to_vec(),
            }),
        }
    }
}

//! The description of a rig that is diagnosed, with the files that it names.

use std::path::Path;

use serde::Deserialize;

use crate::{Error, Model, Names, Recording};

/// A rig's description: `kind = "two_actuators"`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// `two_actuators`.
    pub kind: String,
    /// File of the model, relative to the description.
    pub model: std::path::PathBuf,
    /// Recordings, relative to the description.
    #[serde(default)]
    pub data: Vec<std::path::PathBuf>,
    /// Pins of the coupler, one per actuator: along and across, with units.
    #[serde(default)]
    pub pins: Vec<[String; 2]>,
}

/// What [`Description::kind`] is.
pub const KIND: &str = "two_actuators";

/// A description to fill in.
pub const TEMPLATE: &str = "\
# Two or more actuators that hold one joint, to be compared with a model of the healthy rig.
kind = \"two_actuators\"
model = \"healthy.toml\"                 # written by `shakebench identify HEALTHY.csv --out healthy.toml`
data = [\"today.csv\"]                   # time, command_1, command_2, stroke_1, stroke_2; with pins also translation, rotation
# Pins of the coupler seen from the joint, along the actuators and across; needed where the joint's motion was measured
pins = [[\"266.7 mm\", \"-127 mm\"], [\"266.7 mm\", \"127 mm\"]]
";

/// Places of the pins, m.
pub type Pins = Vec<[f64; 2]>;

impl Description {
    /// Reads a description with everything that it names; `data`, if there are any, replace its recordings.
    ///
    /// # Errors
    /// A file at fault, with the key.
    pub fn read(
        path: &Path,
        data: &[std::path::PathBuf],
        names: &Names,
    ) -> Result<(Model, Pins, Vec<Recording>), Error> {
        let place = path.display().to_string();
        let text = recordings::read_written(path)
            .map_err(|error| Error::at(place.clone(), error.to_string()))?;
        let own: Self =
            toml::from_str(&text).map_err(|error| Error::at(place.clone(), error.to_string()))?;
        if own.kind != KIND {
            return Err(Error::at(
                place,
                format!("`kind` is `{}`; expected `{KIND}`", own.kind),
            ));
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let model = Model::read(&folder.join(&own.model))?;
        let files: Vec<_> = match data.is_empty() {
            true => own.data.iter().map(|file| folder.join(file)).collect(),
            false => data.to_vec(),
        };
        if files.is_empty() {
            return Err(Error::at(
                place,
                "`data` names no recording; add one, or pass --data FILE",
            ));
        }
        let length = |key: String, text: &str| {
            units::value_in(text, "m")
                .map_err(|error| Error::at(format!("{place}, `{key}`"), error.to_string()))
        };
        let mut pins = Pins::new();
        for (i, [along, across]) in own.pins.iter().enumerate() {
            pins.push([
                length(format!("pins[{i}]"), along)?,
                length(format!("pins[{i}]"), across)?,
            ]);
        }
        let recordings = files
            .iter()
            .map(|file| Recording::read_called(file, names))
            .collect::<Result<Vec<_>, _>>()?;
        check_pins(&place, &pins, &model)?;
        Ok((model, pins, recordings))
    }
}

fn check_pins(place: &str, pins: &Pins, model: &Model) -> Result<(), Error> {
    if pins.is_empty() {
        return Ok(());
    }
    let place = format!("{place}, `pins`");
    if pins.len() != model.actuators() {
        return Err(Error::at(
            place,
            format!(
                "{} pins, but the model has {} actuators; give one pin per actuator",
                pins.len(),
                model.actuators()
            ),
        ));
    }
    let across =
        |pick: fn(f64, f64) -> f64| pins.iter().map(|pin| pin[1]).reduce(pick).unwrap_or(0.0);
    let size = pins
        .iter()
        .map(|pin| pin[0].hypot(pin[1]))
        .fold(0.0, f64::max);
    if across(f64::max) - across(f64::min) > 1e-3 * size {
        return Ok(());
    }
    Err(Error::at(
        place,
        "the lever arms are alike, so that no stroke turns the joint; expected pins that differ across the actuators",
    ))
}

//! The systems that come with the program. A rig (plant and specimen) and a controller are files
//! of their own; a system is a controller on a rig.

use super::tuning::{self, Tuning};
use super::{SystemError, SystemFile};
use crate::units::hint;

macro_rules! parts {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_str!(concat!("../../systems/", $name, ".toml")))),*]
    };
}

/// Controllers: the names of the built-in systems.
const CONTROLLERS: [(&str, &str); 5] = parts![
    "displacement-pid",
    "three-variable",
    "loop-shaping",
    "sliding-mode",
    "mpc",
];
/// Tables with their actuators.
const PLANTS: [(&str, &str); 2] = parts!["plant/identified", "plant/servohydraulic"];
/// What stands on the table.
const SPECIMENS: [(&str, &str); 2] = parts!["specimen/linear", "specimen/yielding"];

/// The system run when none is named.
pub const DEFAULT_SYSTEM: &str = "three-variable";
/// The plant when none is named.
pub const DEFAULT_PLANT: &str = "identified";
/// The specimen when none is named.
pub const DEFAULT_SPECIMEN: &str = "linear";

/// Names of the built-in systems.
pub fn names() -> impl Iterator<Item = &'static str> {
    CONTROLLERS.iter().map(|(name, _)| *name)
}

/// Names of the plants.
pub fn plants() -> impl Iterator<Item = &'static str> {
    PLANTS.iter().map(|(name, _)| short(name))
}

/// Names of the specimens, `none` among them.
pub fn specimens() -> impl Iterator<Item = &'static str> {
    std::iter::once("none").chain(SPECIMENS.iter().map(|(name, _)| short(name)))
}

/// A built-in system: the controller `name` on a rig of `plant` and `specimen` (or `none`), with the
/// parameters of `tuning`, by default tuned for the physical rig and as printed for the identified.
///
/// # Errors
/// A name that is unknown, or a rig for which there is no tuning.
pub fn system(
    name: &str,
    plant: &str,
    specimen: &str,
    tuning: Option<Tuning>,
) -> Result<SystemFile, SystemError> {
    let mut file = part("system", &CONTROLLERS, name, names())?;
    let rig = part("plant", &PLANTS, plant, plants())?;
    if specimen == "none" {
        file.disconnect("specimen");
    }
    tuning::apply(&mut file, plant, specimen, tuning).map_err(|reason| SystemError::Place {
        origin: format!("{name} (built-in)"),
        place: "tuning".to_string(),
        reason,
    })?;
    file.redirect(&rig.instead);
    file.extend(rig);
    if specimen == "none" {
        file.disconnect("specimen");
    } else {
        file.extend(part("specimen", &SPECIMENS, specimen, specimens())?);
    }
    // The specimen of half a second is stiff enough for a missing answer to mean something.
    if specimen == "yielding"
        && let Some(interlock) = file.components.get_mut("interlock")
    {
        let silence = toml::Value::String("0.012 g".into());
        interlock
            .parameters
            .insert("specimen_silence".into(), silence);
    }
    file.name = name.to_string();
    file.origin = format!("{name} (built-in)");
    Ok(file)
}

fn part(
    what: &'static str,
    known: &[(&'static str, &'static str)],
    name: &str,
    names: impl Iterator<Item = &'static str>,
) -> Result<SystemFile, SystemError> {
    let found = known.iter().find(|(known, _)| short(known) == name);
    let (path, text) = found.ok_or_else(|| SystemError::Unknown {
        what,
        name: name.to_string(),
        hint: hint(name, names),
    })?;
    SystemFile::parse(&format!("systems/{path}.toml"), text)
}

fn short(name: &'static str) -> &'static str {
    name.rsplit('/').next().unwrap_or(name)
}

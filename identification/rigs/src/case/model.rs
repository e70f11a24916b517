//! The rig of a model file, with its effects.

use super::nominal::set_effect;
use crate::identify::model_file::ModelFile;
use plant::identified::rig::IdentifiedRig;
use recordings::IdentificationError;

/// The rig that `file` describes: actuator, table, specimen and effects, as the extended model of a
/// diagnosis has them; `name` is what messages call it.
///
/// # Errors
/// A file without an actuator, an effect or parameter that there is not, values that make no rig.
pub fn rig_of(file: &ModelFile, name: &str) -> Result<IdentifiedRig, IdentificationError> {
    let wrong = |what: String| IdentificationError::ModelFile {
        path: name.to_string(),
        what,
        expected: "effects of `docs/effects.md` with their parameters, SI",
    };
    let mut rig = IdentifiedRig {
        shake_table: file.shake_table(name)?,
        specimen: file.specimen(name)?,
        ..IdentifiedRig::default()
    };
    rig.effects.valve.command_delay = file.command_delay.unwrap_or(0.0);
    for (effect, values) in &file.effects {
        set_effect(effect, values, &mut rig.effects, &mut rig.sensors)
            .map_err(|error| wrong(error.to_string()))?;
    }
    rig.validate().map_err(|error| wrong(error.to_string()))?;
    Ok(rig)
}

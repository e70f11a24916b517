//! A specimen whose parameters are known, as TOML: `[specimen]` with mass, damping and stiffness,
//! and `units` as in a model file. A model file with a specimen is one too.

use std::path::Path;

use plant::specimens::linear::LinearSpecimen;
use serde::Deserialize;

use crate::identify::model_file::{BodySection, INCH_POUND, Units};
use recordings::IdentificationError;

#[derive(Deserialize)]
struct SpecimenFile {
    units: Option<String>,
    specimen: BodySection,
}

/// Reads a specimen, SI.
///
/// # Errors
/// The file cannot be read; no `[specimen]`; unknown units; numbers that make no specimen.
pub fn read(path: &Path) -> Result<LinearSpecimen, IdentificationError> {
    let name = path.display().to_string();
    let wrong = |what: String| IdentificationError::ModelFile {
        path: name.clone(),
        what,
        expected: "[specimen] mass > 0, damping >= 0 and stiffness > 0, and units",
    };
    let text = recordings::read_written(path).map_err(|error| wrong(error.to_string()))?;
    let file: SpecimenFile =
        toml::from_str(&text).map_err(|error| wrong(error.message().to_string()))?;
    let units = Units::named(file.units.as_deref().unwrap_or(INCH_POUND), &name)?;
    let factor = units.force / units.length;
    let BodySection {
        mass,
        damping,
        stiffness,
    } = file.specimen;
    let all_finite = [mass, damping, stiffness].iter().all(|v| v.is_finite());
    if !(all_finite && mass > 0.0 && damping >= 0.0 && stiffness > 0.0) {
        return Err(wrong(format!(
            "mass {mass}, damping {damping}, stiffness {stiffness}"
        )));
    }
    Ok(LinearSpecimen {
        mass: mass * factor,
        damping: damping * factor,
        stiffness: stiffness * factor,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_specimen_is_read_in_its_units_and_nonsense_refused() {
        let path = std::env::temp_dir().join(format!("specimen-{}.toml", std::process::id()));
        let read_text = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read(&path)
        };
        let body = "[specimen]\nmass = 2.0\ndamping = 3.0\nstiffness = 4.0\n";
        // One lbf/in is 175.1268 N/m.
        let own = read_text(body).unwrap();
        assert!((own.stiffness - 4.0 * 175.126_835).abs() < 1e-3);
        let own = read_text(&format!("units = \"SI\"\n{body}")).unwrap();
        assert_eq!((own.mass, own.damping, own.stiffness), (2.0, 3.0, 4.0));
        for (text, part) in [
            ("[table]\nmass = 1.0\n", "specimen"),
            (
                "units = \"furlong\"\n[specimen]\nmass=1\ndamping=0\nstiffness=1\n",
                "furlong",
            ),
            (
                "[specimen]\nmass=-1.0\ndamping=0.0\nstiffness=1.0\n",
                "mass -1",
            ),
        ] {
            let message = read_text(text).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
        std::fs::remove_file(&path).unwrap();
    }
}

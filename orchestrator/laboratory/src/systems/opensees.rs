//! Structures that OpenSees computes, as components.

use pack::Installation;
use std::path::Path;

use bridges::opensees::{CARRIED, model_of};
use fmi_import::FmiVersion;
use fmi_ssp::export::Carrying;
use fmi_system::{Component, SystemFile, Value};

/// The component that runs OpenSees.
pub const COMPONENT: &str = "OpenSeesSpecimen";
/// Its parameter that names the model.
pub const MODEL: &str = "model";

/// Turns components whose `fmu` is a model, `opensees:MODEL.py`, into the component that runs it; paths
/// are relative to the file.
pub fn find_models(file: &mut SystemFile) {
    let directory = file.directory.clone().unwrap_or_default();
    for component in file.components.values_mut() {
        let Some(model) = model_of(&component.fmu) else {
            continue;
        };
        let path = directory.join(model);
        let path = std::path::absolute(&path).unwrap_or(path);
        component.set(MODEL, path.display().to_string().as_str());
        component.fmu = COMPONENT.to_string();
    }
}

/// The FMU of a component that runs a model, with the model in it; none for other components.
///
/// # Errors
/// The model cannot be read.
pub fn carrying(
    component: &Component,
) -> Result<Option<Carrying>, Box<dyn std::error::Error + Send + Sync>> {
    let description = &component.fmu.description;
    if !component.fmu.is_own || description.model_identifier != COMPONENT {
        return Ok(None);
    }
    let Some(parameter) = description.position(MODEL) else {
        return Ok(None);
    };
    let given = component.parameters.iter();
    let mut given = given.filter(|(position, _)| *position == parameter);
    let Some((_, Value::Text(path))) = given.next().filter(|(_, value)| !is_empty(value)) else {
        return Ok(None);
    };
    let script = identification::data::read_bytes(path.as_ref())
        .map_err(|error| format!("{path}: {error}"))?;
    Ok(Some(Carrying {
        fmu: pack::with_resource(component.fmu.file(), CARRIED, script)?,
        parameter,
        note: format!(
            "`{}` contains the model {path}, but not the files that the model reads; it needs a \
             Python with openseespy",
            component.name
        ),
    }))
}

fn is_empty(value: &Value) -> bool {
    matches!(value, Value::Text(text) if text.is_empty())
}

/// The bytes of the FMU that runs `model`, with the model in it.
///
/// # Errors
/// The model cannot be read, or the component is not available.
pub fn fmu_of(
    model: &Path,
    version: FmiVersion,
    installation: &Installation,
) -> Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>> {
    let script = identification::data::read_bytes(model)?;
    let component = installation.component(COMPONENT, version);
    let component = component.map_err(|error| error.to_string())?;
    Ok(pack::with_resource(&component.path, CARRIED, script)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    #[test]
    fn models_become_the_component_that_runs_them() {
        let text = "name = \"one\"\n[components.frame]\nfmu = \"opensees:frame.py\"\n[components.table]\nfmu = \"ShakeTable\"\n";
        let mut file = SystemFile::parse("one", text).unwrap();
        file.directory = Some("/models".into());
        find_models(&mut file);
        let frame = &file.components["frame"];
        assert_eq!(frame.fmu, COMPONENT);
        assert_eq!(
            frame.parameters[MODEL],
            fmi_system::Setting::Text("/models/frame.py".into())
        );
        let table = &file.components["table"];
        assert_eq!((&*table.fmu, table.parameters.len()), ("ShakeTable", 0));
        // A foreign FMU of that name carries no model.
        let variables = r#"<String name="model" valueReference="1" causality="parameter" variability="fixed"><Start value=""/></String>"#;
        assert!(
            carrying(&made::component(COMPONENT, variables))
                .unwrap()
                .is_none()
        );
        assert!(is_empty(&Value::Text(String::new())) && !is_empty(&Value::Text("a".into())));
    }
}

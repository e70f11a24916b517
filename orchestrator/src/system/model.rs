//! Sets of parameters by name: the published models, and files that identification writes.

use std::path::Path;

use plant::actuator::PublishedActuator;
use plant::table::Table;
use serde::Deserialize;

use super::{Value, hint, value};
use crate::fmu::{Causality, Description};

/// Published models of `ShakeTable`.
const PUBLISHED: [(&str, PublishedActuator); 3] = [
    ("equation-2-11", PublishedActuator::Equation2_11),
    ("equation-2-13", PublishedActuator::Equation2_13),
    ("derounded", PublishedActuator::Derounded),
];

/// A `MODEL.toml`: `[parameters.NAME]` for the component NAME, values as in a system file. Other
/// tables of it tell how the model came about and are not read here.
#[derive(Deserialize)]
struct ModelFile {
    parameters: std::collections::BTreeMap<String, toml::Table>,
}

/// The parameters that the model `name` gives to a component, as position and value; paths are
/// relative to `directory`.
///
/// # Errors
/// An unknown name, a model that must not be simulated (with the reason), a file at fault.
pub(super) fn parameters(
    name: &str,
    component: &Description,
    directory: Option<&Path>,
) -> Result<Vec<(usize, Value)>, String> {
    if name.ends_with(".toml") {
        let path = directory.unwrap_or(Path::new("")).join(name);
        return from_file(&path, component).map_err(|r| format!("{}: {r}", path.display()));
    }
    let found = PUBLISHED.iter().find(|(known, _)| *known == name);
    let Some(&(_, published)) = found else {
        let known = PUBLISHED.iter().map(|(known, _)| *known);
        return Err(format!(
            "`{name}` is no published model and no path to a MODEL.toml{}",
            hint(name, known)
        ));
    };
    let actuator = published
        .for_simulation()
        .map_err(|error| error.to_string())?;
    let table = match published {
        PublishedActuator::Derounded => Table::derounded(),
        _ => Table::equation_2_28(),
    };
    let [a2, a1, a0] = actuator.denominator;
    let [b2, b1, b0] = actuator.voltage_to_force;
    let [e2, e1, e0] = actuator.velocity_to_force;
    let values = [
        ("table_mass", table.mass),
        ("table_damping", table.damping),
        ("table_stiffness", table.stiffness),
        ("actuator_a2", a2),
        ("actuator_a1", a1),
        ("actuator_a0", a0),
        ("actuator_b2", b2),
        ("actuator_b1", b1),
        ("actuator_b0", b0),
        ("actuator_e2", e2),
        ("actuator_e1", e1),
        ("actuator_e0", e0),
    ];
    let place = |(parameter, value)| {
        let position = component.position(parameter).ok_or_else(|| {
            format!(
                "`{name}` is a model of ShakeTable; {} has no parameter `{parameter}`",
                component.model_name
            )
        })?;
        Ok((position, Value::Number(value)))
    };
    values.into_iter().map(place).collect()
}

fn from_file(path: &Path, component: &Description) -> Result<Vec<(usize, Value)>, String> {
    let text = std::fs::read_to_string(path).map_err(|error| error.to_string())?;
    let file: ModelFile = toml::from_str(&text).map_err(|error| error.to_string())?;
    let given = file
        .parameters
        .get(&component.model_name)
        .ok_or_else(|| format!("there is no [parameters.{}]", component.model_name))?;
    let read = |(name, written): (&String, &toml::Value)| {
        let at = |reason: String| format!("parameters.{}.{name}: {reason}", component.model_name);
        let position = component
            .of(Causality::Parameter)
            .find(|&index| component.variables[index].name == *name);
        let position = position.ok_or_else(|| {
            let known = component.of(Causality::Parameter);
            let known = known.map(|index| component.variables[index].name.as_str());
            at(format!("no parameter of that name{}", hint(name, known)))
        })?;
        let value = value::read(&component.variables[position], written).map_err(at)?;
        Ok((position, value))
    };
    given.iter().map(read).collect()
}

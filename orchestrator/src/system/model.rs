//! Sets of parameters by name: the published models, and files that identification writes.

use std::path::Path;

use identification::identify::model_file::ModelFile;
use plant::identified::actuator::PublishedActuator;
use plant::identified::shake_table::ShakeTable;
use plant::identified::table::Table;
use plant::specimens::linear::LinearSpecimen;

use super::hint;
use super::value::Value;
use crate::fmu::{Causality, Description};

/// Published models of `ShakeTable`.
const PUBLISHED: [(&str, PublishedActuator); 3] = [
    ("equation-2-11", PublishedActuator::Equation2_11),
    ("equation-2-13", PublishedActuator::Equation2_13),
    ("derounded", PublishedActuator::Derounded),
];

/// The parameters that the model `name` gives to a component, as position and value; paths are
/// relative to `directory`. A published model is one of `ShakeTable`; a file gives its actuator
/// and table to `ShakeTable` and its specimen to `Specimen`, and the effects in it to the
/// component that has them.
///
/// # Errors
/// An unknown name, a model that must not be simulated (with the reason), a file at fault, a
/// component that the model says nothing of.
pub(super) fn parameters(
    name: &str,
    component: &Description,
    directory: Option<&Path>,
) -> Result<Vec<(usize, Value)>, String> {
    if name.ends_with(".toml") {
        let path = directory.unwrap_or(Path::new("")).join(name);
        return from_file(&path, component);
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
    let values = shake_table_values(&ShakeTable { actuator, table });
    place(&values, component).ok_or_else(|| {
        format!(
            "`{name}` is a model of ShakeTable, not of {}",
            component.model_name
        )
    })
}

fn from_file(path: &Path, component: &Description) -> Result<Vec<(usize, Value)>, String> {
    let name = path.display().to_string();
    let file = ModelFile::read(path).map_err(|error| error.to_string())?;
    let own = COMPONENTS
        .into_iter()
        .find(|(_, mark)| component.position(mark).is_some())
        .map_or("", |(component, _)| component);
    let mut values: Vec<(&str, f64)> = Vec::new();
    if own == "ShakeTable" {
        let rig = file.shake_table(&name).map_err(|error| error.to_string())?;
        values.extend(shake_table_values(&rig));
    } else if own != "Instrumentation" {
        let specimen = file.specimen(&name).map_err(|error| error.to_string())?;
        let specimen = specimen.ok_or_else(|| {
            format!(
                "{name}: there is no [specimen], and {} is no ShakeTable",
                component.model_name
            )
        })?;
        values.extend(specimen_values(&specimen));
    }
    let mut placed = place(&values, component).ok_or_else(|| {
        format!(
            "{name}: a model of ShakeTable, Specimen and Instrumentation, not of {}",
            component.model_name
        )
    })?;
    for (effect, parameters) in &file.effects {
        if component_of(effect) != own {
            continue;
        }
        for (parameter, value) in parameters {
            let parameter = format!("{effect}.{parameter}");
            let known = component
                .of(Causality::Parameter)
                .map(|index| component.variables[index].name.as_str());
            let position = parameter_position(component, &parameter).ok_or_else(|| {
                format!(
                    "{name}: [effects.{effect}]: {} has no parameter `{parameter}`{}",
                    component.model_name,
                    hint(&parameter, known)
                )
            })?;
            placed.push((position, Value::Number(*value)));
        }
    }
    if placed.is_empty() {
        return Err(format!(
            "{name}: it says nothing of {}",
            component.model_name
        ));
    }
    Ok(placed)
}

/// Components that a model file speaks of, each with a parameter that only it has.
const COMPONENTS: [(&str, &str); 3] = [
    ("ShakeTable", "actuator_a2"),
    ("Specimen", "specimen_absent.absent"),
    ("Instrumentation", "load_cell_bias.offset"),
];

/// The component that has the parameters of an effect of the catalogue.
pub fn component_of(effect: &str) -> &'static str {
    const SENSORS: [&str; 4] = ["accelerometer_", "displacement_", "load_cell_", "mains_"];
    if effect.starts_with("specimen_") {
        "Specimen"
    } else if SENSORS.iter().any(|sensor| effect.starts_with(sensor)) {
        "Instrumentation"
    } else {
        "ShakeTable"
    }
}

/// The parameters of the FMU `Specimen`, SI.
pub fn specimen_values(specimen: &LinearSpecimen) -> [(&'static str, f64); 3] {
    [
        ("mass", specimen.mass),
        ("damping", specimen.damping),
        ("stiffness", specimen.stiffness),
    ]
}

/// The parameters of the FMU `ShakeTable`, SI.
pub fn shake_table_values(rig: &ShakeTable) -> [(&'static str, f64); 12] {
    let ShakeTable { actuator, table } = rig;
    let [a2, a1, a0] = actuator.denominator;
    let [b2, b1, b0] = actuator.voltage_to_force;
    let [e2, e1, e0] = actuator.velocity_to_force;
    [
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
    ]
}

fn parameter_position(component: &Description, name: &str) -> Option<usize> {
    component
        .of(Causality::Parameter)
        .find(|&index| component.variables[index].name == name)
}

/// Positions of the parameters, or nothing where the component lacks one.
fn place(values: &[(&str, f64)], component: &Description) -> Option<Vec<(usize, Value)>> {
    values
        .iter()
        .map(|&(name, value)| Some((parameter_position(component, name)?, Value::Number(value))))
        .collect()
}

//! Sets of parameters by name: the published models, and files that identification writes.

use std::path::Path;
use units::vocabulary;

use identification::IdentificationError;
use identification::identify::model_file::ModelFile;
use plant::ModelError;
use plant::identified::actuator::PublishedActuator;
use plant::identified::effects::{self, Component};
use plant::identified::nominal::{shake_table_values, specimen_values};
use plant::identified::shake_table::ShakeTable;
use plant::identified::table::Table;

use fmi_import::{Causality, Description};
use fmi_system::Value;
use units::hint;

/// Why a set of parameters does not fit a component.
#[derive(Debug, thiserror::Error)]
pub enum ParameterSetError {
    /// A name that no published model has.
    #[error("`{name}` is neither a published model nor a path to a MODEL.toml{hint}")]
    Unknown {
        /// What was looked for.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// A published model that must not be simulated.
    #[error(transparent)]
    Refused(#[from] ModelError),
    /// A model file that cannot be read.
    #[error(transparent)]
    File(#[from] IdentificationError),
    /// A published model for another component.
    #[error("`{name}` is a model of ShakeTable, not of {component}")]
    NotShakeTable {
        /// The model.
        name: String,
        /// The component.
        component: String,
    },
    /// A file without a specimen for one.
    #[error("{file}: there is no [specimen], and {component} is not a ShakeTable")]
    NoSpecimen {
        /// The file.
        file: String,
        /// The component.
        component: String,
    },
    /// A file for other components.
    #[error("{file}: a model of ShakeTable, Specimen and Instrumentation, not of {component}")]
    Component {
        /// The file.
        file: String,
        /// The component.
        component: String,
    },
    /// An effect that the component does not know.
    #[error("{file}: [effects.{effect}]: {component} has no parameter `{parameter}`{hint}")]
    NoParameter {
        /// The file.
        file: String,
        /// The effect.
        effect: String,
        /// The component.
        component: String,
        /// Its parameter.
        parameter: String,
        /// The nearest name.
        hint: String,
    },
    /// A file that says nothing of the component.
    #[error("{file}: it has nothing for {component}")]
    Nothing {
        /// The file.
        file: String,
        /// The component.
        component: String,
    },
}

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
pub fn parameters(
    name: &str,
    component: &Description,
    directory: Option<&Path>,
) -> Result<Vec<(usize, Value)>, ParameterSetError> {
    if name.ends_with(".toml") {
        let path = directory.unwrap_or(Path::new("")).join(name);
        return from_file(&path, component);
    }
    let found = PUBLISHED.iter().find(|(known, _)| *known == name);
    let Some(&(_, published)) = found else {
        let known = PUBLISHED.iter().map(|(known, _)| *known);
        return Err(ParameterSetError::Unknown {
            name: name.to_string(),
            hint: hint(name, known),
        });
    };
    let actuator = published.for_simulation()?;
    let table = match published {
        PublishedActuator::Derounded => Table::derounded(),
        _ => Table::equation_2_28(),
    };
    let values = shake_table_values(&ShakeTable { actuator, table });
    place(&values, component).ok_or_else(|| ParameterSetError::NotShakeTable {
        name: name.to_string(),
        component: component.model_name.clone(),
    })
}

fn from_file(
    path: &Path,
    component: &Description,
) -> Result<Vec<(usize, Value)>, ParameterSetError> {
    let name = path.display().to_string();
    let file = ModelFile::read(path)?;
    let own = COMPONENTS
        .into_iter()
        .find(|(_, mark)| component.position(mark).is_some())
        .map(|(component, _)| component);
    let mut values: Vec<(&str, f64)> = Vec::new();
    if own == Some(Component::ShakeTable) {
        let rig = file.shake_table(&name)?;
        values.extend(shake_table_values(&rig));
    } else if own != Some(Component::Instrumentation) {
        let specimen = file.specimen(&name)?;
        let specimen = specimen.ok_or_else(|| ParameterSetError::NoSpecimen {
            file: name.clone(),
            component: component.model_name.clone(),
        })?;
        values.extend(specimen_values(&specimen));
    }
    let mut placed = place(&values, component).ok_or_else(|| ParameterSetError::Component {
        file: name.clone(),
        component: component.model_name.clone(),
    })?;
    for (effect, parameters) in &file.effects {
        if Some(component_of(effect)) != own {
            continue;
        }
        for (parameter, value) in parameters {
            let parameter = format!("{effect}.{parameter}");
            let known = component
                .of(Causality::Parameter)
                .map(|index| component.variables[index].name.as_str());
            let position = parameter_position(component, &parameter).ok_or_else(|| {
                ParameterSetError::NoParameter {
                    file: name.clone(),
                    effect: effect.to_string(),
                    component: component.model_name.clone(),
                    hint: hint(&parameter, known),
                    parameter,
                }
            })?;
            placed.push((position, Value::Number(*value)));
        }
    }
    if placed.is_empty() {
        return Err(ParameterSetError::Nothing {
            file: name,
            component: component.model_name.clone(),
        });
    }
    Ok(placed)
}

/// Components that a model file speaks of, each with a parameter that only it has.
const COMPONENTS: [(Component, &str); 3] = [
    (Component::ShakeTable, vocabulary::ACTUATOR_A2),
    (Component::Specimen, "specimen_absent.absent"),
    (Component::Instrumentation, "load_cell_bias.offset"),
];

/// The component that has the parameters of an effect; of one that is unknown, the table.
pub fn component_of(effect: &str) -> Component {
    effects::find(effect).map_or(Component::ShakeTable, |effect| effect.component)
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

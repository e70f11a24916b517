//! Components and variables by name.

use std::ops::Range;

use super::checked::Component;
use fmi_import::{Causality, Fmu};
use units::hint;

/// The position of a component.
///
/// # Errors
/// No such name (with the nearest one).
pub(super) fn component_index(components: &[Component], name: &str) -> Result<usize, String> {
    components
        .iter()
        .position(|part| part.name == name)
        .ok_or_else(|| {
            let known = components.iter().map(|part| part.name.as_str());
            format!("there is no component `{name}`{}", hint(name, known))
        })
}

/// The position of the variable `name`, which has to be of that causality.
///
/// # Errors
/// Another causality, or no such name (with the nearest one).
pub(super) fn find(fmu: &Fmu, name: &str, causality: Causality) -> Result<usize, String> {
    let description = &fmu.description;
    let word = words(causality);
    let Some(position) = description.position(name) else {
        let known = description
            .of(causality)
            .map(|index| description.variables[index].name.as_str());
        return Err(format!(
            "{} ({}) has no {word} `{name}`{}",
            description.model_name,
            fmu.file_name(),
            hint(name, known)
        ));
    };
    let found = description.variables[position].causality;
    if found != causality {
        return Err(format!("`{name}` is {}, expected {word}", article(found)));
    }
    Ok(position)
}

/// The positions of the variable or array `name`, which has to have a start value that can be set.
///
/// # Errors
/// A variable that the FMU computes, or no such name (with the nearest one).
pub(super) fn find_settable(fmu: &Fmu, name: &str) -> Result<Range<usize>, String> {
    let description = &fmu.description;
    let found = description
        .array(name)
        .or_else(|| description.position(name).map(|at| at..at + 1));
    match found {
        None => find(fmu, name, Causality::Parameter).map(|at| at..at + 1),
        Some(found) => {
            let first = description.variables.get(found.start);
            if first.is_none_or(|variable| variable.is_settable) {
                return Ok(found);
            }
            find(
                fmu,
                &description.variables[found.start].name,
                Causality::Parameter,
            )
            .map(|_| found)
            .map_err(|reason| format!("{reason}: its FMU computes it"))
        }
    }
}

fn words(causality: Causality) -> &'static str {
    match causality {
        Causality::Parameter => "parameter",
        Causality::Input => "input",
        Causality::Output => "output",
        Causality::Local => "local variable",
    }
}

fn article(causality: Causality) -> String {
    let word = words(causality);
    let vowel = word.starts_with(['i', 'o']);
    format!("{} {word}", if vowel { "an" } else { "a" })
}

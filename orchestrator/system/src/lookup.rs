//! Components and variables by name.

use std::ops::Range;

use super::checked::Component;
use fmi_import::{Causality, Fmu};
use units::hint;

/// Why a name of a system leads to no component or variable.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// No such component.
    #[error("there is no component `{name}`{hint}")]
    Component {
        /// What was looked for.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// No such variable of that causality.
    #[error("{model} ({file}) has no {expected} `{name}`{hint}")]
    Variable {
        /// The model.
        model: String,
        /// The FMU's file.
        file: String,
        /// The causality.
        expected: &'static str,
        /// What was looked for.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// A variable of another causality.
    #[error("`{name}` is {found}, expected {expected}{}", if *is_computed { ": its FMU computes it" } else { "" })]
    Causality {
        /// The variable.
        name: String,
        /// Its causality, with an article.
        found: String,
        /// The causality that is needed.
        expected: &'static str,
        /// Whether a value was to be set that the FMU computes.
        is_computed: bool,
    },
}

/// The position of a component.
///
/// # Errors
/// No such name (with the nearest one).
pub(super) fn component_index(components: &[Component], name: &str) -> Result<usize, NameError> {
    components
        .iter()
        .position(|part| part.name == name)
        .ok_or_else(|| {
            let known = components.iter().map(|part| part.name.as_str());
            NameError::Component {
                name: name.to_string(),
                hint: hint(name, known),
            }
        })
}

/// The position of the variable `name`, which has to be of that causality.
///
/// # Errors
/// Another causality, or no such name (with the nearest one).
pub(super) fn find(fmu: &Fmu, name: &str, causality: Causality) -> Result<usize, NameError> {
    let description = &fmu.description;
    let Some(position) = description.position(name) else {
        let known = description
            .of(causality)
            .map(|index| description.variables[index].name.as_str());
        return Err(NameError::Variable {
            model: description.model_name.clone(),
            file: fmu.file_name(),
            expected: words(causality),
            name: name.to_string(),
            hint: hint(name, known),
        });
    };
    let found = description.variables[position].causality;
    if found != causality {
        return Err(NameError::Causality {
            name: name.to_string(),
            found: article(found),
            expected: words(causality),
            is_computed: false,
        });
    }
    Ok(position)
}

/// The positions of the variable or array `name`, which has to have a start value that can be set.
///
/// # Errors
/// A variable that the FMU computes, or no such name (with the nearest one).
pub(super) fn find_settable(fmu: &Fmu, name: &str) -> Result<Range<usize>, NameError> {
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
            let name = &description.variables[found.start].name;
            find(fmu, name, Causality::Parameter)
                .map(|_| found)
                .map_err(|error| match error {
                    NameError::Causality {
                        name,
                        found,
                        expected,
                        ..
                    } => NameError::Causality {
                        name,
                        found,
                        expected,
                        is_computed: true,
                    },
                    other => other,
                })
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

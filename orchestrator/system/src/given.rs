//! Values that a system file or the command line gives to variables.

use std::ops::Range;

use super::checked::Component;
use super::error::Misfit;
use super::library::Library;
use super::lookup::{component_index, find_settable};
use super::value::{self, Setting, Value, ValueError};
use fmi_import::{Causality, Fmu, Kind, Variable};

/// Why a setting of the command line is not carried out.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SettingError {
    /// Not a variable and a value.
    #[error("expected component.variable=VALUE, such as control.valve_limit=\"5 V\"")]
    Form,
    /// An array without elements.
    #[error("`{0}` has no elements")]
    Empty(String),
    /// A number without a unit for a variable that has one.
    #[error(
        "`{text}` has no unit, and `{name}` is in {unit}; expected a number with its unit, such as \
         {name}=\"{text} {unit}\"{}",
        shown.as_ref().map_or(String::new(), |own| format!(" or \"{text} {own}\""))
    )]
    NoUnit {
        /// What was written.
        text: String,
        /// The variable.
        name: String,
        /// Its unit.
        unit: String,
        /// The unit in which it is shown, where that is another one.
        shown: Option<String>,
    },
}

pub(super) fn put(values: &mut Vec<(usize, Value)>, position: usize, value: Value) {
    match values.iter_mut().find(|(known, _)| *known == position) {
        Some(entry) => entry.1 = value,
        None => values.push((position, value)),
    }
}

/// Carries out `component.variable=VALUE` of the command line; `component.model=NAME` sets all
/// that a published model or a model file gives to the component.
pub(super) fn set(
    components: &mut [Component],
    setting: &str,
    library: &mut dyn Library,
) -> Result<(), Misfit> {
    let (name, text) = setting.split_once('=').ok_or(SettingError::Form)?;
    let name = name.trim();
    // Components of archives have points in their names: the longest name that fits counts.
    let fitting = components.iter().filter_map(|part| {
        let variable = name.strip_prefix(&part.name)?.strip_prefix('.')?;
        Some((part.name.as_str(), variable))
    });
    let longest = fitting.max_by_key(|(component, _)| component.len());
    let longest = longest.map(|(component, variable)| (component.to_string(), variable));
    let (component, variable) = match longest {
        Some(found) => found,
        None => {
            let (component, variable) = name.split_once('.').ok_or(SettingError::Form)?;
            (component.to_string(), variable)
        }
    };
    let index = component_index(components, &component)?;
    let part = &mut components[index];
    let fmu = part.fmu.clone();
    if super::fitted::is_stepping(&fmu, variable) {
        return Ok(());
    }
    if variable == "model" && fmu.description.variable(variable).is_none() {
        let set = library.parameters(text.trim(), &fmu.description, None)?;
        for (position, value) in set {
            put(&mut part.parameters, position, value);
        }
        return Ok(());
    }
    let elements = find_settable(&fmu, variable)?;
    let first = fmu.description.variables.get(elements.start);
    let is_input = first.is_some_and(|v| v.causality == Causality::Input);
    let list = if is_input {
        &mut part.inputs
    } else {
        &mut part.parameters
    };
    let Some(first) = first else {
        return Err(SettingError::Empty(variable.to_string()).into());
    };
    ask_for_unit(first, variable, text.trim())?;
    let written = as_toml(first, text.trim());
    for (position, value) in values(&fmu, variable, elements, &written)? {
        put(list, position, value);
    }
    Ok(())
}

/// Values from the command line, as from a file.
pub(super) fn as_toml(variable: &Variable, text: &str) -> Setting {
    match (&variable.kind, text.parse::<i64>()) {
        (Kind::String | Kind::Binary, _) => Setting::from(text),
        (_, Ok(number)) => Setting::from(number),
        _ => match text {
            "true" => Setting::from(true),
            "false" => Setting::from(false),
            _ => Setting::from(text),
        },
    }
}

/// A number alone for a variable with a unit is refused: on a command line nobody sees which unit
/// is meant, and the file's is rarely the laboratory's. Zero is zero in every unit.
fn ask_for_unit(variable: &Variable, name: &str, text: &str) -> Result<(), SettingError> {
    let is_float = matches!(variable.kind, Kind::Float64 | Kind::Float32);
    let unit = variable.unit.as_deref().unwrap_or_default();
    let has_dimension = matches!(
        units::convert(1.0, unit, ""),
        Err(units::UnitError::Misfit { .. })
    );
    match text.parse::<f64>() {
        Ok(number) if is_float && has_dimension && number != 0.0 => {
            let shown = variable.display_unit.as_deref();
            let shown = shown.filter(|own| *own != unit);
            Err(SettingError::NoUnit {
                text: text.to_string(),
                name: name.to_string(),
                unit: unit.to_string(),
                shown: shown.map(str::to_string),
            })
        }
        _ => Ok(()),
    }
}

/// Values for a variable, or for all elements of an array: a list, or a text with one value for
/// each between spaces.
pub(super) fn values(
    fmu: &Fmu,
    name: &str,
    positions: Range<usize>,
    written: &Setting,
) -> Result<Vec<(usize, Value)>, ValueError> {
    let variables = &fmu.description.variables;
    if fmu.description.array(name).is_none() {
        let position = positions.start;
        return Ok(vec![(
            position,
            value::read(&variables[position], written)?,
        )]);
    }
    let first = &variables[positions.start.min(variables.len().saturating_sub(1))];
    let list: Vec<Setting> = match written {
        Setting::List(list) => flat(list),
        Setting::Text(text) if !matches!(first.kind, Kind::String) => text
            .split_whitespace()
            .map(|text| as_toml(first, text))
            .collect(),
        other => vec![other.clone()],
    };
    let count = positions.len();
    let one = match list.as_slice() {
        [one] => Some(one.clone()),
        _ => None,
    };
    if one.is_none() && list.len() != count {
        return Err(ValueError::Count {
            given: list.len(),
            elements: count,
        });
    }
    positions
        .enumerate()
        .map(|(at, position)| {
            let written = one.as_ref().unwrap_or_else(|| &list[at]);
            Ok((position, value::read(&variables[position], written)?))
        })
        .collect()
}

/// A list of lists as one, row after row.
fn flat(list: &[Setting]) -> Vec<Setting> {
    let rows = list.iter().flat_map(|value| match value {
        Setting::List(row) => flat(row),
        other => vec![other.clone()],
    });
    rows.collect()
}

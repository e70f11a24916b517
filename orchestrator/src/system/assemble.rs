//! From a system as written to one whose names, types, units and connections hold.

use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use super::checked::{Component, DEFAULT_PERIOD, End, System};
use super::connection::connect;
use super::error::SystemError;
use super::file::{ComponentFile, SystemFile};
use super::link::{Link, Origin, VariableName};
use super::lookup::{component_index, find, find_settable};
use super::model;
use super::table::InputTable;
use super::value::{self, Setting, Value};
use crate::fmu::{BaseUnit, Causality, Fmu, Kind, Variability, Variable};
use crate::units::{Unit, hint};

/// Finds the FMU of a component by what the system file calls it.
pub type Library<'a> = dyn FnMut(&str) -> Result<Arc<Fmu>, Box<dyn std::error::Error>> + 'a;

/// Checks the system `file` against the FMUs that `library` gives, with `settings` (as in
/// `control.valve_limit=5 V`) on top of the parameters of the file.
///
/// # Errors
/// Unknown names (with the nearest one), units and types that do not fit, inputs driven twice or
/// not at all, values that cannot be read.
pub fn assemble(
    file: &SystemFile,
    settings: &[String],
    library: &mut Library,
) -> Result<System, SystemError> {
    let at = |place: String, reason: String| file.fault(&place, reason);
    if file.components.is_empty() {
        return Err(at("components".to_string(), "there is none".to_string()));
    }
    let mut notes = file.notes.clone();
    let mut components = Vec::new();
    for (name, part) in &file.components {
        let place = format!("components.{name}");
        // Components of archives bear the names of the systems that they stand in before theirs.
        let has_point = name.contains('.') && file.package.is_none();
        if name == "reference" || name.is_empty() || has_point {
            let reason = "this name cannot be given to a component (`reference` is the motion, \
                          and `.` stands between component and variable)";
            return Err(at(place, reason.to_string()));
        }
        let fmu = library(&part.fmu).map_err(|error| SystemError::Missing {
            origin: file.origin.clone(),
            component: name.clone(),
            reason: error.to_string(),
        })?;
        components.push(component(file, name, part, fmu, settings, &mut notes)?);
    }
    let tables = tables(file)?;
    for setting in settings {
        set(&mut components, setting).map_err(|reason| SystemError::Place {
            origin: "command line".to_string(),
            place: format!("--set {setting}"),
            reason,
        })?;
    }
    let mut connections = Vec::new();
    let mut driven: HashMap<(usize, usize), &Link> = HashMap::new();
    let links = file.connections.iter();
    let links: Vec<Link> = links
        .flat_map(|link| whole_arrays(&components, link))
        .collect();
    for link in &links {
        let wrong = |reason| file.fault(&link.place(), reason);
        let connection = connect(&components, &tables, link).map_err(wrong)?;
        let input = (connection.component, connection.input);
        if let Some(first) = driven.insert(input, link) {
            let (to, first) = (&link.to, &first.from);
            return Err(wrong(format!("`{to}` is driven by `{first}` already")));
        }
        connections.push(connection);
    }
    for (index, part) in components.iter_mut().enumerate() {
        let variables = &part.fmu.description.variables;
        part.inputs
            .retain(|(input, _)| !driven.contains_key(&(index, *input)));
        let given: HashSet<usize> = part.inputs.iter().map(|(input, _)| *input).collect();
        let open = part.fmu.description.of(Causality::Input).filter(|input| {
            variables[*input].kind.travels()
                && !given.contains(input)
                && !driven.contains_key(&(index, *input))
        });
        let open: Vec<usize> = open.collect();
        if !open.is_empty() {
            notes.push(left_open(part, &open));
        }
    }
    let end = end(file, &components)?;
    let stop = stop(file, &components)?;
    Ok(System {
        name: file.name.clone(),
        description: file.description.clone(),
        components,
        connections,
        tables,
        start: file.experiment.start.unwrap_or(0.0),
        end,
        notes,
        stop,
    })
}

/// A line on inputs that keep their own start values.
fn left_open(part: &Component, open: &[usize]) -> String {
    const SHOWN: usize = 8;
    let given = HashMap::new();
    let shown: Vec<String> = open
        .iter()
        .take(SHOWN)
        .map(|&input| {
            let variable = &part.fmu.description.variables[input];
            let unit = variable
                .unit
                .as_ref()
                .map_or(String::new(), |unit| format!(" {unit}"));
            format!(
                "`{}` ({}{unit})",
                variable.name,
                part.start_value(&given, input)
            )
        })
        .collect();
    let more = match open.len().saturating_sub(SHOWN) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let (noun, verb, their) = match open.len() {
        1 => ("input", "keeps", "its start value"),
        _ => ("inputs", "keep", "their start values"),
    };
    format!(
        "`{}`: the open {noun} {}{more} {verb} {their}",
        part.name,
        shown.join(", ")
    )
}

/// The links between the elements of two arrays of the same size, or the link as it is.
fn whole_arrays(components: &[Component], link: &Link) -> Vec<Link> {
    let elements = |name: &VariableName| {
        let part = components.iter().find(|part| part.name == name.component)?;
        let description = &part.fmu.description;
        let names = description.array(&name.variable)?;
        let names =
            names.map(|at| VariableName::new(&name.component, &description.variables[at].name));
        Some(names.collect::<Vec<_>>())
    };
    let Origin::Output(from) = &link.from else {
        return vec![link.clone()];
    };
    match (elements(from), elements(&link.to)) {
        (Some(many), Some(others)) if many.len() == others.len() => {
            let pairs = many.into_iter().zip(others);
            let link = |(from, to)| Link {
                from: Origin::Output(from),
                to,
                way: link.way.clone(),
                line: link.line,
            };
            pairs.map(link).collect()
        }
        _ => vec![link.clone()],
    }
}

/// The FMU with arrays as large as the structural parameters say that the file or the command line
/// gives.
fn resized(
    fmu: Arc<Fmu>,
    name: &str,
    part: &ComponentFile,
    settings: &[String],
) -> Result<Arc<Fmu>, String> {
    let description = &fmu.description;
    let structural = |variable: &str| {
        let position = description.position(variable)?;
        let sizes_arrays = description.variables[position].is_structural;
        sizes_arrays.then_some(position)
    };
    let mut sizes: Vec<(usize, u64)> = Vec::new();
    let mut note = |position: usize, value: Value| {
        let size = match value {
            Value::Unsigned(size) => Some(size),
            Value::Signed(size) => u64::try_from(size).ok(),
            Value::Number(size) => Some(size as u64),
            Value::Text(_) => None,
        };
        if let Some(size) = size {
            sizes.retain(|(known, _)| *known != position);
            sizes.push((position, size));
        }
    };
    for (variable, written) in &part.parameters {
        if let Some(position) = structural(variable) {
            note(
                position,
                value::read(&description.variables[position], written)?,
            );
        }
    }
    for setting in settings {
        if let Some((variable, text)) = setting.split_once('=')
            && let Some(variable) = variable.trim().strip_prefix(name)
            && let Some(variable) = variable.strip_prefix('.')
            && let Some(position) = structural(variable)
        {
            let variable = &description.variables[position];
            note(
                position,
                value::read(variable, &as_toml(variable, text.trim()))?,
            );
        }
    }
    if sizes.is_empty() {
        return Ok(fmu);
    }
    fmu.resized(&sizes).map_err(|error| error.to_string())
}

/// What stands on the command line as if it stood in a file.
fn as_toml(variable: &Variable, text: &str) -> Setting {
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
fn ask_for_unit(variable: &Variable, name: &str, text: &str) -> Result<(), String> {
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
            let or = shown.map_or(String::new(), |own| format!(" or \"{text} {own}\""));
            Err(format!(
                "`{text}` has no unit, and `{name}` is in {unit}; expected a number with its unit, \
                 such as {name}=\"{text} {unit}\"{or}"
            ))
        }
        _ => Ok(()),
    }
}

/// Values for a variable, or for all elements of an array: a list, or a text with one value for
/// each between spaces.
fn values(
    fmu: &Fmu,
    name: &str,
    positions: Range<usize>,
    written: &Setting,
) -> Result<Vec<(usize, Value)>, String> {
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
        return Err(format!(
            "{} values for an array of {count} elements",
            list.len()
        ));
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

fn component(
    file: &SystemFile,
    name: &str,
    part: &ComponentFile,
    fmu: Arc<Fmu>,
    settings: &[String],
    notes: &mut Vec<String>,
) -> Result<Component, SystemError> {
    let at = |place: &str, reason| file.fault(&format!("components.{name}{place}"), reason);
    let fmu = resized(fmu, name, part, settings).map_err(|reason| at("", reason))?;
    let fmu = with_units(fmu, part)
        .map_err(|(variable, reason)| at(&format!(".units.{variable}"), reason))?;
    let description = &fmu.description;
    let mut parameters = Vec::new();
    if let Some(model) = &part.model {
        let set = model::parameters(model, description, file.directory.as_deref());
        parameters = set.map_err(|reason| at(".model", reason))?;
    }
    let mut inputs = Vec::new();
    for (variable, written) in &part.parameters {
        let place = format!(".parameters.{variable}");
        let is_known =
            description.position(variable).is_some() || description.array(variable).is_some();
        if file.is_lenient && !is_known {
            let known = description
                .of(Causality::Parameter)
                .map(|index| description.variables[index].name.as_str());
            notes.push(format!(
                "`{name}` has no variable `{variable}`{}: that parameter is passed over",
                hint(variable, known)
            ));
            continue;
        }
        let found = find_settable(&fmu, variable).map_err(|reason| at(&place, reason))?;
        let read = values(&fmu, variable, found, written).map_err(|reason| at(&place, reason))?;
        for (position, value) in read {
            match description.variables[position].causality {
                Causality::Input => put(&mut inputs, position, value),
                _ => put(&mut parameters, position, value),
            }
        }
    }
    for (variable, written) in &part.inputs {
        let place = format!(".inputs.{variable}");
        let found = match description.array(variable) {
            Some(elements) => elements,
            None => {
                let found = find(&fmu, variable, Causality::Input);
                let position = found.map_err(|reason| at(&place, reason))?;
                position..position + 1
            }
        };
        let read = values(&fmu, variable, found, written).map_err(|reason| at(&place, reason))?;
        read.into_iter()
            .for_each(|(position, value)| put(&mut inputs, position, value));
    }
    let period = match &part.period {
        Some(written) => Some(value::time(written).map_err(|reason| at(".period", reason))?),
        None => sampled(&fmu).then(|| description.preferred_step.unwrap_or(DEFAULT_PERIOD)),
    };
    let mut aliases = Vec::new();
    for (alias, variable) in &part.aliases {
        let place = format!(".aliases.{alias}");
        let found = find(&fmu, variable, Causality::Output);
        let found = found.map_err(|reason| at(&place, reason))?;
        if description
            .position(alias)
            .is_some_and(|known| known != found)
        {
            let reason = format!("`{alias}` is a variable of it");
            return Err(at(&place, reason));
        }
        aliases.push((alias.clone(), found));
    }
    Ok(Component {
        name: name.to_string(),
        fmu,
        period,
        parameters,
        inputs,
        aliases,
    })
}

/// The FMU with the units that the file gives to its variables.
fn with_units(fmu: Arc<Fmu>, part: &ComponentFile) -> Result<Arc<Fmu>, (String, String)> {
    if part.units.is_empty() {
        return Ok(fmu);
    }
    let mut changed = Fmu::clone(&fmu);
    for (variable, unit) in &part.units {
        let fault = |reason: String| (variable.clone(), reason);
        let found = fmu
            .description
            .array(variable)
            .or_else(|| fmu.description.position(variable).map(|at| at..at + 1));
        let found = found.ok_or_else(|| {
            let known = fmu.description.variables.iter();
            let known = known.map(|variable| variable.name.as_str());
            fault(format!("no such variable{}", hint(variable, known)))
        })?;
        // A unit that only FMUs know is taken by its name.
        let parsed = Unit::parse(unit).ok().and_then(|unit| unit.base_unit());
        let base = parsed.map(|base| {
            let [kg, m, s, a, k, mol, cd, _] = base.exponents;
            BaseUnit {
                exponents: [kg, m, s, a, k, mol, cd],
                factor: base.factor,
                offset: 0.0,
            }
        });
        for position in found {
            let variable = &mut changed.description.variables[position];
            if !matches!(variable.kind, Kind::Float64 | Kind::Float32) {
                let kind = variable.kind.name();
                return Err(fault(format!("a {kind} has no unit")));
            }
            variable.unit = Some(unit.clone());
            variable.base_unit = base;
        }
    }
    Ok(Arc::new(changed))
}

/// The input tables of the file, read.
fn tables(file: &SystemFile) -> Result<Vec<InputTable>, SystemError> {
    let mut tables = file.own_tables.clone();
    for (name, table) in &file.tables {
        let at = |reason| file.fault(&format!("tables.{name}"), reason);
        if name == "reference" || name.contains('.') || file.components.contains_key(name) {
            let reason = "this name belongs to the motion or a component, or has a `.`";
            return Err(at(reason.to_string()));
        }
        let place = file.directory.as_deref().unwrap_or(Path::new(""));
        let read = InputTable::read(name, &place.join(&table.file), table.between);
        tables.push(read.map_err(at)?);
    }
    Ok(tables)
}

/// Whether every output that depends directly on inputs changes at samples only: such a component
/// computes them when it is stepped, not when they are read.
fn sampled(fmu: &Fmu) -> bool {
    let description = &fmu.description;
    let outputs = description
        .of(Causality::Output)
        .map(|output| &description.variables[output]);
    let mut direct = outputs
        .filter(|variable| !variable.dependencies.is_empty())
        .peekable();
    direct.peek().is_some() && direct.all(|v| v.variability == Variability::Discrete)
}

fn put(values: &mut Vec<(usize, Value)>, position: usize, value: Value) {
    match values.iter_mut().find(|(known, _)| *known == position) {
        Some(entry) => entry.1 = value,
        None => values.push((position, value)),
    }
}

/// Carries out `component.variable=VALUE` of the command line; `component.model=NAME` sets all
/// that a published model or a model file gives to the component.
fn set(components: &mut [Component], setting: &str) -> Result<(), String> {
    let expected = "expected component.variable=VALUE, such as control.valve_limit=\"5 V\"";
    let (name, text) = setting.split_once('=').ok_or(expected)?;
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
            let (component, variable) = name.split_once('.').ok_or(expected)?;
            (component.to_string(), variable)
        }
    };
    let index = component_index(components, &component)?;
    let part = &mut components[index];
    let fmu = part.fmu.clone();
    if variable == "model" && fmu.description.variable(variable).is_none() {
        let set = model::parameters(text.trim(), &fmu.description, None)?;
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
        return Err(format!("`{variable}` has no elements"));
    };
    ask_for_unit(first, variable, text.trim())?;
    let written = as_toml(first, text.trim());
    for (position, value) in values(&fmu, variable, elements, &written)? {
        put(list, position, value);
    }
    Ok(())
}

/// What ends the run early.
fn end(file: &SystemFile, components: &[Component]) -> Result<Option<End>, SystemError> {
    let at = |place: &str| {
        let place = format!("experiment.{place}");
        move |reason| file.fault(&place, reason)
    };
    let experiment = &file.experiment;
    let after = experiment.end_after.as_ref().map(value::time).transpose();
    let after = after.map_err(at("end_after"))?.unwrap_or(0.0);
    let Some(name) = &experiment.end_when else {
        return Ok(None);
    };
    let when = truth(components, name, Causality::Output).map_err(at("end_when"))?;
    let cause = experiment.end_cause.as_ref();
    let cause = cause.map(|name| {
        let (component, variable) = position(components, name, Causality::Output)?;
        match &components[component].fmu.description.variables[variable].kind {
            Kind::Enumeration(_) => Ok((component, variable)),
            _ => Err(format!("`{name}` is no enumeration")),
        }
    });
    let cause = cause.transpose().map_err(at("end_cause"))?;
    Ok(Some(End { when, cause, after }))
}

/// The input that is set when a sampled component fails.
fn stop(
    file: &SystemFile,
    components: &[Component],
) -> Result<Option<(usize, usize)>, SystemError> {
    let name = file.experiment.stop.as_ref();
    let found = name.map(|name| truth(components, name, Causality::Input));
    found
        .transpose()
        .map_err(|reason| file.fault("experiment.stop", reason))
}

/// A Boolean output or input, by its name.
fn truth(
    components: &[Component],
    name: &VariableName,
    causality: Causality,
) -> Result<(usize, usize), String> {
    let (component, variable) = position(components, name, causality)?;
    match components[component].fmu.description.variables[variable].kind {
        Kind::Boolean => Ok((component, variable)),
        _ => Err(format!("`{name}` is not Boolean")),
    }
}

/// Component and variable, by its name.
fn position(
    components: &[Component],
    name: &VariableName,
    causality: Causality,
) -> Result<(usize, usize), String> {
    let component = component_index(components, &name.component)?;
    let variable = find(&components[component].fmu, &name.variable, causality)?;
    Ok((component, variable))
}

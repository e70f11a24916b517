//! From a system as written to one whose names, types, units and connections hold.

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use super::checked::{Component, DEFAULT_PERIOD, System};
use super::connection::connect;
use super::ending::{end, stop};
use super::error::{Misfit, SystemError};
use super::file::{ComponentFile, SystemFile};
use super::fitted::{resized, stepped, with_units};
use super::given::{put, set, values};
use super::library::Library;
use super::link::{Link, Origin, VariableName};
use super::lookup::{find, find_settable};
use super::table::InputTable;
use super::terminals;
use super::value;
use fmi_import::{Causality, Fmu, Ticks, Variability};
use units::hint;

/// Checks the system `file` against the FMUs that `library` gives, with `settings` (as in
/// `control.valve_limit=5 V`) on top of the parameters of the file.
///
/// # Errors
/// Unknown names (with the nearest one), units and types that do not fit, inputs driven twice or
/// not at all, values that cannot be read.
pub fn assemble(
    file: &SystemFile,
    settings: &[String],
    library: &mut dyn Library,
) -> Result<System, SystemError> {
    if file.components.is_empty() {
        return Err(file.fault("components", Misfit::NoComponent));
    }
    let mut notes = file.notes.clone();
    let mut components = Vec::new();
    for (name, part) in &file.components {
        // Components of archives bear the names of the systems that they stand in before theirs.
        let has_point = name.contains('.') && file.package.is_none();
        if name == "reference" || name.is_empty() || has_point {
            let place = format!("components.{name}");
            return Err(file.fault(&place, Misfit::ComponentName));
        }
        let fmu = library
            .fmu(&part.fmu)
            .map_err(|error| SystemError::Missing {
                origin: file.origin.clone(),
                component: name.clone(),
                reason: error.to_string(),
            })?;
        let found = component(file, name, part, fmu, settings, library, &mut notes)?;
        components.push(found);
    }
    let tables = tables(file)?;
    for setting in settings {
        set(&mut components, setting, library).map_err(|reason| SystemError::Place {
            origin: "command line".to_string(),
            place: format!("--set {setting}"),
            reason: Box::new(reason),
        })?;
    }
    let mut connections = Vec::new();
    let mut driven: HashMap<(usize, usize), &Link> = HashMap::new();
    let mut links: Vec<Link> = Vec::new();
    for link in &file.connections {
        let members = terminals::members(&components, link);
        let members = members.map_err(|reason| file.fault(&link.place(), reason))?;
        links.extend(
            members
                .iter()
                .flat_map(|link| whole_arrays(&components, link)),
        );
    }
    for link in &links {
        let wrong = |reason| file.fault(&link.place(), reason);
        let connection = connect(&components, &tables, link).map_err(wrong)?;
        let input = (connection.component, connection.input);
        if let Some(first) = driven.insert(input, link) {
            return Err(wrong(Misfit::DrivenTwice {
                input: link.to.to_string(),
                source_before: first.from.to_string(),
            }));
        }
        connections.push(connection);
    }
    for (index, part) in components.iter_mut().enumerate() {
        let variables = &part.fmu.description.variables;
        part.inputs
            .retain(|(input, _)| !driven.contains_key(&(index, *input)));
        let given: HashSet<usize> = part.inputs.iter().map(|(input, _)| *input).collect();
        let open = part
            .fmu
            .description
            .of(Causality::Input)
            .filter(|input| !given.contains(input) && !driven.contains_key(&(index, *input)));
        let (clocks, open): (Vec<usize>, Vec<usize>) =
            open.partition(|&input| !variables[input].kind.has_values());
        if !open.is_empty() {
            notes.push(left_open(part, &open));
        }
        let description = &part.fmu.description;
        for clock in clocks {
            let name = &variables[clock].name;
            if description.ticks(clock) == Some(Ticks::Triggered) {
                notes.push(format!(
                    "`{}`: nothing triggers the input clock `{name}`: it never ticks; connect an \
                     output clock to it",
                    part.name
                ));
            }
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

fn component(
    file: &SystemFile,
    name: &str,
    part: &ComponentFile,
    fmu: Arc<Fmu>,
    settings: &[String],
    library: &mut dyn Library,
    notes: &mut Vec<String>,
) -> Result<Component, SystemError> {
    let at = |place: &str, reason: Misfit| file.fault(&format!("components.{name}{place}"), reason);
    let fmu = stepped(fmu, name, part, settings)
        .map_err(|(key, reason)| at(&format!(".{key}"), reason.into()))?;
    let fmu = resized(fmu, name, part, settings).map_err(|reason| at("", reason))?;
    let fmu = with_units(fmu, part)
        .map_err(|(variable, reason)| at(&format!(".units.{variable}"), reason.into()))?;
    let fmu = with_locals(fmu, file, name, part, notes);
    let description = &fmu.description;
    let mut parameters = Vec::new();
    if let Some(model) = &part.model {
        let set = library.parameters(model, description, file.directory.as_deref());
        parameters = set.map_err(|reason| at(".model", reason.into()))?;
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
                "`{name}` has no variable `{variable}`{}: that parameter is ignored",
                hint(variable, known)
            ));
            continue;
        }
        let found = find_settable(&fmu, variable).map_err(|reason| at(&place, reason.into()))?;
        let read =
            values(&fmu, variable, found, written).map_err(|reason| at(&place, reason.into()))?;
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
                let position = found.map_err(|reason| at(&place, reason.into()))?;
                position..position + 1
            }
        };
        let read =
            values(&fmu, variable, found, written).map_err(|reason| at(&place, reason.into()))?;
        read.into_iter()
            .for_each(|(position, value)| put(&mut inputs, position, value));
    }
    let period = match &part.period {
        Some(written) => Some(value::time(written).map_err(|reason| at(".period", reason.into()))?),
        // No period is invented for an FMU of somebody else.
        None => sampled(&fmu)
            .then(|| {
                let own = fmu.is_own.then_some(DEFAULT_PERIOD);
                description.preferred_step.or(own)
            })
            .flatten(),
    };
    let mut aliases = Vec::new();
    for (alias, variable) in &part.aliases {
        let place = format!(".aliases.{alias}");
        let found = find(&fmu, variable, Causality::Output);
        let found = found.map_err(|reason| at(&place, reason.into()))?;
        if description
            .position(alias)
            .is_some_and(|known| known != found)
        {
            return Err(at(&place, Misfit::AliasTaken(alias.clone())));
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

/// Most local variables that are recorded where an FMU has no outputs.
const MOST_LOCALS: usize = 1000;

/// The FMU with the local variables as outputs that the system connects or gives another name. Where
/// a single component has no outputs at all, all that it computes are.
fn with_locals(
    fmu: Arc<Fmu>,
    file: &SystemFile,
    name: &str,
    part: &ComponentFile,
    notes: &mut Vec<String>,
) -> Arc<Fmu> {
    let description = &fmu.description;
    let connected = file.connections.iter().filter_map(|link| match &link.from {
        Origin::Output(from) if from.component == name => Some(from.variable.as_str()),
        _ => None,
    });
    let wanted = part.aliases.values().map(String::as_str).chain(connected);
    let found = wanted.filter_map(|variable| {
        let position = description.position(variable);
        position.or_else(|| Some(description.array(variable)?.start))
    });
    let is_local = |at: &usize| {
        let variable = &description.variables[*at];
        variable.causality == Causality::Local && variable.kind.has_values()
    };
    let mut locals: Vec<usize> = found.filter(is_local).collect();
    let is_mute = description.of(Causality::Output).next().is_none();
    if is_mute && file.components.len() == 1 {
        let all = description.of(Causality::Local).filter(is_local);
        let all = all.filter(|&at| {
            description.variables[at].name != "time"
                && description.variables[at].variability != Variability::Fixed
        });
        locals.extend(all.take(MOST_LOCALS));
        if !locals.is_empty() {
            notes.push(format!(
                "`{name}` has no outputs, so its local variables are recorded"
            ));
        }
    }
    match locals.is_empty() {
        true => fmu,
        false => Arc::new(fmu.with_outputs(&locals)),
    }
}

/// The input tables of the file, read.
fn tables(file: &SystemFile) -> Result<Vec<InputTable>, SystemError> {
    let mut tables = file.own_tables.clone();
    for (name, table) in &file.tables {
        let at = |reason: Misfit| file.fault(&format!("tables.{name}"), reason);
        if name == "reference" || name.contains('.') || file.components.contains_key(name) {
            return Err(at(Misfit::TableName));
        }
        let place = file.directory.as_deref().unwrap_or(Path::new(""));
        let read = InputTable::read(name, &place.join(&table.file), table.between);
        tables.push(read.map_err(|error| at(error.into()))?);
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

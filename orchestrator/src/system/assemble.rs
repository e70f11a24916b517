//! From a system as written to one whose names, types, units and connections hold.

use std::collections::HashMap;
use std::sync::Arc;

use super::checked::{Component, DEFAULT_PERIOD, End, System};
use super::connection::connect;
use super::error::SystemError;
use super::file::{ComponentFile, SystemFile};
use super::link::{Link, VariableName};
use super::lookup::{component_index, find};
use super::model;
use super::value::{self, Setting, Value};
use crate::fmu::{Causality, Fmu, Kind, Variability};

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
    let mut components = Vec::new();
    for (name, part) in &file.components {
        let place = format!("components.{name}");
        if name == "reference" || name.is_empty() || name.contains('.') {
            let reason = "this name cannot be given to a component (`reference` is the motion, \
                          and `.` stands between component and variable)";
            return Err(at(place, reason.to_string()));
        }
        let fmu = library(&part.fmu).map_err(|error| SystemError::Missing {
            origin: file.origin.clone(),
            component: name.clone(),
            reason: error.to_string(),
        })?;
        components.push(component(file, name, part, fmu)?);
    }
    for setting in settings {
        set(&mut components, setting).map_err(|reason| SystemError::Place {
            origin: "command line".to_string(),
            place: format!("--set {setting}"),
            reason,
        })?;
    }
    let mut connections = Vec::new();
    let mut driven: HashMap<(usize, usize), &Link> = HashMap::new();
    for link in &file.connections {
        let wrong = |reason| file.fault(&link.place(), reason);
        let connection = connect(&components, link).map_err(wrong)?;
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
        for input in part.fmu.description.of(Causality::Input) {
            let given = part.inputs.iter().any(|(variable, _)| *variable == input);
            if !given && !driven.contains_key(&(index, input)) {
                let (name, input) = (&part.name, &variables[input].name);
                return Err(at(
                    format!("components.{name}"),
                    format!(
                        "the input `{name}.{input}` is open: connect it, or give it a value under \
                         [components.{name}.inputs]"
                    ),
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
        end,
        stop,
    })
}

fn component(
    file: &SystemFile,
    name: &str,
    part: &ComponentFile,
    fmu: Arc<Fmu>,
) -> Result<Component, SystemError> {
    let at = |place: &str, reason| file.fault(&format!("components.{name}{place}"), reason);
    let description = &fmu.description;
    let mut parameters = Vec::new();
    if let Some(model) = &part.model {
        let set = model::parameters(model, description, file.directory.as_deref());
        parameters = set.map_err(|reason| at(".model", reason))?;
    }
    for (variable, written) in &part.parameters {
        let place = format!(".parameters.{variable}");
        let found = find(&fmu, variable, Causality::Parameter);
        let position = found.map_err(|reason| at(&place, reason))?;
        let value = value::read(&description.variables[position], written);
        put(
            &mut parameters,
            position,
            value.map_err(|reason| at(&place, reason))?,
        );
    }
    let mut inputs = Vec::new();
    for (variable, written) in &part.inputs {
        let place = format!(".inputs.{variable}");
        let found = find(&fmu, variable, Causality::Input);
        let position = found.map_err(|reason| at(&place, reason))?;
        let value = value::read(&description.variables[position], written);
        put(
            &mut inputs,
            position,
            value.map_err(|reason| at(&place, reason))?,
        );
    }
    let period = match &part.period {
        Some(written) => Some(value::time(written).map_err(|reason| at(".period", reason))?),
        None => sampled(&fmu).then(|| description.preferred_step.unwrap_or(DEFAULT_PERIOD)),
    };
    Ok(Component {
        name: name.to_string(),
        fmu,
        period,
        parameters,
        inputs,
    })
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
    let (component, variable) = name.trim().split_once('.').ok_or(expected)?;
    let index = component_index(components, component)?;
    let part = &mut components[index];
    let fmu = part.fmu.clone();
    if variable == "model" && fmu.description.variable(variable).is_none() {
        let set = model::parameters(text.trim(), &fmu.description, None)?;
        for (position, value) in set {
            put(&mut part.parameters, position, value);
        }
        return Ok(());
    }
    let is_input = fmu.description.variable(variable);
    let is_input = is_input.is_some_and(|v| v.causality == Causality::Input);
    let (causality, values) = if is_input {
        (Causality::Input, &mut part.inputs)
    } else {
        (Causality::Parameter, &mut part.parameters)
    };
    let position = find(&fmu, variable, causality)?;
    let variable = &fmu.description.variables[position];
    let text = text.trim();
    let written = match (&variable.kind, text.parse::<i64>()) {
        (Kind::String, _) => Setting::from(text),
        (_, Ok(number)) => Setting::from(number),
        _ => match text {
            "true" => Setting::from(true),
            "false" => Setting::from(false),
            _ => Setting::from(text),
        },
    };
    put(values, position, value::read(variable, &written)?);
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

//! What ends a run early, and what is stopped then.

use super::checked::{Component, End};
use super::error::{Misfit, SystemError};
use super::file::SystemFile;
use super::link::VariableName;
use super::lookup::{component_index, find};
use super::value;
use fmi_import::{Causality, Kind};

/// What ends the run early.
pub(super) fn end(file: &SystemFile, components: &[Component]) -> Result<Option<End>, SystemError> {
    let at = |place: &str| {
        let place = format!("experiment.{place}");
        move |reason: Misfit| file.fault(&place, reason)
    };
    let experiment = &file.experiment;
    let after = experiment.end_after.as_ref().map(value::time).transpose();
    let after = after
        .map_err(|reason| at("end_after")(reason.into()))?
        .unwrap_or(0.0);
    let Some(name) = &experiment.end_when else {
        return Ok(None);
    };
    let when = truth(components, name, Causality::Output).map_err(at("end_when"))?;
    let cause = experiment.end_cause.as_ref();
    let cause = cause.map(|name| {
        let (component, variable) = position(components, name, Causality::Output)?;
        match &components[component].fmu.description.variables[variable].kind {
            Kind::Enumeration(_) => Ok((component, variable)),
            _ => Err(Misfit::Type {
                name: name.to_string(),
                expected: "an enumeration",
            }),
        }
    });
    let cause = cause.transpose().map_err(at("end_cause"))?;
    Ok(Some(End { when, cause, after }))
}

/// The input that is set when a sampled component fails.
pub(super) fn stop(
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
) -> Result<(usize, usize), Misfit> {
    let (component, variable) = position(components, name, causality)?;
    match components[component].fmu.description.variables[variable].kind {
        Kind::Boolean => Ok((component, variable)),
        _ => Err(Misfit::Type {
            name: name.to_string(),
            expected: "Boolean",
        }),
    }
}

/// Component and variable, by its name.
fn position(
    components: &[Component],
    name: &VariableName,
    causality: Causality,
) -> Result<(usize, usize), Misfit> {
    let component = component_index(components, &name.component)?;
    let variable = find(&components[component].fmu, &name.variable, causality)?;
    Ok((component, variable))
}

//! Connections checked against the FMUs: names, types and units.

use super::checked::{Component, Connection, Source};
use super::link::{Link, Origin};
use super::lookup::{component_index, find};
use crate::fmu::{Causality, Kind, Variable};
use crate::units::Unit;

/// The connection of a link, after its names, types and units were checked.
///
/// # Errors
/// What does not hold.
pub(super) fn connect(components: &[Component], link: &Link) -> Result<Connection, String> {
    let Link { from, to, .. } = link;
    let component = component_index(components, &to.component)?;
    let input = find(&components[component].fmu, &to.variable, Causality::Input)?;
    let target = &components[component].fmu.description.variables[input];

    let (source, kind, unit) = match from {
        Origin::Reference { quantity, ahead } => {
            let source = Source::Reference {
                quantity: *quantity,
                ahead: *ahead,
            };
            (source, &Kind::Float64, Some(quantity.unit()))
        }
        Origin::Output(name) => {
            let component = component_index(components, &name.component)?;
            let fmu = &components[component].fmu;
            let variable = find(fmu, &name.variable, Causality::Output)?;
            let output = &fmu.description.variables[variable];
            let source = Source::Output {
                component,
                variable,
            };
            (source, &output.kind, output.unit.as_deref())
        }
    };
    fits(kind, target).map_err(|reason| format!("`{from}` {reason} `{to}`"))?;
    let factor = factor(unit, target.unit.as_deref())
        .map_err(|reason| format!("`{from}` does not fit `{to}`: {reason}"))?;
    Ok(Connection {
        source,
        component,
        input,
        factor,
    })
}

fn fits(kind: &Kind, target: &Variable) -> Result<(), String> {
    let same = kind.name() == target.kind.name();
    let widened = *kind == Kind::Int32 && target.kind == Kind::Float64;
    if kind.is_numeric() && (same || widened) {
        return Ok(());
    }
    let (from, to) = (kind.name(), target.kind.name());
    Err(format!("is a {from} and cannot drive the {to}"))
}

/// The factor from one unit to the other; a side without a unit takes the other's.
fn factor(from: Option<&str>, to: Option<&str>) -> Result<f64, String> {
    match (from, to) {
        (Some(from), Some(to)) if from != to => {
            let unit = |text: &str| Unit::parse(text).map_err(|error| error.to_string());
            let factor = unit(from)?.factor_to(&unit(to)?);
            factor.map_err(|error| error.to_string())
        }
        _ => Ok(1.0),
    }
}

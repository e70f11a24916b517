//! Connections checked against the FMUs: names, types and units.

use super::checked::{Component, Connection, Source};
use super::link::{Link, Origin};
use super::lookup::{component_index, find};
use crate::fmu::{BaseUnit, Causality, Kind, Variable};
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

    let (source, kind, unit, base) = match from {
        Origin::Reference { quantity, ahead } => {
            let source = Source::Reference {
                quantity: *quantity,
                ahead: *ahead,
            };
            (
                source,
                &Kind::Float64,
                Some(quantity.unit()),
                Some(quantity.base_unit()),
            )
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
            (
                source,
                &output.kind,
                output.unit.as_deref(),
                output.base_unit,
            )
        }
    };
    fits(kind, target).map_err(|reason| format!("`{from}` {reason} `{to}`"))?;
    let (factor, offset) = conversion((unit, base), (target.unit.as_deref(), target.base_unit))
        .map_err(|reason| format!("`{from}` does not fit `{to}`: {reason}"))?;
    Ok(Connection {
        source,
        component,
        input,
        factor,
        offset,
    })
}

fn fits(kind: &Kind, target: &Variable) -> Result<(), String> {
    if kind.drives(&target.kind) {
        return Ok(());
    }
    let (from, to) = (kind.name(), target.kind.name());
    Err(format!("is a {from} and cannot drive the {to}"))
}

/// A unit as a description names it, and what it is in SI where the description says so.
type NamedUnit<'a> = (Option<&'a str>, Option<BaseUnit>);

/// Factor and offset from one unit to the other; a side without a unit takes the other's.
fn conversion(from: NamedUnit, to: NamedUnit) -> Result<(f64, f64), String> {
    let ((Some(name), base), (Some(target), target_base)) = (from, to) else {
        return Ok((1.0, 0.0));
    };
    let (Some(base), Some(target_base)) = (base, target_base) else {
        if name == target {
            return Ok((1.0, 0.0));
        }
        let unit = |text: &str| Unit::parse(text).map_err(|error| error.to_string());
        let factor = unit(name)?.factor_to(&unit(target)?);
        return factor
            .map(|factor| (factor, 0.0))
            .map_err(|error| error.to_string());
    };
    if base == target_base {
        return Ok((1.0, 0.0));
    }
    if name == target {
        return Err(format!(
            "both are in `{name}`, but that is {} in one FMU and {} in the other",
            in_si(&base),
            in_si(&target_base)
        ));
    }
    if base.exponents != target_base.exponents {
        return Err(format!(
            "`{name}` is {} and `{target}` is {}",
            in_si(&base),
            in_si(&target_base)
        ));
    }
    // Written units that our own grammar knows keep its factors, which are exact.
    let known = || Some((Unit::parse(name).ok()?, Unit::parse(target).ok()?));
    if base.offset == 0.0
        && target_base.offset == 0.0
        && let Some((from, to)) = known()
        && let Ok(factor) = from.factor_to(&to)
        && (factor * target_base.factor / base.factor - 1.0).abs() < 1e-6
    {
        return Ok((factor, 0.0));
    }
    Ok((
        base.factor / target_base.factor,
        (base.offset - target_base.offset) / target_base.factor,
    ))
}

/// A unit in SI, for people.
fn in_si(base: &BaseUnit) -> String {
    let names = ["kg", "m", "s", "A", "K", "mol", "cd"];
    let mut text = base.factor.to_string();
    for (name, &exponent) in names.iter().zip(&base.exponents) {
        match exponent {
            0 => {}
            1 => text += &format!(" {name}"),
            exponent => text += &format!(" {name}^{exponent}"),
        }
    }
    if base.offset != 0.0 {
        text += &format!(" + {}", base.offset);
    }
    text
}

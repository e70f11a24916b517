//! `"table.displacement -> control.measured_displacement"`.

use super::assemble::{component_index, find};
use super::{Component, Connection, hint};
use crate::fmu::{BaseUnit, Causality, Kind, Variable};
use crate::units::Unit;

/// Where a connection's value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Source {
    /// The motion that the table is asked for.
    Reference {
        /// What of it.
        quantity: Quantity,
        /// How many samples ahead of the present one; negative: before it.
        ahead: isize,
    },
    /// An output of a component.
    Output {
        /// The component.
        component: usize,
        /// Position of the variable.
        variable: usize,
    },
}

/// What of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Displacement, m.
    Displacement,
    /// Velocity, m/s.
    Velocity,
    /// Acceleration, m/s².
    Acceleration,
}

impl Quantity {
    /// All of them, in the order of their results.
    pub const ALL: [Self; 3] = [Self::Displacement, Self::Velocity, Self::Acceleration];

    /// Its name as an output of `reference`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Displacement => "displacement",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
        }
    }

    /// Its unit in SI.
    fn base_unit(self) -> BaseUnit {
        let seconds = match self {
            Self::Displacement => 0,
            Self::Velocity => -1,
            Self::Acceleration => -2,
        };
        BaseUnit {
            exponents: [0, 1, seconds, 0, 0, 0, 0],
            factor: 1.0,
            offset: 0.0,
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Displacement => "m",
            Self::Velocity => "m/s",
            Self::Acceleration => "m/s2",
        }
    }
}

/// The two ends of a connection as written; `[a..b]` on both sides stands for several.
///
/// # Errors
/// What was expected.
pub(super) fn parse(text: &str) -> Result<Vec<(String, String)>, String> {
    let (from, to) = text
        .split_once("->")
        .ok_or("expected \"component.output -> component.input\"")?;
    let (from, to) = (expand(from.trim())?, expand(to.trim())?);
    if from.len() != to.len() {
        return Err(format!(
            "{} values on the left and {} on the right",
            from.len(),
            to.len()
        ));
    }
    Ok(from.into_iter().zip(to).collect())
}

fn expand(end: &str) -> Result<Vec<String>, String> {
    let range = end
        .strip_suffix(']')
        .and_then(|rest| rest.rsplit_once('['))
        .and_then(|(name, range)| Some((name, range.split_once("..")?)));
    let Some((name, (first, last))) = range else {
        return Ok(vec![end.to_string()]);
    };
    let bound = |text: &str| text.trim().parse::<usize>().ok().filter(|&n| n < 100_000);
    match (bound(first), bound(last)) {
        (Some(first), Some(last)) if first <= last => Ok((first..=last)
            .map(|index| format!("{name}[{index}]"))
            .collect()),
        _ => Err(format!("`{end}` has no range such as [1..15]")),
    }
}

/// `displacement` or `displacement[3]` of the reference.
fn reference(variable: &str) -> Option<Source> {
    let (name, ahead) = match variable.strip_suffix(']') {
        None => (variable, 0),
        Some(rest) => {
            let (name, index) = rest.split_once('[')?;
            (
                name,
                index
                    .trim()
                    .parse()
                    .ok()
                    .filter(|ahead: &isize| ahead.abs() < 100_000)?,
            )
        }
    };
    let quantity = Quantity::ALL.into_iter().find(|q| q.name() == name)?;
    Some(Source::Reference { quantity, ahead })
}

pub(super) fn split(end: &str) -> Result<(&str, &str), String> {
    end.split_once('.')
        .ok_or_else(|| format!("`{end}` should read component.variable"))
}

/// The connection of `from` to `to`, after its names, types and units were checked.
///
/// # Errors
/// What does not hold.
pub(super) fn connect(
    components: &[Component],
    from: &str,
    to: &str,
) -> Result<Connection, String> {
    let (component, variable) = split(to)?;
    let component = component_index(components, component)?;
    let input = find(&components[component].fmu, variable, Causality::Input)?;
    let target = &components[component].fmu.description.variables[input];

    let (name, variable) = split(from)?;
    let (source, kind, unit, base) = if name == "reference" {
        let source = reference(variable).ok_or_else(|| {
            let known = Quantity::ALL.into_iter().map(Quantity::name);
            format!(
                "the reference has no `{variable}`{} (or `displacement[3]`, three samples ahead)",
                hint(variable, known)
            )
        })?;
        let Source::Reference { quantity, .. } = source else {
            return Err(format!("`{from}` is no reference"));
        };
        (
            source,
            Kind::Float64,
            Some(quantity.unit()),
            Some(quantity.base_unit()),
        )
    } else {
        let component = component_index(components, name)?;
        let variable = find(&components[component].fmu, variable, Causality::Output)?;
        let output = &components[component].fmu.description.variables[variable];
        let source = Source::Output {
            component,
            variable,
        };
        (
            source,
            output.kind.clone(),
            output.unit.as_deref(),
            output.base_unit,
        )
    };
    fits(&kind, target).map_err(|reason| format!("`{from}` {reason} `{to}`"))?;
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

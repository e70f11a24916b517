//! Which parameters may be changed during a run, and between which bounds.

use crate::error::Error;
use fmi_import::Variable;
use fmi_master::{Change, Panel, Tunable};
use fmi_system::{Component, System};
use pages::report::UnitSystem;
use pages::report::Units;
use pages::report::number::significant;
use units::hint;

/// Time that a change takes, s.
pub const CHANGE: f64 = 1.0;
/// Word for all parameters that can be changed.
const ALL: &str = "all";

/// The parameters that `wanted` names, each as `component.variable`, perhaps with its bounds as
/// `component.variable=LOW..HIGH`, or `all`. Without bounds they are half and twice the value at the start,
/// within what the FMU accepts. A sample takes `period` seconds.
///
/// # Errors
/// A parameter that there is not or that cannot be changed, bounds that do not hold its value.
pub fn panel(system: &System, wanted: &[String], period: f64) -> Result<Panel, Error> {
    let mut tunables: Vec<Tunable> = Vec::new();
    let mut add = |new: Tunable| {
        tunables.retain(|own| own.variable != new.variable);
        tunables.push(new);
    };
    // Bounds that somebody states come last, so that they replace those of `all`.
    if wanted.iter().any(|name| name == ALL) {
        let all = tunable(system).filter_map(|(component, variable)| {
            let start = start(component, variable)?;
            let (low, high) = usual_bounds(variable, start)?;
            Some(Tunable {
                variable: format!("{}.{}", component.name, variable.name),
                start,
                low,
                high,
            })
        });
        all.for_each(&mut add);
    }
    for text in wanted.iter().filter(|name| *name != ALL) {
        add(one(system, text)?);
    }
    if tunables.is_empty() {
        let reason = "the system has no tunable parameter whose value is not 0; state one with its bounds as \
                      --tune INSTANCE.VARIABLE=LOW..HIGH";
        return Err(fault(reason.to_string()));
    }
    Ok(Panel::new(tunables, (CHANGE / period).round() as usize))
}

fn fault(reason: String) -> Error {
    Error::Option {
        option: "--tune",
        reason,
    }
}

/// The parameters of a system that the standard lets be changed between steps.
fn tunable(system: &System) -> impl Iterator<Item = (&Component, &Variable)> {
    system.components.iter().flat_map(|component| {
        let variables = component.fmu.description.variables.iter();
        let own = variables.filter(|own| is_tunable(own));
        own.map(move |variable| (component, variable))
    })
}

fn is_tunable(variable: &Variable) -> bool {
    variable.is_tunable() && variable.is_real_number()
}

/// The value at the beginning.
fn start(component: &Component, variable: &Variable) -> Option<f64> {
    let position = component.fmu.description.position(&variable.name)?;
    let given = component
        .parameters
        .iter()
        .find(|(own, _)| *own == position);
    match given {
        Some((_, value)) => serde_json::json!(value).as_f64(),
        None => variable.start.as_deref()?.trim().parse().ok(),
    }
}

/// Half and twice the value, within what the FMU accepts; none of 0.
fn usual_bounds(variable: &Variable, start: f64) -> Option<(f64, f64)> {
    let [least, most] = variable.bounds;
    let (one, other) = (0.5 * start, 2.0 * start);
    let low = one.min(other).max(least.unwrap_or(f64::NEG_INFINITY));
    let high = one.max(other).min(most.unwrap_or(f64::INFINITY));
    (low < high).then_some((low, high))
}

/// A parameter as a user names it.
fn one(system: &System, text: &str) -> Result<Tunable, Error> {
    let (name, bounds) = match text.split_once('=') {
        Some((name, bounds)) => (name.trim(), Some(bounds)),
        None => (text.trim(), None),
    };
    let found = system.variable(name).map(|(component, position)| {
        let variable = &component.fmu.description.variables[position];
        (component, variable)
    });
    let Some((component, variable)) = found.filter(|(_, variable)| is_tunable(variable)) else {
        return Err(fault(not_tunable(system, name)));
    };
    let start = start(component, variable).ok_or_else(|| {
        fault(format!(
            "`{name}` has no value at the beginning; give one with --set"
        ))
    })?;
    let (low, high) = match bounds {
        Some(bounds) => stated(variable, name, bounds)?,
        None => usual_bounds(variable, start).ok_or_else(|| {
            fault(format!(
                "`{name}` is {start} at the beginning, so half and twice its value cannot be its bounds; \
                 expected {name}=LOW..HIGH"
            ))
        })?,
    };
    if !(low..=high).contains(&start) {
        return Err(fault(format!(
            "`{name}` is {start} at the beginning, which is outside of {low} to {high}{}",
            variable
                .unit
                .as_ref()
                .map_or(String::new(), |unit| format!(" {unit}")),
        )));
    }
    Ok(Tunable {
        variable: name.to_string(),
        start,
        low,
        high,
    })
}

/// Bounds as `LOW..HIGH`, both with units.
fn stated(variable: &Variable, name: &str, text: &str) -> Result<(f64, f64), Error> {
    let unit = variable.unit.as_deref().unwrap_or_default();
    let expected = || match unit {
        "" => format!("expected {name}=LOW..HIGH"),
        unit => format!("expected {name}=\"LOW {unit}..HIGH {unit}\""),
    };
    let (low, high) = text
        .split_once("..")
        .ok_or_else(|| fault(format!("`{text}` is not a range; {}", expected())))?;
    let read = |text: &str| {
        let number = text.trim().parse::<f64>().ok();
        // Zero is zero in every unit.
        match number.filter(|number| unit.is_empty() || *number == 0.0) {
            Some(number) => Ok(number),
            None if number.is_some() => Err(fault(format!(
                "`{}` has no unit; {}",
                text.trim(),
                expected()
            ))),
            None => units::value_in(text.trim(), unit)
                .map_err(|error| fault(format!("`{}`: {error}; {}", text.trim(), expected()))),
        }
    };
    let (low, high) = (read(low)?, read(high)?);
    let [least, most] = variable.bounds;
    let is_accepted = low >= least.unwrap_or(f64::NEG_INFINITY)
        && high <= most.unwrap_or(f64::INFINITY)
        && low.is_finite()
        && high.is_finite();
    if low >= high {
        return Err(fault(format!("`{text}` holds no values; {}", expected())));
    }
    if !is_accepted {
        let side = |bound: Option<f64>| bound.map_or("any".to_string(), |bound| bound.to_string());
        return Err(fault(format!(
            "`{text}` is beyond what the FMU accepts for `{name}`, {} to {} {unit}",
            side(least),
            side(most)
        )));
    }
    Ok((low, high))
}

/// Why a name is not one of a parameter that can be changed.
fn not_tunable(system: &System, name: &str) -> String {
    let known: Vec<String> = tunable(system)
        .map(|(component, variable)| format!("{}.{}", component.name, variable.name))
        .collect();
    let reason = match system.variable(name) {
        Some(_) => {
            format!("`{name}` is not a tunable parameter: its FMU takes it before the run only")
        }
        None => format!(
            "the system has no parameter `{name}`{}",
            hint(name, known.iter().map(String::as_str))
        ),
    };
    match known.is_empty() {
        true => format!("{reason}; no component of the system has a tunable parameter"),
        false => format!("{reason}; tunable are {}", known.join(", ")),
    }
}

/// A change in words.
#[must_use]
pub fn in_words(change: &Change, unit: &str, system: UnitSystem) -> String {
    let units = Units::of(unit);
    let (from, name) = units.shown(change.from, system);
    let (to, _) = units.shown(change.to, system);
    let unit = match name {
        "" => String::new(),
        name => format!(" {name}"),
    };
    format!(
        "`{}` from {} to {}{unit} at {:.3} s",
        change.variable,
        significant(from, 4),
        significant(to, 4),
        change.time_s
    )
}

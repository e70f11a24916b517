//! Content of a row: the figures of a run, and variables by name.

use super::factor::with_unit;
use super::setting::Key;
use super::table::Cell;
use fmi_import::{Causality, Datum, Kind};
use fmi_master::Outcome;
use fmi_system::{Component, Link, Setting, System};
use laboratory::error::Error;
use laboratory::run::experiment::Prepared;
use laboratory::run::summary::asked;
use laboratory::run::table::Table;
use motion::{metrics, peak};
use units::{STANDARD_GRAVITY, hint};

/// The figures of a run, and their units.
pub(super) const FIGURES: [(&str, &str); 11] = [
    ("pga_g", "g"),
    ("peak_reference_m", "m"),
    ("time_domain_percent", "%"),
    ("frequency_domain_percent", "%"),
    ("displacement_percent", "%"),
    ("peak_displacement_m", "m"),
    ("peak_displacement_error_m", "m"),
    ("peak_acceleration_m_s2", "m/s2"),
    ("peak_acceleration_error_m_s2", "m/s2"),
    ("correlation", ""),
    ("delay_s", "s"),
];

/// The unit of a variable that is a number, empty where it has none; none for other variables.
pub(super) fn number_unit(system: &System, name: &str) -> Option<String> {
    let (component, position) = system.variable(name)?;
    let variable = &component.fmu.description.variables[position];
    let is_number = variable.kind.is_numeric()
        && !matches!(variable.kind, Kind::Enumeration(_) | Kind::Boolean);
    is_number.then(|| variable.unit.clone().unwrap_or_default())
}

/// The value of a factor that is not a variable, as in the table.
pub(super) fn written(key: &Key, value: &Setting) -> Cell {
    match (key.unit(), key.number(value)) {
        (Some(_), Ok(number)) => number.into(),
        _ => value.to_string().into(),
    }
}

/// The figures of a run in the order of [`FIGURES`].
pub(super) fn figures(prepared: &Prepared, outcome: &Outcome) -> [Cell; FIGURES.len()] {
    let motion = &prepared.motion;
    let mut cells = [const { Cell::Missing }; FIGURES.len()];
    if motion.is_empty() {
        return cells;
    }
    let wanted = asked(&outcome.record, motion);
    let wanted = wanted.as_ref().unwrap_or(motion);
    cells[0] = (motion.peak_acceleration() / STANDARD_GRAVITY).into();
    cells[1] = motion.peak_displacement().into();
    let names = prepared
        .system
        .components
        .iter()
        .map(|own| own.name.as_str());
    let links: Vec<Link> = prepared.system.links().collect();
    let Some(table) = Table::among(names, &links, &outcome.record) else {
        return cells;
    };
    let column = |name: &str| outcome.record.column(&table.name(name));
    let (Some(x), Some(a)) = (column("displacement"), column("acceleration")) else {
        return cells;
    };
    let mut set = |name: &str, number: f64| {
        if let Some(place) = FIGURES.iter().position(|(own, _)| *own == name) {
            cells[place] = number.into();
        }
    };
    set("peak_displacement_m", peak(&x));
    set("peak_acceleration_m_s2", peak(&a));
    // The beginning of a run that was stopped says nothing about how the motion is followed.
    if let Some(own) = metrics::errors(wanted, &x, &a)
        .ok()
        .filter(|_| outcome.ended.is_regular())
    {
        set("time_domain_percent", own.time_domain_percent);
        set("frequency_domain_percent", own.frequency_domain_percent);
        set("displacement_percent", own.displacement_percent);
        set("peak_displacement_error_m", own.peak_displacement_error);
        set("peak_acceleration_error_m_s2", own.peak_acceleration_error);
        set("correlation", own.correlation);
        set("delay_s", own.delay);
    }
    cells
}

/// As [`System::variable`], of an output.
pub(super) fn output<'a>(system: &'a System, name: &str) -> Option<(&'a Component, usize)> {
    system.variable(name).filter(|(component, position)| {
        component.fmu.description.variables[*position].causality == Causality::Output
    })
}

pub(super) fn outputs(system: &System) -> impl Iterator<Item = String> {
    system.components.iter().flat_map(|component| {
        let description = &component.fmu.description;
        description.of(Causality::Output).map(|position| {
            format!(
                "{}.{}",
                component.name, description.variables[position].name
            )
        })
    })
}

/// Why a study cannot vary a variable.
#[derive(Debug, thiserror::Error)]
pub enum VariableError {
    /// The system of the study cannot be assembled.
    #[error(transparent)]
    System(#[from] Error),
    /// No such variable.
    #[error("`{name}` is not a variable of {system}{hint}")]
    Unknown {
        /// The variable.
        name: String,
        /// The system.
        system: String,
        /// The nearest one.
        hint: String,
    },
    /// A variable of another type.
    #[error("`{0}` is not a number")]
    NotANumber(String),
    /// A multiple of nothing.
    #[error(
        "`{name}` is 0 in {system}, and every multiple of it is 0; expected a distribution that is not relative"
    )]
    Zero {
        /// The variable.
        name: String,
        /// The system.
        system: String,
    },
    /// A multiple that is not a number.
    #[error("`{factor}` is not a factor of `{name}`")]
    Factor {
        /// What was written.
        factor: String,
        /// The variable.
        name: String,
    },
}

/// A variable's value times a factor, as `--set` takes it.
pub(super) fn times(
    system: &System,
    name: &str,
    factor: &Setting,
) -> Result<String, VariableError> {
    let (nominal, unit) = nominal(system, name)?;
    match factor {
        _ if nominal == 0.0 => Err(VariableError::Zero {
            name: name.to_string(),
            system: system.name.clone(),
        }),
        Setting::Number(factor) => Ok(with_unit(factor * nominal, &unit).to_string()),
        other => Err(VariableError::Factor {
            factor: other.to_string(),
            name: name.to_string(),
        }),
    }
}

/// What a variable is when the study does not vary it, and its unit.
pub(super) fn nominal(system: &System, name: &str) -> Result<(f64, String), VariableError> {
    let (component, position) = system.variable(name).ok_or_else(|| {
        let known = system.components.iter().flat_map(|component| {
            let variables = component.fmu.description.variables.iter();
            variables.map(|variable| format!("{}.{}", component.name, variable.name))
        });
        let known: Vec<String> = known.collect();
        VariableError::Unknown {
            name: name.to_string(),
            system: system.name.clone(),
            hint: hint(name, known.iter().map(String::as_str)),
        }
    })?;
    let variable = &component.fmu.description.variables[position];
    match component.start_value(&component.given(), position) {
        Datum::Number(number) => Ok((number, variable.unit.clone().unwrap_or_default())),
        _ => Err(VariableError::NotANumber(name.to_string())),
    }
}

//! What follows from a table of variables, and the mistakes that it may hold.

use std::collections::HashMap;

use thiserror::Error;
use units::{Unit, UnitError};

use crate::terminal::Terminal;
use crate::variable::{Causality, Declaration, Dependency, Row, Type, Value, Variability};

/// A mistake in a component's table.
#[derive(Debug, Error)]
#[error("{component}: variable `{variable}`: {problem}")]
pub struct TableError {
    component: &'static str,
    variable: String,
    problem: String,
}

/// What is wrong with one row of a table.
#[derive(Debug, PartialEq, Error)]
enum RowError {
    #[error("has a display unit but no unit")]
    NoUnit,
    #[error("only a Float64 has a unit")]
    UnitOfAnotherType,
    #[error(transparent)]
    Unit(#[from] NotationError),
    #[error("cannot be shown in `{shown}`: {source}")]
    NotShown { shown: String, source: UnitError },
    #[error("cannot be {0:?} and {1:?}")]
    Variability(Causality, Variability),
    #[error("only a Float64 is continuous")]
    Continuous,
    #[error("is not an element of its array")]
    NoElement,
    #[error("start {0} is not a choice")]
    NotAChoice(i32),
    #[error("start {start} is outside {min} to {max}")]
    OutOfRange { start: f64, min: f64, max: f64 },
}

/// A unit that is not in the notation of Modelica.
#[derive(Debug, PartialEq, Error)]
#[error("unit `{unit}`: {problem}")]
struct NotationError {
    unit: String,
    problem: Notation,
}

/// Why a unit is not in the notation of Modelica.
#[derive(Debug, PartialEq, Error)]
enum Notation {
    #[error("`{0}` is not of Modelica's notation")]
    Character(char),
    #[error("a product below the line is in parentheses")]
    Parentheses,
    #[error(transparent)]
    Unknown(#[from] UnitError),
    #[error("has no whole exponents of base units")]
    Exponents,
}

/// A continuous state and its derivative, as positions in the table from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct State {
    /// The state.
    pub state: usize,
    /// Its time derivative.
    pub derivative: usize,
}

/// What the rows of a table say of each other, by position.
pub(crate) struct Structure {
    /// Dependencies of each variable at communication points, ascending.
    pub(crate) dependencies: Vec<Vec<(usize, Dependency)>>,
    /// Dependencies of each variable's initial value, ascending.
    pub(crate) initial_dependencies: Vec<Vec<usize>>,
    /// The continuous states.
    pub(crate) states: Vec<State>,
}

impl Structure {
    /// Checks the rows of a component's table and resolves the names in them.
    pub(crate) fn of(component: &'static str, rows: &[Row]) -> Result<Self, TableError> {
        let names: HashMap<&str, usize> = rows
            .iter()
            .enumerate()
            .map(|(i, row)| (row.declaration.name.as_str(), i))
            .collect();
        let fail = |variable: &Declaration, problem: String| TableError {
            component,
            variable: variable.name.clone(),
            problem,
        };
        let mut structure = Self {
            dependencies: Vec::new(),
            initial_dependencies: Vec::new(),
            states: Vec::new(),
        };
        for (index, row) in rows.iter().enumerate() {
            let variable = row.declaration;
            let wrong = |problem| fail(variable, problem);
            if names[variable.name.as_str()] != index {
                return Err(wrong("the name is used twice".into()));
            }
            let refused = |error: RowError| wrong(error.to_string());
            check_units(row).map_err(refused)?;
            check_kind(row).map_err(refused)?;
            let find = |name: &str| {
                names
                    .get(name)
                    .copied()
                    .ok_or_else(|| wrong(format!("`{name}` is not a variable")))
            };
            let mut on = variable
                .dependencies
                .iter()
                .map(|(name, kind)| Ok((find(name)?, *kind)))
                .collect::<Result<Vec<_>, _>>()?;
            on.sort_by_key(|(index, _)| *index);
            structure.dependencies.push(on);
            let mut on = variable
                .initial_dependencies
                .iter()
                .map(|name| find(name))
                .collect::<Result<Vec<_>, _>>()?;
            on.sort_unstable();
            structure.initial_dependencies.push(on);
            if let Some(state) = &variable.state {
                structure.states.push(State {
                    state: find(state)?,
                    derivative: index,
                });
            }
        }
        for State { state, .. } in &structure.states {
            structure.dependencies[*state] = vec![(*state, Dependency::Constant)];
        }
        match structure.mistake(rows) {
            Some((index, problem)) => Err(fail(rows[index].declaration, problem)),
            None => Ok(structure),
        }
    }

    /// A row at fault, and why: what things depend on, and what states are.
    fn mistake(&self, rows: &[Row]) -> Option<(usize, String)> {
        let is_state = |index| self.states.iter().any(|s| s.state == index);
        for index in 0..rows.len() {
            for (on, _) in &self.dependencies[index] {
                let known = rows[*on].declaration;
                if known.causality != Causality::Input && !is_state(*on) {
                    let problem = format!("`{}` is neither input nor state", known.name);
                    return Some((index, problem));
                }
            }
            for on in &self.initial_dependencies[index] {
                let known = rows[*on].declaration;
                if known.is_computed() {
                    let problem = format!("`{}` is neither input nor parameter", known.name);
                    return Some((index, problem));
                }
            }
        }
        let pairs = self.states.iter().flat_map(|s| [s.state, s.derivative]);
        let is_wrong = |index: &usize| {
            let variable = rows[*index].declaration;
            !variable.is_computed() || variable.variability != Variability::Continuous
        };
        let problem = "states and derivatives are continuous outputs or locals";
        pairs
            .into_iter()
            .find(is_wrong)
            .map(|i| (i, problem.into()))
    }
}

/// Checks a component's terminals against the rows of its table.
pub(crate) fn check_terminals(
    component: &'static str,
    rows: &[Row],
    terminals: &[Terminal],
) -> Result<(), TableError> {
    for (index, terminal) in terminals.iter().enumerate() {
        let wrong = |variable: &str, problem: String| TableError {
            component,
            variable: variable.to_string(),
            problem: format!("terminal `{}`: {problem}", terminal.name),
        };
        let before = &terminals[..index];
        if before.iter().any(|other| other.name == terminal.name) {
            return Err(wrong("", "the name is used twice".into()));
        }
        for (at, (member, variable)) in terminal.members.iter().enumerate() {
            let mut rows = rows.iter().map(|row| row.declaration);
            let found = rows.find(|declaration| declaration.name == *variable);
            let is_port = found.is_some_and(|found| {
                matches!(found.causality, Causality::Input | Causality::Output)
            });
            if !is_port {
                return Err(wrong(variable, "is neither input nor output".into()));
            }
            if terminal.members[..at].iter().any(|(m, _)| m == member) {
                return Err(wrong(variable, format!("member `{member}` is there twice")));
            }
        }
    }
    Ok(())
}

fn check_units(row: &Row) -> Result<(), RowError> {
    let Declaration {
        unit, display_unit, ..
    } = row.declaration;
    let unit = match (unit, display_unit) {
        (None, None) => return Ok(()),
        (None, Some(_)) => return Err(RowError::NoUnit),
        (Some(unit), _) => modelica_unit(unit)?,
    };
    if row.kind != Type::Real {
        return Err(RowError::UnitOfAnotherType);
    }
    if let Some(shown) = display_unit {
        let fits = unit.factor_to(&modelica_unit(shown)?);
        fits.map_err(|source| RowError::NotShown {
            shown: shown.to_string(),
            source,
        })?;
    }
    Ok(())
}

/// Reads a unit in the notation of Modelica, which importers read too: names with whole exponents,
/// joined by `.`, divided at most once by a name or by a product in parentheses, as in
/// `lbf/(V.s2)`.
fn modelica_unit(text: &str) -> Result<Unit, NotationError> {
    let wrong = |problem: Notation| NotationError {
        unit: text.to_string(),
        problem,
    };
    let foreign = |c: &char| !(c.is_ascii_alphanumeric() || "./()-".contains(*c));
    if let Some(foreign) = text.chars().find(foreign) {
        return Err(wrong(Notation::Character(foreign)));
    }
    let below = text.split_once('/').map_or("", |(_, below)| below);
    if below.contains('/') || (below.contains('.') && !below.starts_with('(')) {
        return Err(wrong(Notation::Parentheses));
    }
    let unit = Unit::parse(text).map_err(|error| wrong(error.into()))?;
    match unit.base_unit() {
        Some(_) if !text.is_empty() => Ok(unit),
        _ => Err(wrong(Notation::Exponents)),
    }
}

fn check_kind(row: &Row) -> Result<(), RowError> {
    use Causality::{Input, Local, Output, Parameter};
    use Variability::{Continuous, Discrete, Fixed, Tunable};
    let variable = row.declaration;
    match (variable.causality, variable.variability) {
        (Parameter, Fixed | Tunable) | (Input | Output | Local, Discrete | Continuous) => {}
        (causality, variability) => {
            return Err(RowError::Variability(causality, variability));
        }
    }
    if variable.variability == Continuous && row.kind != Type::Real {
        return Err(RowError::Continuous);
    }
    let value = match (row.kind, &row.start) {
        (_, Value::Missing) => return Err(RowError::NoElement),
        (Type::Choice(choices), Value::Integer(value)) => {
            if !choices.items.iter().any(|item| item.value == *value) {
                return Err(RowError::NotAChoice(*value));
            }
            return Ok(());
        }
        (_, Value::Real(value)) => *value,
        (_, Value::Integer(value)) => f64::from(*value),
        (_, Value::Boolean(_) | Value::Text(_)) => return Ok(()),
    };
    let min = variable.min.unwrap_or(f64::NEG_INFINITY);
    let max = variable.max.unwrap_or(f64::INFINITY);
    if !value.is_finite() || value < min || value > max {
        return Err(RowError::OutOfRange {
            start: value,
            min,
            max,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_in_the_notation_of_modelica() {
        for unit in ["N.s/m", "lbf/(V.s2)", "1", "A.s-1/m", "Hz"] {
            assert!(modelica_unit(unit).is_ok(), "{unit}");
        }
        for unit in [
            "N.furlong",
            "N/V.s",
            "m/s/s",
            "",
            "mx2",
            "N*m",
            "m^2",
            "V s",
        ] {
            assert!(modelica_unit(unit).is_err(), "{unit}");
        }
    }
}

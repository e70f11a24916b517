//! A component's table, checked and resolved once.

use std::{
    any::{Any, TypeId},
    collections::HashMap,
    sync::{Mutex, OnceLock, PoisonError},
};

use thiserror::Error;
use units::Unit;

use crate::{
    component::Component,
    fault::{Fault, Outcome},
    variable::{Access, Causality, Dependency, Variability, Variable},
};

/// A value reference: the position in the table, counted from 1. In FMI 3.0, 0 is the time.
pub type ValueReference = u32;

/// A mistake in a component's table.
#[derive(Debug, Error)]
#[error("{component}: variable `{variable}`: {problem}")]
pub struct TableError {
    component: &'static str,
    variable: String,
    problem: String,
}

/// A continuous state and its derivative, as positions in the table from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct State {
    /// The state.
    pub state: usize,
    /// Its time derivative.
    pub derivative: usize,
}

/// The table of a component with everything that follows from it.
pub struct Model<C: Component> {
    /// The variables, by value reference less one.
    pub variables: Vec<Variable<C>>,
    /// Dependencies of each variable at communication points: positions and kinds, ascending.
    pub dependencies: Vec<Vec<(usize, Dependency)>>,
    /// Dependencies of each variable's initial value: positions, ascending.
    pub initial_dependencies: Vec<Vec<usize>>,
    /// The continuous states, empty if there is no model exchange.
    pub states: Vec<State>,
    /// The instantiation token, kept by [`crate::description::token`] when it is first asked for.
    pub(crate) token: OnceLock<String>,
}

impl<C: Component> Model<C> {
    /// Checks the component's table.
    ///
    /// # Errors
    /// Names the variable and the mistake: a name used twice, a bad unit, a start value out of
    /// its range, a dependency on something unknown.
    pub fn new() -> Result<Self, TableError> {
        let variables = C::variables();
        let names: HashMap<&str, usize> = variables
            .iter()
            .enumerate()
            .map(|(i, v)| (v.name.as_str(), i))
            .collect();
        let mut start = C::default();
        let fail = |variable: &Variable<C>, problem: String| TableError {
            component: C::NAME,
            variable: variable.name.clone(),
            problem,
        };
        let mut dependencies = Vec::new();
        let mut initial_dependencies = Vec::new();
        let mut states = Vec::new();
        for (index, variable) in variables.iter().enumerate() {
            let wrong = |problem| fail(variable, problem);
            if names[variable.name.as_str()] != index {
                return Err(wrong("the name is used twice".into()));
            }
            check_units(variable).map_err(wrong)?;
            check_kind(variable, &mut start).map_err(wrong)?;
            let find = |name: &str| {
                names
                    .get(name)
                    .copied()
                    .ok_or_else(|| wrong(format!("`{name}` is no variable")))
            };
            let mut on = variable
                .dependencies
                .iter()
                .map(|(name, kind)| Ok((find(name)?, *kind)))
                .collect::<Result<Vec<_>, _>>()?;
            on.sort_by_key(|(index, _)| *index);
            dependencies.push(on);
            let mut on = variable
                .initial_dependencies
                .iter()
                .map(|name| find(name))
                .collect::<Result<Vec<_>, _>>()?;
            on.sort_unstable();
            initial_dependencies.push(on);
            if let Some(state) = &variable.state {
                states.push(State {
                    state: find(state)?,
                    derivative: index,
                });
            }
        }
        for State { state, .. } in &states {
            dependencies[*state] = vec![(*state, Dependency::Constant)];
        }
        let model = Self {
            variables,
            dependencies,
            initial_dependencies,
            states,
            token: OnceLock::new(),
        };
        model.check_structure()?;
        model.check_terminals()?;
        Ok(model)
    }

    fn check_structure(&self) -> Result<(), TableError> {
        let is_state = |index| self.states.iter().any(|s| s.state == index);
        for (index, variable) in self.variables.iter().enumerate() {
            let wrong = |problem: String| TableError {
                component: C::NAME,
                variable: variable.name.clone(),
                problem,
            };
            for (on, _) in &self.dependencies[index] {
                let known = &self.variables[*on];
                if known.causality != Causality::Input && !is_state(*on) {
                    return Err(wrong(format!(
                        "`{}` is neither input nor state",
                        known.name
                    )));
                }
            }
            for on in &self.initial_dependencies[index] {
                let known = &self.variables[*on];
                if known.is_computed() {
                    return Err(wrong(format!(
                        "`{}` is neither input nor parameter",
                        known.name
                    )));
                }
            }
        }
        for State { state, derivative } in &self.states {
            for variable in [&self.variables[*state], &self.variables[*derivative]] {
                if !variable.is_computed() || variable.variability != Variability::Continuous {
                    return Err(TableError {
                        component: C::NAME,
                        variable: variable.name.clone(),
                        problem: "states and derivatives are continuous outputs or locals".into(),
                    });
                }
            }
        }
        Ok(())
    }

    fn check_terminals(&self) -> Result<(), TableError> {
        for (index, terminal) in C::TERMINALS.iter().enumerate() {
            let wrong = |variable: &str, problem: String| TableError {
                component: C::NAME,
                variable: variable.to_string(),
                problem: format!("terminal `{}`: {problem}", terminal.name),
            };
            if C::TERMINALS[..index]
                .iter()
                .any(|t| t.name == terminal.name)
            {
                return Err(wrong("", "the name is used twice".into()));
            }
            for (at, (member, variable)) in terminal.members.iter().enumerate() {
                let found = self.find(variable);
                let is_port = found.is_some_and(|(_, found)| {
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

    /// The table of `C`, made at its first use and kept.
    ///
    /// # Errors
    /// When the table holds a mistake.
    pub fn get() -> Result<&'static Self, TableError> {
        static MODELS: Mutex<Option<HashMap<TypeId, &'static (dyn Any + Send + Sync)>>> =
            Mutex::new(None);
        let mut models = MODELS.lock().unwrap_or_else(PoisonError::into_inner);
        let models = models.get_or_insert_default();
        if let Some(model) = models
            .get(&TypeId::of::<C>())
            .and_then(|m| m.downcast_ref())
        {
            return Ok(model);
        }
        let model: &'static Self = Box::leak(Box::new(Self::new()?));
        models.insert(TypeId::of::<C>(), model);
        Ok(model)
    }

    /// Whether the component offers model exchange.
    pub fn offers_model_exchange(&self) -> bool {
        !self.states.is_empty()
    }

    /// The state whose derivative the variable at `index` is, both as positions from 0.
    pub fn state_of(&self, index: usize) -> Option<usize> {
        let mut states = self.states.iter();
        states.find(|s| s.derivative == index).map(|s| s.state)
    }

    /// The position of a value reference in the table.
    ///
    /// # Errors
    /// When it is unknown.
    #[inline]
    pub fn position(&self, reference: ValueReference) -> Outcome<usize> {
        let index = (reference as usize).wrapping_sub(1);
        if index < self.variables.len() {
            return Ok(index);
        }
        Err(Fault::error(format!(
            "value reference {reference} is unknown, {} has 1 to {}",
            C::NAME,
            self.variables.len()
        )))
    }

    /// The variable of that name and its position.
    pub fn find(&self, name: &str) -> Option<(usize, &Variable<C>)> {
        self.variables
            .iter()
            .enumerate()
            .find(|(_, v)| v.name == name)
    }
}

fn check_units<C>(variable: &Variable<C>) -> Result<(), String> {
    let unit = match (variable.unit, variable.display_unit) {
        (None, None) => return Ok(()),
        (None, Some(_)) => return Err("has a display unit but no unit".into()),
        (Some(unit), _) => modelica_unit(unit)?,
    };
    if !variable.access.is_real() {
        return Err("only a Float64 has a unit".into());
    }
    if let Some(shown) = variable.display_unit {
        let fits = unit.factor_to(&modelica_unit(shown)?);
        fits.map_err(|error| format!("cannot be shown in `{shown}`: {error}"))?;
    }
    Ok(())
}

/// Reads a unit in the notation of Modelica, which importers read too: names with whole exponents,
/// joined by `.`, divided at most once by a name or by a product in parentheses, as in
/// `lbf/(V.s2)`.
fn modelica_unit(text: &str) -> Result<Unit, String> {
    let wrong = |problem: String| format!("unit `{text}`: {problem}");
    let foreign = |c: &char| !(c.is_ascii_alphanumeric() || "./()-".contains(*c));
    if let Some(foreign) = text.chars().find(foreign) {
        return Err(wrong(format!("`{foreign}` is not of Modelica's notation")));
    }
    let below = text.split_once('/').map_or("", |(_, below)| below);
    if below.contains('/') || (below.contains('.') && !below.starts_with('(')) {
        return Err(wrong(
            "a product below the line stands in parentheses".into(),
        ));
    }
    let unit = Unit::parse(text).map_err(|error| wrong(error.to_string()))?;
    match unit.base_unit() {
        Some(_) if !text.is_empty() => Ok(unit),
        _ => Err(wrong("has no whole exponents of base units".into())),
    }
}

fn check_kind<C>(variable: &Variable<C>, start: &mut C) -> Result<(), String> {
    use Causality::{Input, Local, Output, Parameter};
    use Variability::{Continuous, Discrete, Fixed, Tunable};
    match (variable.causality, variable.variability) {
        (Parameter, Fixed | Tunable) | (Input | Output | Local, Discrete | Continuous) => {}
        (causality, variability) => {
            return Err(format!("cannot be {causality:?} and {variability:?}"));
        }
    }
    if variable.variability == Continuous && !variable.access.is_real() {
        return Err("only a Float64 is continuous".into());
    }
    let value = match &variable.access {
        Access::Real(field) => *field(start),
        Access::Within(place) => *place(start),
        Access::Element(field, index) => *field(start)
            .get(*index)
            .ok_or_else(|| "is no element of its array".to_string())?,
        Access::Integer(field) => f64::from(*field(start)),
        Access::Choice(field, choices) => {
            let value = *field(start);
            if !choices.items.iter().any(|item| item.value == value) {
                return Err(format!("start {value} is no choice"));
            }
            return Ok(());
        }
        Access::Boolean(_) | Access::Text(_) => return Ok(()),
    };
    let min = variable.min.unwrap_or(f64::NEG_INFINITY);
    let max = variable.max.unwrap_or(f64::INFINITY);
    if !value.is_finite() || value < min || value > max {
        return Err(format!("start {value} is outside {min} to {max}"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::component::ComponentResult;
    use serde::{Deserialize, Serialize};

    /// Components that differ in the mistake in their table.
    #[derive(Clone, Default, Serialize, Deserialize)]
    struct Wrong<const MISTAKE: usize> {
        input: f64,
        output: f64,
        flag: bool,
    }

    impl<const MISTAKE: usize> Component for Wrong<MISTAKE> {
        const NAME: &'static str = "Wrong";
        const DESCRIPTION: &'static str = "Has a mistake in its table";

        fn variables() -> Vec<Variable<Self>> {
            let input = Variable::<Self>::input("input", |s| &mut s.input).unit("m");
            let output = Variable::<Self>::output("output", |s| &mut s.output);
            let flag = Variable::<Self>::input("flag", |s| &mut s.flag);
            let fixed = Dependency::Fixed;
            match MISTAKE {
                0 => vec![input, Variable::<Self>::output("input", |s| &mut s.output)],
                1 => vec![input.shown_in("s"), output],
                2 => vec![input.unit("cubit"), output],
                3 => vec![input.min(1.0), output],
                4 => vec![input, output.depends_on(&["inptu"], fixed)],
                5 => vec![flag.unit("m"), output],
                6 => vec![input.tunable(), output],
                7 => vec![input.derivative_of("output"), output],
                8 => vec![input, output.initially_depends_on(&["output"])],
                _ => vec![input, output.depends_on(&["input"], fixed), flag],
            }
        }

        fn initialize(&mut self) -> ComponentResult {
            Ok(())
        }

        fn step(&mut self, _: f64, _: f64) -> ComponentResult {
            Ok(())
        }
    }

    fn problem<const MISTAKE: usize>() -> String {
        Model::<Wrong<MISTAKE>>::new()
            .err()
            .map(|e| e.to_string())
            .unwrap_or_default()
    }

    #[test]
    fn mistakes_in_a_table_are_named() {
        for (problem, expected) in [
            (problem::<0>(), "`input`: the name is used twice"),
            (problem::<1>(), "`input`: cannot be shown in `s`"),
            (problem::<2>(), "unknown unit \"cubit\""),
            (problem::<3>(), "`input`: start 0 is outside 1 to inf"),
            (problem::<4>(), "`output`: `inptu` is no variable"),
            (problem::<5>(), "`flag`: only a Float64 has a unit"),
            (problem::<6>(), "`input`: cannot be Input and Tunable"),
            (
                problem::<7>(),
                "`input`: states and derivatives are continuous outputs or locals",
            ),
            (
                problem::<8>(),
                "`output`: `output` is neither input nor parameter",
            ),
        ] {
            assert!(problem.contains(expected), "`{problem}` lacks `{expected}`");
        }
        assert_eq!(problem::<9>(), "");
    }

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

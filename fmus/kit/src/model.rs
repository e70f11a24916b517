//! A component's table, checked and resolved once.

use std::{
    any::{Any, TypeId},
    collections::HashMap,
    sync::{Mutex, OnceLock, PoisonError},
};

pub use crate::structure::{State, TableError};
use crate::{
    component::Component,
    fault::{Fault, Outcome},
    structure::{Structure, check_terminals},
    variable::{Dependency, Row, Variable},
};

/// A value reference: the position in the table, counted from 1. In FMI 3.0, 0 is the time.
pub type ValueReference = u32;

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
        let mut start = C::default();
        let rows: Vec<Row> = variables.iter().map(|v| v.row(&mut start)).collect();
        let Structure {
            dependencies,
            initial_dependencies,
            states,
        } = Structure::of(C::NAME, &rows)?;
        check_terminals(C::NAME, &rows, C::TERMINALS)?;
        Ok(Self {
            variables,
            dependencies,
            initial_dependencies,
            states,
            token: OnceLock::new(),
        })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::component::ComponentResult;
    use crate::variable::{Enumeration, Item, Variability};
    use serde::{Deserialize, Serialize};

    /// Components that differ in the mistake in their table.
    #[derive(Clone, Default, Serialize, Deserialize)]
    struct Wrong<const MISTAKE: usize> {
        input: f64,
        output: f64,
        flag: bool,
        number: i32,
    }

    const MODES: Enumeration = Enumeration {
        name: "Mode",
        items: &[Item {
            name: "only",
            value: 1,
            description: "The only one",
        }],
    };

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
                10 => vec![input.max(-1.0), output],
                11 => vec![Variable::<Self>::parameter("input", |s| &mut s.input).discrete()],
                12 => vec![flag.derivative_of("input"), input],
                13 => vec![
                    input,
                    output.depends_on(&["flag"], fixed),
                    Variable::local("flag", |s: &mut Self| &mut s.flag),
                ],
                14 => vec![Variable::choice("mode", MODES, |s: &mut Self| {
                    &mut s.number
                })],
                15 => vec![
                    input.shown_in("in"),
                    Variable::output("output", |s: &mut Self| &mut s.output).shown_in("in"),
                ],
                16 => {
                    let mut flag = flag;
                    flag.declaration.variability = Variability::Continuous;
                    vec![flag]
                }
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
            (problem::<4>(), "`output`: `inptu` is not a variable"),
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
            (problem::<10>(), "`input`: start 0 is outside -inf to -1"),
            (problem::<11>(), "`input`: cannot be Parameter and Discrete"),
            (
                problem::<12>(),
                "`input`: states and derivatives are continuous outputs or locals",
            ),
            (
                problem::<13>(),
                "`output`: `flag` is neither input nor state",
            ),
            (problem::<14>(), "`mode`: start 0 is not a choice"),
            (problem::<15>(), "`output`: has a display unit but no unit"),
            (problem::<16>(), "`flag`: only a Float64 is continuous"),
        ] {
            assert!(problem.contains(expected), "`{problem}` lacks `{expected}`");
        }
        assert_eq!(problem::<9>(), "");
    }
}

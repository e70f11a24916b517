//! A system whose names, types, units and connections hold: what the master is given.

use std::collections::HashMap;
use std::sync::Arc;

use super::link::{Link, Origin, Quantity, VariableName};
use super::passage::{Passage, Way};
use super::table::InputTable;
use super::value::Value;
use fmi_import::{Datum, Fmu};

/// Sampling period of a controller without other settings, s (Section 5.3.1: 500 Hz).
pub const DEFAULT_PERIOD: f64 = units::constants::SAMPLING_PERIOD;

/// A system whose names, types, units and connections have been checked.
#[derive(Debug, Clone)]
pub struct System {
    /// Its name.
    pub name: String,
    /// One line for people.
    pub description: String,
    /// The components, in alphabetical order.
    pub components: Vec<Component>,
    /// The connections.
    pub connections: Vec<Connection>,
    /// Input tables.
    pub tables: Vec<InputTable>,
    /// Time at which it begins, s.
    pub start: f64,
    /// What ends the run early.
    pub end: Option<End>,
    /// What the user should know of it.
    pub notes: Vec<String>,
    /// The Boolean input that is set when a sampled component fails, as component and variable.
    pub stop: Option<(usize, usize)>,
}

/// What ends a run early.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct End {
    /// The Boolean output that ends the run when it becomes true, as component and variable.
    pub when: (usize, usize),
    /// The enumeration output that says why, as component and variable.
    pub cause: Option<(usize, usize)>,
    /// How long the run goes on after that, s.
    pub after: f64,
}

/// A component of a [`System`].
#[derive(Debug, Clone)]
pub struct Component {
    /// Its name in the system.
    pub name: String,
    /// What it is an instance of.
    pub fmu: Arc<Fmu>,
    /// For a sampled component its period, s: its outputs hold what its last call computed.
    pub period: Option<f64>,
    /// Parameters that are set, as position of the variable and value.
    pub parameters: Vec<(usize, Value)>,
    /// Values of inputs that nothing drives.
    pub inputs: Vec<(usize, Value)>,
    /// Further names of outputs in the results.
    pub aliases: Vec<(String, usize)>,
}

impl Component {
    /// What the system gives, by position.
    pub fn given(&self) -> HashMap<usize, &Value> {
        let given = self.parameters.iter().chain(&self.inputs);
        given.map(|(position, value)| (*position, value)).collect()
    }

    /// Further names of outputs: those that the system gives, and those of the FMU.
    pub fn all_aliases(&self) -> impl Iterator<Item = (String, usize)> + '_ {
        let own = self.aliases.iter().cloned();
        own.chain(self.fmu.description.output_aliases())
    }

    /// The value of a variable before the run: what the system gives, or its own start value.
    pub fn start_value(&self, given: &HashMap<usize, &Value>, position: usize) -> Datum {
        let variable = &self.fmu.description.variables[position];
        match given.get(&position) {
            Some(value) => value.datum(&variable.kind),
            None => variable
                .start
                .as_deref()
                .and_then(|text| Datum::read(&variable.kind, text))
                .unwrap_or_else(|| Datum::empty(&variable.kind)),
        }
    }
}

/// A connection of a [`System`]: an input takes what comes of the source's value on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Connection {
    /// Where the value comes from.
    pub source: Source,
    /// The driven component.
    pub component: usize,
    /// Its input.
    pub input: usize,
    /// Conversion between the units, and whatever else the system says.
    pub passage: Passage,
}

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
    /// A column of an input table.
    Table {
        /// The table.
        table: usize,
        /// The column.
        column: usize,
    },
}

impl System {
    /// Component and position of a variable called `component.variable`.
    pub fn variable(&self, name: &str) -> Option<(&Component, usize)> {
        self.components.iter().find_map(|component| {
            let variable = name.strip_prefix(&component.name)?.strip_prefix('.')?;
            Some((component, component.fmu.description.position(variable)?))
        })
    }

    /// The name of an output or input.
    pub fn variable_name(&self, component: usize, variable: usize) -> VariableName {
        let component = &self.components[component];
        let variable = &component.fmu.description.variables[variable];
        VariableName::new(&component.name, &variable.name)
    }

    /// The name of a source of a connection.
    pub fn origin(&self, source: Source) -> Origin {
        match source {
            Source::Reference { quantity, ahead } => Origin::Reference { quantity, ahead },
            Source::Output {
                component,
                variable,
            } => Origin::Output(self.variable_name(component, variable)),
            Source::Table { table, column } => {
                let table = &self.tables[table];
                Origin::output(&table.name, &table.columns[column])
            }
        }
    }

    /// The connections by names.
    pub fn links(&self) -> impl Iterator<Item = Link> {
        self.connections.iter().map(|connection| Link {
            from: self.origin(connection.source),
            to: self.variable_name(connection.component, connection.input),
            way: Way::default(),
            line: None,
        })
    }
}

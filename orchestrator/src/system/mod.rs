//! Systems: components, how they are connected, and the experiment; read from TOML, checked
//! against the FMUs before anything is run.

mod assemble;
pub mod built_in;
mod connection;
mod error;
mod file;
mod graph;
pub mod model;
pub mod tuning;
mod value;

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

pub use assemble::{Library, assemble};
pub use connection::{Quantity, Source};
pub use error::SystemError;
pub use file::{ComponentFile, ExperimentFile, SystemFile};
pub use graph::{Operation, Schedule};
pub use value::Value;

use crate::fmu::{Datum, Fmu};

/// Sampling period of a controller for which nothing else is said, s (Section 5.3.1: 500 Hz).
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
    /// The Boolean output that ends the run when it becomes true, as component and variable.
    pub end_when: Option<(usize, usize)>,
    /// How long the run goes on after that, s.
    pub end_after: f64,
    /// What the user should know of it.
    pub notes: Vec<String>,
    /// The Boolean input that is set when a sampled component fails, as component and variable.
    pub stop: Option<(usize, usize)>,
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
}

impl Component {
    /// What the system gives, by position.
    pub(crate) fn given(&self) -> HashMap<usize, &Value> {
        let given = self.parameters.iter().chain(&self.inputs);
        given.map(|(position, value)| (*position, value)).collect()
    }

    /// The value of a variable before the run: what the system gives, or its own start value.
    pub(crate) fn start_value(&self, given: &HashMap<usize, &Value>, position: usize) -> Datum {
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

/// A connection of a [`System`]: an input takes `factor` times the source's value plus `offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Connection {
    /// Where the value comes from.
    pub source: Source,
    /// The driven component.
    pub component: usize,
    /// Its input.
    pub input: usize,
    /// Conversion between the units, 1 where they are the same.
    pub factor: f64,
    /// Added after the factor, in the input's unit; 0 but for temperatures and the like.
    pub offset: f64,
}

impl System {
    /// `component.variable` of an output or input.
    pub fn variable_name(&self, component: usize, variable: usize) -> String {
        let component = &self.components[component];
        let variable = &component.fmu.description.variables[variable];
        format!("{}.{}", component.name, variable.name)
    }

    /// The name of a source of a connection.
    pub fn source_name(&self, source: Source) -> String {
        match source {
            Source::Reference { quantity, ahead: 0 } => format!("reference.{}", quantity.name()),
            Source::Reference { quantity, ahead } => {
                format!("reference.{}[{ahead}]", quantity.name())
            }
            Source::Output {
                component,
                variable,
            } => self.variable_name(component, variable),
        }
    }

    /// The order in which outputs become known and components are called at a sample.
    ///
    /// # Errors
    /// A loop of direct feedthrough, unless `iterate` is set.
    pub fn schedule(&self, iterate: bool) -> Result<Schedule, SystemError> {
        graph::schedule(self, iterate)
    }

    /// Files of the FMUs, one for each component.
    pub fn files(&self) -> Vec<PathBuf> {
        let files = self.components.iter();
        files.map(|component| component.fmu.path.clone()).collect()
    }
}

/// ` (did you mean ...?)` with the nearest of the known names, or the known names themselves.
pub(crate) fn hint<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.collect();
    let nearest = known
        .iter()
        .map(|candidate| (strsim::jaro_winkler(name, candidate), candidate))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        Some((likeness, nearest)) if likeness > 0.75 => format!("; did you mean `{nearest}`?"),
        Some(_) if known.len() <= 12 => format!("; there is `{}`", known.join("`, `")),
        Some((_, nearest)) => format!("; the nearest name is `{nearest}`"),
        None => "; there is none".to_string(),
    }
}

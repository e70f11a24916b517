//! Systems: components, how they are connected, and the experiment; read from TOML or put together
//! in code, and checked against the FMUs before anything is run.

mod aids;
mod assemble;
pub mod built_in;
mod checked;
mod connection;
pub mod control_model;
mod ending;
mod error;
mod file;
mod fitted;
mod given;
mod graph;
pub mod jacobi;
mod link;
mod lookup;
pub mod model;
mod passage;
mod rule;
mod surface_control;
mod table;
pub mod tuning;
mod value;
mod written;

pub use assemble::{Library, assemble};
pub use checked::{Component, Connection, DEFAULT_PERIOD, Source, System};
pub use error::SystemError;
pub use file::{ComponentFile, ExperimentFile, SystemFile};
pub use graph::{Operation, Schedule};
pub use link::{Link, Origin, Quantity, VariableName};
pub use passage::{DeclaredUnit, Hop, Passage, Transformation, Way};
pub use rule::Rule;
pub use table::{Between, InputTable, TableFile};
pub(crate) use value::percent;
pub use value::{Declared, Setting, Value};

//! Systems: components, how they are connected, and the experiment; read from TOML or put together
//! in code, and checked against the FMUs before anything is run.

mod assemble;
mod checked;
mod connection;
mod ending;
mod error;
mod file;
mod fitted;
mod given;
mod graph;
mod library;
mod link;
mod lookup;
mod passage;
mod table;
mod terminals;
mod value;
mod written;

pub use assemble::assemble;
pub use checked::{Component, Connection, DEFAULT_PERIOD, Source, System};
pub use connection::ConnectionError;
pub use error::{Misfit, SystemError};
pub use file::{ComponentFile, ElementFile, ExperimentFile, Stepping, SystemFile};
pub use fitted::FitError;
pub use given::SettingError;
pub use graph::{Operation, Schedule};
pub use library::{Archive, Files, Library};
pub use link::{Link, LinkError, Origin, Quantity, VariableName};
pub use lookup::NameError;
pub use passage::{DeclaredUnit, Hop, Passage, Transformation, Way, WayError};
pub use table::{Between, InputTable, TableError, TableFile};
pub use terminals::TerminalError;
pub use value::{Declared, NotAShare, Setting, Value, ValueError, percent};

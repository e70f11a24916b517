//! Systems: components, how they are connected, and the experiment; read from TOML or put together
//! in code, and checked against the FMUs before anything is run.

mod assemble;
pub mod built_in;
mod checked;
mod connection;
mod error;
mod file;
mod graph;
mod link;
mod lookup;
pub mod model;
mod rule;
pub mod tuning;
mod value;

pub use assemble::{Library, assemble};
pub use checked::{Component, Connection, DEFAULT_PERIOD, Source, System};
pub use error::SystemError;
pub use file::{ComponentFile, ExperimentFile, MeasurementsFile, SystemFile};
pub use graph::{Operation, Schedule};
pub use link::{Link, Origin, Quantity, VariableName};
pub use rule::Rule;
pub use value::{Setting, Value};

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

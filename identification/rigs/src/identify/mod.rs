//! From recordings of the shake table to its parameters.

mod assessment;
mod checks;
mod identifiability;
pub mod identified;
pub mod instrument;
pub mod model;
pub mod model_file;
pub mod parameters;
pub mod rig;
mod setup;
pub mod specimen_file;
mod start;
pub mod validation;

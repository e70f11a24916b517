//! The shake table of the thesis with its records.

pub mod catalogue;
mod diagnosis;
pub mod predictor;
pub mod relations;
mod sentence;

pub use diagnosis::*;
pub use plant::identified::effects::quantity::laboratory_unit;
pub use sentence::{amount, said};

//! The shake table of the thesis with its records.

pub mod catalogue;
mod diagnosis;
pub mod experiment;
pub mod gain;
pub mod predictor;
pub mod relations;
mod sentence;

pub use diagnosis::*;
pub use sentence::{amount, laboratory_unit, said};

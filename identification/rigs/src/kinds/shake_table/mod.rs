//! The shake table of the thesis with its records.

pub mod catalogue;
mod command;
mod course;
mod diagnosis;
pub mod experiment;
mod extended;
mod friction;
pub mod gain;
mod health;
pub mod left_over;
mod mains;
pub mod predictor;
pub mod relations;
mod sentence;

pub use course::Course;
pub use diagnosis::*;
pub use extended::{ChannelErrors, DESCRIBED, ExtendedTable, TableErrors, TablePrediction};
pub use health::RelationReport;
pub use plant::identified::effects::quantity::laboratory_unit;
pub use sentence::{amount, change, said, with_interval};

//! From measured data to a model, and what a model gets wrong

pub mod closed_loop;
pub mod data;
pub mod diagnosis;
mod error;
pub mod estimation;
pub mod identify;
pub mod one_input;

pub use error::IdentificationError;

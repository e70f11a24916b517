//! From measured data to a model, and what a model gets wrong

pub mod case;
pub mod catalogue;
mod checks;
pub mod continuous;
pub mod data;
pub mod diagnosis;
mod error;
pub mod frequency_response;
pub mod gauss_newton;
mod identifiability;
pub mod input_matrices;
pub mod instrumental_variables;
mod least_squares;
pub mod model_file;
pub mod prediction;
pub mod predictor;
pub mod residuals;
pub mod rig;
mod rig_assessment;
pub mod rig_model;
mod rig_setup;
mod rig_start;
pub mod rigs;
pub mod specimen_file;
pub mod state_variable_filter;
pub mod subspace;
pub mod transfer_function;
pub mod units;
pub mod validation;

pub use error::IdentificationError;

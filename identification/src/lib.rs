//! From measured data to a model, and what a model gets wrong

pub mod case;
pub mod catalogue;
pub mod diagnosis;
pub mod predictor;

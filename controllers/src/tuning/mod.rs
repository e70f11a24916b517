//! Gains from a model, by stated rules.

pub mod preview;
pub mod sliding_mode;
pub mod three_variable;

//! Gains from a model, by stated rules.

#[cfg(test)]
mod known_rig;
pub mod preview;
pub mod sliding_mode;
pub mod suite;
pub mod three_variable;

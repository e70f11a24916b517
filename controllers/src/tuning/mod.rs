//! Gains from a model, by stated rules.

pub mod acceleration_tracking;
pub mod aids;
#[cfg(test)]
mod known_rig;
mod minimal_control_synthesis;
pub mod preview;
pub mod sliding_mode;
pub mod suite;
pub mod surface_control;
pub mod three_variable;

//! What a model gets wrong, the name of the cause, and what it brings to know it.

pub mod case;
pub mod engine;
pub mod rigs;

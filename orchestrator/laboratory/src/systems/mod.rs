//! The systems that come with the program, and the parameters of their controllers by rule.

mod aids;
pub mod biaxial;
pub mod built_in;
mod catalogue;
pub mod control_model;
pub mod jacobi;
pub mod opensees;
mod rule;
mod surface_control;
pub mod tuning;

//! Shake table, actuator, specimen and sensors: what the world does.
//!
//! Everything here is in SI units; the thesis's constants stand in thesis units (inch,
//! pound-force, second, volt) beside their conversion. No control and no FMI.

pub mod delay_line;
pub mod error;
pub mod identified;
pub mod integration;
pub mod linear;
pub mod platform;
pub mod sensors;
pub mod servo_hydraulic;
pub mod signal_path;
pub mod specimens;
pub mod transfer_system;

pub use error::ModelError;

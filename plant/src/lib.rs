//! Shake table, actuator, specimen and sensors: what the world does.
//!
//! Everything here is in SI units; the thesis's constants stand in thesis units (inch,
//! pound-force, second, volt) beside their conversion. No control and no FMI.

pub mod actuator;
pub mod effects;
pub mod error;
pub mod extended_specimen;
pub mod extended_table;
pub mod hysteresis;
pub mod identified_rig;
pub mod instrumentation;
pub mod integration;
pub mod linear;
pub mod rig;
pub mod sensor;
pub mod servo_hydraulic;
pub mod shake_table;
pub mod specimen;
pub mod specimens;
pub mod table;
pub mod units;

pub use error::ModelError;

//! The thesis's rig as identified from measurements, and what it lacks against a real one.

pub mod actuator;
pub mod coupled;
pub mod effects;
pub mod extended_table;
pub mod nominal;
pub mod rig;
pub mod seal_shape;
pub mod shake_table;
pub mod table;
pub mod valve_curve;

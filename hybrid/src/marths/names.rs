//! Names of the variables of components of the two actuators, each written once.

/// Commands of the actuators.
pub const COMMAND: [&str; 2] = ["command[1]", "command[2]"];
/// Strokes of the actuators.
pub const STROKE: [&str; 2] = ["stroke[1]", "stroke[2]"];
/// Measured strokes, of as many actuators as a platform may have.
pub const MEASURED_STROKE: [&str; 8] = [
    "measured_stroke[1]",
    "measured_stroke[2]",
    "measured_stroke[3]",
    "measured_stroke[4]",
    "measured_stroke[5]",
    "measured_stroke[6]",
    "measured_stroke[7]",
    "measured_stroke[8]",
];

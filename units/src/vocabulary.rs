//! Names of variables that several components have, each written once.

macro_rules! names {
    ($($constant:ident $name:literal;)*) => {$(
        #[doc = concat!("`", $name, "`.")]
        pub const $constant: &str = $name;
    )*};
}

names! {
    VALVE_COMMAND "valve_command";
    VALVE_LIMIT "valve_limit";
    LOOP_DELAY_SAMPLES "loop_delay_samples";
    COMMAND_DELAY_SAMPLES "command_delay_samples";
    CONTROLLER_COMMAND "controller_command";
    REFERENCE_DISPLACEMENT "reference_displacement";
    REFERENCE_VELOCITY "reference_velocity";
    REFERENCE_ACCELERATION "reference_acceleration";
    MEASURED_DISPLACEMENT "measured_displacement";
    MEASURED_VELOCITY "measured_velocity";
    MEASURED_ACCELERATION "measured_acceleration";
    MEASURED_FORCE "measured_force";
    SPECIMEN_ACCELERATION "specimen_acceleration";
    SPECIMEN_MASS "specimen_mass";
    SPECIMEN_DAMPING "specimen_damping";
    SPECIMEN_STIFFNESS "specimen_stiffness";
    ACTUATOR_FORCE "actuator_force";
}

/// Standard deviations of the noise of the sensors of displacement, velocity and acceleration.
pub const MEASUREMENT_NOISE: [&str; 3] = [
    "displacement_measurement_noise",
    "velocity_measurement_noise",
    "acceleration_measurement_noise",
];

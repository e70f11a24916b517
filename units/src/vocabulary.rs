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
    INTEGRAL_GAIN "integral_gain";
    PROPORTIONAL_GAIN "proportional_gain";
    COULOMB_FRICTION "coulomb_friction";
    TABLE_ACCELERATION "table_acceleration";
    DEAD_BAND "dead_band";
    TABLE_MASS "table_mass";
    LEAD_SAMPLES "lead_samples";
    DISPLACEMENT_SCALE "displacement_scale";
    CUBIC_STIFFNESS "cubic_stiffness";
    VALVE_NULL_BIAS "valve_null_bias";
    ACTUATOR_A2 "actuator_a2";
    VALVE_FREQUENCY "valve_frequency";
    RATE_LIMIT "rate_limit";
    DAMPER_STOREY "damper_storey";
    ACCELERATION_WEIGHT "acceleration_weight";
    FORCE_NOISE "force_noise";
    DRIFT_VELOCITY "drift_velocity";
    ADDED_PAYLOAD "added_payload";
    TABLE_DAMPING "table_damping";
    TABLE_STIFFNESS "table_stiffness";
    VELOCITY_LAG "velocity_lag";
    OIL_VOLUME "oil_volume";
    PISTON_LEAKAGE "piston_leakage";
    BULK_MODULUS "bulk_modulus";
    PUMP_PRESSURE "pump_pressure";
    VALVE_BETA1 "valve_beta1";
    VALVE_BETA2 "valve_beta2";
    ACTUATOR_A3 "actuator_a3";
    FORCE_GAIN "force_gain";
    FRICTION_COMPENSATION "friction_compensation";
    SPECIMEN_COMPENSATION "specimen_compensation";
    PRESSURE_STABILISATION "pressure_stabilisation";
    SENSOR_NOISE "measurement_noise";
    VELOCITY_SCALE "velocity_scale";
    ACCELERATION_SCALE "acceleration_scale";
    VALVE_NOISE "valve_noise";
    TIME_LIMIT "time_limit";
    TABLE_DISPLACEMENT "table_displacement";
    TABLE_VELOCITY "table_velocity";
    MEASURED_SPECIMEN_ACCELERATION "measured_specimen_acceleration";
    AMPLITUDE_PHASE_CONTROL "amplitude_phase_control";
    HARMONIC_CANCELLATION "harmonic_cancellation";
    SPECIMEN_FORCE "specimen_force";
    COMMAND_WEIGHT "command_weight";
    DAMPING_RATIO "damping_ratio";
    STRIBECK_VELOCITY "stribeck_velocity";
    CONVERTER_QUANTUM "converter_quantum";
    CONVERTER_LIMIT "converter_limit";
}

/// Standard deviations of the noise of the sensors of displacement, velocity and acceleration.
pub const MEASUREMENT_NOISE: [&str; 3] = [
    "displacement_measurement_noise",
    "velocity_measurement_noise",
    "acceleration_measurement_noise",
];

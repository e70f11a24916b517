//! What the channels show instead of the truth.

use crate::ModelError;

/// Errors of the sensors, zero is off.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorEffects {
    /// Offset of the table's accelerometer, m/s².
    pub accelerometer_bias: f64,
    /// Relative error of its scale.
    pub accelerometer_scale: f64,
    /// Pitch per displacement, rad/m: gravity enters as `g tilt x`.
    pub accelerometer_tilt: f64,
    /// Lateness of its channel, s.
    pub accelerometer_delay: f64,
    /// Amplitude of the mains on it, m/s².
    pub hum_amplitude: f64,
    /// Frequency of the mains, Hz.
    pub hum_frequency: f64,
    /// Phase of the mains at time zero, rad.
    pub hum_phase: f64,
    /// Relative error of the displacement's scale.
    pub displacement_scale: f64,
    /// Corner of a first-order lag of the displacement, Hz; 0 is none.
    pub displacement_lag: f64,
    /// Relative error of the load cell's scale.
    pub load_cell_scale: f64,
    /// Offset of the load cell, N.
    pub load_cell_bias: f64,
}

impl Default for SensorEffects {
    fn default() -> Self {
        Self {
            accelerometer_bias: 0.0,
            accelerometer_scale: 0.0,
            accelerometer_tilt: 0.0,
            accelerometer_delay: 0.0,
            hum_amplitude: 0.0,
            hum_frequency: 60.0,
            hum_phase: 0.0,
            displacement_scale: 0.0,
            displacement_lag: 0.0,
            load_cell_scale: 0.0,
            load_cell_bias: 0.0,
        }
    }
}

impl SensorEffects {
    /// Refuses a negative delay, lag or mains frequency.
    pub fn validate(&self) -> Result<(), ModelError> {
        for (name, value) in [
            ("accelerometer_bias", self.accelerometer_bias),
            ("accelerometer_scale", self.accelerometer_scale),
            ("accelerometer_tilt", self.accelerometer_tilt),
            ("hum_amplitude", self.hum_amplitude),
            ("hum_phase", self.hum_phase),
            ("displacement_scale", self.displacement_scale),
            ("load_cell_scale", self.load_cell_scale),
            ("load_cell_bias", self.load_cell_bias),
        ] {
            ModelError::require_finite(name, value)?;
        }
        ModelError::require_non_negative("accelerometer_delay", self.accelerometer_delay)?;
        ModelError::require_non_negative("hum_frequency", self.hum_frequency)?;
        ModelError::require_non_negative("displacement_lag", self.displacement_lag)
    }
}

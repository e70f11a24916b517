//! What controllers are designed on: a rig as its recordings show it.

use std::path::Path;

use identification::closed_loop::model_section::HydraulicSection;
use identification::identify::model_file::{ModelFile, Units};
use plant::identified::shake_table::ShakeTable;
use units::constants::{G, INCH, SAMPLING_PERIOD};

/// The model of the physical rig that comes with the program, as its commissioning found it.
const COMMISSIONED: &str = include_str!("../../systems/plant/servohydraulic-model.toml");

/// One standard deviation of what is measured, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// m.
    pub displacement: f64,
    /// m/s.
    pub velocity: f64,
    /// m/s².
    pub acceleration: f64,
}

/// An identified rig with the lateness and noise of its measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlModel {
    /// Actuator and table.
    pub rig: ShakeTable,
    /// Samples by which measurements are late behind the command's effect.
    pub delay: usize,
    /// Noise of the measurements.
    pub noise: Noise,
    /// Valve, oil and seals, where they were identified.
    pub hydraulics: Option<HydraulicSection>,
    /// Mass of the specimen in the recordings, kg.
    pub specimen_mass: Option<f64>,
}

impl ControlModel {
    /// Reads a model file; a sentence says what is wrong.
    ///
    /// # Errors
    /// A file at fault, or one whose data did not determine the actuator.
    pub fn read(path: &Path) -> Result<Self, String> {
        let file = ModelFile::read(path).map_err(|error| error.to_string())?;
        Self::new(&file, &path.display().to_string())
    }

    /// The physical rig's.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn commissioned() -> Result<Self, String> {
        const NAME: &str = "the built-in model of the physical rig";
        let file = ModelFile::parse(COMMISSIONED, NAME).map_err(|error| error.to_string())?;
        Self::new(&file, NAME)
    }

    fn new(file: &ModelFile, name: &str) -> Result<Self, String> {
        let said = |error: identification::IdentificationError| error.to_string();
        let rig = file.shake_table(name).map_err(said)?;
        let units: Units = file.units(name).map_err(said)?;
        let noise = |channel: &str| {
            let value = file.noise.as_ref().and_then(|noise| noise.get(channel));
            value.and_then(toml::Value::as_float).unwrap_or(0.0) * units.length
        };
        // Below these sensors err in other ways than by noise (as for the velocity's filter of the
        // instrumentation).
        let displacement = noise("displacement").max(1e-4 * INCH);
        let acceleration = noise("acceleration").max(0.01 * G);
        // Steady Kalman filter of a double integrator: sqrt(2) Q^(3/4) R^(1/4) is the variance of
        // the velocity for densities Q of the acceleration's noise and R of the displacement's.
        let [q, r] = [acceleration, displacement].map(|own| own * own * SAMPLING_PERIOD);
        let velocity = (std::f64::consts::SQRT_2 * q.powf(0.75) * r.powf(0.25)).sqrt();
        let late = file.command_delay.unwrap_or(0.0);
        Ok(Self {
            rig,
            delay: (late / SAMPLING_PERIOD).round().max(0.0) as usize,
            noise: Noise {
                displacement,
                velocity,
                acceleration,
            },
            hydraulics: file.hydraulics,
            specimen_mass: file.specimen(name).map_err(said)?.map(|own| own.mass),
        })
    }
}

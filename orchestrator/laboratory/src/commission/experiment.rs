//! A rig on its bench: motions under displacement control, played by the master on the rig's FMUs,
//! and what its sensors showed of them.

use controllers::pid::Pid;
use identification::closed_loop::velocity::noise_floor;
use identification::data::{Channel, Recording, mean_and_deviation};
use units::vocabulary;

use super::Request;
use crate::error::Error;
use crate::run::experiment::{self, Prepared, prepare};
use crate::systems::tuning::Tuning;
use fmi_import::Datum;
use fmi_master::{Algorithm, Record};
use motion::{Motion, peak};

/// The controller under which a rig is commissioned: soft, and known before the rig is.
pub const CONTROLLER: &str = "displacement-pid";
const CONTROL: &str = "control";

/// A rig under displacement control.
pub struct Bench {
    prepared: Prepared,
    specimen: bool,
}

/// A motion that was played.
pub struct Played {
    /// What the sensors showed, until it ended.
    pub recording: Recording,
    /// Why it ended early.
    pub ended: Option<String>,
}

impl Played {
    /// Largest magnitude of a channel.
    pub fn peak(&self, channel: Channel) -> f64 {
        peak(self.recording.samples(channel))
    }
}

impl Bench {
    /// The rig that is asked for.
    ///
    /// # Errors
    /// A plant or a parameter at fault.
    pub fn new(request: &Request) -> Result<Self, Error> {
        let prepared = prepare(&experiment::Request {
            plant: request.plant.clone(),
            specimen: request.specimen.clone(),
            tuning: Some(Tuning::Printed),
            set: request.set.clone(),
            fmi: request.fmi,
            installation: request.installation.clone(),
            ..experiment::Request::built_in(CONTROLLER)
        })?;
        Ok(Self {
            prepared,
            specimen: request.specimen != "none",
        })
    }

    /// Sample time of motions and recordings, s.
    pub fn dt(&self) -> f64 {
        self.prepared.motion.dt
    }

    /// The controller's law.
    pub fn law(&self) -> Pid {
        let mut pid = Pid::equation_3_6();
        let components = &self.prepared.system.components;
        if let Some(own) = components.iter().find(|own| own.name == CONTROL) {
            let given = own.given();
            let value = |name: &str| {
                let position = own.fmu.description.position(name)?;
                match own.start_value(&given, position) {
                    Datum::Number(value) => Some(value),
                    _ => None,
                }
            };
            for (name, slot) in [
                (vocabulary::PROPORTIONAL_GAIN, &mut pid.proportional),
                (vocabulary::INTEGRAL_GAIN, &mut pid.integral),
                ("integral_leak", &mut pid.integral_leak),
                (vocabulary::VALVE_LIMIT, &mut pid.limit),
            ] {
                *slot = value(name).unwrap_or(*slot);
            }
        }
        pid
    }

    /// Plays a motion from rest.
    ///
    /// # Errors
    /// A rig that cannot be initialised, or that does not show what is needed.
    pub fn play(&mut self, motion: Motion) -> Result<Played, Error> {
        self.prepared.samples = motion.len();
        self.prepared.motion = motion;
        let outcome = self.prepared.run(Algorithm::default())?;
        let motion = &self.prepared.motion;
        let rows = outcome.record.len().min(motion.len());
        let mut channels = vec![
            (Channel::Reference, motion.displacement[..rows].to_vec()),
            (
                Channel::ValveCommand,
                shown(&outcome.record, &["control.valve_command"])?,
            ),
        ];
        let measured: [(Channel, [&str; 2]); 4] = [
            (
                Channel::Displacement,
                ["sensors.measured_displacement", "table.displacement"],
            ),
            (
                Channel::Acceleration,
                ["sensors.measured_acceleration", "table.acceleration"],
            ),
            (
                Channel::ActuatorForce,
                ["sensors.measured_force", "table.actuator_force"],
            ),
            (
                Channel::SpecimenAcceleration,
                [
                    "sensors.measured_specimen_acceleration",
                    "specimen.acceleration",
                ],
            ),
        ];
        for (channel, names) in measured {
            // A rig may carry a specimen that nobody named.
            let is_named = channel != Channel::SpecimenAcceleration || self.specimen;
            match shown(&outcome.record, &names) {
                Ok(values) if is_named || is_lively(&values) => channels.push((channel, values)),
                Err(error) if is_named => return Err(error),
                _ => (),
            }
        }
        for (_, values) in &mut channels {
            values.truncate(rows);
        }
        Ok(Played {
            recording: Recording::new(&motion.name, motion.dt, channels)?,
            ended: outcome.ended.reason(),
        })
    }
}

/// Whether there is more in it than noise that is white.
fn is_lively(values: &[f64]) -> bool {
    const LIVELY: f64 = 5.0;
    mean_and_deviation(values).1 > LIVELY * noise_floor(values)
}

/// The first of the columns that is there.
fn shown(record: &Record, names: &[&str]) -> Result<Vec<f64>, Error> {
    let found = names.iter().find_map(|name| record.column(name));
    found.ok_or_else(|| Error::Option {
        option: "--plant",
        reason: format!(
            "the plant lacks an output to record; expected an output {}",
            names.join(" or ")
        ),
    })
}

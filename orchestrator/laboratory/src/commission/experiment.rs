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

#[cfg(test)]
impl Bench {
    /// A bench whose table follows with nine tenths.
    pub(super) fn made() -> Self {
        use crate::made;
        Self {
            prepared: made::prepared(made::wave("wave", 10), made::follows),
            specimen: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_is_lively_where_it_is_more_than_white_noise() {
        let mut state = 7_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let noise: Vec<f64> = (0..2000).map(|_| uniform()).collect();
        let wave = |size: f64| -> Vec<f64> {
            let noise = noise.iter().enumerate();
            noise
                .map(|(n, own)| own + size * (0.02 * n as f64).sin())
                .collect()
        };
        assert!(!is_lively(&noise) && !is_lively(&wave(0.5)));
        assert!(is_lively(&wave(10.0)));
    }

    #[test]
    fn the_first_column_that_is_there_is_recorded() {
        let names = ["time", "table.x", "sensors.x"].map(String::from).to_vec();
        let record = Record::of(names, vec![0.0, 1.0, 2.0], Vec::new(), Vec::new()).unwrap();
        assert_eq!(shown(&record, &["sensors.x", "table.x"]).unwrap(), [2.0]);
        assert_eq!(shown(&record, &["other.x", "table.x"]).unwrap(), [1.0]);
        let told = shown(&record, &["a.x", "b.x"]).unwrap_err().to_string();
        assert!(told.contains("expected an output a.x or b.x"), "{told}");
        let channels = vec![(Channel::Displacement, vec![0.25, -0.5])];
        let played = Played {
            recording: Recording::new("one", 0.002, channels).unwrap(),
            ended: None,
        };
        assert_eq!(played.peak(Channel::Displacement), 0.5);
    }

    #[test]
    fn a_bench_records_what_the_sensors_show_of_a_motion() {
        use crate::made;
        let mut bench = Bench::made();
        assert_eq!(bench.dt(), 0.002);
        let law = bench.law();
        assert_eq!((law.proportional, law.integral_leak), (25.0, 0.5));
        assert_eq!(law.limit, Pid::equation_3_6().limit);
        let motion = made::wave("other", 400);
        let played = bench.play(motion.clone()).unwrap();
        assert_eq!(
            (
                played.ended,
                &*played.recording.name,
                played.recording.len()
            ),
            (None, "other", 400)
        );
        let samples = |channel| played.recording.samples(channel);
        assert_eq!(samples(Channel::Reference), motion.displacement);
        let near = |found: f64, wanted: f64| {
            assert!(
                (found / wanted - 1.0).abs() < 1e-9,
                "{found} is not {wanted}"
            )
        };
        near(
            peak(samples(Channel::Displacement)),
            0.9 * motion.peak_displacement(),
        );
        near(
            peak(samples(Channel::ActuatorForce)),
            450.0 * motion.peak_acceleration(),
        );
        near(
            peak(samples(Channel::ValveCommand)),
            25.0 * motion.peak_displacement(),
        );
        assert!(
            played
                .recording
                .channel(Channel::SpecimenAcceleration)
                .is_none()
        );
        // With a specimen its acceleration must be there.
        bench.specimen = true;
        let told = bench.play(motion).err().unwrap().to_string();
        assert!(
            told.contains("measured_specimen_acceleration or specimen.acceleration"),
            "{told}"
        );
    }
}

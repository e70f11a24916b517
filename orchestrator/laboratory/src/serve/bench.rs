//! A system as the rig of an experimental element.

use bridges::element::{Command as Wanted, Measured, Rig, RigError};

use super::channels::{Channel, Channels, Command};
use fmi_master::{Asked, Driven, Ended, MasterError, Outcome, Simulation};

/// A simulation with the signals that an element is made of.
pub struct Bench {
    driven: Driven,
    is_reference: bool,
    displacement: Vec<Place>,
    velocity: Vec<Place>,
    acceleration: Vec<Place>,
    force: Vec<Place>,
    degrees_of_freedom: usize,
    asked: Asked,
}

/// A signal and its factor to SI.
struct Place {
    signal: usize,
    factor: f64,
}

impl Bench {
    /// Puts `channels` on a simulation, which is asked to rest.
    ///
    /// # Errors
    /// A simulation that cannot be moved from outside.
    pub fn new(simulation: Simulation, channels: &Channels) -> Result<Self, MasterError> {
        let driven = Driven::new(simulation)?;
        let names = driven.simulation().names();
        let places = |channels: &[Channel]| -> Vec<Place> {
            let found = channels.iter().filter_map(|channel| {
                let signal = names.iter().position(|name| *name == channel.name)?;
                Some(Place {
                    signal,
                    factor: channel.factor,
                })
            });
            found.collect()
        };
        Ok(Self {
            is_reference: channels.command == Command::Reference,
            displacement: places(&channels.displacement),
            velocity: places(&channels.velocity),
            acceleration: places(&channels.acceleration),
            force: places(&channels.force),
            degrees_of_freedom: channels.degrees_of_freedom(),
            asked: Asked::default(),
            driven,
        })
    }

    /// What came of it.
    pub fn finish(self, ended: Ended) -> Outcome {
        self.driven.finish(ended)
    }

    fn ask(&mut self, command: &Wanted) {
        let first = |values: &[f64]| values.first().copied().unwrap_or(0.0);
        if self.is_reference {
            self.asked.displacement = first(&command.displacement);
            self.asked.velocity = first(&command.velocity);
            self.asked.acceleration = first(&command.acceleration);
        } else {
            self.asked.columns.clone_from(&command.displacement);
        }
    }
}

impl Rig for Bench {
    fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }

    fn step(&self) -> f64 {
        self.driven.simulation().step()
    }

    fn advance(&mut self, command: &Wanted) -> Result<(), RigError> {
        self.ask(command);
        Ok(self.driven.advance(&self.asked)?)
    }

    fn place(&mut self, command: &Wanted) -> Result<(), RigError> {
        self.ask(command);
        Ok(self.driven.place(&self.asked)?)
    }

    fn measure(&self, into: &mut Measured) {
        let simulation = self.driven.simulation();
        let signals = simulation.signals();
        let read = |places: &[Place], into: &mut Vec<f64>| {
            into.clear();
            into.extend(
                places
                    .iter()
                    .map(|place| signals[place.signal] * place.factor),
            );
        };
        read(&self.force, &mut into.force);
        read(&self.velocity, &mut into.velocity);
        read(&self.acceleration, &mut into.acceleration);
        read(&self.displacement, &mut into.displacement);
        if self.displacement.is_empty() {
            match self.is_reference {
                true => into.displacement.push(self.asked.displacement),
                false => into.displacement.clone_from(&self.asked.columns),
            }
        }
        for missing in [
            &mut into.displacement,
            &mut into.velocity,
            &mut into.acceleration,
        ] {
            missing.resize(self.degrees_of_freedom, 0.0);
        }
        into.time = simulation.time();
    }

    fn save(&mut self) -> Result<(), RigError> {
        Ok(self.driven.save()?)
    }

    fn restore(&mut self) -> Result<(), RigError> {
        self.driven.restore()?;
        Ok(())
    }
}

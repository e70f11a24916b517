//! A simulation that its owner steps: it follows its motion, and keeps its record.

use std::time::Instant;

use super::{Checkpoint, Ended, MasterError, Outcome, Record, Simulation};

/// A simulation between two of its steps, with its record.
pub struct Stepwise {
    simulation: Simulation,
    record: Record,
    /// Samples of the motion that are played.
    samples: usize,
    ended: Option<Ended>,
    begun: Instant,
}

/// A moment of a [`Stepwise`], as plain data: another process that has prepared the same system can go
/// on from it.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Saved {
    checkpoint: Checkpoint,
    rows: usize,
}

impl Saved {
    /// Its time, s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.checkpoint.time
    }
}

impl Stepwise {
    /// Begins with the first sample, which is known then.
    ///
    /// # Errors
    /// A call that an FMU did not complete.
    pub fn new(simulation: Simulation, samples: usize) -> Result<Self, MasterError> {
        let record = Record::with_capacity(simulation.columns(), samples);
        let mut stepwise = Self {
            record: record.beside(&simulation.exact_names),
            simulation,
            samples,
            ended: None,
            begun: Instant::now(),
        };
        let is_over = stepwise.simulation.arrive(&mut stepwise.record)?;
        stepwise.settle(is_over);
        Ok(stepwise)
    }

    /// Steps once; gives whether another step may follow. After the end nothing happens.
    #[inline]
    pub fn step(&mut self) -> bool {
        if self.ended.is_some() {
            return false;
        }
        match self.go_on() {
            Ok(is_over) => self.settle(is_over),
            Err(error) => self.ended = Some(Ended::Failed(error)),
        }
        self.ended.is_none()
    }

    fn go_on(&mut self) -> Result<bool, MasterError> {
        self.simulation.advance()?;
        if let Some(ended) = self.simulation.terminated(&mut self.record)? {
            self.ended = Some(ended);
            return Ok(false);
        }
        // The last step leads to the end of the last sample, which has no row.
        if self.is_played() {
            return Ok(true);
        }
        self.simulation.arrive(&mut self.record)
    }

    fn is_played(&self) -> bool {
        self.simulation.tick >= self.samples * self.simulation.ticks_per_row
    }

    fn settle(&mut self, is_over: bool) {
        if is_over && self.ended.is_none() {
            self.ended = Some(self.simulation.ended());
        }
    }

    /// Whether it has ended: its motion is played, or something has stopped it.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.ended.is_some()
    }

    /// How it ended, if it has.
    #[must_use]
    pub fn ended(&self) -> Option<&Ended> {
        self.ended.as_ref()
    }

    /// The simulation.
    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// What has been recorded.
    #[must_use]
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// The present moment.
    ///
    /// # Errors
    /// A component that cannot write its state, by name, or a simulation that has ended.
    pub fn save(&mut self) -> Result<Saved, MasterError> {
        self.simulation.check_checkpoints()?;
        let checkpoint = match self.ended {
            None => self.simulation.checkpoint(0.0)?,
            Some(_) => None,
        };
        let checkpoint = checkpoint.ok_or_else(|| MasterError::Ended {
            time: self.simulation.time(),
        })?;
        Ok(Saved {
            checkpoint,
            rows: self.record.len(),
        })
    }

    /// Goes back to a moment, or on to a later one. What is recorded after it is forgotten; rows between
    /// the end of the record and a later moment are missing.
    ///
    /// # Errors
    /// A moment of another system, or a state that an FMU does not take.
    pub fn restore(&mut self, moment: &Saved) -> Result<(), MasterError> {
        self.simulation.go_to(&moment.checkpoint)?;
        self.record.truncate(moment.rows);
        self.ended = None;
        Ok(())
    }

    /// Record and ending; a simulation that could go on is interrupted.
    #[must_use]
    pub fn finish(self) -> Outcome {
        let time = self.simulation.time();
        let ended = self.ended.unwrap_or(Ended::Interrupted { time });
        let wall = self.begun.elapsed().as_secs_f64();
        self.simulation.outcome(self.record, ended, wall)
    }
}

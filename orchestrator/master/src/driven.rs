//! A simulation that is moved from outside, a step at a time, instead of by a motion.

use std::time::Instant;

use super::signals::Signals;
use super::{Ended, MasterError, Outcome, Record, Simulation};
use fmi_import::State;

/// What a system is asked for at a sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Asked {
    /// m.
    pub displacement: f64,
    /// m/s.
    pub velocity: f64,
    /// m/s2.
    pub acceleration: f64,
    /// Values of the columns of the table [`OUTSIDE`], where the system has one.
    pub columns: Vec<f64>,
}

impl Asked {
    fn motion(&self) -> [f64; 3] {
        [self.displacement, self.velocity, self.acceleration]
    }
}

/// The input table whose only row is what somebody outside says.
pub const OUTSIDE: &str = "outside";

/// A simulation that follows values from outside, with its record.
pub struct Driven {
    simulation: Simulation,
    record: Record,
    asked: Asked,
    kept: Option<Kept>,
    begun: Instant,
}

/// A moment that can be gone back to.
struct Kept {
    states: Vec<State>,
    tick: usize,
    signals: Signals,
    last_signals: Signals,
    asked: Asked,
    rows: usize,
}

impl Driven {
    /// Begins with `simulation`, which is asked to rest at zero.
    ///
    /// # Errors
    /// Steps that vary, components that need to know the motion ahead, or a call that an FMU did not
    /// complete.
    pub fn new(mut simulation: Simulation) -> Result<Self, MasterError> {
        if simulation.variable.is_some() {
            let reason = "what is moved from outside has steps of one length".to_string();
            return Err(MasterError::VariableStep(reason));
        }
        if let Some(ahead) = simulation.reference.ahead_of_time() {
            let name = simulation.names.get(ahead).cloned().unwrap_or_default();
            return Err(MasterError::Ahead(name));
        }
        simulation.reference.take_from_outside();
        let record = Record::with_capacity(simulation.columns(), 1024);
        let mut driven = Self {
            record: record.beside(&simulation.exact_names),
            simulation,
            asked: Asked::default(),
            kept: None,
            begun: Instant::now(),
        };
        driven.simulation.observe()?;
        driven.keep_row()?;
        Ok(driven)
    }

    /// Steps, and then asks for `asked`.
    ///
    /// # Errors
    /// A call that an FMU did not complete, a run that diverges, or an interlock that tripped.
    pub fn advance(&mut self, asked: &Asked) -> Result<(), MasterError> {
        self.simulation.advance()?;
        self.ask(asked);
        self.simulation.observe()?;
        self.keep_row()
    }

    /// Asks for `asked` at the present moment. Where components are called at samples, that has been
    /// done already, and only what was asked for then can be asked for again.
    ///
    /// # Errors
    /// As [`Driven::advance`], or a sample that has passed.
    pub fn place(&mut self, asked: &Asked) -> Result<(), MasterError> {
        let rests = |asked: &Asked| asked.columns.iter().all(|value| *value == 0.0);
        let is_same =
            self.asked.columns == asked.columns || (self.asked.columns.is_empty() && rests(asked));
        if is_same && self.asked.motion() == asked.motion() {
            return Ok(());
        }
        if self
            .simulation
            .parts
            .iter()
            .any(|part| part.every.is_some())
        {
            return Err(MasterError::Passed {
                time: self.simulation.time(),
            });
        }
        self.ask(asked);
        self.simulation.observe()?;
        self.record.truncate(self.record.len().saturating_sub(1));
        self.keep_row()
    }

    fn ask(&mut self, asked: &Asked) {
        self.asked.clone_from(asked);
        let reference = &mut self.simulation.reference;
        reference.set_now(asked.motion(), OUTSIDE, &asked.columns);
    }

    fn keep_row(&mut self) -> Result<(), MasterError> {
        let simulation = &mut self.simulation;
        simulation.keep(simulation.time(), &mut self.record);
        simulation.check_bounds()?;
        if let Some(error) = simulation
            .parts
            .iter_mut()
            .find_map(|part| part.failure.take())
        {
            return Err(error);
        }
        if let Some(ended) = simulation.parts.iter().find(|part| part.ended.is_some()) {
            return Err(MasterError::Over(ended.instance.name.clone()));
        }
        match simulation.tripped_now() {
            Some(tripped) => Err(MasterError::Tripped(tripped.message())),
            None => Ok(()),
        }
    }

    /// Keeps the present moment in place of the one before.
    ///
    /// # Errors
    /// A component that cannot save its state, by name.
    pub fn save(&mut self) -> Result<(), MasterError> {
        let parts = &mut self.simulation.parts;
        let mut kept = self.kept.take().unwrap_or_else(|| Kept {
            states: parts.iter().map(|_| State::default()).collect(),
            tick: 0,
            signals: self.simulation.signals.clone(),
            last_signals: self.simulation.last_signals.clone(),
            asked: Asked::default(),
            rows: 0,
        });
        for (part, state) in parts.iter_mut().zip(&mut kept.states) {
            if !part.instance.fmu.description.saves_state {
                return Err(MasterError::NotSaved(part.instance.name.clone()));
            }
            part.instance.save_state(state)?;
        }
        kept.tick = self.simulation.tick;
        kept.signals.copy_from(&self.simulation.signals);
        kept.last_signals.copy_from(&self.simulation.last_signals);
        kept.asked.clone_from(&self.asked);
        kept.rows = self.record.len();
        self.kept = Some(kept);
        Ok(())
    }

    /// Goes back to the moment that was kept; what was recorded since is forgotten.
    ///
    /// # Errors
    /// A component that does not take its state.
    pub fn restore(&mut self) -> Result<(), MasterError> {
        let Some(kept) = &self.kept else {
            return Ok(());
        };
        let simulation = &mut self.simulation;
        for (part, state) in simulation.parts.iter_mut().zip(&kept.states) {
            part.ended = None;
            part.instance.restore_state(state)?;
        }
        simulation.tick = kept.tick;
        simulation.signals.copy_from(&kept.signals);
        simulation.last_signals.copy_from(&kept.last_signals);
        self.asked.clone_from(&kept.asked);
        let (motion, columns) = (kept.asked.motion(), &kept.asked.columns);
        simulation.reference.set_now(motion, OUTSIDE, columns);
        self.record.truncate(kept.rows);
        Ok(())
    }

    /// The simulation.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// The record, and how it ended.
    pub fn finish(mut self, ended: Ended) -> Outcome {
        if let Some(kept) = self.kept.take() {
            for (part, state) in self.simulation.parts.iter_mut().zip(kept.states) {
                // A state that cannot be given back is lost with its instance.
                let _ = part.instance.free_state(state);
            }
        }
        let wall = self.begun.elapsed().as_secs_f64();
        self.simulation.outcome(self.record, ended, wall)
    }
}

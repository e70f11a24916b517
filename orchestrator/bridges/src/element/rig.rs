//! What an element moves: a system that is stepped, small enough to be a spring in a test.

use std::error::Error;

use super::Measured;

/// A rig that could not go on.
pub type RigError = Box<dyn Error + Send + Sync>;

/// Where a rig is asked to be at the end of one of its steps, SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Command {
    /// m.
    pub displacement: Vec<f64>,
    /// m/s.
    pub velocity: Vec<f64>,
    /// m/s2.
    pub acceleration: Vec<f64>,
}

/// A system that follows a displacement step by step.
pub trait Rig {
    /// How many displacements it takes.
    fn degrees_of_freedom(&self) -> usize;

    /// Its step, s.
    fn step(&self) -> f64;

    /// Advances by one step, at the end of which it is asked to be where `command` says.
    ///
    /// # Errors
    /// A component that fails, an interlock that trips.
    fn advance(&mut self, command: &Command) -> Result<(), RigError>;

    /// Asks for `command` at the present moment, with no time passing.
    ///
    /// # Errors
    /// As [`Rig::advance`].
    fn place(&mut self, command: &Command) -> Result<(), RigError>;

    /// What is measured now.
    fn measure(&self, into: &mut Measured);

    /// Keeps the present state, in place of the one kept before.
    ///
    /// # Errors
    /// A component that cannot save its state.
    fn save(&mut self) -> Result<(), RigError>;

    /// Goes back to the state that was kept.
    ///
    /// # Errors
    /// No state is kept, or a component does not take it.
    fn restore(&mut self) -> Result<(), RigError>;
}

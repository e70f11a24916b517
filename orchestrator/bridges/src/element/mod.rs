//! What answers a client: an experimental element, over a rig that is moved step by step.

mod ideal;
mod path;
mod rig;
mod stepwise;

use thiserror::Error;

use crate::protocol::Matrix;

pub use ideal::{Ideal, Matrices};
pub use path::{Interval, Path, Shape};
pub use rig::{Command, Rig, RigError};
pub use stepwise::{Moves, Stepwise};

/// A trial response, SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trial {
    /// Displacements, m.
    pub displacement: Vec<f64>,
    /// Velocities, m/s; none where the client does not send them.
    pub velocity: Vec<f64>,
    /// Accelerations, m/s2; none where the client does not send them.
    pub acceleration: Vec<f64>,
    /// Time of the analysis, s, where the client sends it.
    pub time: Option<f64>,
}

/// What was measured, SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Measured {
    /// Displacements, m.
    pub displacement: Vec<f64>,
    /// Velocities, m/s.
    pub velocity: Vec<f64>,
    /// Accelerations, m/s2.
    pub acceleration: Vec<f64>,
    /// Resisting forces, N: positive against a positive displacement.
    pub force: Vec<f64>,
    /// Time of the rig, s.
    pub time: f64,
}

impl Measured {
    /// Zeros for so many degrees of freedom.
    #[must_use]
    pub fn zeros(degrees_of_freedom: usize) -> Self {
        let zeros = vec![0.0; degrees_of_freedom];
        Self {
            displacement: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros.clone(),
            force: zeros,
            time: 0.0,
        }
    }
}

/// An experimental element: trials in, forces out.
pub trait Element {
    /// How many displacements a trial has.
    fn degrees_of_freedom(&self) -> usize;

    /// Takes a trial; nothing moves yet.
    fn set_trial(&mut self, trial: &Trial);

    /// What is measured at the latest trial; moves there where that is still to be done.
    ///
    /// # Errors
    /// A rig that fails, or a trial that it cannot take.
    fn measure(&mut self) -> Result<&Measured, ElementError>;

    /// Makes the latest trial the step's.
    ///
    /// # Errors
    /// As [`Element::measure`].
    fn commit(&mut self) -> Result<(), ElementError>;

    /// What was measured last, without a move.
    fn last(&self) -> &Measured;

    /// A matrix row by row, SI, where it is known.
    fn matrix(&self, matrix: Matrix) -> Option<&[f64]>;
}

/// Why an element cannot answer.
#[derive(Debug, Error)]
pub enum ElementError {
    /// The rig failed.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// A trial after the rig has moved.
    #[error(
        "in step {step} the client changed its trial displacement from {moved_m} m to {trial_m} m \
         after the rig had moved there: an integrator that iterates, such as `Newmark` or `HHT` \
         with the algorithm `Newton`. A rig cannot take a move back. Use an explicit integrator \
         (`AlphaOS`, `NewmarkExplicit`, `HHTExplicit`, `CentralDifference`, `KRAlphaExplicit`), one \
         with a fixed number of iterations (`NewmarkHSFixedNumIter`, `HHTHSFixedNumIter`, \
         `CollocationHSFixedNumIter`) with --iterations N, or --mode ideal"
    )]
    Iterates {
        /// Step of the analysis, from 1.
        step: usize,
        /// Where the rig has moved, m.
        moved_m: f64,
        /// Where it is asked to be now, m.
        trial_m: f64,
    },
    /// A step of the analysis that is not a whole number of steps of the rig.
    #[error(
        "step {step} of the analysis lasts {interval_s} s, which is {ratio} steps of the system \
         ({own_s} s); expected a whole number: change the step of the analysis, --interval, \
         --time-scale or the system's step"
    )]
    Interval {
        /// Step of the analysis, from 1.
        step: usize,
        /// How long it lasts for the rig, s.
        interval_s: f64,
        /// As steps of the system.
        ratio: f64,
        /// Step of the system, s.
        own_s: f64,
    },
    /// No time to move in.
    #[error(
        "step {step} of the analysis has no time for a move to {trial_m} m: the client sends {time}; \
         say how long a step lasts with --interval, such as --interval \"0.01 s\""
    )]
    NoTime {
        /// Step of the analysis, from 1.
        step: usize,
        /// Where to, m.
        trial_m: f64,
        /// What the client says of time.
        time: String,
    },
}

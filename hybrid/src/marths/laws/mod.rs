//! Tracking laws for two actuators: from targets and measured strokes to commands.

mod estimator;
mod inverse;
mod linear_quadratic;
mod predictive;
mod rodeac;
mod single_axis;

pub use estimator::{Estimator, Prior};
pub use inverse::Inverse;
pub use linear_quadratic::{LinearQuadratic, LinearQuadraticDesign};
pub use predictive::{Predictive, PredictiveDesign};
pub use rodeac::DecentralisedAdaptive;
pub use single_axis::SingleAxis;

use super::Pair;

/// What a law puts between the sensors and the specimen's force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// The measured strokes.
    Raw,
    /// A causal function of commands and measured strokes.
    Estimate,
}

/// A tracking law. At each sample [`Law::feedback`] is called first, [`Law::step`] second.
pub trait Law: Send {
    /// What it feeds to the force.
    fn class(&self) -> Class {
        Class::Raw
    }

    /// Strokes (m) that the specimen's force is made of.
    fn feedback(&mut self, measured: Pair) -> Pair {
        measured
    }

    /// Commands (m) for targets and measured strokes (m).
    fn step(&mut self, target: Pair, measured: Pair) -> Pair;
}

/// No controller: the targets are the commands.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoControl;

impl Law for NoControl {
    fn step(&mut self, target: Pair, _measured: Pair) -> Pair {
        target
    }
}

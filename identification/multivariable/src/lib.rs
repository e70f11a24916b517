//! Rigs of several actuators: from commands to strokes.
//!
//! A [`Model`] has poles that all entries share, a residue for each entry and pole, and a delay for each command. It is
//! found by [`identify`], judged by [`interaction`], and compared with later recordings by [`diagnose`], which names a fault
//! and its actuator.

mod description;
pub mod diagnose;
mod fault;
mod fit;
pub mod identify;
pub mod interaction;
mod model;
mod recording;
mod residuals;
mod search;

pub use description::{Description, KIND, Pins, TEMPLATE};
pub use fault::Fault;
pub use model::Model;
pub use recording::{Joint, Names, Recording, is_multivariable};

/// What is wrong with a file, recording or model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{place}: {what}")]
pub struct Error {
    /// File, and line or key.
    pub place: String,
    /// What is wrong, what was expected, what to do.
    pub what: String,
}

impl Error {
    pub(crate) fn at(place: impl Into<String>, what: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            what: what.into(),
        }
    }
}

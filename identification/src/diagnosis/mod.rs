//! What a model gets wrong, the name of the cause, and what it brings to know it.

mod fit;
mod model;

pub use fit::{Fit, Jacobian, evaluate, fit, polish};
pub use model::{Candidate, EffectParameter, Point, RigModel, Role, Scale};

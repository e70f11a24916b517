//! The search for what a model lacks; knows no rig.

pub mod adequacy;
pub mod experiment;
mod fit;
pub mod gain;
mod model;
mod search;
mod verdict;

pub use adequacy::Test;
pub use fit::{Fit, Jacobian, evaluate, fit, polish};
pub use model::{Candidate, EffectParameter, Point, RigModel, Role, Scale};
pub use search::{Found, Hypothesis, Search};
pub use verdict::{Estimate, Judgement, NamedEffect, Verdict, judge};

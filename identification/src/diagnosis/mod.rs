//! What a model gets wrong, the name of the cause, and what it brings to know it.

pub mod adequacy;
mod fit;
mod model;
mod search;
mod verdict;

pub use fit::{Fit, Jacobian, evaluate, fit, polish};
pub use model::{Candidate, EffectParameter, Point, RigModel, Role, Scale};
pub use search::{Found, Hypothesis, Search};
pub use verdict::{Estimate, Judgement, NamedEffect, Verdict, judge};

//! What a model gets wrong, the name of the cause, and what it brings to know it.

pub mod adequacy;
pub mod experiment;
mod fit;
pub mod gain;
mod model;
pub mod relations;
mod search;
mod sentence;
pub mod shake_table;
mod verdict;

pub use adequacy::Test;
pub use fit::{Fit, Jacobian, evaluate, fit, polish};
pub use model::{Candidate, EffectParameter, Point, RigModel, Role, Scale};
pub use search::{Found, Hypothesis, Search};
pub use sentence::{amount, laboratory_unit, said};
pub use verdict::{Estimate, Judgement, NamedEffect, Verdict, judge};

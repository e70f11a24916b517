//! The search for what a model lacks; knows no rig.

pub mod adequacy;
mod cross_validation;
mod fit;
mod likelihood;
mod model;
mod progress;
pub mod resampling;
mod search;
mod verdict;

pub use adequacy::Test;
pub use cross_validation::{Rival, Selected, Simulated, SimulatedModel, select};
pub use fit::{Fit, Jacobian, evaluate, fit, polish};
pub use likelihood::{Hypothesis, PenalisedLikelihood};
pub use model::{Candidate, EffectParameter, ExtensibleModel, Point, Role, Scale};
pub use progress::{Observer, Progress, Step};
pub use search::{Found, Selection, search};
pub use verdict::{Judgement, NamedEffect, ParameterEstimate, Verdict, estimates, judge};

//! The search for what a model lacks; knows no rig.

pub mod adequacy;
mod cross_validation;
mod fit;
mod least_squares;
mod likelihood;
mod model;
mod opening;
mod progress;
pub mod resampling;
mod search;
mod verdict;

pub use adequacy::Test;
pub use cross_validation::{Rival, Selected, Simulated, completed, nominal, refit, select};
pub use fit::{Fit, Jacobian, evaluate, fit, polish};
pub(super) use least_squares::WEAK;
pub use least_squares::{
    Columns, Free, SimulatedModel, Solution, all_errors, deviations, least_squares, solution,
};
pub use likelihood::{Hypothesis, PenalisedLikelihood};
pub use model::{Candidate, EffectParameter, ExtensibleModel, Lesson, Point, Role, Scale};
pub use progress::{Observer, Progress, Step};
pub use search::{Found, Selection, search};
pub use verdict::{Judgement, NamedEffect, ParameterEstimate, Verdict, estimates, judge};

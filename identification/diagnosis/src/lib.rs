//! The search for effects that a model lacks, independent of any rig.

mod ablation;
pub mod adequacy;
mod cross_validation;
mod fit;
mod least_squares;
mod likelihood;
mod model;
mod opening;
mod progress;
pub mod resampling;
mod rounds;
mod search;
mod verdict;

pub use adequacy::{Part, Place, Test};
pub use cross_validation::{
    AGAIN, Rival, Selected, Simulated, VITAL, as_stated, completed, looked, nominal, refit, select,
    select_jointly, settled, settled_along,
};
pub use fit::{Fit, Jacobian, evaluate, residuals};
pub use least_squares::WEAK;
pub use least_squares::{
    Columns, Free, SimulatedModel, Solution, all_errors, deviations, least_squares, solution,
    squares,
};
pub use likelihood::{FLOOR, Hypothesis, PRICE_OF_A_PARAMETER, PenalisedLikelihood};
pub use model::{Candidate, EffectParameter, ExtensibleModel, Lesson, Point, Role, Scale};
pub use progress::{Deadline, Observer, Progress, Step};
pub use search::{Found, Selection, search};
pub use verdict::{
    Judgement, NamedEffect, ParameterEstimate, SUREST, Verdict, WeighedModel, estimates, judge,
};

//! The laboratory: runs, comparisons, iterations, commissioning, designs and diagnoses of the built-in
//! systems and of others.

pub mod commission;
pub mod comparison;
pub mod design;
pub mod diagnosis;
pub mod error;
pub mod export;
pub mod figures;
pub mod identify;
pub mod iteration;
pub mod json;
#[cfg(test)]
#[path = "tests/made.rs"]
mod made;
pub mod qualify;
pub mod results;
pub mod run;
pub mod run_comparison;
pub mod serve;
pub mod systems;

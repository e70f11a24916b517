//! Rigs with an effect hidden in the data: an independent generator and a scorer.
//!
//! Nothing here knows the crate `plant`: the same rig is written down again in inch, pound-force
//! and volt, as two companion forms joined at the force, and integrated by Kutta's 3/8 rule at
//! 20 steps a sample. A case holds what a laboratory would have; the truth is kept apart.

pub mod case;
pub mod catalogue;
pub mod excitation;
pub mod form;
pub mod hidden;
pub mod law;
pub mod outside;
pub mod plant;
pub mod rig;
pub mod score;
pub mod world;

pub use case::{Case, Kind, Settings};
pub use score::{Outcome, Truth, Verdict};
pub use world::World;

//! The thesis's table in worlds of another form.

pub mod ablation;
pub mod case;
pub mod hidden;
pub mod rig;
pub mod score;

pub use case::{Case, Kind};
pub use hidden::{Hidden, Laws, Outside};

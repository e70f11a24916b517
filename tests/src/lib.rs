//! Acceptance tests: the thesis's tables, importers, hidden effects

pub mod fuzz;
pub mod hidden_suite;
pub mod monolithic;
pub mod native_rig;
pub mod physical_recordings;
pub mod python;
pub mod recordings;
pub mod shared;

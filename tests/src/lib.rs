//! Acceptance tests: the thesis's tables, importers, hidden effects

pub mod native_rig;
pub mod python;

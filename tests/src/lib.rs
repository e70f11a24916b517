//! Acceptance tests: the thesis's tables, importers, hidden effects

pub mod python;

//! A comparison of controllers on records.

pub(crate) mod errors;
pub(crate) mod tables;

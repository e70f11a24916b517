//! Benchmarks of others, run by their own rules.

pub mod vrths;

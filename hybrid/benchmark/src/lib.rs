//! Benchmarks of real-time hybrid simulation: what `shakebench benchmark` runs, scores and draws.
//!
//! The program `shakebench-hybrid` holds it, which `shakebench` starts, so that nobody else compiles it.

pub mod console;
pub mod marths;
pub mod vrths;

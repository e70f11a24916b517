//! A hydraulic actuator with the specimen that it moves: the transfer system of real-time hybrid
//! simulation, as its equations say and with what a real one does besides.
//!
//! Numbers are those of the single-axis benchmark: C. E. Silva, D. Gomez, A. Maghareh, S. J. Dyke
//! and B. F. Spencer Jr., "Benchmark control problem for real-time hybrid simulation", Mechanical
//! Systems and Signal Processing 135 (2020) 106381, and its published program
//! (MECHS-RCN/BENCHMARKS, RTHS code RT V23).

mod extended;
mod linear;

pub use extended::{ExtendedTransferSystem, TransferSystemEffects};
pub use linear::{InteractionForm, TransferSystem, TransferSystemParameters, TransferSystemState};

/// Samples a second of controller, sensors and integration.
pub const RATE: f64 = 4096.0;

/// Time between samples, s.
pub const PERIOD: f64 = 1.0 / RATE;

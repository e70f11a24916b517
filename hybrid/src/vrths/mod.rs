//! Real-time hybrid simulation with a virtual plant: one actuator moves the first floor of a
//! three-storey frame whose rest is computed.
//!
//! The single-axis benchmark of C. E. Silva, D. Gomez, A. Maghareh, S. J. Dyke and B. F. Spencer
//! Jr., "Benchmark control problem for real-time hybrid simulation", Mechanical Systems and Signal
//! Processing 135 (2020) 106381. Numbers are those of its published program (MECHS-RCN/BENCHMARKS,
//! RTHS code RT V23), from which its published scores come.
//!
//! At sample k, in this order: the numerical substructure gives its displacement and the sensors
//! their readings; the controller computes its command without delay; plant and substructure step
//! to sample k + 1, the plant under the held command, the substructure under the force measured
//! one sample earlier.

mod frame;
mod perturbation;
mod sensors;
mod substructure;

pub use frame::{BenchmarkCase, Frame, ReferenceFrame};
pub use perturbation::{Deviation, corners};
pub use plant::transfer_system::*;
pub use sensors::{Converter, PublishedNoise, SensorNoise};
pub use substructure::{GroundMotion, NumericalSubstructure};

/// Force at which the published program stops with an error, N.
pub const FORCE_LIMIT: f64 = 8900.0;

/// Stroke of the actuator, m; stated in the paper, not checked by the program.
pub const STROKE: f64 = 7.0e-3;

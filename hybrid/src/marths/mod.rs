//! Multi-axial real-time hybrid simulation: two actuators move one joint of a three-storey frame
//! whose rest is computed.
//!
//! The benchmark of J. W. Condori Uribe, M. Salmeron, E. Patino, H. Montoya, S. J. Dyke, C. E.
//! Silva, A. Maghareh, M. Najarian and A. Montoya, "Experimental benchmark control problem for
//! multi-axial real-time hybrid simulation", Frontiers in Built Environment 9 (2023) 1270996.
//! Numbers are those of its published program.
//!
//! At sample k, in this order: the plant gives its strokes and the sensors their readings; the
//! coupler's kinematics turn what is fed back into the joint's motion; the specimen's force acts on
//! the numerical substructure in the same sample; its joint gives the target strokes; the controller
//! computes its commands without delay, and the plant steps to sample k + 1 under them. The plant is
//! strictly proper, so this is no algebraic loop.

mod coupler;
pub mod criteria;
mod frame;
pub mod laws;
pub mod names;
mod newmark;
mod perturbation;
mod plant;
pub mod run;
mod sensors;
mod specimen;
mod structure;

pub use self::plant::{ColumnDynamics, Plant, PlantParameters, Volts};
pub use coupler::{Coupler, JointMotion};
pub use newmark::Newmark;
pub use perturbation::{COVERING, Deviation, PERTURBED, corners, covering_corners};
pub use sensors::{NOISE, independent_noise, published_noise};
pub use specimen::{InterfaceForce, Specimen};
pub use structure::{Freedom, Structure};

/// A number for each actuator.
pub type Pair = [f64; 2];

/// Samples a second of controller, sensors and integration.
pub const RATE: f64 = 1024.0;

/// Time between samples, s.
pub const PERIOD: f64 = 1.0 / RATE;

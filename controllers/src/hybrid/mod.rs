//! Tracking laws of real-time hybrid simulation: from a displacement that the numerical
//! substructure wants now to the command of an actuator that would be late.
//!
//! Every law knows the desired displacement up to now, the measured displacement and the measured
//! force, and nothing else; models that a law is designed on are parameters of it.

pub mod adaptive_inverse;
pub mod extrapolation;
pub mod lag_chain;
pub mod model_inverse;
pub mod phase_lead_pi;

/// What a tracking law is told at a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct TrackingInput {
    /// Displacement that the numerical substructure wants, m.
    pub desired: f64,
    /// Measured displacement of the specimen, m.
    pub measured: f64,
    /// Measured force of the specimen, N.
    pub force: f64,
}

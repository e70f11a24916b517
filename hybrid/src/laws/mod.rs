//! Tracking laws of real-time hybrid simulation: from a displacement that the numerical
//! substructure wants now to the command of an actuator that would be late.
//!
//! Every law knows the desired displacement up to now, the measured displacement and the measured
//! force, and nothing else; models that a law is designed on are parameters of it.

pub mod adaptive_inverse;
pub mod compensation;
pub mod extrapolation;
pub mod gradient_inverse;
pub mod lag_chain;
pub mod linear_quadratic;
pub mod model_inverse;
pub mod phase_lead_pi;
pub mod robust_tracking;
pub mod sliding_mode;

use extrapolation::DERIVATIVES;

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

/// An inverse seen through a command that is held over each period, which is late by half of it:
/// the inverse times `e^(s period / 2)`, to the same order.
fn held_inverse(inverse: [f64; DERIVATIVES], period: f64) -> [f64; DERIVATIVES] {
    let mut result = [0.0; DERIVATIVES];
    for (i, a) in inverse.iter().enumerate() {
        let mut term = *a;
        for (n, slot) in result[i..].iter_mut().enumerate() {
            *slot += term;
            term *= 0.5 * period / (n + 1) as f64;
        }
    }
    result
}

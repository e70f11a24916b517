//! The rules by which controllers can be tuned.

use serde::Deserialize;

/// How a component is tuned; a built-in system's file says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// The gain of displacement PID.
    DisplacementPid,
    /// The gain of force PID under sliding mode.
    ForcePid,
    /// Model and weights of linear quadratic Gaussian control.
    LinearQuadraticGaussian,
    /// All coefficients of loop shaping.
    LoopShaping,
    /// Model and weights of model predictive control.
    ModelPredictive,
    /// Model, friction, specimen and weights of preview control.
    Preview,
    /// Model and rates of sliding mode.
    SlidingMode,
    /// All gains of three-variable control.
    ThreeVariable,
    /// The gains of three-variable control under model predictive control.
    UnderPrediction,
}

//! The rules by which controllers can be tuned.

use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error;

/// How a component is tuned; a built-in system's file says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// Rig and hold of adaptive inverse control.
    AdaptiveInverse,
    /// All gains of the dual loop of acceleration and force.
    DualLoop,
    /// The gain of displacement PID.
    DisplacementPid,
    /// The gain of force PID under sliding mode.
    ForcePid,
    /// Model and weights of linear quadratic Gaussian control.
    LinearQuadraticGaussian,
    /// All coefficients of loop shaping.
    LoopShaping,
    /// Start and rates of adaptation of minimal control synthesis.
    MinimalControlSynthesis,
    /// Model and weights of model predictive control.
    ModelPredictive,
    /// Model, weights and inverse of multi-metric control.
    MultiMetric,
    /// Rig, friction, corners and gains of the aids of operators.
    OperatorAids,
    /// Model, friction, specimen and weights of preview control.
    Preview,
    /// Model and rates of sliding mode.
    SlidingMode,
    /// Model, surfaces and lead of sliding mode down to the valve.
    SurfaceControl,
    /// All gains of three-variable control.
    ThreeVariable,
    /// Shaping, filter and gain of acceleration trajectory tracking.
    TrajectoryTracking,
    /// The gains of three-variable control under model predictive control.
    UnderPrediction,
}

impl Rule {
    /// The rule that a system file names.
    ///
    /// # Errors
    /// No such rule, with those that there are.
    pub fn named(name: &str) -> Result<Self, String> {
        let deserializer = IntoDeserializer::<Error>::into_deserializer(name);
        Self::deserialize(deserializer).map_err(|error| error.to_string())
    }
}

//! The rules by which controllers can be tuned.

use std::path::PathBuf;

use identification::IdentificationError;
use plant::ModelError;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error as UnknownRule;

/// Why the controllers of a system cannot be tuned.
#[derive(Debug, thiserror::Error)]
pub(super) enum TuningError {
    /// A rule refuses the model.
    #[error(transparent)]
    Refused(#[from] ModelError),
    /// The model cannot be read.
    #[error(transparent)]
    Model(#[from] IdentificationError),
    /// A component asks for a rule that there is not.
    #[error(transparent)]
    Rule(#[from] UnknownRule),
    /// A model for parameters that are printed.
    #[error("printed parameters do not use `--control-model`; expected one of the two")]
    Printed,
    /// A plant that nobody has commissioned.
    #[error(
        "there is no tuning for the plant `{plant}`: the printed one was made for it; expected \
         `--plant servohydraulic`, `--tuning printed` or `--control-model FILE`"
    )]
    NoTuning {
        /// The plant.
        plant: String,
    },
    /// The rules refuse the model of a file.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: Box<TuningError>,
    },
}

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
    pub fn named(name: &str) -> Result<Self, UnknownRule> {
        Self::deserialize(name.into_deserializer())
    }
}

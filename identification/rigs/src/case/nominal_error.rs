//! What may be wrong with a `nominal.toml`.

use plant::ModelError;

/// Why a text is not a nominal model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NominalError {
    /// No TOML, or a key that is unknown or missing.
    #[error(transparent)]
    Toml(#[from] toml::de::Error),
    /// The model was identified without an actuator.
    #[error(
        "no [actuator]: the data of this model did not determine it; expected a model that was \
         identified with a specimen or two payloads"
    )]
    NoActuator,
    /// A value out of range.
    #[error("{key} {expected}")]
    OutOfRange {
        /// The key, as the file writes it, with what the sentence needs after it.
        key: &'static str,
        /// What it must be.
        expected: &'static str,
    },
    /// A value that the plant refuses.
    #[error(transparent)]
    Plant(#[from] ModelError),
    /// A control law of a kind that is not known.
    #[error("controller.kind: `{0}` is unknown, expected `three_variable_control`")]
    UnknownControl(String),
    /// A section of an effect that is not known.
    #[error("[effects.{effect}]: unknown effect{hint}")]
    UnknownEffect {
        /// Its name.
        effect: String,
        /// What may have been meant.
        hint: String,
    },
    /// A parameter that an effect does not have.
    #[error("[effects.{effect}] {parameter}: unknown parameter{hint}")]
    UnknownParameter {
        /// The effect.
        effect: String,
        /// The parameter.
        parameter: String,
        /// What may have been meant.
        hint: String,
    },
}

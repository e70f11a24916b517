//! What can be wrong with a model's parameters.

const NOT_NEGATIVE: &str = "zero or a positive number";

/// A model that cannot be built or must not be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// A parameter lies outside what the model allows.
    #[error("parameter `{name}` is {value}, expected {expected}")]
    Parameter {
        /// The parameter's name, as the FMU shows it.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed, in words.
        expected: &'static str,
    },
    /// The model is readable but simulating it would mislead.
    #[error("{model} must not be simulated: {reason}")]
    NotForSimulation {
        /// The model's name.
        model: &'static str,
        /// Why.
        reason: String,
    },
    /// Matrices whose shapes do not fit.
    #[error("{what}: expected {expected}, got {got}")]
    Shape {
        /// Which matrix.
        what: &'static str,
        /// The shape needed.
        expected: String,
        /// The shape given.
        got: String,
    },
    /// A matrix equation without the solution that was asked for.
    #[error("{equation} has no stabilising solution: {reason}")]
    NoSolution {
        /// The equation.
        equation: &'static str,
        /// Why.
        reason: String,
    },
}

impl From<units::OutOfRange> for ModelError {
    fn from(wrong: units::OutOfRange) -> Self {
        Self::Parameter {
            name: wrong.parameter.name,
            value: wrong.value,
            expected: wrong.parameter.range.expected(),
        }
    }
}

impl ModelError {
    /// A parameter that counts.
    ///
    /// # Errors
    /// Names the parameter and its value where it is negative.
    pub fn count(name: &'static str, value: i32) -> Result<usize, Self> {
        usize::try_from(value).map_err(|_| Self::Parameter {
            name,
            value: f64::from(value),
            expected: NOT_NEGATIVE,
        })
    }

    /// Checks that a parameter is finite and positive.
    ///
    /// # Errors
    /// Names the parameter and its value otherwise.
    pub fn require_positive(name: &'static str, value: f64) -> Result<(), Self> {
        if value.is_finite() && value > 0.0 {
            return Ok(());
        }
        Err(Self::Parameter {
            name,
            value,
            expected: "a positive number",
        })
    }

    /// Checks that a parameter is finite and not negative.
    ///
    /// # Errors
    /// Names the parameter and its value otherwise.
    pub fn require_non_negative(name: &'static str, value: f64) -> Result<(), Self> {
        if value.is_finite() && value >= 0.0 {
            return Ok(());
        }
        Err(Self::Parameter {
            name,
            value,
            expected: NOT_NEGATIVE,
        })
    }

    /// Checks that a parameter is finite.
    ///
    /// # Errors
    /// Names the parameter and its value otherwise.
    pub fn require_finite(name: &'static str, value: f64) -> Result<(), Self> {
        if value.is_finite() {
            return Ok(());
        }
        Err(Self::Parameter {
            name,
            value,
            expected: "a finite number",
        })
    }
}

//! What can be wrong with a unit or a quantity.

use thiserror::Error;

use super::dimension::Dimension;

/// What is wrong with a unit, or with a number that carries one.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UnitError {
    /// An unknown unit.
    #[error("unknown unit \"{name}\" in \"{text}\"{hint}")]
    Unknown {
        /// The name that was not recognised.
        name: String,
        /// The whole text.
        text: String,
        /// The nearest known names, as a clause, or nothing.
        hint: String,
    },
    /// The text does not follow the grammar.
    #[error("cannot read the unit \"{text}\" at character {at}: expected {expected}")]
    Syntax {
        /// The whole text.
        text: String,
        /// Where, counted in characters from 1.
        at: usize,
        /// What was expected there.
        expected: &'static str,
    },
    /// Two units of different dimension.
    #[error("unit \"{from}\" ({from_dimension}) does not fit \"{to}\" ({to_dimension})")]
    Misfit {
        /// The unit that was given.
        from: String,
        /// Its dimension.
        from_dimension: Dimension,
        /// The unit that was expected.
        to: String,
        /// Its dimension.
        to_dimension: Dimension,
    },
    /// A quantity that does not begin with a number.
    #[error("cannot read \"{text}\" as a number with a unit, as in \"1.5 in\"")]
    NotANumber {
        /// The whole text.
        text: String,
    },
}

//! Hypotheses of the user's own: effects that no catalogue has, written as expressions in a file. They are
//! searched, weighed, written into the extended model and read again as those of a catalogue are.

mod compiled;
mod expression;
mod extended_kind;
mod file;
mod parser;
mod running;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

pub use compiled::Place;
pub use expression::{Expression, ExpressionError, FUNCTIONS};
pub use extended_kind::extended;
pub use file::{line_of, read};
pub use running::{Inside, Running};

/// Effects of the user's own by name.
pub type Hypotheses = BTreeMap<String, Hypothesis>;

/// An effect as it is written in a file. Expressions are in SI.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hypothesis {
    /// Where it acts: `input`, `output` or a place inside of the kind, such as `force`.
    pub at: String,
    /// What the signal becomes there, or the force that is added.
    pub value: String,
    /// What it is, for the report; `{parameter}` is replaced by the value with its interval.
    pub sentence: String,
    /// Effects that records often cannot tell from it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub like: Vec<String>,
    /// Its parameters.
    pub parameters: BTreeMap<String, Parameter>,
    /// Values that it remembers.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub memory: BTreeMap<String, Memory>,
}

/// A parameter of a [`Hypothesis`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Values from which fits begin.
    pub start: Starts,
    /// Smallest and largest value. A parameter whose range holds 0 is a size: at 0 the effect is absent.
    pub range: [f64; 2],
    /// Unit of all of them.
    pub unit: String,
}

/// One start or several.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, or a list of numbers such as [0.1, 1.0]"
)]
pub enum Starts {
    /// One.
    One(f64),
    /// Several.
    Many(Vec<f64>),
}

impl Starts {
    fn values(&self) -> &[f64] {
        match self {
            Self::One(value) => std::slice::from_ref(value),
            Self::Many(values) => values,
        }
    }
}

/// A value that an effect remembers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    /// Its value at the first sample, 0 without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<String>,
    /// Its rate, one over s; this or `next`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<String>,
    /// Its value at each sample, from the one before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
}

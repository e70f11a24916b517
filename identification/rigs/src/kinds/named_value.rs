//! A parameter as a diagnosis reports it.

use serde::{Deserialize, Serialize};

use crate::report::or_not_a_number;

/// A parameter of the extended model, SI.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedValue {
    /// Its name.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// SI unit.
    pub unit: String,
    /// One standard deviation, autocorrelation of the residuals counted.
    #[serde(deserialize_with = "or_not_a_number")]
    pub standard_error: f64,
}

//! The extended model of a rig as a file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::description::Quantity;
use super::diagnosis::{NamedValue, RigDiagnosis};

/// What the data say of a rig, in the form that a description's `[nominal]` has: SI values with
/// their standard errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExtendedRig {
    /// What the rig is called.
    pub name: String,
    /// Its kind.
    pub kind: String,
    /// Nominal parameters as refitted.
    pub nominal: BTreeMap<String, Quantity>,
    /// The effects' parameters.
    #[serde(default)]
    pub effects: BTreeMap<String, BTreeMap<String, Quantity>>,
}

fn quantities(values: &[NamedValue]) -> BTreeMap<String, Quantity> {
    let quantity = |p: &NamedValue| Quantity {
        value: p.value,
        plus_minus: p.standard_error,
        unit: p.unit.clone(),
    };
    values
        .iter()
        .map(|p| (p.name.clone(), quantity(p)))
        .collect()
}

impl From<&RigDiagnosis> for ExtendedRig {
    fn from(found: &RigDiagnosis) -> Self {
        let part = &found.as_described;
        let effects = part.effects.iter();
        Self {
            name: found.name.clone(),
            kind: found.kind.clone(),
            nominal: quantities(&part.parameters),
            effects: effects
                .map(|effect| (effect.effect.clone(), quantities(&effect.parameters)))
                .collect(),
        }
    }
}

impl ExtendedRig {
    /// The text of the file.
    ///
    /// # Errors
    /// Numbers that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        Ok(format!(
            "# What the data say of this rig: value and standard error, SI.\n{}",
            toml::to_string(self)?
        ))
    }
}

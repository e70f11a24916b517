//! What the table carries and rubs against beyond Eq 2-5.

use crate::ModelError;

/// Mass, viscous damping and a hardening spring beside those of Eq 2-28.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TableEffects {
    /// Mass on the table that the model does not know, kg.
    pub added_mass: f64,
    /// Extra damping, N s/m.
    pub viscous_damping: f64,
    /// k3 of the force `k3 x³`, N/m³.
    pub cubic_stiffness: f64,
}

impl TableEffects {
    /// True when the table is not that of the model.
    pub fn is_active(&self) -> bool {
        [self.added_mass, self.viscous_damping, self.cubic_stiffness]
            .into_iter()
            .any(|size| size != 0.0)
    }

    /// Refuses values that are not finite.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("added_mass", self.added_mass)?;
        ModelError::require_finite("viscous_damping", self.viscous_damping)?;
        ModelError::require_finite("cubic_stiffness", self.cubic_stiffness)
    }
}

//! Effects between the valve's opening and the force: supply and oil.

use crate::ModelError;

/// Supply pressure, leakage and compressibility, all as a loss of flow in V of an ideal valve.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HydraulicEffects {
    /// Force at which the flow stops, N: `u sqrt(1 - sign(u) F / F_stall)`; 0 is none.
    pub stall_force: f64,
    /// Relative loss of flow per V of recent mean demand, 1/V.
    pub droop_loss: f64,
    /// Time constant of the accumulator, s: `T dm/dt = |u| - m`.
    pub droop_time: f64,
    /// Form of the droop: flow times `(1 - c L m)^(1/c)`; 1 is a straight line, -1 is
    /// `1/(1 + L m)`.
    pub droop_form: f64,
    /// Share of the flow that the droop leaves at least.
    pub droop_floor: f64,
    /// Flow lost in proportion to force, V/N.
    pub leakage: f64,
    /// Flow lost in proportion to the rate of force, V s/N.
    pub compliance: f64,
}

impl Default for HydraulicEffects {
    fn default() -> Self {
        Self {
            stall_force: 0.0,
            droop_loss: 0.0,
            droop_time: 0.5,
            droop_form: 1.0,
            droop_floor: 0.0,
            leakage: 0.0,
            compliance: 0.0,
        }
    }
}

impl HydraulicEffects {
    /// Refuses negative forces and losses and a time constant that is not positive.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_non_negative("stall_force", self.stall_force)?;
        ModelError::require_finite("droop_loss", self.droop_loss)?;
        ModelError::require_positive("droop_time", self.droop_time)?;
        ModelError::require_finite("droop_form", self.droop_form)?;
        ModelError::require_non_negative("droop_floor", self.droop_floor)?;
        ModelError::require_finite("leakage", self.leakage)?;
        ModelError::require_finite("compliance", self.compliance)
    }

    /// True when supply and oil are not ideal.
    pub fn is_active(&self) -> bool {
        [
            self.stall_force,
            self.droop_loss,
            self.leakage,
            self.compliance,
        ]
        .into_iter()
        .any(|size| size != 0.0)
    }

    /// What is left of the flow `u` (V) under `force` (N) and mean demand (V).
    #[inline]
    pub fn available_flow(&self, mut u: f64, force: f64, demand: f64) -> f64 {
        if self.stall_force > 0.0 {
            u *= (1.0 - u.signum() * force / self.stall_force)
                .max(0.0)
                .sqrt();
        }
        if self.droop_loss != 0.0 {
            let loss = self.droop_loss * demand;
            let left = if self.droop_form == 1.0 {
                1.0 - loss
            } else {
                (1.0 - self.droop_form * loss)
                    .max(0.0)
                    .powf(1.0 / self.droop_form)
            };
            u *= left.max(self.droop_floor);
        }
        u - self.leakage * force
    }
}

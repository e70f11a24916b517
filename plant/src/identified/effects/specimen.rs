//! A specimen that is not the linear one of Appendix A.

use crate::ModelError;

/// Changes of the specimen `m_s (a + d'') = -f(d, d')`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SpecimenEffects {
    /// Nothing stands on the table although the model says so.
    pub absent: bool,
    /// Share of the table's acceleration that the specimen's accelerometer then shows.
    pub absent_sensor_share: f64,
    /// Yield displacement of a Bouc-Wen spring, m; 0 is elastic. The spring's force is
    /// `k (r d + (1 - r) z)`, `z' = d' (1 - |z/d_y|^n (1 + sign(z d')) / 2)`.
    pub yield_displacement: f64,
    /// r, stiffness after yielding over elastic stiffness.
    pub yield_post_ratio: f64,
    /// n, sharpness of yielding.
    pub yield_exponent: f64,
    /// Relative change of the stiffness.
    pub stiffness_change: f64,
    /// Relative change of the damping.
    pub damping_change: f64,
    /// Frequency of a second mass on its own spring on top, Hz; 0 is none.
    pub second_mode_frequency: f64,
    /// Share of the specimen's mass in it.
    pub second_mode_mass_share: f64,
    /// Its damping ratio.
    pub second_mode_damping_ratio: f64,
    /// Stiffness lost with the largest drift so far: `k (1 - loss share)`, where the share is
    /// `1 - (1 + c d_max/d_0)^(-1/c)`, which for c = 0 is `1 - exp(-d_max/d_0)`.
    pub degradation_loss: f64,
    /// d_0, m.
    pub degradation_drift: f64,
    /// c: -1 is a straight line up to d_0, 1 a hyperbola.
    pub degradation_form: f64,
    /// Drift beyond which the spring is softer, m; 0 is never.
    pub uplift_displacement: f64,
    /// Stiffness beyond it over stiffness below.
    pub uplift_post_ratio: f64,
}

impl Default for SpecimenEffects {
    fn default() -> Self {
        Self {
            absent: false,
            absent_sensor_share: 0.0,
            yield_displacement: 0.0,
            yield_post_ratio: 0.1,
            yield_exponent: 2.0,
            stiffness_change: 0.0,
            damping_change: 0.0,
            second_mode_frequency: 0.0,
            second_mode_mass_share: 0.25,
            second_mode_damping_ratio: 0.02,
            degradation_loss: 0.0,
            degradation_drift: units::constants::INCH,
            degradation_form: 0.0,
            uplift_displacement: 0.0,
            uplift_post_ratio: 0.3,
        }
    }
}

impl SpecimenEffects {
    /// Refuses values without meaning.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("absent_sensor_share", self.absent_sensor_share)?;
        ModelError::require_non_negative("yield_displacement", self.yield_displacement)?;
        ModelError::require_finite("yield_post_ratio", self.yield_post_ratio)?;
        ModelError::require_positive("yield_exponent", self.yield_exponent)?;
        ModelError::require_finite("stiffness_change", self.stiffness_change)?;
        ModelError::require_finite("damping_change", self.damping_change)?;
        ModelError::require_non_negative("second_mode_frequency", self.second_mode_frequency)?;
        ModelError::require_positive("second_mode_mass_share", self.second_mode_mass_share)?;
        ModelError::require_non_negative(
            "second_mode_damping_ratio",
            self.second_mode_damping_ratio,
        )?;
        ModelError::require_finite("degradation_loss", self.degradation_loss)?;
        ModelError::require_positive("degradation_drift", self.degradation_drift)?;
        ModelError::require_finite("degradation_form", self.degradation_form)?;
        ModelError::require_non_negative("uplift_displacement", self.uplift_displacement)?;
        ModelError::require_finite("uplift_post_ratio", self.uplift_post_ratio)
    }

    /// True when the specimen is not the linear one.
    pub fn is_active(&self) -> bool {
        self.absent
            || [
                self.yield_displacement,
                self.stiffness_change,
                self.damping_change,
                self.second_mode_frequency,
                self.degradation_loss,
                self.uplift_displacement,
            ]
            .into_iter()
            .any(|size| size != 0.0)
    }

    /// Deformation that the spring of stiffness `k` answers to (its force over `k`), from drift,
    /// the hysteretic deformation `z` and the largest drift so far, all m.
    #[inline]
    pub fn deformation(&self, drift: f64, z: f64, peak: f64) -> f64 {
        let mut effective = drift;
        if self.uplift_displacement > 0.0 {
            let beyond = (drift.abs() - self.uplift_displacement).max(0.0);
            effective -= drift.signum() * (1.0 - self.uplift_post_ratio) * beyond;
        }
        if self.yield_displacement > 0.0 {
            effective += (1.0 - self.yield_post_ratio) * (z - drift);
        }
        if self.degradation_loss != 0.0 {
            let ratio = peak.max(drift.abs()) / self.degradation_drift;
            let c = self.degradation_form;
            let kept = if c == 0.0 {
                (-ratio).exp()
            } else {
                (1.0 + c * ratio).max(0.0).powf(-1.0 / c)
            };
            effective *= 1.0 - self.degradation_loss * (1.0 - kept);
        }
        effective * (1.0 + self.stiffness_change)
    }

    /// Rate of the hysteretic deformation, m/s.
    #[inline]
    pub fn hysteretic_rate(&self, z: f64, drift_velocity: f64) -> f64 {
        if z * drift_velocity <= 0.0 {
            return drift_velocity;
        }
        let ratio = (z / self.yield_displacement).abs();
        let power = if self.yield_exponent == 2.0 {
            ratio * ratio
        } else {
            ratio.powf(self.yield_exponent)
        };
        drift_velocity * (1.0 - power)
    }
}

//! A specimen that is not the linear one of Appendix A.

use super::quantity::{FREQUENCY, LENGTH, RATIO};
use super::{AtStart, Component, Effect, Family, Parameter, Scale};
use crate::ModelError;
use crate::specimens::hysteresis::elastic_share;
use units::constants::INCH;
use units::vocabulary;

/// Changes of the specimen `m_s (a + d'') = -f(d, d')`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SpecimenEffects {
    /// 1 when nothing stands on the table although the model says so, else 0.
    pub absent: f64,
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
            absent: 0.0,
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
            degradation_drift: INCH,
            degradation_form: 0.0,
            uplift_displacement: 0.0,
            uplift_post_ratio: 0.3,
        }
    }
}

/// The law of the columns' force over the drift.
const RESTORING_FORCE: &str = "restoring force of the specimen";

impl Family for SpecimenEffects {
    type Memory = ();

    const EFFECTS: &'static [Effect] = &[
        Effect {
            equation: "f = k (r d + (1 - r) z) + c d', z' = d' (1 - |z/d_y|^n (1 + sign(z d')) / 2)",
            sentence: "the specimen yields at a drift of {}",
            parameters: &[
                Parameter::new(
                    "yield_displacement",
                    LENGTH,
                    "Yield displacement of a Bouc-Wen spring; 0 is elastic",
                )
                .size(Scale::Logarithmic, 1.2 * INCH, (0.1 * INCH, 4.0 * INCH))
                .on_specimen(|s| &mut s.yield_displacement)
                .min(0.0),
                Parameter::new(
                    "post_yield_ratio",
                    RATIO,
                    "Stiffness after yielding over elastic stiffness",
                )
                .shape(Scale::Linear(0.01), 0.05, 10.0, (-0.1, 0.5))
                .on_specimen(|s| &mut s.yield_post_ratio),
                Parameter::new("exponent", RATIO, "Sharpness of yielding")
                    .shape(Scale::Logarithmic, 3.0, 0.35, (0.8, 12.0))
                    .on_specimen(|s| &mut s.yield_exponent)
                    .min(0.1),
            ],
            starts: &[
                &[0.4 * INCH, 0.05, 3.0],
                &[0.65 * INCH, 0.05, 3.0],
                &[1.05 * INCH, 0.05, 3.0],
            ],
            needs_co_simulation: true,
            law: RESTORING_FORCE,
            ..Effect::new("specimen_yielding", Component::Specimen)
        },
        Effect {
            equation: "f = (1 + p) k d + c d'",
            sentence: "the specimen's stiffness is off by {}",
            parameters: &[Parameter::new(
                "relative_change",
                RATIO,
                "Relative change of the stiffness; 0 is off",
            )
            .relative(0.06, 0.35)
            .on_specimen(|s| &mut s.stiffness_change)],
            starts: &[&[0.0], &[0.25], &[-0.25]],
            is_linear: true,
            ..Effect::new(vocabulary::SPECIMEN_STIFFNESS, Component::Specimen)
        },
        Effect {
            equation: "f = k d + (1 + p) c d'",
            sentence: "the specimen's damping is off by {}",
            parameters: &[Parameter::new(
                "relative_change",
                RATIO,
                "Relative change of the damping; 0 is off",
            )
            .size(Scale::Factor(0.5), 0.5, (-0.95, 12.0))
            .on_specimen(|s| &mut s.damping_change)],
            starts: &[&[0.0], &[1.0], &[2.5]],
            is_linear: true,
            ..Effect::new(vocabulary::SPECIMEN_DAMPING, Component::Specimen)
        },
        Effect {
            equation: "p m (a + d'' + e'') = -k_2 e - c_2 e', k_2 = p m w², c_2 = 2 zeta w p m, w = 2 pi f",
            sentence: "a part of the specimen swings by itself at {}",
            parameters: &[
                Parameter::new(
                    "frequency",
                    FREQUENCY,
                    "Frequency of a part of the mass on its own spring; 0 is off",
                )
                .size(Scale::Logarithmic, 12.0, (2.0, 25.0))
                .on_specimen(|s| &mut s.second_mode_frequency)
                .min(0.0),
                Parameter::new("mass_share", RATIO, "Share of the mass in it")
                    .on_specimen(|s| &mut s.second_mode_mass_share)
                    .min(1e-3)
                    .max(0.95),
                Parameter::new(vocabulary::DAMPING_RATIO, RATIO, "Damping ratio of it")
                    .shape(Scale::Logarithmic, 0.03, 0.4, (0.005, 0.2))
                    .on_specimen(|s| &mut s.second_mode_damping_ratio)
                    .min(0.0),
            ],
            // A lightly damped mode is found from nearby only.
            starts: &[
                &[4.2, 0.03],
                &[4.8, 0.03],
                &[5.5, 0.03],
                &[6.3, 0.03],
                &[7.2, 0.03],
                &[8.2, 0.03],
                &[9.4, 0.03],
                &[10.7, 0.03],
                &[12.0, 0.03],
            ],
            is_linear: true,
            needs_co_simulation: true,
            ..Effect::new("specimen_second_mode", Component::Specimen)
        },
        Effect {
            equation: "f = k (1 - L (1 - (1 + c d_max/d_0)^(-1/c))) d + c d'",
            sentence: "the specimen loses up to {} of its stiffness",
            parameters: &[
                Parameter::new(
                    "loss",
                    RATIO,
                    "Share of the stiffness lost with the largest drift so far; 0 is off",
                )
                .positive(0.1, 0.24)
                .on_specimen(|s| &mut s.degradation_loss)
                .max(1.0),
                Parameter::new(
                    "degradation_drift",
                    LENGTH,
                    "Drift at which 1 - 1/e of it is lost",
                )
                .shape(
                    Scale::Logarithmic,
                    1.0 * INCH,
                    1.0,
                    (0.05 * INCH, 20.0 * INCH),
                )
                .on_specimen(|s| &mut s.degradation_drift)
                .min(1e-6),
                Parameter::new(
                    "form",
                    RATIO,
                    "c of the share lost, 1 - (1 + c drift/degradation_drift)^(-1/c); 0 is exponential, -1 a straight line",
                )
                .shape(Scale::Linear(1.0), 0.0, 1.0, (-2.0, 3.0))
                .on_specimen(|s| &mut s.degradation_form),
            ],
            starts: &[
                &[0.15, 0.8 * INCH, 0.0],
                &[0.3, 0.8 * INCH, 0.0],
                &[0.3, 0.8 * INCH, -1.0],
                &[0.3, 0.8 * INCH, 1.0],
            ],
            needs_co_simulation: true,
            // Powers near zero are those of the exponential, inexactly.
            settle: |effects, _, _| {
                let form = &mut effects.specimen.degradation_form;
                if form.abs() < 1e-6 {
                    *form = 0.0;
                }
            },
            law: RESTORING_FORCE,
            ..Effect::new("specimen_degradation", Component::Specimen)
        },
        Effect {
            equation: "f = k (min(|d|, d_u) + r max(|d| - d_u, 0)) sign(d) + c d'",
            sentence: "the specimen lifts off beyond a drift of {}",
            parameters: &[
                Parameter::new(
                    "uplift_displacement",
                    LENGTH,
                    "Drift beyond which the spring is softer, without a loop; 0 is off",
                )
                .size(Scale::Logarithmic, 1.0 * INCH, (0.08 * INCH, 3.0 * INCH))
                .on_specimen(|s| &mut s.uplift_displacement)
                .min(0.0),
                Parameter::new(
                    "post_uplift_ratio",
                    RATIO,
                    "Stiffness beyond it over stiffness below",
                )
                .shape(Scale::Linear(1.0), 0.3, 0.3, (-0.1, 0.95))
                .on_specimen(|s| &mut s.uplift_post_ratio),
            ],
            starts: &[&[0.3 * INCH, 0.3], &[0.55 * INCH, 0.3], &[0.9 * INCH, 0.3]],
            law: RESTORING_FORCE,
            ..Effect::new("specimen_uplift", Component::Specimen)
        },
        Effect {
            equation: "f = 0",
            sentence: "nothing stands on the table",
            parameters: &[
                // What the sensor of a missing specimen shows belongs to no component.
                Parameter::new(
                    "sensor_share",
                    RATIO,
                    "Share of the table's acceleration on the specimen's channel",
                )
                .shape(Scale::Linear(1.0), 0.0, 2.0, (-0.5, 1.5))
                .on_specimen(|s| &mut s.absent_sensor_share)
                .without_variable(),
                Parameter::new(
                    "absent",
                    RATIO,
                    "1: nothing stands on the table; 0 is off",
                )
                .on_specimen(|s| &mut s.absent)
                .min(0.0)
                .max(1.0)
                .switch()
                .at_start(AtStart::Acceleration),
            ],
            starts: &[&[0.0]],
            is_linear: true,
            needs_co_simulation: true,
            settle: |effects, _, _| effects.specimen.absent = 1.0,
            ..Effect::new("specimen_absent", Component::Specimen)
        },
    ];

    fn validate(&self) -> Result<(), ModelError> {
        if self.absent != 0.0 && self.absent != 1.0 {
            return Err(ModelError::Parameter {
                name: "specimen_absent.absent",
                value: self.absent,
                expected: "0 or 1",
            });
        }
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

    fn is_active(&self) -> bool {
        [
            self.absent,
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
}

impl SpecimenEffects {
    /// True when nothing stands on the table.
    pub fn is_absent(&self) -> bool {
        self.absent != 0.0
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
        let unloads = z * drift_velocity <= 0.0;
        let weight = if unloads { 0.0 } else { 1.0 };
        let share = elastic_share(
            z / self.yield_displacement,
            self.yield_exponent,
            1.0,
            weight,
        );
        drift_velocity * share
    }
}

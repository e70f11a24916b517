//! The specimen with the catalogue's effects on it, the table's acceleration given.

use std::f64::consts::TAU;

use crate::ModelError;
use crate::identified::effects::{Family, SpecimenEffects};
use crate::integration::{inner_steps, runge_kutta_4};
use crate::specimens::linear::{LinearSpecimen, SpecimenState};

/// Number of continuous states of [`ExtendedSpecimen`]: drift, drift velocity, second mode (2),
/// hysteretic deformation.
pub const STATES: usize = 5;
const SECOND_MODE: usize = 2;
const HYSTERETIC: usize = 4;

/// Longest inner step, s.
const LONGEST_STEP: f64 = 1e-3;

/// The specimen of Appendix A with effects, ready to compute its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtendedSpecimen {
    effects: SpecimenEffects,
    specimen: LinearSpecimen,
    second_mode: [f64; 3],
    is_present: bool,
    has_second_mode: bool,
    yields: bool,
}

/// State of [`ExtendedSpecimen`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ExtendedSpecimenState {
    /// Drift and drift velocity.
    pub specimen: SpecimenState,
    /// Second mode (m, m/s), hysteretic deformation (m).
    pub added: [f64; 3],
    /// Largest drift so far, m.
    pub peak_drift: f64,
}

impl ExtendedSpecimenState {
    /// The continuous states in the order of [`STATES`].
    fn continuous(&self) -> [f64; STATES] {
        let [a, b, c] = self.added;
        [self.specimen.drift, self.specimen.drift_velocity, a, b, c]
    }
}

impl ExtendedSpecimen {
    /// Prepares `specimen`, if one stands on the table, with `effects`.
    pub fn new(specimen: Option<LinearSpecimen>, effects: &SpecimenEffects) -> Self {
        let is_present = specimen.is_some() && !effects.is_absent();
        let mut specimen = specimen.unwrap_or_default();
        specimen.damping *= 1.0 + effects.damping_change;
        let upper = specimen.mass * effects.second_mode_mass_share;
        let omega = TAU * effects.second_mode_frequency;
        let has_second_mode = is_present && omega > 0.0;
        if has_second_mode {
            specimen.mass -= upper;
        }
        Self {
            effects: *effects,
            specimen,
            second_mode: [
                upper,
                2.0 * effects.second_mode_damping_ratio * omega * upper,
                omega * omega * upper,
            ],
            is_present,
            has_second_mode,
            yields: is_present && effects.yield_displacement > 0.0,
        }
    }

    /// True when something stands on the table.
    pub fn is_present(&self) -> bool {
        self.is_present
    }

    /// Force on the table, N.
    #[inline]
    pub fn force(&self, s: &[f64; STATES], peak: f64) -> f64 {
        if !self.is_present {
            return 0.0;
        }
        self.specimen.stiffness * self.effects.deformation(s[0], s[HYSTERETIC], peak)
            + self.specimen.damping * s[1]
    }

    /// Absolute acceleration of the mass (m/s²), whose force on the table is `force` (N); of an
    /// absent specimen, what its sensor shows of the table's.
    #[inline]
    pub fn acceleration(&self, s: &[f64; STATES], force: f64, table_acceleration: f64) -> f64 {
        if !self.is_present {
            return self.effects.absent_sensor_share * table_acceleration;
        }
        let mut on_mass = -force;
        if self.has_second_mode {
            on_mass +=
                self.second_mode[2] * s[SECOND_MODE] + self.second_mode[1] * s[SECOND_MODE + 1];
        }
        on_mass / self.specimen.mass
    }

    /// Rates of the states, with `force` (N) on the table.
    #[inline]
    pub fn rates(&self, s: &[f64; STATES], force: f64, table_acceleration: f64) -> [f64; STATES] {
        let mut rate = [0.0; STATES];
        if !self.is_present {
            return rate;
        }
        rate[0] = s[1];
        let mut on_mass = -force;
        if self.has_second_mode {
            let [upper, damping, stiffness] = self.second_mode;
            let between = stiffness * s[SECOND_MODE] + damping * s[SECOND_MODE + 1];
            on_mass += between;
            rate[SECOND_MODE] = s[SECOND_MODE + 1];
            rate[SECOND_MODE + 1] = -on_mass / self.specimen.mass - between / upper;
        }
        rate[1] = on_mass / self.specimen.mass - table_acceleration;
        if self.yields {
            rate[HYSTERETIC] = self.effects.hysteretic_rate(s[HYSTERETIC], s[1]);
        }
        rate
    }

    /// Force on the table (N) and absolute acceleration of the mass (m/s²) in `state`.
    pub fn outputs(&self, state: &ExtendedSpecimenState, table_acceleration: f64) -> (f64, f64) {
        let s = state.continuous();
        let force = self.force(&s, state.peak_drift);
        (force, self.acceleration(&s, force, table_acceleration))
    }

    /// Moves `state` on by `step` (s) with the table's acceleration held, in equal Runge-Kutta
    /// steps.
    pub fn advance(&self, state: &mut ExtendedSpecimenState, table_acceleration: f64, step: f64) {
        let count = inner_steps(step, LONGEST_STEP);
        let inner = step / f64::from(count);
        let mut s = state.continuous();
        for _ in 0..count {
            let peak = state.peak_drift;
            s = runge_kutta_4(&s, inner, |s| {
                self.rates(s, self.force(s, peak), table_acceleration)
            });
            state.peak_drift = peak.max(s[0].abs());
        }
        state.specimen = SpecimenState {
            drift: s[0],
            drift_velocity: s[1],
        };
        state.added.copy_from_slice(&s[SECOND_MODE..]);
    }

    /// Checks the effects.
    ///
    /// # Errors
    /// Names the first parameter with which they cannot be simulated.
    pub fn validate(effects: &SpecimenEffects) -> Result<(), ModelError> {
        effects.validate()?;
        if effects.second_mode_mass_share < 1.0 {
            return Ok(());
        }
        Err(ModelError::Parameter {
            name: "second_mode_mass_share",
            value: effects.second_mode_mass_share,
            expected: "less than one",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_masses_of_a_specimen_with_a_second_mode_obey_newton() {
        let whole = LinearSpecimen::appendix_a();
        let (share, frequency, ratio) = (0.3, 4.0, 0.06);
        let effects = SpecimenEffects {
            second_mode_mass_share: share,
            second_mode_frequency: frequency,
            second_mode_damping_ratio: ratio,
            ..SpecimenEffects::default()
        };
        let specimen = ExtendedSpecimen::new(Some(whole), &effects);
        let s = [0.01, -0.2, 0.004, 0.3, 0.0];
        let (force, shaken) = (specimen.force(&s, 0.0), 1.7);
        let pull = whole.stiffness * s[0] + whole.damping * s[1];
        assert!((force - pull).abs() < 1e-9 * pull.abs());
        let lower = specimen.acceleration(&s, force, shaken);
        let rates = specimen.rates(&s, force, shaken);
        let upper = lower + rates[SECOND_MODE + 1];
        assert_eq!([rates[0], rates[SECOND_MODE]], [s[1], s[SECOND_MODE + 1]]);
        assert!((rates[1] - (lower - shaken)).abs() < 1e-12);
        // What acts on the whole is the table; what acts on the upper mass its own spring and damper.
        let momentum = whole.mass * ((1.0 - share) * lower + share * upper);
        assert!((momentum + force).abs() < 1e-9 * force.abs());
        let w = TAU * frequency;
        let own = -w * w * s[SECOND_MODE] - 2.0 * ratio * w * s[SECOND_MODE + 1];
        assert!((upper / own - 1.0).abs() < 1e-12, "{upper} {own}");
    }

    #[test]
    fn an_absent_specimen_pulls_at_nothing_and_shows_its_sensors_share() {
        let effects = SpecimenEffects {
            absent_sensor_share: 0.25,
            ..SpecimenEffects::default()
        };
        let specimen = ExtendedSpecimen::new(None, &effects);
        let s = [0.01, -0.2, 0.004, 0.3, 0.0];
        assert!(!specimen.is_present());
        assert_eq!(specimen.force(&s, 0.0), 0.0);
        assert_eq!(specimen.rates(&s, 0.0, 2.0), [0.0; STATES]);
        assert_eq!(specimen.acceleration(&s, 0.0, 2.0), 0.5);
    }
}

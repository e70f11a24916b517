//! A shear building of several storeys, each elastic or yielding.

use super::{YieldingSpecimen, YieldingState};
use crate::ModelError;
use crate::integration::{self, Dynamics};
use crate::specimens::hysteresis::Hysteresis;

/// The largest number of storeys.
pub const MAX_STOREYS: usize = 10;

const STATES: usize = 4 * MAX_STOREYS;

/// Storeys one above the other: each is a mass that stands by its columns on the one below,
/// `m_i a_i = f_(i+1) - f_i` with `f_i = F_i(d_i, z_i) + c_i d_i'`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Storeys {
    /// Mass, damping and columns of each storey, the lowest first; those beyond `count` are not
    /// used. A post-yield ratio of 1 makes a storey elastic.
    pub storey: [YieldingSpecimen; MAX_STOREYS],
    /// Number of storeys, 1 to [`MAX_STOREYS`].
    pub count: usize,
}

/// State of [`Storeys`]: drifts are those between neighbouring floors.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct StoreysState {
    /// State of each storey, the lowest first.
    pub storey: [YieldingState; MAX_STOREYS],
}

impl Storeys {
    /// `count` equal storeys.
    pub fn uniform(storey: YieldingSpecimen, count: usize) -> Self {
        Self {
            storey: [storey; MAX_STOREYS],
            count,
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// A number of storeys out of range, or what a storey refuses.
    pub fn validate(&self) -> Result<(), ModelError> {
        if !(1..=MAX_STOREYS).contains(&self.count) {
            return Err(ModelError::Parameter {
                name: "storeys",
                value: self.count as f64,
                expected: "a number of storeys from 1 to 10",
            });
        }
        self.storey[..self.count]
            .iter()
            .try_for_each(YieldingSpecimen::validate)
    }

    /// Force on the table in N, positive along the drift of the lowest storey.
    pub fn force(&self, state: &StoreysState) -> f64 {
        self.storey[0].force(&state.storey[0])
    }

    /// Absolute accelerations of the floors, the lowest first, m/s²; zero beyond the top.
    pub fn accelerations(&self, state: &StoreysState) -> [f64; MAX_STOREYS] {
        self.accelerations_under(state, &[0.0; MAX_STOREYS])
    }

    /// As [`Self::accelerations`], with forces on the floors besides (N).
    pub fn accelerations_under(
        &self,
        state: &StoreysState,
        on_floors: &[f64; MAX_STOREYS],
    ) -> [f64; MAX_STOREYS] {
        let mut accelerations = [0.0; MAX_STOREYS];
        let mut above = 0.0;
        for i in (0..self.count).rev() {
            let force = self.storey[i].force(&state.storey[i]);
            accelerations[i] = (above - force + on_floors[i]) / self.storey[i].mass;
            above = force;
        }
        accelerations
    }

    /// Time derivative of the state under `table_acceleration` (m/s²).
    pub fn derivatives(&self, state: &StoreysState, table_acceleration: f64) -> StoreysState {
        self.rates(state, &self.accelerations(state), table_acceleration)
    }

    /// Time derivative of the state whose floors have `accelerations` (m/s²).
    pub(super) fn rates(
        &self,
        state: &StoreysState,
        accelerations: &[f64; MAX_STOREYS],
        table_acceleration: f64,
    ) -> StoreysState {
        let mut rates = StoreysState::default();
        let mut below = table_acceleration;
        for i in 0..self.count {
            let s = &state.storey[i];
            rates.storey[i] = YieldingState {
                drift: s.drift_velocity,
                drift_velocity: accelerations[i] - below,
                hysteresis: self.storey[i]
                    .columns
                    .rates(s.drift_velocity, &s.hysteresis),
            };
            below = accelerations[i];
        }
        rates
    }

    /// The state `duration` seconds later with `table_acceleration` (m/s²) held.
    pub fn advance(
        &self,
        state: &StoreysState,
        table_acceleration: f64,
        duration: f64,
    ) -> StoreysState {
        let shaken = Shaken {
            storeys: self,
            table_acceleration,
        };
        integration::advance(&shaken, &(*state).into(), duration, 5e-4).into()
    }
}

impl From<[f64; STATES]> for StoreysState {
    fn from(x: [f64; STATES]) -> Self {
        Self {
            storey: std::array::from_fn(|i| YieldingState {
                drift: x[4 * i],
                drift_velocity: x[4 * i + 1],
                hysteresis: Hysteresis {
                    z: x[4 * i + 2],
                    work: x[4 * i + 3],
                },
            }),
        }
    }
}

impl From<StoreysState> for [f64; STATES] {
    fn from(state: StoreysState) -> Self {
        let mut x = [0.0; STATES];
        for (i, storey) in state.storey.into_iter().enumerate() {
            x[4 * i..4 * i + 4].copy_from_slice(&<[f64; 4]>::from(storey));
        }
        x
    }
}

struct Shaken<'a> {
    storeys: &'a Storeys,
    table_acceleration: f64,
}

impl Dynamics<STATES> for Shaken<'_> {
    fn derivatives(&self, x: &[f64; STATES]) -> [f64; STATES] {
        self.storeys
            .derivatives(&(*x).into(), self.table_acceleration)
            .into()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn one_storey_is_the_yielding_specimen() {
        let specimen = YieldingSpecimen::default();
        let storeys = Storeys::uniform(specimen, 1);
        let (mut one, mut many) = (YieldingState::default(), StoreysState::default());
        for k in 0..500 {
            let a = 4.0 * (0.03 * f64::from(k)).sin();
            one = specimen.advance(&one, a, 0.002);
            many = storeys.advance(&many, a, 0.002);
            assert_eq!(many.storey[0], one);
        }
        assert_eq!(storeys.force(&many), specimen.force(&one));
    }

    #[test]
    fn free_vibration_in_a_mode_has_the_closed_form_frequency() {
        // n equal elastic undamped storeys: w_j = 2 sqrt(k/m) sin((2 j - 1) π / (2 (2 n + 1))),
        // floor i moves as sin((2 j - 1) π i / (2 n + 1)).
        let mut storey = YieldingSpecimen {
            damping: 0.0,
            ..YieldingSpecimen::default()
        };
        storey.columns.post_yield_ratio = 1.0;
        let storeys = Storeys::uniform(storey, 3);
        let omega0 = (storey.columns.stiffness() / storey.mass).sqrt();
        for mode in [1.0, 2.0, 3.0] {
            let angle = (2.0 * mode - 1.0) * PI / 7.0;
            let omega = 2.0 * omega0 * (0.5 * angle).sin();
            let floor = |i: f64| 1e-3 * (angle * i).sin();
            let mut start = StoreysState::default();
            for i in 0..3 {
                start.storey[i].drift = floor(i as f64 + 1.0) - floor(i as f64);
            }
            let period = 2.0 * PI / omega;
            let end = storeys.advance(&start, 0.0, period);
            for i in 0..3 {
                let off = end.storey[i].drift - start.storey[i].drift;
                assert!(off.abs() < 1e-3 * 1e-3, "mode {mode}: {off:e} m");
            }
        }
    }

    #[test]
    fn momentum_changes_by_the_force_on_the_table() {
        let storeys = Storeys::uniform(YieldingSpecimen::default(), 4);
        let mut state = StoreysState::default();
        for k in 0..300 {
            state = storeys.advance(&state, (0.1 * f64::from(k)).sin(), 0.002);
        }
        let total: f64 = storeys
            .accelerations(&state)
            .iter()
            .zip(&storeys.storey)
            .map(|(a, s)| a * s.mass)
            .sum();
        assert!((total + storeys.force(&state)).abs() < 1e-12);
    }
}

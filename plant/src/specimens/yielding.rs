//! A mass on a yielding storey.

use std::f64::consts::TAU;

use units::Parameters as _;

use crate::ModelError;
use crate::integration::{self, Dynamics};
use crate::specimens::hysteresis::{BoucWen, Hysteresis};
use crate::specimens::linear::LinearSpecimen;

/// A storey that yields: `m (at + d'') + c d' + F(d, z) = 0`, with the force of a [`BoucWen`]
/// spring.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct YieldingSpecimen {
    /// Mass of the storey, kg.
    #[parameter("kg" => "lbf.s2/in", positive)]
    pub mass: f64,
    /// Viscous damping of the storey, N.s/m.
    #[parameter("N.s/m" => "lbf.s/in", non_negative)]
    pub damping: f64,
    /// Restoring force of the columns.
    #[parameters]
    pub columns: BoucWen,
}

/// State of [`YieldingSpecimen`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct YieldingState {
    /// Drift, m.
    pub drift: f64,
    /// Drift velocity, m/s.
    pub drift_velocity: f64,
    /// Memory of the columns.
    pub hysteresis: Hysteresis,
}

impl YieldingSpecimen {
    /// Takes the period (s) and the damping ratio before yielding.
    pub fn from_period(columns: BoucWen, period: f64, damping_ratio: f64) -> Self {
        let omega = TAU / period;
        let mass = columns.stiffness() / (omega * omega);
        Self {
            mass,
            damping: 2.0 * damping_ratio * mass * omega,
            columns,
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// A mass that is not positive, negative damping, or what the columns refuse.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        self.columns.validate()
    }

    /// Force on the table in N, positive along the drift.
    pub fn force(&self, state: &YieldingState) -> f64 {
        self.columns.force(state.drift, &state.hysteresis) + self.damping * state.drift_velocity
    }

    /// Absolute acceleration of the mass in m/s².
    pub fn acceleration(&self, state: &YieldingState) -> f64 {
        -self.force(state) / self.mass
    }

    /// Time derivative of the state under `table_acceleration` (m/s²).
    pub fn derivatives(&self, state: &YieldingState, table_acceleration: f64) -> YieldingState {
        YieldingState {
            drift: state.drift_velocity,
            drift_velocity: self.acceleration(state) - table_acceleration,
            hysteresis: self.columns.rates(state.drift_velocity, &state.hysteresis),
        }
    }

    /// The state `duration` seconds later with `table_acceleration` (m/s²) held.
    pub fn advance(
        &self,
        state: &YieldingState,
        table_acceleration: f64,
        duration: f64,
    ) -> YieldingState {
        let shaken = Shaken {
            specimen: self,
            table_acceleration,
        };
        integration::advance(&shaken, &(*state).into(), duration, INNER_STEP).into()
    }
}

/// Longest inner step, s: a fraction of the time in which the columns go from elastic to plastic at
/// the largest velocities of the rig.
const INNER_STEP: f64 = 5e-4;

impl Default for YieldingSpecimen {
    fn default() -> Self {
        // T = 0.5 s; the damping of the linear specimen of Appendix A, 5 %.
        Self::from_period(BoucWen::default(), 0.5, 0.05)
    }
}

/// Columns that never yield.
impl From<LinearSpecimen> for YieldingSpecimen {
    fn from(linear: LinearSpecimen) -> Self {
        const ANY_DRIFT: f64 = 0.1;
        Self {
            mass: linear.mass,
            damping: linear.damping,
            columns: BoucWen {
                yield_force: linear.stiffness * ANY_DRIFT,
                yield_displacement: ANY_DRIFT,
                post_yield_ratio: 1.0,
                ..BoucWen::default()
            },
        }
    }
}

impl From<[f64; 4]> for YieldingState {
    fn from([drift, drift_velocity, z, work]: [f64; 4]) -> Self {
        Self {
            drift,
            drift_velocity,
            hysteresis: Hysteresis { z, work },
        }
    }
}

impl From<YieldingState> for [f64; 4] {
    fn from(s: YieldingState) -> Self {
        [s.drift, s.drift_velocity, s.hysteresis.z, s.hysteresis.work]
    }
}

struct Shaken<'a> {
    specimen: &'a YieldingSpecimen,
    table_acceleration: f64,
}

impl Dynamics<4> for Shaken<'_> {
    fn derivatives(&self, x: &[f64; 4]) -> [f64; 4] {
        self.specimen
            .derivatives(&(*x).into(), self.table_acceleration)
            .into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimens::linear::{LinearSpecimen, SpecimenState};
    use units::constants::{INCH, LBF};

    #[test]
    fn it_weighs_100_pounds() {
        let weight = YieldingSpecimen::default().mass * 386.4 * INCH / LBF;
        assert!((weight - 100.0).abs() < 0.2, "{weight} lbf");
    }

    #[test]
    fn small_motions_are_those_of_the_linear_specimen() {
        let specimen = YieldingSpecimen::default();
        let linear = LinearSpecimen {
            mass: specimen.mass,
            damping: specimen.damping,
            stiffness: specimen.columns.stiffness(),
        }
        .sample(0.002);
        let (mut y, mut l) = (YieldingState::default(), SpecimenState::default());
        let mut largest: f64 = 0.0;
        for k in 0..1000 {
            let a = 1e-4 * (0.02 * f64::from(k)).sin();
            y = specimen.advance(&y, a, 0.002);
            l = linear.advance(&l, a);
            assert!(
                (y.drift - l.drift).abs() < 1e-3 * 1e-5,
                "{} {}",
                y.drift,
                l.drift
            );
            largest = largest.max(l.drift.abs());
        }
        assert!(largest > 1e-6);
    }

    #[test]
    fn strong_shaking_leaves_the_energy_balance_closed() {
        let specimen = YieldingSpecimen::default();
        let mut state = YieldingState::default();
        let h = 1e-4;
        let (mut work, mut viscous) = (0.0, 0.0);
        for k in 0..50_000 {
            let a = 3.0 * (8.0 * h * f64::from(k)).sin();
            let next = specimen.advance(&state, a, h);
            // Work of the inertia force in the frame of the table, trapezoidal.
            work -= specimen.mass * a * (next.drift - state.drift);
            let mean = 0.5 * (state.drift_velocity + next.drift_velocity);
            viscous += specimen.damping * mean * (next.drift - state.drift);
            state = next;
        }
        let columns = &specimen.columns;
        let scale = columns.yield_force * columns.yield_displacement;
        let z = state.hysteresis.z;
        // Work on the hysteretic part is a state of its own, integrated with the others.
        let hysteretic = scale * state.hysteresis.work;
        let elastic = columns.stored_energy(state.drift, &state.hysteresis)
            - 0.5 * scale * (1.0 - columns.post_yield_ratio) * z * z;
        let kinetic = 0.5 * specimen.mass * state.drift_velocity.powi(2);
        let balance = work - viscous - hysteretic - elastic - kinetic;
        assert!(hysteretic > 20.0 * scale, "it yielded");
        assert!(balance.abs() < 1e-3 * work, "{balance} of {work} J");
    }

    #[test]
    fn period_and_damping_before_yielding_are_those_asked_for() {
        let columns = BoucWen::default();
        let specimen = YieldingSpecimen::from_period(columns, 0.4, 0.03);
        let omega = (columns.yield_force / columns.yield_displacement / specimen.mass).sqrt();
        assert!((omega * 0.4 / TAU - 1.0).abs() < 1e-12);
        let ratio = specimen.damping / (2.0 * specimen.mass * omega);
        assert!((ratio - 0.03).abs() < 1e-12);
    }
}

//! A building of several storeys with what structural control puts into it: a tuned mass damper on a
//! floor and a magnetorheological damper in a storey.

use super::magnetorheological::{DamperState, MagnetorheologicalDamper};
use super::storeys::{MAX_STOREYS, Storeys, StoreysState};
use crate::ModelError;
use crate::integration::{self, Dynamics};
use units::vocabulary;

const OF_STOREYS: usize = 4 * MAX_STOREYS;
const STATES: usize = OF_STOREYS + 5;
const DAMPER: usize = OF_STOREYS;
const TUNED: usize = OF_STOREYS + 3;
/// Longest inner step, s.
const LONGEST_STEP: f64 = 5e-4;

/// A mass on a spring and a dashpot.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TunedMass {
    /// Index of its floor, the lowest 0.
    pub floor: usize,
    /// kg.
    pub mass: f64,
    /// Its own frequency, rad/s.
    pub frequency: f64,
    /// Its own damping ratio.
    pub damping_ratio: f64,
}

impl TunedMass {
    /// Frequency over the structure's and damping ratio that make the largest drift of a structure
    /// without damping smallest under any harmonic acceleration of its ground, `mass_ratio` of its mass:
    /// `f = sqrt(1 - mu/2)/(1 + mu)`, `zeta² = 3 mu/(8 (1 + mu) (1 - mu/2))`. It is Den Hartog's rule
    /// with the mass shaken as well (G. B. Warburton, Earthquake Engineering and Structural Dynamics 10, 1982).
    pub fn optimum(mass_ratio: f64) -> (f64, f64) {
        let shaken = 1.0 - 0.5 * mass_ratio;
        let frequency = shaken.sqrt() / (1.0 + mass_ratio);
        let damping = (3.0 * mass_ratio / (8.0 * (1.0 + mass_ratio) * shaken)).sqrt();
        (frequency, damping)
    }

    /// Force on its floor (N) at its drift (m) and rate (m/s).
    fn force(&self, [drift, rate]: [f64; 2]) -> f64 {
        let w = self.frequency;
        self.mass * (w * w * drift + 2.0 * self.damping_ratio * w * rate)
    }
}

/// Storeys with their devices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlledStoreys {
    /// The building.
    pub storeys: Storeys,
    /// A damper, and the index of the storey whose drift it resists, the lowest 0.
    pub damper: Option<(usize, MagnetorheologicalDamper)>,
    /// A tuned mass.
    pub tuned_mass: Option<TunedMass>,
}

/// State of [`ControlledStoreys`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ControlledState {
    /// The building's.
    pub storeys: StoreysState,
    /// The damper's.
    pub damper: DamperState,
    /// Drift (m) of the tuned mass against its floor and its rate (m/s).
    pub tuned_mass: [f64; 2],
}

impl ControlledStoreys {
    /// Checks the parameters.
    ///
    /// # Errors
    /// A storey or floor that there is not, or what a part refuses.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.storeys.validate()?;
        let place = |name, index: usize| {
            if index < self.storeys.count {
                return Ok(());
            }
            Err(ModelError::Parameter {
                name,
                value: (index + 1) as f64,
                expected: "one of the building's, counted from 1, or 0 for none",
            })
        };
        if let Some((storey, damper)) = &self.damper {
            place(vocabulary::DAMPER_STOREY, *storey)?;
            damper.validate()?;
        }
        if let Some(mass) = &self.tuned_mass {
            place("tuned_mass_floor", mass.floor)?;
            ModelError::require_positive("tuned_mass", mass.mass)?;
            ModelError::require_non_negative("tuned_mass_frequency", mass.frequency)?;
            ModelError::require_non_negative("tuned_mass_damping_ratio", mass.damping_ratio)?;
        }
        Ok(())
    }

    /// Force of the damper against its storey's drift, N; 0 without one.
    pub fn damper_force(&self, state: &ControlledState) -> f64 {
        self.damper.map_or(0.0, |(storey, damper)| {
            damper.force(&state.damper, motion_of(state, storey))
        })
    }

    /// Forces of the devices on the floors, the lowest first, and on the table, N.
    fn devices(&self, state: &ControlledState) -> ([f64; MAX_STOREYS], f64) {
        let (mut floors, mut table) = ([0.0; MAX_STOREYS], 0.0);
        if let Some((storey, _)) = self.damper {
            let force = self.damper_force(state);
            floors[storey] -= force;
            match storey.checked_sub(1) {
                Some(below) => floors[below] += force,
                None => table += force,
            }
        }
        if let Some(mass) = &self.tuned_mass {
            floors[mass.floor] += mass.force(state.tuned_mass);
        }
        (floors, table)
    }

    /// Force on the table in N.
    pub fn force(&self, state: &ControlledState) -> f64 {
        self.storeys.force(&state.storeys) + self.devices(state).1
    }

    /// Absolute accelerations of the floors, the lowest first, m/s².
    pub fn accelerations(&self, state: &ControlledState) -> [f64; MAX_STOREYS] {
        let (floors, _) = self.devices(state);
        self.storeys.accelerations_under(&state.storeys, &floors)
    }

    /// Mass of everything that moves, kg.
    pub fn mass(&self) -> f64 {
        let storeys = self.storeys.storey.iter().take(self.storeys.count);
        let storeys: f64 = storeys.map(|storey| storey.mass).sum();
        storeys + self.tuned_mass.map_or(0.0, |own| own.mass)
    }

    /// The state `duration` s later with the table's acceleration (m/s²) and the voltage (V) held.
    pub fn advance(
        &self,
        state: &ControlledState,
        table_acceleration: f64,
        voltage: f64,
        duration: f64,
    ) -> ControlledState {
        if self.damper.is_none() && self.tuned_mass.is_none() {
            let storeys = &state.storeys;
            return ControlledState {
                storeys: self.storeys.advance(storeys, table_acceleration, duration),
                ..*state
            };
        }
        let shaken = Shaken {
            building: self,
            table_acceleration,
            voltage,
        };
        let longest = self.damper.map_or(LONGEST_STEP, |(storey, damper)| {
            let speed = motion_of(state, storey)[1].abs() + (table_acceleration * duration).abs();
            damper.longest_step(speed).min(LONGEST_STEP)
        });
        integration::advance(&shaken, &(*state).into(), duration, longest).into()
    }
}

/// Drift (m) of a storey and its rate (m/s).
fn motion_of(state: &ControlledState, storey: usize) -> [f64; 2] {
    let own = &state.storeys.storey[storey];
    [own.drift, own.drift_velocity]
}

impl From<[f64; STATES]> for ControlledState {
    fn from(x: [f64; STATES]) -> Self {
        let storeys: [f64; OF_STOREYS] = std::array::from_fn(|i| x[i]);
        Self {
            storeys: storeys.into(),
            damper: DamperState {
                inner: x[DAMPER],
                hysteretic: x[DAMPER + 1],
                voltage: x[DAMPER + 2],
            },
            tuned_mass: [x[TUNED], x[TUNED + 1]],
        }
    }
}

impl From<ControlledState> for [f64; STATES] {
    fn from(state: ControlledState) -> Self {
        let mut x = [0.0; STATES];
        x[..OF_STOREYS].copy_from_slice(&<[f64; OF_STOREYS]>::from(state.storeys));
        let damper = state.damper;
        x[DAMPER..TUNED].copy_from_slice(&[damper.inner, damper.hysteretic, damper.voltage]);
        x[TUNED..].copy_from_slice(&state.tuned_mass);
        x
    }
}

struct Shaken<'a> {
    building: &'a ControlledStoreys,
    table_acceleration: f64,
    voltage: f64,
}

impl Dynamics<STATES> for Shaken<'_> {
    fn derivatives(&self, x: &[f64; STATES]) -> [f64; STATES] {
        let state = ControlledState::from(*x);
        let (building, ground) = (self.building, self.table_acceleration);
        let floors = building.accelerations(&state);
        let mut rates = ControlledState {
            storeys: building.storeys.rates(&state.storeys, &floors, ground),
            ..ControlledState::default()
        };
        if let Some((storey, damper)) = &building.damper {
            let motion = motion_of(&state, *storey);
            rates.damper = damper.rates(&state.damper, motion, self.voltage);
        }
        if let Some(mass) = &building.tuned_mass {
            let own = -mass.force(state.tuned_mass) / mass.mass;
            rates.tuned_mass = [state.tuned_mass[1], own - floors[mass.floor]];
        }
        rates.into()
    }

    fn stiff_diagonal(&self, x: &[f64; STATES]) -> [f64; STATES] {
        let state = ControlledState::from(*x);
        let mut stiff = ControlledState::default();
        if let Some((storey, damper)) = &self.building.damper {
            stiff.damper = damper.stiffness_of(&state.damper, motion_of(&state, *storey));
        }
        stiff.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimens::YieldingSpecimen;
    use nalgebra::{Complex, DMatrix, DVector};

    fn elastic(mass: f64, damping: f64, stiffness: f64) -> YieldingSpecimen {
        let mut storey = YieldingSpecimen {
            mass,
            damping,
            ..YieldingSpecimen::default()
        };
        storey.columns.yield_force = stiffness * storey.columns.yield_displacement;
        storey.columns.post_yield_ratio = 1.0;
        storey
    }

    /// Warburton's closed form of the largest drift: `R = (1 + mu) sqrt(2/mu)` times the static one, met at
    /// two peaks of the same height.
    #[test]
    fn an_optimal_tuned_mass_has_two_peaks_of_the_closed_form() {
        let (mass, omega) = (100.0, 12.0);
        for ratio in [0.02, 0.05, 0.1] {
            let (frequency, damping_ratio) = TunedMass::optimum(ratio);
            let building = ControlledStoreys {
                storeys: Storeys::uniform(elastic(mass, 0.0, mass * omega * omega), 1),
                damper: None,
                tuned_mass: Some(TunedMass {
                    floor: 0,
                    mass: ratio * mass,
                    frequency: frequency * omega,
                    damping_ratio,
                }),
            };
            building.validate().unwrap();
            let rates = |x: [f64; STATES], table_acceleration: f64| {
                let shaken = Shaken {
                    building: &building,
                    table_acceleration,
                    voltage: 0.0,
                };
                shaken.derivatives(&x)
            };
            // Drift, its rate, and the tuned mass's: the linear part.
            let own = [0, 1, TUNED, TUNED + 1];
            let a = DMatrix::from_fn(4, 4, |i, j| {
                let mut x = [0.0; STATES];
                x[own[j]] = 1e-3;
                1e3 * rates(x, 0.0)[own[i]]
            });
            let b = DVector::from_fn(4, |i, _| rates([0.0; STATES], 1.0)[own[i]]);
            let drift = |w: f64| {
                let s = Complex::new(0.0, w);
                let m = DMatrix::from_fn(4, 4, |i, j| {
                    Complex::from(-a[(i, j)]) + if i == j { s } else { 0.0.into() }
                });
                let x = m.lu().solve(&b.map(Complex::from)).unwrap();
                x[0].norm() * omega * omega
            };
            let curve: Vec<f64> = (0..4000)
                .map(|k| drift(omega * (0.5 + 2.5e-4 * f64::from(k))))
                .collect();
            let peaks: Vec<f64> = curve
                .windows(3)
                .filter(|w| w[1] > w[0] && w[1] > w[2])
                .map(|w| w[1])
                .collect();
            let expected = (1.0 + ratio) * (2.0 / ratio).sqrt();
            println!("mass ratio {ratio}: {peaks:.3?}, closed form {expected:.3}");
            assert_eq!(peaks.len(), 2);
            for peak in peaks {
                assert!((peak / expected - 1.0).abs() < 0.02, "{peak} {expected}");
            }
        }
    }

    /// The damper alone under a sine, its equations written again and integrated in tiny steps.
    #[test]
    fn the_damper_follows_its_equations_in_tiny_steps() {
        let damper = MagnetorheologicalDamper::default();
        let w = std::f64::consts::TAU * 2.5;
        // A storey so heavy and stiff that nothing moves it but its start.
        for voltage in [0.0, 1.0, 2.25] {
            let building = ControlledStoreys {
                storeys: Storeys::uniform(elastic(1e9, 0.0, 1e9 * w * w), 1),
                damper: Some((0, damper)),
                tuned_mass: None,
            };
            let mut state = ControlledState::default();
            state.storeys.storey[0].drift_velocity = 0.015 * w;
            let (mut y, mut z, mut u) = (0.0f64, 0.0f64, 0.0f64);
            let h = 2e-6;
            let mut largest = 0.0f64;
            for k in 0..400 {
                let t = 0.002 * f64::from(k);
                for i in 0..1000 {
                    let t = t + h * f64::from(i);
                    let (x, dx) = (0.015 * (w * t).sin(), 0.015 * w * (w * t).cos());
                    let c0 = 2100.0 + 350.0 * u;
                    let c1 = 28_300.0 + 295.0 * u;
                    let alpha = 14_000.0 + 69_500.0 * u;
                    let dy = (alpha * z + c0 * dx + 4690.0 * (x - y)) / (c0 + c1);
                    let v = dx - dy;
                    z += h * (301.0 * v - 3.63e6 * (v.abs() * z * z.abs() + v * z * z));
                    y += h * dy;
                    u += h * 190.0 * (voltage - u);
                }
                state = building.advance(&state, 0.0, voltage, 0.002);
                let t = t + 0.002;
                let (x, dx) = (0.015 * (w * t).sin(), 0.015 * w * (w * t).cos());
                let c0 = 2100.0 + 350.0 * u;
                let c1 = 28_300.0 + 295.0 * u;
                let alpha = 14_000.0 + 69_500.0 * u;
                let dy = (alpha * z + c0 * dx + 4690.0 * (x - y)) / (c0 + c1);
                let expected = c1 * dy + 500.0 * x;
                let got = building.damper_force(&state);
                largest = largest.max(expected.abs());
                assert!((got - expected).abs() < 12.0, "{k}: {got} {expected}");
            }
            println!("{voltage} V: {largest:.0} N");
            // The prototype's: some 200 N without voltage, beyond 1 kN with all of it.
            let range = if voltage == 0.0 {
                150.0..700.0
            } else {
                700.0..2500.0
            };
            assert!(range.contains(&largest), "{largest}");
        }
    }

    #[test]
    fn momentum_changes_by_the_force_on_the_table() {
        let building = ControlledStoreys {
            storeys: Storeys::uniform(YieldingSpecimen::default(), 3),
            damper: Some((1, MagnetorheologicalDamper::default())),
            tuned_mass: Some(TunedMass {
                floor: 2,
                mass: 1.0,
                frequency: 10.0,
                damping_ratio: 0.1,
            }),
        };
        let mut state = ControlledState::default();
        for k in 0..300 {
            state = building.advance(&state, (0.1 * f64::from(k)).sin(), 1.0, 0.002);
        }
        let floors = building.accelerations(&state);
        let mass = building.tuned_mass.unwrap();
        let total: f64 = (0..3)
            .map(|i| floors[i] * building.storeys.storey[i].mass)
            .sum();
        let total = total - mass.force(state.tuned_mass);
        assert!((total + building.force(&state)).abs() < 1e-9);
        let wrong = ControlledStoreys {
            damper: Some((3, MagnetorheologicalDamper::default())),
            ..building
        };
        assert!(
            wrong
                .validate()
                .unwrap_err()
                .to_string()
                .contains("damper_storey")
        );
    }
}

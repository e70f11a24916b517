//! Clipped-optimal control of a magnetorheological damper in a building (S. J. Dyke, B. F. Spencer, M. K. Sain and
//! J. D. Carlson, Smart Materials and Structures 5, 1996).
//!
//! A linear quadratic Gaussian law finds the force that would be best, from the floors' absolute accelerations and
//! the damper's measured force. The damper cannot be told a force: it is given its largest voltage
//! while its force has the wanted one's sign and is smaller, and none otherwise.

use nalgebra::DMatrix;
use plant::linear::{StateSpace, discrete_riccati};
use plant::specimens::MAX_STOREYS;
use units::vocabulary;

use crate::mpc::kalman::SteadyStateKalmanFilter;
use crate::{Controller, ModelError};

const STATES: usize = 2 * MAX_STOREYS;

/// What the damper is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DamperControl {
    /// Largest voltage or none, after the best force.
    #[default]
    ClippedOptimal,
    /// No voltage.
    PassiveOff,
    /// The largest voltage.
    PassiveOn,
}

/// What the law is designed for.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ClippedOptimalDesign {
    /// Number of storeys.
    pub storeys: usize,
    /// Mass of each floor, the lowest first, kg.
    pub mass: [f64; MAX_STOREYS],
    /// Viscous damping of each storey, N s/m.
    pub damping: [f64; MAX_STOREYS],
    /// Stiffness of each storey, N/m.
    pub stiffness: [f64; MAX_STOREYS],
    /// Index of the damper's storey, the lowest 0.
    pub damper_storey: usize,
    /// Weight of each floor's absolute acceleration, s²/m.
    pub acceleration_weight: f64,
    /// Weight of each storey's drift, 1/m.
    pub drift_weight: f64,
    /// Weight of the force, 1/N.
    pub force_weight: f64,
    /// White noise that the ground's acceleration is taken for, one standard deviation, m/s².
    pub ground_noise: f64,
    /// Noise of the measured accelerations, one standard deviation, m/s².
    pub measurement_noise: f64,
    /// What the damper is told.
    pub control: DamperControl,
    /// Largest voltage, V.
    pub largest_voltage: f64,
}

impl Default for ClippedOptimalDesign {
    /// For the default building of `StoreysSpecimen`: three storeys of 100 lbf together, first period 0.5 s.
    fn default() -> Self {
        Self {
            storeys: 3,
            mass: [15.11; MAX_STOREYS],
            damping: [2.0 * 0.05 * 12_050.0 / 12.57; MAX_STOREYS],
            stiffness: [12_050.0; MAX_STOREYS],
            damper_storey: 0,
            acceleration_weight: 1.0,
            drift_weight: 400.0,
            force_weight: 6.5e-4,
            ground_noise: 5.0,
            measurement_noise: 0.1,
            control: DamperControl::ClippedOptimal,
            largest_voltage: 2.25,
        }
    }
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ClippedOptimalInput {
    /// Absolute accelerations of the floors, the lowest first, m/s².
    pub floor_acceleration: [f64; MAX_STOREYS],
    /// Force of the damper against the drift, N.
    pub damper_force: f64,
}

/// The law with its memory.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ClippedOptimal {
    control: DamperControl,
    largest_voltage: f64,
    storeys: usize,
    transition: [[f64; STATES]; STATES],
    input: [f64; STATES],
    correction: [[f64; MAX_STOREYS]; STATES],
    measured: [[f64; STATES]; MAX_STOREYS],
    direct: [f64; MAX_STOREYS],
    feedback: [f64; STATES],
    estimate: [f64; STATES],
    wanted: f64,
}

impl ClippedOptimalDesign {
    /// The building under the damper's force and the ground's acceleration: displacements of the floors
    /// against the ground and their rates; out come the floors' absolute accelerations.
    fn building(&self) -> Result<StateSpace, ModelError> {
        let n = self.storeys;
        if !(1..=MAX_STOREYS).contains(&n) || self.damper_storey >= n {
            return Err(ModelError::Parameter {
                name: vocabulary::DAMPER_STOREY,
                value: (self.damper_storey + 1) as f64,
                expected: "a storey of a building of 1 to 10",
            });
        }
        let (mut a, mut b) = (DMatrix::zeros(2 * n, 2 * n), DMatrix::zeros(2 * n, 2));
        let (mut c, mut d) = (DMatrix::zeros(n, 2 * n), DMatrix::zeros(n, 2));
        for i in 0..n {
            ModelError::require_positive("mass", self.mass[i])?;
            ModelError::require_positive("stiffness", self.stiffness[i])?;
            ModelError::require_non_negative("damping", self.damping[i])?;
            a[(i, n + i)] = 1.0;
            b[(n + i, 1)] = -1.0;
            // The storey below pulls the floor down, the one above up.
            for (storey, sign) in [(i, -1.0), (i + 1, 1.0)] {
                if storey >= n {
                    continue;
                }
                for (coefficient, at) in [(self.stiffness[storey], 0), (self.damping[storey], n)] {
                    let own = sign * coefficient / self.mass[i];
                    c[(i, at + storey)] += own;
                    if storey > 0 {
                        c[(i, at + storey - 1)] -= own;
                    }
                }
                if storey == self.damper_storey {
                    d[(i, 0)] += sign / self.mass[i];
                }
            }
        }
        a.view_mut((n, 0), (n, 2 * n)).copy_from(&c);
        b.view_mut((n, 0), (n, 1)).copy_from(&d.columns(0, 1));
        StateSpace::new(a, b, c, d)
    }

    /// Designs the law, sampled every `period` (s).
    ///
    /// # Errors
    /// Parameters that make no building; weights or noises for which a Riccati equation has no stabilising
    /// solution.
    pub fn law(&self, period: f64) -> Result<ClippedOptimal, ModelError> {
        for (name, value) in [
            ("force_weight", self.force_weight),
            ("ground_noise", self.ground_noise),
            (vocabulary::SENSOR_NOISE, self.measurement_noise),
            ("largest_voltage", self.largest_voltage),
        ] {
            ModelError::require_positive(name, value)?;
        }
        ModelError::require_non_negative(
            vocabulary::ACCELERATION_WEIGHT,
            self.acceleration_weight,
        )?;
        ModelError::require_non_negative("drift_weight", self.drift_weight)?;
        let n = self.storeys;
        let building = self.building()?;
        let sampled = building.sample(period);
        let (a, b) = (&sampled.a, sampled.b.columns(0, 1).into_owned());
        // Accelerations and drifts, weighted; the force goes into the first directly.
        let mut out = DMatrix::zeros(2 * n, 2 * n);
        let mut direct = DMatrix::zeros(2 * n, 1);
        for i in 0..n {
            out.row_mut(i)
                .copy_from(&(building.c.row(i) * self.acceleration_weight));
            direct[(i, 0)] = building.d[(i, 0)] * self.acceleration_weight;
            out[(n + i, i)] = self.drift_weight;
            if i > 0 {
                out[(n + i, i - 1)] = -self.drift_weight;
            }
        }
        // Without the cross term: f = -(R^-1 N' + K') x.
        let r = direct.transpose() * &direct
            + DMatrix::from_element(1, 1, self.force_weight * self.force_weight);
        let across = out.transpose() * &direct / r[(0, 0)];
        let rest = out.transpose() * &out - &across * r[(0, 0)] * across.transpose();
        let moved = a - &b * across.transpose();
        let x = discrete_riccati(&moved, &b, &(0.5 * (&rest + rest.transpose())), &r)?;
        let bx = b.transpose() * &x;
        let gain = &bx * &moved / ((&bx * &b)[(0, 0)] + r[(0, 0)]) + across.transpose();

        let ground = sampled.b.columns(1, 1).into_owned();
        let q = &ground * ground.transpose() * self.ground_noise.powi(2);
        let noise = DMatrix::identity(n, n) * self.measurement_noise.powi(2);
        let filter = SteadyStateKalmanFilter::new(a, &building.c, &q, &noise)?;
        let at = |m: &DMatrix<f64>, i: usize, j: usize| m.get((i, j)).copied().unwrap_or(0.0);
        Ok(ClippedOptimal {
            control: self.control,
            largest_voltage: self.largest_voltage,
            storeys: n,
            transition: std::array::from_fn(|i| std::array::from_fn(|j| at(a, i, j))),
            input: std::array::from_fn(|i| at(&b, i, 0)),
            correction: std::array::from_fn(|i| std::array::from_fn(|j| at(&filter.gain, i, j))),
            measured: std::array::from_fn(|i| std::array::from_fn(|j| at(&building.c, i, j))),
            direct: std::array::from_fn(|i| at(&building.d, i, 0)),
            feedback: std::array::from_fn(|i| at(&gain, 0, i)),
            estimate: [0.0; STATES],
            wanted: 0.0,
        })
    }
}

impl ClippedOptimal {
    /// The force that would be best, against the drift of the damper's storey, N.
    pub fn wanted_force(&self) -> f64 {
        self.wanted
    }
}

impl Controller for ClippedOptimal {
    type Input = ClippedOptimalInput;
    /// Voltage of the damper, V.
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.feedback
            .iter()
            .try_for_each(|gain| ModelError::require_finite("feedback", *gain))
    }

    fn step(&mut self, input: &ClippedOptimalInput, _period: f64) -> f64 {
        let (n, states) = (self.storeys, 2 * self.storeys);
        let mut innovation = [0.0; MAX_STOREYS];
        for i in 0..n {
            let known: f64 = (0..states)
                .map(|j| self.measured[i][j] * self.estimate[j])
                .sum();
            innovation[i] =
                input.floor_acceleration[i] - known - self.direct[i] * input.damper_force;
        }
        let mut now = self.estimate;
        for i in 0..states {
            now[i] += (0..n)
                .map(|j| self.correction[i][j] * innovation[j])
                .sum::<f64>();
        }
        self.wanted = -(0..states).map(|j| self.feedback[j] * now[j]).sum::<f64>();
        for i in 0..states {
            let moved: f64 = (0..states).map(|j| self.transition[i][j] * now[j]).sum();
            self.estimate[i] = moved + self.input[i] * input.damper_force;
        }
        let more = (self.wanted - input.damper_force) * input.damper_force > 0.0;
        match self.control {
            DamperControl::PassiveOff => 0.0,
            DamperControl::PassiveOn => self.largest_voltage,
            DamperControl::ClippedOptimal if more => self.largest_voltage,
            DamperControl::ClippedOptimal => 0.0,
        }
    }

    fn reset(&mut self) {
        self.estimate = [0.0; STATES];
        self.wanted = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::sensors::channel::Noise;
    use plant::specimens::{
        ControlledState, ControlledStoreys, MagnetorheologicalDamper, Storeys, YieldingSpecimen,
    };

    const PERIOD: f64 = 0.002;
    /// The three-storey model of the paper, lowest storey first: 98.3 kg a floor.
    const MASS: f64 = 98.3;
    const DAMPING: [f64; 3] = [125.0, 50.0, 50.0];
    const STIFFNESS: [f64; 3] = [5.16e5, 6.84e5, 6.84e5];

    fn paper(damper: bool) -> ControlledStoreys {
        let storey = |i: usize| {
            let i = i.min(2);
            let mut own = YieldingSpecimen {
                mass: MASS,
                damping: DAMPING[i],
                ..YieldingSpecimen::default()
            };
            own.columns.yield_force = STIFFNESS[i] * own.columns.yield_displacement;
            own.columns.post_yield_ratio = 1.0;
            own
        };
        ControlledStoreys {
            storeys: Storeys {
                storey: std::array::from_fn(storey),
                count: 3,
            },
            damper: damper.then(|| (0, MagnetorheologicalDamper::default())),
            tuned_mass: None,
        }
    }

    fn design(control: DamperControl) -> ClippedOptimalDesign {
        let each = |values: [f64; 3]| std::array::from_fn(|i| values[i.min(2)]);
        ClippedOptimalDesign {
            mass: each([MASS; 3]),
            damping: each(DAMPING),
            stiffness: each(STIFFNESS),
            drift_weight: 3000.0,
            force_weight: 1e-4,
            control,
            ..ClippedOptimalDesign::default()
        }
    }

    /// Ground motion as an earthquake's, five times as fast as the model's scale asks, 0.34 g.
    fn ground(seed: u64) -> Vec<f64> {
        let (w, zeta) = (std::f64::consts::TAU * 10.0, 0.6);
        let (mut x, mut v) = (0.0, 0.0);
        let mut motion: Vec<f64> = (0..4000)
            .map(|sample| {
                let t = PERIOD * sample as f64;
                let envelope = (t / 0.4).min(1.0) * (-(t - 2.0).max(0.0) / 1.5).exp();
                let noise = Noise {
                    seed,
                    channel: 0,
                    sample,
                };
                let push = envelope * noise.gaussian();
                for _ in 0..4 {
                    v += 0.25 * PERIOD * (push - 2.0 * zeta * w * v - w * w * x);
                    x += 0.25 * PERIOD * v;
                }
                w * w * x + 2.0 * zeta * w * v
            })
            .collect();
        let peak = motion.iter().fold(0.0f64, |m, a| m.max(a.abs()));
        motion.iter_mut().for_each(|a| *a *= 0.34 * 9.81 / peak);
        motion
    }

    /// Peaks of the top floor's displacement against the ground (m), any drift (m), any floor's
    /// acceleration (m/s²), the damper's force (N), and the rms of what the filter does not foresee of the
    /// accelerations over that of themselves.
    fn peaks(control: Option<DamperControl>, seed: u64) -> [f64; 5] {
        let building = paper(control.is_some());
        let mut law = design(control.unwrap_or_default()).law(PERIOD).unwrap();
        let mut state = ControlledState::default();
        let mut most = [0.0f64; 5];
        let (mut unforeseen, mut all) = (0.0, 0.0);
        for a in ground(seed) {
            let input = ClippedOptimalInput {
                floor_acceleration: building.accelerations(&state),
                damper_force: building.damper_force(&state),
            };
            let drifts: Vec<f64> = state.storeys.storey[..3].iter().map(|s| s.drift).collect();
            let top: f64 = drifts.iter().sum();
            let drift = drifts.iter().fold(0.0f64, |m, d| m.max(d.abs()));
            let floors = input.floor_acceleration;
            let quick = floors.iter().fold(0.0f64, |m, a| m.max(a.abs()));
            for (most, own) in most.iter_mut().zip([top, drift, quick, input.damper_force]) {
                *most = most.max(own.abs());
            }
            for i in 0..3 {
                let foreseen: f64 = (0..6).map(|j| law.measured[i][j] * law.estimate[j]).sum();
                let foreseen = foreseen + law.direct[i] * input.damper_force;
                unforeseen += (floors[i] - foreseen).powi(2);
                all += floors[i].powi(2);
            }
            let voltage = law.step(&input, PERIOD);
            state = building.advance(&state, a, voltage, PERIOD);
        }
        most[4] = (unforeseen / all).sqrt();
        most
    }

    /// Without voltage the damper is too weak, with all of it so stiff that it shakes the floors; switched, the
    /// floors' largest acceleration is below both, and the top moves less than without voltage.
    #[test]
    fn clipped_optimal_control_shakes_the_floors_less_than_either_passive_damper() {
        use DamperControl::{ClippedOptimal, PassiveOff, PassiveOn};
        for seed in [1, 2] {
            let none = peaks(None, seed);
            let [off, on, best] =
                [PassiveOff, PassiveOn, ClippedOptimal].map(|control| peaks(Some(control), seed));
            for (name, row) in [("none", none), ("off", off), ("on", on), ("clipped", best)] {
                println!(
                    "seed {seed} {name:8} top {:.3} cm, drift {:.3} cm, {:.0} cm/s2, {:.0} N, {:.3}",
                    100.0 * row[0],
                    100.0 * row[1],
                    100.0 * row[2],
                    row[3],
                    row[4]
                );
            }
            assert!(off[0] < none[0] && best[0] < off[0], "seed {seed}: top");
            assert!(best[2] < off[2].min(on[2]), "seed {seed}: floors");
            // The filter knows the building and the damper's force.
            assert!(off[4] < 0.05, "{}", off[4]);
        }
    }

    #[test]
    fn what_makes_no_building_is_refused() {
        for wrong in [
            ClippedOptimalDesign {
                damper_storey: 3,
                ..ClippedOptimalDesign::default()
            },
            ClippedOptimalDesign {
                mass: [0.0; MAX_STOREYS],
                ..ClippedOptimalDesign::default()
            },
            ClippedOptimalDesign {
                force_weight: 0.0,
                ..ClippedOptimalDesign::default()
            },
        ] {
            assert!(wrong.law(PERIOD).is_err());
        }
    }
}

//! Tracking of an acceleration in its authors' structures: acceleration trajectory tracking (Fig 1-3;
//! N. Nakata, Engineering Structures 32, 2010) and the dual loop of acceleration and force (Fig 1-4;
//! M. Stehman and N. Nakata, Journal of Earthquake Engineering 17, 2013).
//!
//! The command is a sum, each part of which gains of zero switch off:
//!
//! - **command shaping**: the inverse of the rig, to third order in `s`, of the motion ahead. That motion is
//!   ahead by as much as the rig is late, so that feedback compares with a later one: the intentional
//!   delay of Fig 1-3;
//! - **displacement feedback** of a Kalman filter on displacement and acceleration, which holds the table;
//! - **acceleration loop**, its integrals leaking, for an accelerometer knows no position;
//! - **force loop**, slow, which keeps the table from drifting: the springs of the table turn its place
//!   into a force.

use nalgebra::Complex;
use plant::identified::table::Table;
use units::constants::{INCH, LBF};
use units::{Parameters, vocabulary};

use crate::pid::VALVE_LIMIT;
use crate::{Controller, ModelError, Motion};

/// Coefficients of command shaping: of displacement, velocity, acceleration and jerk.
pub const SHAPING: usize = 4;
/// Their names as parameters.
pub const SHAPES: [&str; SHAPING] = [
    "displacement_shaping",
    "velocity_shaping",
    "acceleration_shaping",
    "jerk_shaping",
];

/// Parameters of both structures, and what they remember.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct AccelerationTracking {
    /// Command shaping: V/m, V s/m, V s²/m, V s³/m.
    #[parameter(0, name = SHAPES[0], about = "F0 of command shaping", "V/m" => "V/in", finite)]
    #[parameter(1, name = SHAPES[1], about = "F1 of command shaping", "V.s/m" => "V.s/in", finite)]
    #[parameter(2, name = SHAPES[2], about = "F2 of command shaping", "V.s2/m" => "V.s2/in", finite)]
    #[parameter(3, name = SHAPES[3], about = "F3 of command shaping", "V.s3/m" => "V.s3/in", finite)]
    pub shaping: [f64; SHAPING],
    /// K of the displacement feedback, V/m.
    #[parameter("V/m" => "V/in", finite)]
    pub displacement_gain: f64,
    /// The displacement that is fed back.
    #[parameters]
    pub filter: DisplacementFilter,
    /// Acceleration loop.
    #[parameters]
    pub acceleration: AccelerationLoop,
    /// Force loop.
    #[parameters]
    pub force: ForceLoop,
    /// Largest magnitude of the valve command, V.
    pub limit: f64,
    /// What the law remembers.
    pub memory: Memory,
}

/// A table's displacement from noisy displacement and acceleration: the steady Kalman filter of a
/// double integrator, `x⁻ = x + h v + h² a/2`, `v⁻ = v + h a`, `x = x⁻ + alpha (y - x⁻)`,
/// `v = v⁻ + beta/h (y - x⁻)`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct DisplacementFilter {
    /// Standard deviation of the measured displacement, m.
    #[parameter("m" => "in", positive)]
    pub displacement_noise: f64,
    /// Standard deviation of the measured acceleration, m/s2.
    #[parameter("m/s2" => "g", positive)]
    pub acceleration_noise: f64,
}

impl DisplacementFilter {
    /// `alpha`, `beta` for a sampling `period` (s): with the tracking index
    /// `L = acceleration_noise h² / displacement_noise`, `r = (4 + L - sqrt(8 L + L²))/4`,
    /// `alpha = 1 - r²`, `beta = 2 (2 - alpha) - 4 sqrt(1 - alpha)` (P. R. Kalata, IEEE Transactions
    /// on Aerospace and Electronic Systems 20, 1984).
    pub fn gains(&self, period: f64) -> [f64; 2] {
        let index = self.acceleration_noise * period * period / self.displacement_noise;
        let r = (4.0 + index - (8.0 * index + index * index).sqrt()) / 4.0;
        let alpha = 1.0 - r * r;
        [alpha, 2.0 * (2.0 - alpha) - 4.0 * r]
    }

    /// From measured displacement and acceleration to the estimate, at `z`.
    pub fn responses(&self, z: Complex<f64>, period: f64) -> [Complex<f64>; 2] {
        let [alpha, beta] = self.gains(period);
        let q = 1.0 / z;
        let one = Complex::new(1.0, 0.0);
        // Of the predicted x and v, row after row, under displacement and mean acceleration.
        let (a, b) = (one - q * (1.0 - alpha) + q * beta, -q * period);
        let (c, d) = (q * beta / period, one - q);
        let determinant = a * d - b * c;
        let predicted =
            |first: Complex<f64>, second: Complex<f64>| (first * d - b * second) / determinant;
        let mean = (one + q) * 0.5;
        let by_displacement = predicted(q * (alpha + beta), q * beta / period);
        let by_acceleration = predicted(mean * (0.5 * period * period), mean * period);
        [
            by_displacement * (1.0 - alpha) + alpha,
            by_acceleration * (1.0 - alpha),
        ]
    }
}

/// `u = Kp e + Ki i + Kii j`, `di/dt = e - leak i`, `dj/dt = i - leak j`, `e` the acceleration's error.
#[derive(
    Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize, Parameters,
)]
#[parameters(prefix = "acceleration_")]
pub struct AccelerationLoop {
    /// Kp of the acceleration loop, V.s2/m.
    #[parameter("V.s2/m" => "V.s2/in", name = "gain", finite)]
    pub proportional: f64,
    /// Ki of the acceleration loop, V.s/m.
    #[parameter("V.s/m" => "V.s/in", name = "integral_gain", finite)]
    pub integral: f64,
    /// Kii of the acceleration loop, V/m.
    #[parameter("V/m" => "V/in", name = "double_integral_gain", finite)]
    pub double_integral: f64,
    /// Rate at which its integrals leak away, 1/s.
    #[parameter("1/s", non_negative)]
    pub leak: f64,
}

impl AccelerationLoop {
    /// From the acceleration's error to the command, at `z`.
    pub fn response(&self, z: Complex<f64>, period: f64) -> Complex<f64> {
        let once = period / (1.0 - (-self.leak * period).exp() / z);
        self.proportional + once * self.integral + once * once * self.double_integral
    }
}

/// `u = K f`, `df/dt = corner (m r_a + c r_v + k r_d - F - f)`.
#[derive(
    Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize, Parameters,
)]
pub struct ForceLoop {
    /// Kf of the force loop, V/N.
    #[parameter("V/N" => "V/lbf", name = vocabulary::FORCE_GAIN, finite)]
    pub gain: f64,
    /// Corner of its lag, rad/s.
    #[parameter("rad/s", name = "force_corner", positive)]
    pub corner: f64,
    /// Mass of the table, for the wanted force, kg.
    #[parameter("kg" => "lbf.s2/in", name = Table::TABLE_MASS, non_negative)]
    pub mass: f64,
    /// Viscous damping of the table, N.s/m.
    #[parameter("N.s/m" => "lbf.s/in", name = Table::TABLE_DAMPING, non_negative)]
    pub damping: f64,
    /// Stiffness from table to ground, N/m.
    #[parameter("N/m" => "lbf/in", name = Table::TABLE_STIFFNESS, non_negative)]
    pub stiffness: f64,
}

impl ForceLoop {
    fn share(&self, period: f64) -> f64 {
        1.0 - (-self.corner * period).exp()
    }

    /// From the force's error to the command, at `z`.
    pub fn response(&self, z: Complex<f64>, period: f64) -> Complex<f64> {
        let share = self.share(period);
        self.gain * share / (1.0 - (1.0 - share) / z)
    }
}

/// Memory of [`AccelerationTracking`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Memory {
    /// Acceleration ahead at the sample before, m/s²; absent before the first.
    ahead: Option<f64>,
    /// Estimated displacement (m) and velocity (m/s).
    estimate: [f64; 2],
    /// Measured acceleration at the sample before, m/s²; absent before the first.
    measured: Option<f64>,
    /// Integral and double integral of the acceleration's error.
    integrals: [f64; 2],
    /// Lagged error of the force, N.
    force: f64,
}

/// What the law is told.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct AccelerationTrackingInput {
    /// Wanted motion, ahead by what the rig is late.
    pub ahead: Motion,
    /// Wanted motion at the time that is measured now.
    pub reference: Motion,
    /// Measured motion; its velocity is not used.
    pub measured: Motion,
    /// Measured force of the actuator, N.
    pub force: f64,
}

impl Default for AccelerationTracking {
    /// Trajectory tracking by its rule for the identified rig (Eq 2-13, 2-28), the motion two samples
    /// ahead.
    fn default() -> Self {
        Self {
            shaping: [-20.532, 10.7825, 0.055_067, 1.046_23e-3],
            displacement_gain: 102.44,
            filter: DisplacementFilter {
                displacement_noise: 5e-4 * INCH,
                acceleration_noise: 3.864 * INCH,
            },
            acceleration: AccelerationLoop::default(),
            force: ForceLoop {
                gain: 0.0,
                corner: 1.0,
                mass: 0.1212 * LBF / INCH,
                damping: 0.2466 * LBF / INCH,
                stiffness: 23.33 * LBF / INCH,
            },
            limit: VALVE_LIMIT,
            memory: Memory::default(),
        }
    }
}

impl AccelerationTracking {
    /// The estimate of displacement that takes in this sample's measurements.
    fn filter(&mut self, measured: &Motion, period: f64) -> f64 {
        let [alpha, beta] = self.filter.gains(period);
        let before = self.memory.measured.replace(measured.acceleration);
        let Some(before) = before else {
            self.memory.estimate = [measured.displacement, 0.0];
            return measured.displacement;
        };
        let mean = 0.5 * (before + measured.acceleration);
        let [x, v] = self.memory.estimate;
        let (x, v) = (
            x + period * v + 0.5 * period * period * mean,
            v + period * mean,
        );
        let left = measured.displacement - x;
        self.memory.estimate = [x + alpha * left, v + beta / period * left];
        self.memory.estimate[0]
    }
}

impl Controller for AccelerationTracking {
    type Input = AccelerationTrackingInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        ModelError::require_positive(vocabulary::VALVE_LIMIT, self.limit)
    }

    fn step(&mut self, input: &AccelerationTrackingInput, period: f64) -> f64 {
        let AccelerationTrackingInput {
            ahead,
            reference,
            measured,
            force,
        } = input;
        let last = self.memory.ahead.replace(ahead.acceleration);
        let jerk = (ahead.acceleration - last.unwrap_or(ahead.acceleration)) / period;
        let [f0, f1, f2, f3] = self.shaping;
        let shaped =
            f0 * ahead.displacement + f1 * ahead.velocity + f2 * ahead.acceleration + f3 * jerk;
        let estimate = self.filter(measured, period);
        let held = self.displacement_gain * (reference.displacement - estimate);

        let own = &self.force;
        let wanted = own.mass * reference.acceleration
            + own.damping * reference.velocity
            + own.stiffness * reference.displacement;
        self.memory.force += own.share(period) * (wanted - force - self.memory.force);
        let others = shaped + held + own.gain * self.memory.force;

        let own = &self.acceleration;
        let error = reference.acceleration - measured.acceleration;
        let left = (-own.leak * period).exp();
        let [once, twice] = self.memory.integrals;
        let once = left * once + period * error;
        let twice = left * twice + period * once;
        let command = |[once, twice]: [f64; 2]| {
            others + own.proportional * error + own.integral * once + own.double_integral * twice
        };
        let next = command([once, twice]);
        // At the limit the integrals stand still, unless they lead away from it.
        if next.abs() <= self.limit || next.abs() < command(self.memory.integrals).abs() {
            self.memory.integrals = [once, twice];
        }
        command(self.memory.integrals).clamp(-self.limit, self.limit)
    }

    fn reset(&mut self) {
        self.memory = Memory::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mpc::kalman::SteadyStateKalmanFilter;
    use nalgebra::dmatrix;

    const H: f64 = 0.002;

    #[test]
    fn the_filter_is_the_solution_of_its_riccati_equation() {
        for (displacement, acceleration) in [(1e-5, 0.04), (1e-4, 1.0), (1e-6, 3.0)] {
            let filter = DisplacementFilter {
                displacement_noise: displacement,
                acceleration_noise: acceleration,
            };
            let [alpha, beta] = filter.gains(H);
            let own = SteadyStateKalmanFilter::new(
                &dmatrix![1.0, H; 0.0, 1.0],
                &dmatrix![1.0, 0.0],
                &(dmatrix![H * H * H * H / 4.0, H * H * H / 2.0; H * H * H / 2.0, H * H]
                    * (acceleration * acceleration)),
                &dmatrix![displacement * displacement],
            )
            .unwrap();
            assert!(
                (own.gain[0] / alpha - 1.0).abs() < 1e-6,
                "{} {alpha}",
                own.gain
            );
            assert!(
                (own.gain[1] * H / beta - 1.0).abs() < 1e-6,
                "{} {beta}",
                own.gain
            );
        }
    }

    /// Sines through the law as it runs beside its responses in closed form.
    #[test]
    fn what_runs_has_the_stated_responses() {
        let omega = 40.0;
        let z = Complex::new(0.0, omega * H).exp();
        let plain = AccelerationTracking {
            shaping: [0.0; SHAPING],
            displacement_gain: 0.0,
            limit: 1e9,
            ..AccelerationTracking::default()
        };
        let filtered = AccelerationTracking {
            displacement_gain: 2.0,
            ..plain
        };
        let accelerated = AccelerationTracking {
            acceleration: AccelerationLoop {
                proportional: 0.3,
                integral: 7.0,
                double_integral: 90.0,
                leak: 2.0,
            },
            ..plain
        };
        let forced = AccelerationTracking {
            force: ForceLoop {
                gain: 3.0,
                corner: 30.0,
                ..plain.force
            },
            ..plain
        };
        let one = Complex::new(1.0, 0.0);
        let [by_displacement, by_acceleration] = filtered.filter.responses(z, H);
        let zero = Complex::new(0.0, 0.0);
        // Measured displacement, acceleration and force, as phasors, and the response.
        let cases = [
            (filtered, [one, zero, zero], by_displacement * -2.0),
            (filtered, [zero, one, zero], by_acceleration * -2.0),
            (
                accelerated,
                [zero, one, zero],
                -accelerated.acceleration.response(z, H),
            ),
            (forced, [zero, zero, one], -forced.force.response(z, H)),
        ];
        for (mut law, measured, expected) in cases {
            let mut off = 0.0_f64;
            for k in 0..20_000 {
                let turn = z.powi(k);
                let [displacement, acceleration, force] = measured.map(|own| (own * turn).re);
                let input = AccelerationTrackingInput {
                    measured: Motion {
                        displacement,
                        acceleration,
                        ..Motion::default()
                    },
                    force,
                    ..AccelerationTrackingInput::default()
                };
                let u = law.step(&input, H);
                if k > 19_000 {
                    off = off.max((u - (expected * turn).re).abs());
                }
            }
            assert!(
                off < 1e-6 * expected.norm().max(1e-3),
                "{off} of {expected}"
            );
        }
    }

    #[test]
    fn shaping_is_a_polynomial_of_the_motion_ahead() {
        let mut law = AccelerationTracking {
            shaping: [2.0, 3.0, 5.0, 7.0],
            displacement_gain: 0.0,
            limit: 1e3,
            ..AccelerationTracking::default()
        };
        let mut last = 0.0;
        for k in 0..3 {
            let t = H * f64::from(k);
            let input = AccelerationTrackingInput {
                ahead: Motion {
                    displacement: t * t * t / 6.0,
                    velocity: t * t / 2.0,
                    acceleration: t,
                },
                ..AccelerationTrackingInput::default()
            };
            last = law.step(&input, H);
        }
        let t = 2.0 * H;
        let expected = 2.0 * t * t * t / 6.0 + 3.0 * t * t / 2.0 + 5.0 * t + 7.0;
        assert!((last - expected).abs() < 1e-9, "{last} {expected}");
    }
}

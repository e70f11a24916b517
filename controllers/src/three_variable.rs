//! Three-variable control: displacement, velocity and acceleration fed back and forward
//! (Section 3.3, Fig 3-5, Table 3-2).

use units::constants::INCH;
use units::{Parameters, vocabulary};

use crate::pid::{VALVE_LIMIT, limit_and_integrate};
use crate::{Controller, ModelError, Motion};

/// Gains of three-variable control and its memory:
/// `u = Kp (rd - x) + xi + Kfd rd + Kbv (rv - v) + Kfv rv + Kba (ra - a) + Kfa ra`,
/// `dxi/dt = Ki (rd - x)`.
///
/// As a sampled law the integral takes in the error of the present sample and stands still while
/// the command is at its limit and the error would push it further.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct ThreeVariableControl {
    /// The gains.
    #[parameters]
    pub gains: ThreeVariableGains,
    /// Largest magnitude of the valve command, V.
    #[parameter("V", name = vocabulary::VALVE_LIMIT, positive)]
    pub limit: f64,
    /// Integral part of the command, V.
    pub integral: f64,
}

/// The eight gains of Table 3-2 less the derivative one, which is zero there and which the
/// velocity gain replaces.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct ThreeVariableGains {
    /// P of Table 3-2, V/m.
    #[parameter(name = vocabulary::PROPORTIONAL_GAIN, "V/m" => "V/in", finite)]
    pub proportional: f64,
    /// I of Table 3-2, V/(m.s).
    #[parameter(name = vocabulary::INTEGRAL_GAIN, "V/(m.s)" => "V/(in.s)", finite)]
    pub integral: f64,
    /// Kbv of Table 3-2, V.s/m.
    #[parameter(name = "velocity_feedback_gain", "V.s/m" => "V.s/in", finite)]
    pub velocity_feedback: f64,
    /// Kba of Table 3-2, V.s2/m.
    #[parameter(name = "acceleration_feedback_gain", "V.s2/m" => "V.s2/in", finite)]
    pub acceleration_feedback: f64,
    /// Kfd of Table 3-2, V/m.
    #[parameter(name = "displacement_feedforward_gain", "V/m" => "V/in", finite)]
    pub displacement_feedforward: f64,
    /// Kfv of Table 3-2, V.s/m.
    #[parameter(name = "velocity_feedforward_gain", "V.s/m" => "V.s/in", finite)]
    pub velocity_feedforward: f64,
    /// Kfa of Table 3-2, V.s2/m.
    #[parameter(name = "acceleration_feedforward_gain", "V.s2/m" => "V.s2/in", finite)]
    pub acceleration_feedforward: f64,
}

impl ThreeVariableGains {
    /// Table 3-2, in thesis units: V/in, V/(in s), V s/in, V s²/in.
    pub const TABLE_3_2_IN_THESIS_UNITS: Self = Self {
        proportional: 6.15,
        integral: 0.161,
        velocity_feedback: 0.005,
        acceleration_feedback: 0.0001,
        displacement_feedforward: 0.2,
        velocity_feedforward: 0.125,
        acceleration_feedforward: 0.0,
    };

    /// Table 3-2.
    pub fn table_3_2() -> Self {
        let g = Self::TABLE_3_2_IN_THESIS_UNITS;
        Self {
            proportional: g.proportional / INCH,
            integral: g.integral / INCH,
            velocity_feedback: g.velocity_feedback / INCH,
            acceleration_feedback: g.acceleration_feedback / INCH,
            displacement_feedforward: g.displacement_feedforward / INCH,
            velocity_feedforward: g.velocity_feedforward / INCH,
            acceleration_feedforward: g.acceleration_feedforward / INCH,
        }
    }

    /// The law as `u = K [rd rv ra]' - L [x v a]' + xi`: returns `(K, L)`.
    pub fn reference_and_feedback(&self) -> ([f64; 3], [f64; 3]) {
        let feedback = [
            self.proportional,
            self.velocity_feedback,
            self.acceleration_feedback,
        ];
        let reference = [
            self.proportional + self.displacement_feedforward,
            self.velocity_feedback + self.velocity_feedforward,
            self.acceleration_feedback + self.acceleration_feedforward,
        ];
        (reference, feedback)
    }
}

/// What three-variable control is told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ThreeVariableInput {
    /// Wanted motion.
    pub reference: Motion,
    /// Measured motion.
    pub measured: Motion,
}

impl ThreeVariableControl {
    /// The tuning of Table 3-2.
    pub fn table_3_2() -> Self {
        Self {
            gains: ThreeVariableGains::table_3_2(),
            limit: VALVE_LIMIT,
            integral: 0.0,
        }
    }
}

impl Default for ThreeVariableControl {
    fn default() -> Self {
        Self::table_3_2()
    }
}

impl Controller for ThreeVariableControl {
    type Input = ThreeVariableInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }

    fn step(&mut self, input: &ThreeVariableInput, period: f64) -> f64 {
        let ThreeVariableInput {
            reference: r,
            measured: y,
        } = input;
        let (k, l) = self.gains.reference_and_feedback();
        let others = k[0] * r.displacement + k[1] * r.velocity + k[2] * r.acceleration
            - l[0] * y.displacement
            - l[1] * y.velocity
            - l[2] * y.acceleration;
        let increment = self.gains.integral * (r.displacement - y.displacement) * period;
        limit_and_integrate(&mut self.integral, increment, others, self.limit)
    }

    fn reset(&mut self) {
        self.integral = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sampled_law_is_the_sum_of_its_terms() {
        let mut law = ThreeVariableControl::table_3_2();
        let g = law.gains;
        let input = ThreeVariableInput {
            reference: Motion {
                displacement: 0.01,
                velocity: 0.1,
                acceleration: 1.0,
            },
            measured: Motion {
                displacement: 0.008,
                velocity: 0.12,
                acceleration: 0.7,
            },
        };
        let expected = g.proportional * 0.002
            + g.integral * 0.002 * 0.002
            + g.displacement_feedforward * 0.01
            + g.velocity_feedback * -0.02
            + g.velocity_feedforward * 0.1
            + g.acceleration_feedback * 0.3;
        assert!((law.step(&input, 0.002) - expected).abs() < 1e-12);
    }

    #[test]
    fn each_gain_acts_on_its_own_signal() {
        // Eight gains that no other sum gives: u = Kp e + xi + Kfd rd + Kbv (rv - v) + Kfv rv
        // + Kba (ra - a) + Kfa ra, xi = Ki h times the sum of e.
        let gains = ThreeVariableGains {
            proportional: 3.0,
            integral: 5.0,
            velocity_feedback: 0.7,
            acceleration_feedback: 0.011,
            displacement_feedforward: 1.3,
            velocity_feedforward: 0.17,
            acceleration_feedforward: 0.023,
        };
        let mut law = ThreeVariableControl {
            gains,
            limit: 100.0,
            integral: 0.0,
        };
        let period = 0.01;
        let (mut summed, mut largest) = (0.0, 0.0_f64);
        for k in 0..20 {
            let t = 0.3 * f64::from(k);
            let reference = Motion {
                displacement: t.sin(),
                velocity: t.cos(),
                acceleration: 9.0 * (1.7 * t).sin(),
            };
            let measured = Motion {
                displacement: 0.8 * t.cos(),
                velocity: -0.4 * t.sin(),
                acceleration: 5.0 * (0.6 * t).cos(),
            };
            let error = reference.displacement - measured.displacement;
            summed += gains.integral * period * error;
            let expected = gains.proportional * error
                + summed
                + gains.displacement_feedforward * reference.displacement
                + gains.velocity_feedback * (reference.velocity - measured.velocity)
                + gains.velocity_feedforward * reference.velocity
                + gains.acceleration_feedback * (reference.acceleration - measured.acceleration)
                + gains.acceleration_feedforward * reference.acceleration;
            let got = law.step(
                &ThreeVariableInput {
                    reference,
                    measured,
                },
                period,
            );
            assert!((got - expected).abs() < 1e-12, "{got} {expected}");
            largest = largest.max(summed.abs());
        }
        assert!(largest > 0.1, "the integral took part");
    }
}

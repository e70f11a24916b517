//! Minimal control synthesis: two gains that adapt themselves until the table moves as a model of first
//! order wants it (D. P. Stoten and H. Benchoubane, International Journal of Control 51, 1990; on shaking
//! tables D. P. Stoten and E. G. Gómez, Philosophical Transactions of the Royal Society A 359, 2001).

use units::constants::{INCH, STROKE};
use units::{Parameters, vocabulary};

use crate::pid::{VALVE_LIMIT, limit_and_integrate};
use crate::{Controller, ModelError, Motion};

/// `u = K x + Kr r` with `dK/dt = alpha y x + beta d(y x)/dt`, the same for `Kr` with `r`.
///
/// The reference model is `dx_m/dt = a (r - x_m)` and `y = x_m - x`. The table's motion is wanted to be a
/// given one, whose velocity is known: `r = x_d + v_d/a`, the model's inverse of it, makes `x_m` that
/// motion, so that nothing lags by the model.
///
/// A valve's velocity per volt `g` makes `K = -a/g`, `Kr = a/g` the gains with which the table moves as the
/// model; the law needs neither to know it nor the start near it. Integrals stand still while the
/// command is at its limit and they would push it further, and leak at `leak`, for noise alone would
/// raise them without end.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct MinimalControlSynthesis {
    /// a of the reference model, rad/s.
    #[parameter("rad/s", positive)]
    pub bandwidth: f64,
    /// alpha, V/(m3.s).
    #[parameter("V/(m3.s)", non_negative)]
    pub integral_adaptation: f64,
    /// beta, V/m3.
    #[parameter("V/m3", non_negative)]
    pub proportional_adaptation: f64,
    /// Rate at which what was learnt leaks away, 1/s.
    #[parameter("1/s", non_negative)]
    pub leak: f64,
    /// Kr and -K at the start, V/m.
    #[parameter("V/m" => "V/in", finite)]
    pub initial_gain: f64,
    /// Largest magnitude of the valve command, V.
    pub limit: f64,
    /// What was learnt beyond the start: `K`, `Kr`, V/m.
    pub learnt: [f64; 2],
}

/// What the law is told.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct MinimalControlSynthesisInput {
    /// Wanted motion; its acceleration is not used.
    pub reference: Motion,
    /// Wanted displacement at the time that is measured, m.
    pub wanted: f64,
    /// Measured displacement, m.
    pub measured: f64,
}

impl Default for MinimalControlSynthesis {
    /// For the identified rig (Eq 2-13, 2-28), from nothing learnt.
    fn default() -> Self {
        Self::around(6.0 / INCH, 12.0)
    }
}

impl MinimalControlSynthesis {
    /// From a displacement gain (V/m) that holds the table, as the start, and the bandwidth (rad/s) that
    /// it has: at a stroke of 1.5 in the adaptation adds at most a quarter of the gain at once, and
    /// `alpha/beta` is 10 1/s, as the authors have it.
    pub fn around(gain: f64, bandwidth: f64) -> Self {
        let beta = 0.25 * gain / (2.0 * STROKE * STROKE);
        Self {
            bandwidth,
            integral_adaptation: 10.0 * beta,
            proportional_adaptation: beta,
            leak: 0.05,
            initial_gain: gain,
            limit: VALVE_LIMIT,
            learnt: [0.0; 2],
        }
    }

    /// `[K, Kr]` now without their proportional part, V/m.
    pub fn gains(&self) -> [f64; 2] {
        [
            self.learnt[0] - self.initial_gain,
            self.learnt[1] + self.initial_gain,
        ]
    }
}

impl Controller for MinimalControlSynthesis {
    type Input = MinimalControlSynthesisInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        ModelError::require_positive(vocabulary::VALVE_LIMIT, self.limit)
    }

    fn step(&mut self, input: &MinimalControlSynthesisInput, period: f64) -> f64 {
        let own = [
            input.measured,
            input.reference.displacement + input.reference.velocity / self.bandwidth,
        ];
        let error = input.wanted - input.measured;
        let left = (-self.leak * period).exp();
        self.learnt = self.learnt.map(|gain| left * gain);
        let gains = self.gains();
        let fixed: f64 = gains.iter().zip(own).map(|(gain, own)| gain * own).sum();
        let square: f64 = own.iter().map(|own| own * own).sum();
        let others = fixed + self.proportional_adaptation * error * square;
        // What adaptation adds to the command: alpha h y (x² + r²).
        let rate = self.integral_adaptation * period * error;
        let mut taken = 0.0;
        let command = limit_and_integrate(&mut taken, rate * square, others, self.limit);
        if taken != 0.0 {
            for (gain, own) in self.learnt.iter_mut().zip(own) {
                *gain += rate * own;
            }
        }
        command
    }

    fn reset(&mut self) {
        self.learnt = [0.0; 2];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A valve that gives a velocity and nothing else: Erzberger's conditions hold exactly, and the gains
    /// have a closed form.
    #[test]
    fn gains_that_start_from_nothing_become_those_of_the_model() {
        let (velocity, h) = (0.05, 0.002);
        let mut law = MinimalControlSynthesis {
            integral_adaptation: 4e7,
            proportional_adaptation: 4e6,
            leak: 0.0,
            initial_gain: 0.0,
            ..MinimalControlSynthesis::default()
        };
        let expected = law.bandwidth / velocity;
        let mut x = 0.0;
        let (mut first, mut last) = (0.0_f64, 0.0_f64);
        for k in 0..60_000 {
            let t = h * f64::from(k);
            let motion = |t: f64| {
                let (slow, fast) = (3.0 * t, 11.0 * t);
                Motion {
                    displacement: 0.012 * slow.sin() + 0.006 * fast.sin(),
                    velocity: 0.036 * slow.cos() + 0.066 * fast.cos(),
                    acceleration: 0.0,
                }
            };
            let reference = motion(t);
            let error = (reference.displacement - x).abs();
            if k < 500 {
                first = first.max(error);
            } else if k > 59_000 {
                last = last.max(error);
            }
            let input = MinimalControlSynthesisInput {
                reference,
                wanted: reference.displacement,
                measured: x,
            };
            x += h * velocity * law.step(&input, h);
        }
        let [k, kr] = law.gains();
        println!("{k} {kr} of {expected}, error {first} to {last}");
        assert!(last < 0.02 * first, "{first} {last}");
        assert!((kr / expected - 1.0).abs() < 0.05, "{kr} {expected}");
        assert!((k / -expected - 1.0).abs() < 0.05, "{k} {expected}");
    }

    #[test]
    fn at_the_limit_nothing_is_learnt_that_pushes_further() {
        let mut law = MinimalControlSynthesis::default();
        let far = MinimalControlSynthesisInput {
            reference: Motion {
                displacement: 0.2,
                ..Motion::default()
            },
            wanted: 0.2,
            measured: -0.2,
        };
        assert_eq!(law.step(&far, 0.002), law.limit);
        assert_eq!(law.learnt, [0.0; 2]);
    }
}

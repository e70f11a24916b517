//! Adaptive inverse control of a table (B. Widrow and E. Walach, Adaptive Inverse Control, 1996): an inverse of the rig
//! that learns by the filtered-x least mean squares while the motion goes on. On hydraulic tables G. Shen,
//! S.-T. Zheng, Z.-M. Ye, D.-C. Cong and J.-W. Han (Journal of Vibration and Control 17, 2011) have an inverse model
//! and an adaptive filter of acceleration so.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, DVector, SVector};
use plant::linear::log_space;
use units::constants::{INCH, SAMPLING_PERIOD};
use units::{Parameters as _, vocabulary};

use crate::aids::rig::{KnownRig, MAXIMUM_DELAY};
use crate::pid::VALVE_LIMIT;
use crate::preview::model::{STATES, SampledRig};
use crate::robustness::LateRig;
use crate::{Controller, ModelError, Motion};

/// Taps of the inverse.
pub const TAPS: usize = 32;
/// Samples by which the motion of its first tap is ahead.
pub const LEAD: usize = 16;
/// Band in which the inverse of the model is fitted, Hz.
const BAND: (f64, f64) = (0.25, 20.0);
/// Weight of its taps beside the fit, relative.
const RIDGE: f64 = 1e-6;

/// What the law is built from.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct Parameters {
    /// The rig.
    pub rig: KnownRig,
    /// Gain that holds the displacement, V/m.
    #[parameter("V/m" => "V/in", min = 0.0, non_negative)]
    pub hold_gain: f64,
    /// mu; 0: nothing is learnt.
    ///
    /// Below 2.
    #[parameter(min = 0.0, max = 2.0, non_negative)]
    pub adaptation: f64,
    /// Rate at which what was learnt leaks away, 1/s.
    #[parameter("1/s", min = 0.0, non_negative)]
    pub leak: f64,
    /// Largest magnitude of the valve command, V.
    pub limit: f64,
    /// Sampling period, s.
    pub period: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            rig: KnownRig::default(),
            hold_gain: 2.0 / INCH,
            adaptation: 0.005,
            leak: 0.05,
            limit: VALVE_LIMIT,
            period: SAMPLING_PERIOD,
        }
    }
}

impl Parameters {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first with which the law cannot run.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.rig.validate()?;
        self.check()?;
        if self.adaptation >= 2.0 {
            return Err(ModelError::Parameter {
                name: Self::ADAPTATION,
                value: self.adaptation,
                expected: "less than 2, above which the weights diverge",
            });
        }
        ModelError::require_positive(vocabulary::VALVE_LIMIT, self.limit)?;
        ModelError::require_positive("period", self.period)
    }
}

/// What the law is told.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct AdaptiveInverseInput {
    /// Wanted velocity [`LEAD`] samples ahead, m/s.
    pub ahead: f64,
    /// Wanted motion at the time that is measured; its velocity is not used.
    pub reference: Motion,
    /// Measured motion; its velocity is not used.
    pub measured: Motion,
}

/// What the law remembers: plain data.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Memory {
    /// What was learnt beyond the model's inverse, V s/m.
    learnt: [f64; TAPS],
    /// Wanted velocities, the furthest ahead first, m/s.
    wanted: [f64; TAPS],
    /// What the model's acceleration answers to them, taken for volts, m/s².
    filtered: [f64; TAPS],
    /// State of the model.
    model: [f64; STATES],
    /// Its displacement and acceleration, the latest first.
    heard: [[f64; 2]; MAXIMUM_DELAY + 1],
    saturated: bool,
}

/// `u = sum_i w_i v_d(k + LEAD - i) + K (x_d - x)`, `w_i -= mu e x_i/(eps + sum x²)` a sample: `e` is the error of the
/// measured acceleration, `x_i` what the model of the held rig makes of `v_d(k + LEAD - i)`. The taps are at
/// first those of the model's inverse, `1/P_v` in least squares.
#[derive(Debug, Clone, PartialEq)]
pub struct AdaptiveInverse {
    parameters: Parameters,
    rig: SampledRig,
    /// The model's inverse, V s/m.
    inverse: [f64; TAPS],
    /// The law's memory.
    pub memory: Memory,
}

impl AdaptiveInverse {
    /// Finds the model's inverse.
    ///
    /// # Errors
    /// What [`Parameters::validate`] refuses; a rig that does not move.
    pub fn new(parameters: Parameters) -> Result<Self, ModelError> {
        parameters.validate()?;
        let period = parameters.period;
        Ok(Self {
            rig: parameters.rig.model().sample(period),
            inverse: inverse(&parameters.rig, period)?,
            memory: Memory::default(),
            parameters,
        })
    }

    /// What it was built from.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The taps now, V s/m.
    pub fn weights(&self) -> [f64; TAPS] {
        std::array::from_fn(|i| self.inverse[i] + self.memory.learnt[i])
    }
}

/// Taps on the wanted velocity, the furthest ahead first, which move the table as wanted in least squares.
fn inverse(rig: &KnownRig, period: f64) -> Result<[f64; TAPS], ModelError> {
    let late = LateRig::new(&rig.state_space(None), 0.0, period)?;
    let mut normal = DMatrix::<f64>::zeros(TAPS, TAPS);
    let mut right = DVector::<f64>::zeros(TAPS);
    for hertz in log_space(BAND.0, BAND.1, 200) {
        let omega = TAU * hertz;
        let velocity = late.responses(omega)[1];
        let row: Vec<Complex<f64>> = (0..TAPS)
            .map(|i| {
                let ahead = (LEAD as f64 - i as f64) * period;
                velocity * Complex::new(0.0, omega * ahead).exp()
            })
            .collect();
        for part in [|c: &Complex<f64>| c.re, |c: &Complex<f64>| c.im] {
            let row = DVector::from_iterator(TAPS, row.iter().map(part));
            normal += &row * row.transpose();
            right += &row * part(&Complex::new(1.0, 0.0));
        }
    }
    let ridge = RIDGE * normal.trace() / TAPS as f64;
    normal += DMatrix::identity(TAPS, TAPS) * ridge;
    let found = normal.cholesky().ok_or(ModelError::NoSolution {
        equation: "the least squares of the rig's inverse",
        reason: "the valve does not move the table".into(),
    })?;
    let found = found.solve(&right);
    Ok(std::array::from_fn(|i| found[i]))
}

/// Squares of the filtered motion below which little is learnt, (m/s²)² a tap.
const QUIET: f64 = 2.5e-3;

impl Controller for AdaptiveInverse {
    type Input = AdaptiveInverseInput;
    /// Valve command, V.
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.parameters.validate()
    }

    fn step(&mut self, input: &AdaptiveInverseInput, period: f64) -> f64 {
        let p = &self.parameters;
        let memory = &mut self.memory;
        let delay = p.rig.delay.min(MAXIMUM_DELAY);
        // The held model, whose valve gets the wanted velocity.
        let x = SVector::from(memory.model);
        let y = self.rig.c * x;
        memory.heard.rotate_right(1);
        memory.heard[0] = [y[0], y[2]];
        let [displacement, acceleration] = memory.heard[delay];
        let command = input.ahead - p.hold_gain * displacement;
        memory.model = self.rig.advance(&x, command, [0.0; 2]).into();
        memory.filtered.rotate_right(1);
        memory.filtered[0] = acceleration;
        memory.wanted.rotate_right(1);
        memory.wanted[0] = input.ahead;

        if !memory.saturated {
            let error = input.measured.acceleration - input.reference.acceleration;
            let power: f64 = memory.filtered.iter().map(|own| own * own).sum();
            let rate = p.adaptation * error / (QUIET * TAPS as f64 + power);
            let left = (-p.leak * period).exp();
            for (weight, own) in memory.learnt.iter_mut().zip(memory.filtered) {
                *weight = left * *weight - rate * own;
            }
        }
        let mut command =
            p.hold_gain * (input.reference.displacement - input.measured.displacement);
        for i in 0..TAPS {
            command += (self.inverse[i] + memory.learnt[i]) * memory.wanted[i];
        }
        let sent = command.clamp(-p.limit, p.limit);
        memory.saturated = sent != command;
        sent
    }

    fn reset(&mut self) {
        self.memory = Memory::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parts of the wanted velocity: angular frequency (rad/s) and amplitude (m/s).
    const PARTS: [(f64, f64); 4] = [(4.0, 0.05), (11.0, 0.05), (23.0, 0.04), (47.0, 0.03)];

    /// Error over the wanted acceleration, first and last, on a rig whose valve does `gain` of what the law
    /// takes it to do; and the law at the end.
    fn learn(adaptation: f64, gain: f64) -> ([f64; 2], AdaptiveInverse) {
        let known = KnownRig {
            delay: 1,
            ..KnownRig::default()
        };
        let mut law = AdaptiveInverse::new(Parameters {
            rig: known,
            adaptation,
            leak: 0.0,
            ..Parameters::default()
        })
        .unwrap();
        let period = law.parameters().period;
        let rig = known.model().sample(period);
        let wanted = |k: f64| {
            let t = period * k;
            let sum = |by: i32, shift: f64| -> f64 {
                PARTS
                    .iter()
                    .map(|(w, v): &(f64, f64)| v * w.powi(by) * (w * t + shift).sin())
                    .sum()
            };
            Motion {
                displacement: sum(-1, 0.0),
                velocity: sum(0, 0.25 * TAU),
                acceleration: -sum(1, 0.0),
            }
        };
        let mut x = SVector::<f64, STATES>::zeros();
        let mut before = Motion::default();
        let mut sums = [[0.0; 2]; 2];
        let count = 30_000;
        for k in 0..count {
            let y = rig.c * x;
            let now = wanted(f64::from(k));
            let place = if k < 2500 { 0 } else { 1 };
            if k > count - 2500 || (500..2500).contains(&k) {
                sums[place][0] += (y[2] - now.acceleration).powi(2);
                sums[place][1] += now.acceleration.powi(2);
            }
            let input = AdaptiveInverseInput {
                ahead: wanted(f64::from(k) + LEAD as f64).velocity,
                reference: wanted(f64::from(k) - 1.0),
                measured: before,
            };
            before = Motion {
                displacement: y[0],
                velocity: y[1],
                acceleration: y[2],
            };
            let command = law.step(&input, period);
            x = rig.advance(&x, gain * command, [0.0; 2]);
        }
        (sums.map(|[error, wanted]| (error / wanted).sqrt()), law)
    }

    fn errors(adaptation: f64, gain: f64) -> [f64; 2] {
        learn(adaptation, gain).0
    }

    /// Where the motion has power, the taps come to `1/(gain P_v)`, the inverse of the rig that they drive.
    #[test]
    fn the_taps_converge_to_the_inverse_in_closed_form() {
        let gain = 0.8;
        let (_, law) = learn(0.02, gain);
        let (known, period) = (law.parameters().rig, law.parameters().period);
        let rig = LateRig::new(&known.state_space(None), 0.0, period).unwrap();
        let off = |taps: [f64; TAPS], omega: f64| {
            let response: Complex<f64> = (0..TAPS)
                .map(|i| {
                    let ahead = (LEAD as f64 - i as f64) * period;
                    taps[i] * Complex::new(0.0, omega * ahead).exp()
                })
                .sum();
            (response * rig.responses(omega)[1] * gain - 1.0).norm()
        };
        for (omega, _) in PARTS {
            let (before, after) = (off(law.inverse, omega), off(law.weights(), omega));
            println!("{omega} rad/s: off by {before:.4}, learnt {after:.4}");
            assert!((before - 0.2).abs() < 0.03, "{before}");
            assert!(after < 0.02, "{after}");
        }
    }

    #[test]
    fn the_inverse_of_the_model_follows_and_another_rig_is_learnt() {
        let exact = errors(0.0, 1.0);
        let [first, last] = errors(0.02, 0.8);
        let fixed = errors(0.0, 0.8);
        println!("{exact:?} {fixed:?} {first} {last}");
        assert!(exact[1] < 0.02, "{exact:?}");
        assert!(
            last < 0.2 * fixed[1] && last < 0.5 * first,
            "{first} {last}"
        );
    }

    #[test]
    fn parameters_that_make_no_law_are_refused_by_name() {
        let refused = |change: fn(&mut Parameters)| {
            let mut parameters = Parameters::default();
            change(&mut parameters);
            AdaptiveInverse::new(parameters).unwrap_err().to_string()
        };
        assert!(refused(|p| p.adaptation = 2.0).contains("`adaptation`"));
        assert!(refused(|p| p.hold_gain = -1.0).contains("`hold_gain`"));
        assert!(refused(|p| p.limit = 0.0).contains("`valve_limit`"));
    }
}

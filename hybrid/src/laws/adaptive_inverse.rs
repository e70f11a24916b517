//! Feed-forward by an inverse whose coefficients are estimated while the test runs.

use crate::vrths::{Deviation, TransferSystemParameters};

use super::extrapolation::{DERIVATIVES, Extrapolation};
use super::lag_chain::LagChain;
use super::{TrackingInput, held_inverse};
use controllers::{Controller, ModelError};

/// `u = sum_i a_i x_d^(i)(t + lead)` with coefficients from recursive estimation by instrumental
/// variables.
///
/// The actuator obeys `u = sum_i a_i x^(i)`. Both sides pass the same low-pass filter, so that no
/// noise is differentiated. Regressors are the filtered derivatives of the measured displacement;
/// those of the desired displacement, which carries no sensor noise, are the instruments (Young
/// 1970): noise then does not bias the estimate. It starts from a nominal plant and from how far
/// the coefficients of its family spread together, so that what one of them tells moves the
/// others, and it takes a prior's place where the motion tells nothing.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AdaptiveInverse {
    /// Coefficients at the start, s^i.
    pub nominal: [f64; DERIVATIVES],
    /// Their covariance at the start, s^(i + j).
    pub covariance: [[f64; DERIVATIVES]; DERIVATIVES],
    /// Variance of the filtered equation's error, times its correlation in samples, m².
    pub error_variance: f64,
    /// Corner of each lag of the filter, rad/s.
    pub corner: f64,
    /// Where the derivatives of the desired displacement come from.
    pub desired: Extrapolation,
    /// What the law remembers.
    pub memory: AdaptiveInverseMemory,
}

/// Memory of [`AdaptiveInverse`]; coefficients are scaled by `corner^i`.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct AdaptiveInverseMemory {
    started: bool,
    coefficients: [f64; DERIVATIVES],
    covariance: [[f64; DERIVATIVES]; DERIVATIVES],
    command: LagChain,
    measured: LagChain,
    instrument: LagChain,
    last_command: f64,
    last_input: TrackingInput,
}

impl AdaptiveInverse {
    /// Standard deviation of the specimen's stiffness at the start, N/m: a third of the nominal
    /// one, which is as good as unknown.
    pub const STIFFNESS_DEVIATION: f64 = 4e5;
    /// Lead of the desired displacement, samples: how old the force is, in the mean, that the
    /// numerical substructure gets.
    pub const LEAD: f64 = 1.5;
    /// Corner of each lag of the filter, rad/s: above the frames' first two modes, where the
    /// motion tells most.
    pub const CORNER: f64 = 180.0;
    /// Variance of the filtered equation's error times its correlation, m².
    pub const ERROR_VARIANCE: f64 = 2e-10;

    /// For the benchmark, sampled every `period` (s): its nominal plant and spread, but for a
    /// stiffness of the specimen that is as good as unknown.
    ///
    /// # Errors
    /// None with these constants.
    pub fn benchmark(period: f64) -> Result<Self, ModelError> {
        Self::around(&TransferSystemParameters::default(), period)
    }

    /// The same around another plant.
    ///
    /// # Errors
    /// None with these constants.
    pub fn around(nominal: &TransferSystemParameters, period: f64) -> Result<Self, ModelError> {
        let deviation = Deviation {
            specimen_stiffness: Self::STIFFNESS_DEVIATION,
            ..Deviation::default()
        };
        Self::for_family(nominal, &deviation, period, Self::LEAD)
    }

    /// For a family of plants around `nominal`.
    ///
    /// # Errors
    /// None with the default window.
    pub fn for_family(
        nominal: &TransferSystemParameters,
        deviation: &Deviation,
        period: f64,
        lead: f64,
    ) -> Result<Self, ModelError> {
        let centre = held_inverse(nominal.inverse(), period);
        let mut covariance = [[0.0; DERIVATIVES]; DERIVATIVES];
        for direction in 0..4 {
            let mut by = [0.0; 4];
            by[direction] = 1.0;
            let there = held_inverse(deviation.moved(nominal, by).inverse(), period);
            let moved: [f64; DERIVATIVES] = std::array::from_fn(|i| there[i] - centre[i]);
            for i in 0..DERIVATIVES {
                for j in 0..DERIVATIVES {
                    covariance[i][j] += moved[i] * moved[j];
                }
            }
        }
        // What the family does not know of: a thousandth of each coefficient.
        for i in 0..DERIVATIVES {
            covariance[i][i] += (1e-3 * centre[i]).powi(2);
        }
        Ok(Self {
            nominal: centre,
            covariance,
            error_variance: Self::ERROR_VARIANCE,
            corner: Self::CORNER,
            desired: Extrapolation::new(5, 16, lead)?,
            memory: AdaptiveInverseMemory::default(),
        })
    }

    fn start(&mut self) {
        let scale: [f64; DERIVATIVES] = std::array::from_fn(|i| self.corner.powi(i as i32));
        let memory = &mut self.memory;
        for i in 0..DERIVATIVES {
            memory.coefficients[i] = self.nominal[i] * scale[i];
            for j in 0..DERIVATIVES {
                memory.covariance[i][j] = self.covariance[i][j] * scale[i] * scale[j];
            }
        }
        memory.started = true;
    }

    /// The coefficients as they are now, s^i.
    pub fn coefficients(&self) -> [f64; DERIVATIVES] {
        if !self.memory.started {
            return self.nominal;
        }
        std::array::from_fn(|i| self.memory.coefficients[i] / self.corner.powi(i as i32))
    }

    /// Takes in the readings of a sample and the command that was computed from them.
    fn adapt(&mut self, input: &TrackingInput, period: f64) {
        let variance = self.error_variance;
        let memory = &mut self.memory;
        let command = memory
            .command
            .step(memory.last_command, self.corner, period)
            .value();
        let regressor = memory
            .measured
            .step(input.measured, self.corner, period)
            .differences();
        let instrument = memory
            .instrument
            .step(input.desired, self.corner, period)
            .differences();
        let mut weighted = [0.0; DERIVATIVES];
        for i in 0..DERIVATIVES {
            for j in 0..DERIVATIVES {
                weighted[i] += memory.covariance[i][j] * instrument[j];
            }
        }
        let mut spread = variance;
        let mut error = command;
        for i in 0..DERIVATIVES {
            spread += instrument[i] * weighted[i];
            error -= regressor[i] * memory.coefficients[i];
        }
        for i in 0..DERIVATIVES {
            let gain = weighted[i] / spread;
            memory.coefficients[i] += gain * error;
            for j in 0..DERIVATIVES {
                memory.covariance[i][j] -= gain * weighted[j];
            }
        }
    }
}

impl Controller for AdaptiveInverse {
    type Input = TrackingInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        for coefficient in self.nominal {
            ModelError::require_finite("coefficients", coefficient)?;
        }
        for variance in self.covariance.as_flattened() {
            ModelError::require_finite("covariance", *variance)?;
        }
        ModelError::require_positive("error_variance", self.error_variance)?;
        ModelError::require_positive("corner", self.corner)
    }

    fn step(&mut self, input: &TrackingInput, period: f64) -> f64 {
        if !self.memory.started {
            self.start();
        }
        let last = self.memory.last_input;
        self.adapt(&last, period);
        let desired = self.desired.step(input.desired, period);
        let (mut command, mut scale) = (0.0, 1.0);
        for (a, x) in self.memory.coefficients.iter().zip(&desired) {
            command += a * x * scale;
            scale /= self.corner;
        }
        (self.memory.last_command, self.memory.last_input) = (command, *input);
        command
    }

    fn reset(&mut self) {
        self.memory = AdaptiveInverseMemory::default();
        self.desired.reset();
    }
}

#[cfg(test)]
mod tests {
    use crate::vrths::{InteractionForm, PERIOD, SensorNoise, TransferSystem};
    use plant::sensors::channel::Noise;

    use super::*;

    /// A smooth start and four sines between 1 and 17 Hz, m.
    fn wanted(t: f64) -> f64 {
        let ramp = (t / 2.0).min(1.0).powi(3);
        [(1.1, 1e-3), (3.6, 1e-3), (9.0, 1e-4), (17.0, 3e-5)]
            .iter()
            .map(|(hertz, peak)| ramp * peak * (std::f64::consts::TAU * hertz * t).sin())
            .sum()
    }

    #[test]
    fn the_coefficients_of_a_plant_it_was_not_told_are_found_through_noise() {
        let plant = TransferSystemParameters {
            specimen_stiffness: 0.6e6,
            valve_beta2: 1.06e5,
            ..TransferSystemParameters::default()
        };
        let mut system =
            TransferSystem::new(plant, InteractionForm::TransferFunction, PERIOD).unwrap();
        let mut law = AdaptiveInverse::benchmark(PERIOD).unwrap();
        let noise = SensorNoise::default().displacement;
        let start = law.coefficients();
        let mut late: f64 = 0.0;
        for k in 0..30 * 4096 {
            let t = k as f64 * PERIOD;
            let draw = Noise {
                seed: 3,
                channel: 0,
                sample: k,
            };
            let input = TrackingInput {
                desired: wanted(t),
                measured: system.state.displacement + noise * draw.gaussian(),
                force: 0.0,
            };
            if t > 10.0 {
                let led = wanted(t + AdaptiveInverse::LEAD * PERIOD);
                late = late.max((system.state.displacement - led).abs());
            }
            let command = law.step(&input, PERIOD);
            system.step(command);
        }
        let truth = held_inverse(plant.inverse(), PERIOD);
        let found = law.coefficients();
        for (i, within) in [2e-3, 5e-3, 0.02].into_iter().enumerate() {
            let off = (found[i] / truth[i] - 1.0).abs();
            assert!(off < within, "{i}: {start:?} {found:?} {truth:?}");
        }
        assert!(late < 1.5e-5, "{late:e}");
    }

    #[test]
    fn without_motion_nothing_is_learnt() {
        let mut law = AdaptiveInverse::benchmark(PERIOD).unwrap();
        let start = law.coefficients();
        for k in 0..40_960 {
            let draw = Noise {
                seed: 4,
                channel: 0,
                sample: k,
            };
            let input = TrackingInput {
                measured: 1.6e-5 * draw.gaussian(),
                ..TrackingInput::default()
            };
            assert_eq!(law.step(&input, PERIOD), 0.0);
        }
        for (now, before) in law.coefficients().iter().zip(start) {
            assert!((now / before - 1.0).abs() < 1e-12);
        }
    }
}

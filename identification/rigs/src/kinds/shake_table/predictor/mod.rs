//! One-step predictor in innovation form: `y(k) - C(x(k|k-1))` whitened, with a constant Kalman
//! gain.
//!
//! The plant is unstable without its controller, so a replay of the command would drift; a small
//! correction from the measured channels holds the model to the record, small enough that an
//! effect stays visible in the innovations. What drives the rig unseen is a coloured voltage beside the
//! command; a sensor's noise is white, with coloured parts where the records show them ([`learn`]).

mod learning;
mod linear;
mod noise;
mod simulation;

use plant::ModelError;
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState, STATES, SampledRig};

use recordings::{Channel, Recording};

pub use learning::{Innovations, Learned, learn};
use linear::Linear;
pub use noise::{Disturbance, Noise, total};

/// Sampling period beyond which friction and a fast spool get two steps a sample, s: 1 kHz needs none finer.
const LONGEST_FAST_STEP: f64 = 1.1e-3;

/// Kalman gain and whitening for one rig and one sampling period.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictor {
    period: f64,
    /// Corrections per innovation: continuous states that have one.
    gain: Vec<(usize, [f64; 4])>,
    /// Corrections of the accelerations one, two, ... samples ago.
    past_gain: Vec<[f64; 4]>,
    /// Parts of the coloured noises: of the voltage first, then those of the sensors.
    followers: Vec<Followed>,
    /// Inverse of the lower Cholesky factor of the innovations' covariance.
    whitening: [[f64; 4]; 4],
    /// Its inverse: from whitened innovations to SI.
    spread: [[f64; 4]; 4],
    /// Logarithm of the determinant of the innovations' covariance, in units of the noise.
    pub log_determinant: f64,
}

/// A part of a coloured noise and its corrections.
#[derive(Debug, Clone, PartialEq)]
struct Followed {
    /// A channel, or the voltage beside the command.
    channel: Option<usize>,
    part: Disturbance,
    gain: [[f64; 4]; 2],
}

/// A recording as the predictor walks through it: the command that acted and the four outputs
/// sample by sample, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// V.
    pub command: Vec<f64>,
    /// Displacement, acceleration, actuator force, specimen acceleration, sample by sample.
    pub channels: Vec<[f64; 4]>,
}

impl Samples {
    /// Those of `recording` under `command` (V); zeros in the place of an output that is missing.
    pub fn of(recording: &Recording, command: Vec<f64>) -> Self {
        let outputs = Channel::OUTPUTS.map(|channel| recording.samples(channel));
        let at = |k: usize| outputs.map(|values| values.get(k).copied().unwrap_or(0.0));
        Self {
            command,
            channels: (0..recording.len()).map(at).collect(),
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.command.len()
    }

    /// True without a sample.
    pub fn is_empty(&self) -> bool {
        self.command.is_empty()
    }
}

impl Predictor {
    /// Designs the gain on the linear part of `rig` for `noise`.
    ///
    /// # Errors
    /// A rig that cannot be simulated, or one for which there is no stabilising gain.
    pub fn design(rig: &IdentifiedRig, period: f64, noise: &Noise) -> Result<Self, ModelError> {
        let linear = Linear::design(rig, period, noise)?;
        let white = &noise.white;
        let row = |i: usize| {
            let mut row = [0.0; 4];
            for (j, &channel) in linear.measured.iter().enumerate() {
                row[channel] = linear.scale[i] * linear.gain[(i, j)] / white[channel];
            }
            row
        };
        let mut whitening = [[0.0; 4]; 4];
        let mut spread = [[0.0; 4]; 4];
        for (j, &channel) in linear.measured.iter().enumerate() {
            for (i, &other) in linear.measured.iter().enumerate() {
                whitening[other][channel] = linear.whiten[(i, j)] / white[channel];
                spread[other][channel] = linear.factor[(i, j)] * white[other];
            }
        }
        let states = linear.continuous.iter().enumerate();
        let mut gain: Vec<_> = states.map(|(i, &state)| (state, row(i))).collect();
        if let Some(follower) = rig.linear_part().follower() {
            gain.push((follower, row(5)));
        }
        let n = linear.continuous.len();
        let followers = linear.followers.iter().map(|follower| Followed {
            channel: follower.channel,
            part: follower.part,
            gain: [0, 1].map(|age| {
                let is_there = age < follower.part.order();
                if is_there {
                    row(follower.at + age)
                } else {
                    [0.0; 4]
                }
            }),
        });
        Ok(Self {
            period,
            gain,
            past_gain: (0..linear.past).map(|age| row(n + age)).collect(),
            followers: followers.collect(),
            whitening,
            spread,
            log_determinant: linear.log_determinant,
        })
    }

    /// Whitened innovations of `rig` on `samples`, four a sample, into `out` (which must have
    /// that length). A missing channel gives zeros. False where the prediction left the finite.
    pub fn innovations(&self, rig: &SampledRig, samples: &Samples, out: &mut [f64]) -> bool {
        self.disturbed_innovations(rig, samples, |_| 0.0, out)
    }

    /// As [`Self::innovations`] of a rig with a voltage (V) `added` beside the command of every sample.
    pub fn disturbed_innovations(
        &self,
        rig: &SampledRig,
        samples: &Samples,
        added: impl Fn(usize) -> f64,
        out: &mut [f64],
    ) -> bool {
        let mut state = IdentifiedRigState::default();
        let mut coloured = vec![[0.0; 2]; self.followers.len()];
        let mut slow = [0.0; 4];
        let rows = samples.command.iter().zip(&samples.channels);
        for (k, ((&command, measured), row)) in rows.zip(out.chunks_exact_mut(4)).enumerate() {
            let predicted = rig.measure(&mut state, k as f64 * self.period);
            let mut innovation = [0.0; 4];
            for i in 0..4 {
                innovation[i] = measured[i] - predicted[i] - slow[i];
            }
            for i in 0..4 {
                row[i] = dot(&self.whitening[i], &innovation);
            }
            for (state_index, gain) in &self.gain {
                state.continuous[*state_index % STATES] += dot(gain, &innovation);
            }
            for (age, gain) in self.past_gain.iter().enumerate() {
                rig.correct_past(&mut state, age, dot(gain, &innovation));
            }
            let disturbance = self.follow(&mut coloured, &innovation, &mut slow);
            rig.step_disturbed(&mut state, command, disturbance + added(k));
        }
        out.iter().all(|value| value.is_finite())
    }

    /// Corrects the coloured noises by an innovation: the voltage (V) that acts now, and in `slow` what each
    /// sensor's is expected to be in the next sample.
    fn follow(&self, coloured: &mut [[f64; 2]], innovation: &[f64; 4], slow: &mut [f64; 4]) -> f64 {
        let mut voltage = 0.0;
        *slow = [0.0; 4];
        for (follower, past) in self.followers.iter().zip(coloured) {
            past[0] += dot(&follower.gain[0], innovation);
            past[1] += dot(&follower.gain[1], innovation);
            match follower.channel {
                None => {
                    voltage += past[0];
                    follower.part.expect(past);
                }
                Some(channel) => slow[channel % 4] += follower.part.expect(past),
            }
        }
        voltage
    }

    /// An innovation in SI from a whitened one.
    pub fn physical(&self, whitened: &[f64; 4]) -> [f64; 4] {
        [0, 1, 2, 3].map(|i| dot(&self.spread[i], whitened))
    }

    /// Standard deviations of the innovations of a perfect model, SI.
    pub fn floor(&self) -> [f64; 4] {
        self.spread.map(|row| dot(&row, &row).sqrt())
    }

    /// Sampled form of `rig` for this predictor; friction and a fast spool get finer steps.
    ///
    /// # Errors
    /// A rig that cannot be simulated.
    pub fn sample(&self, rig: &IdentifiedRig) -> Result<SampledRig, ModelError> {
        let is_long = self.period > LONGEST_FAST_STEP;
        rig.sample(self.period, if is_long && rig.is_fast() { 2 } else { 1 })
    }
}

#[inline]
fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

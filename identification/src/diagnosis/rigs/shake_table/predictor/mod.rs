//! One-step predictor in innovation form: `y(k) - C(x(k|k-1))` whitened, with a constant Kalman
//! gain.
//!
//! The plant is unstable without its controller, so a replay of the command would drift; a small
//! correction from the measured channels holds the model to the record, small enough that an
//! effect stays visible in the innovations. What drives the rig unseen is a voltage `w` beside
//! the command, white or coloured: `w(k+1) = phi w(k) + sigma sqrt(1 - phi²) e(k)`.

use nalgebra::{DMatrix, DVector};
use plant::ModelError;
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState, STATES, SampledRig};
use plant::linear::discrete_riccati;

use crate::data::{Channel, Recording};

/// The unseen voltage beside the command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    /// Standard deviation, V.
    pub sigma: f64,
    /// Correlation from sample to sample.
    pub phi: f64,
}

impl Disturbance {
    /// What a servo valve adds to a command recorded with `command_noise` (V): eight times that
    /// noise, with a corner at 30 Hz.
    pub fn beside_command(command_noise: f64, period: f64) -> Self {
        Self {
            sigma: 8.0 * command_noise.max(1e-5),
            phi: (-std::f64::consts::TAU * 30.0 * period).exp(),
        }
    }
}

/// Kalman gain and whitening for one rig and one sampling period.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictor {
    period: f64,
    /// Correlation of the disturbance from sample to sample.
    phi: f64,
    /// Corrections per innovation: continuous states that have one.
    gain: Vec<(usize, [f64; 4])>,
    disturbance_gain: [f64; 4],
    /// Corrections of the accelerations one, two, ... samples ago.
    past_gain: Vec<[f64; 4]>,
    /// Inverse of the lower Cholesky factor of the innovations' covariance.
    whitening: [[f64; 4]; 4],
    /// Its inverse: from whitened innovations to SI.
    spread: [[f64; 4]; 4],
    /// Logarithm of the determinant of the innovations' covariance, in units of the noise.
    pub log_determinant: f64,
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
    /// Designs the gain on the linear part of `rig` for channels with `noise` (one standard
    /// deviation, SI; infinite for a channel that is missing).
    ///
    /// # Errors
    /// A rig that cannot be simulated, or one for which there is no stabilising gain.
    pub fn design(
        rig: &IdentifiedRig,
        period: f64,
        noise: [f64; 4],
        disturbance: Disturbance,
    ) -> Result<Self, ModelError> {
        let rig = rig.linear_part();
        let sampled = rig.sample(period, 2)?;
        let continuous = rig.active_states();
        let late = (rig.sensors.acceleration.delay / period).floor();
        let past = if rig.sensors.acceleration.delay > 0.0 {
            late as usize + 1
        } else {
            0
        };
        let n = continuous.len();
        let order = n + 1 + past;
        let mut undelayed = rig;
        undelayed.sensors.acceleration.delay = 0.0;
        let undelayed = undelayed.sample(period, 1)?;

        // The linear system, column by column from unit perturbations (balanced below).
        let mut a = DMatrix::<f64>::zeros(order, order);
        let mut c = DMatrix::<f64>::zeros(4, order);
        for j in 0..=n {
            let mut state = IdentifiedRigState::default();
            if j < n {
                state.continuous[continuous[j]] = 1.0;
            }
            let now = undelayed.measure(&mut state, 0.0);
            let acceleration = undelayed.motion(&state).acceleration;
            for i in 0..4 {
                c[(i, j)] = now[i];
            }
            if past > 0 {
                c[(1, j)] -= (1.0 + rig.sensors.acceleration.scale_error) * acceleration;
                a[(n + 1, j)] = acceleration;
            }
            sampled.step_disturbed(&mut state, 0.0, if j < n { 0.0 } else { 1.0 });
            for (i, &index) in continuous.iter().enumerate() {
                a[(i, j)] = state.continuous[index];
            }
        }
        a[(n, n)] = disturbance.phi;
        if past > 0 {
            let samples = rig.sensors.acceleration.delay / period;
            let (whole, fraction) = (late as usize, samples - late);
            let scale = 1.0 + rig.sensors.acceleration.scale_error;
            // Past accelerations: entry 1 is one sample old.
            for (age, weight) in [(whole, 1.0 - fraction), (whole + 1, fraction)] {
                if age == 0 {
                    for j in 0..n {
                        let mut state = IdentifiedRigState::default();
                        state.continuous[continuous[j]] = 1.0;
                        c[(1, j)] += scale * weight * undelayed.motion(&state).acceleration;
                    }
                } else {
                    c[(1, n + age)] += scale * weight;
                }
            }
            for age in 2..=past {
                a[(n + age, n + age - 1)] = 1.0;
            }
        }

        // Balance: scale states by their response to the disturbance.
        let drive = disturbance.sigma * (1.0 - disturbance.phi * disturbance.phi).sqrt();
        let mut response = DVector::<f64>::zeros(order);
        response[n] = 1.0;
        let mut scale = DVector::<f64>::from_element(order, 1e-12);
        for _ in 0..300 {
            for i in 0..order {
                scale[i] = scale[i].max(response[i].abs());
            }
            response = &a * &response;
        }
        let shows_specimen = rig.specimen.is_some();
        let measured: Vec<usize> = (0..4)
            .filter(|&i| noise[i].is_finite() && (shows_specimen || i < 3))
            .collect();
        let a = DMatrix::from_fn(order, order, |i, j| a[(i, j)] * scale[j] / scale[i]);
        let c = DMatrix::from_fn(measured.len(), order, |i, j| {
            c[(measured[i], j)] * scale[j] / noise[measured[i]]
        });
        let r = DMatrix::identity(measured.len(), measured.len());
        let mut q = DMatrix::identity(order, order) * (1e-3 * drive).powi(2);
        q[(n, n)] = (drive / scale[n]).powi(2);
        if !a
            .iter()
            .chain(c.iter())
            .all(|value| value.is_finite() && value.abs() < 1e12)
        {
            return Err(ModelError::NoSolution {
                equation: "the predictor's Riccati equation",
                reason: "the sampled rig is not finite".into(),
            });
        }
        let p = discrete_riccati(&a.transpose(), &c.transpose(), &q, &r)?;
        let s = &c * &p * c.transpose() + &r;
        let no_solution = || ModelError::NoSolution {
            equation: "the predictor's Riccati equation",
            reason: "the innovations have no covariance".into(),
        };
        let inverse = s.clone().try_inverse().ok_or_else(no_solution)?;
        let k = &p * c.transpose() * inverse;
        let log_determinant = s.determinant().ln();
        let factor = s.cholesky().ok_or_else(no_solution)?.l();
        let whiten = factor.clone().try_inverse().ok_or_else(no_solution)?;
        let row = |i: usize| {
            let mut row = [0.0; 4];
            for (j, &channel) in measured.iter().enumerate() {
                row[channel] = scale[i] * k[(i, j)] / noise[channel];
            }
            row
        };
        let mut whitening = [[0.0; 4]; 4];
        let mut spread = [[0.0; 4]; 4];
        for (j, &channel) in measured.iter().enumerate() {
            for i in 0..measured.len() {
                whitening[measured[i]][channel] = whiten[(i, j)] / noise[channel];
                spread[measured[i]][channel] = factor[(i, j)] * noise[measured[i]];
            }
        }
        let mut gain: Vec<_> = (0..n).map(|i| (continuous[i], row(i))).collect();
        if let Some(follower) = rig.follower() {
            gain.push((follower, row(5)));
        }
        Ok(Self {
            period,
            phi: disturbance.phi,
            gain,
            disturbance_gain: row(n),
            past_gain: (1..=past).map(|age| row(n + age)).collect(),
            whitening,
            spread,
            log_determinant,
        })
    }

    /// Whitened innovations of `rig` on `samples`, four a sample, into `out` (which must have
    /// that length). A missing channel gives zeros. False where the prediction left the finite.
    pub fn innovations(&self, rig: &SampledRig, samples: &Samples, out: &mut [f64]) -> bool {
        let mut state = IdentifiedRigState::default();
        let mut disturbance = 0.0;
        let rows = samples.command.iter().zip(&samples.channels);
        for (k, ((&command, measured), row)) in rows.zip(out.chunks_exact_mut(4)).enumerate() {
            let predicted = rig.measure(&mut state, k as f64 * self.period);
            let mut innovation = [0.0; 4];
            for i in 0..4 {
                innovation[i] = measured[i] - predicted[i];
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
            disturbance += dot(&self.disturbance_gain, &innovation);
            rig.step_disturbed(&mut state, command, disturbance);
            disturbance *= self.phi;
        }
        out.iter().all(|value| value.is_finite())
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
        rig.sample(self.period, if rig.is_fast() { 2 } else { 1 })
    }
}

#[inline]
fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

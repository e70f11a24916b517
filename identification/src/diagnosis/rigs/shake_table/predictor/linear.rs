//! The linear part of a rig with the noises that drive it, and the constant gain that follows them.

use nalgebra::{DMatrix, DVector};
use plant::ModelError;
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use plant::linear::discrete_riccati;

use super::noise::Noise;

/// `x(k+1) = A x(k)`, `y(k) = C x(k)`, and the gain that corrects `x` by what of `y` was not expected.
///
/// States: `n` of the rig, the unseen voltage, past accelerations where their channel is late, and the
/// slow noise of every channel that has one. They are balanced (`x = scale · own`); outputs are in units
/// of their white noise.
pub(super) struct Linear {
    /// States of the rig: places among its continuous ones.
    pub continuous: Vec<usize>,
    /// Accelerations of the past.
    pub past: usize,
    /// Channels that have a slow noise, in the order of their states.
    pub slow: Vec<usize>,
    /// Channels that are measured, in the order of the outputs.
    pub measured: Vec<usize>,
    pub scale: DVector<f64>,
    pub a: DMatrix<f64>,
    pub c: DMatrix<f64>,
    /// Corrections of the states before the next step.
    pub gain: DMatrix<f64>,
    /// Lower Cholesky factor of the innovations' covariance.
    pub factor: DMatrix<f64>,
    /// Its inverse.
    pub whiten: DMatrix<f64>,
    pub log_determinant: f64,
}

impl Linear {
    /// Place of the unseen voltage among the states.
    pub fn unseen(&self) -> usize {
        self.continuous.len()
    }

    /// Place of the first slow noise among the states.
    pub fn first_slow(&self) -> usize {
        self.unseen() + 1 + self.past
    }

    /// # Errors
    /// A rig that cannot be simulated, or one for which there is no stabilising gain.
    pub fn design(rig: &IdentifiedRig, period: f64, noise: &Noise) -> Result<Self, ModelError> {
        let rig = rig.linear_part();
        let sampled = rig.sample(period, 2)?;
        let continuous = rig.active_states();
        let late = (rig.sensors.acceleration.delay / period).floor();
        let past = if rig.sensors.acceleration.delay > 0.0 {
            late as usize + 1
        } else {
            0
        };
        let shows_specimen = rig.specimen.is_some();
        let measured: Vec<usize> = (0..4)
            .filter(|&i| noise.white[i].is_finite() && (shows_specimen || i < 3))
            .collect();
        let slow: Vec<usize> = measured
            .iter()
            .copied()
            .filter(|&i| noise.slow[i].is_some())
            .collect();
        let n = continuous.len();
        let first_slow = n + 1 + past;
        let order = first_slow + slow.len();
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
        a[(n, n)] = noise.unseen.phi;
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
        let drive = noise.unseen.drive();
        let mut response = DVector::<f64>::zeros(order);
        response[n] = 1.0;
        let mut scale = DVector::<f64>::from_element(order, 1e-12);
        for _ in 0..300 {
            for i in 0..order {
                scale[i] = scale[i].max(response[i].abs());
            }
            response = &a * &response;
        }
        let mut q = DMatrix::identity(order, order) * (1e-3 * drive).powi(2);
        q[(n, n)] = (drive / scale[n]).powi(2);
        for (place, &channel) in slow.iter().enumerate() {
            let Some(own) = noise.slow[channel] else {
                continue;
            };
            let at = first_slow + place;
            a[(at, at)] = own.phi;
            c[(channel, at)] = 1.0;
            scale[at] = own.sigma;
            q[(at, at)] = 1.0 - own.phi * own.phi;
        }
        let a = DMatrix::from_fn(order, order, |i, j| a[(i, j)] * scale[j] / scale[i]);
        let c = DMatrix::from_fn(measured.len(), order, |i, j| {
            c[(measured[i], j)] * scale[j] / noise.white[measured[i]]
        });
        let r = DMatrix::identity(measured.len(), measured.len());
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
        let gain = &p * c.transpose() * inverse;
        let log_determinant = s.determinant().ln();
        let factor = s.cholesky().ok_or_else(no_solution)?.l();
        let whiten = factor.clone().try_inverse().ok_or_else(no_solution)?;
        Ok(Self {
            continuous,
            past,
            slow,
            measured,
            scale,
            a,
            c,
            gain,
            factor,
            whiten,
            log_determinant,
        })
    }
}

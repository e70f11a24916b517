//! The linear part of a rig with the noises that drive it, and the constant gain that follows them.

use nalgebra::{DMatrix, DVector};
use plant::ModelError;
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use plant::linear::discrete_riccati;

use super::noise::{Disturbance, Noise};

/// Corner of the voltage by whose effect the states are balanced, Hz.
const BALANCED_BELOW: f64 = 30.0;

/// A part of a coloured noise among the states: its last sample, then the one before.
pub(super) struct Follower {
    /// What it disturbs: a channel, or the voltage beside the command.
    pub channel: Option<usize>,
    pub part: Disturbance,
    /// Place of its first state.
    pub at: usize,
}

/// `x(k+1) = A x(k)`, `y(k) = C x(k)`, and the gain that corrects `x` by what of `y` was not expected.
///
/// States: `n` of the rig, past accelerations where their channel is late, and those of every part of the
/// coloured noises. They are balanced (`x = scale · own`); outputs are in units of their white noise.
pub(super) struct Linear {
    /// States of the rig: places among its continuous ones.
    pub continuous: Vec<usize>,
    /// Accelerations of the past.
    pub past: usize,
    /// Parts of the coloured noises.
    pub followers: Vec<Follower>,
    /// What a volt beside the command adds to the states in one step.
    pub from_voltage: DVector<f64>,
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
        let n = continuous.len();
        let mut order = n + past;
        let voltage = noise.unseen.iter().map(|part| (None, *part));
        let sensors = measured.iter().flat_map(|&i| {
            let parts = noise.coloured[i].iter();
            parts.map(move |part| (Some(i), *part))
        });
        let followers: Vec<Follower> = voltage
            .chain(sensors)
            .map(|(channel, part)| {
                let at = order;
                order += part.order();
                Follower { channel, part, at }
            })
            .collect();
        let mut undelayed = rig;
        undelayed.sensors.acceleration.delay = 0.0;
        let undelayed = undelayed.sample(period, 1)?;

        // The linear system, column by column from unit perturbations (balanced below).
        let mut a = DMatrix::<f64>::zeros(order, order);
        let mut c = DMatrix::<f64>::zeros(4, order);
        let mut from_voltage = DVector::<f64>::zeros(order);
        for j in 0..n {
            let mut state = IdentifiedRigState::default();
            state.continuous[continuous[j]] = 1.0;
            let now = undelayed.measure(&mut state, 0.0);
            let acceleration = undelayed.motion(&state).acceleration;
            for i in 0..4 {
                c[(i, j)] = now[i];
            }
            if past > 0 {
                c[(1, j)] -= (1.0 + rig.sensors.acceleration.scale_error) * acceleration;
                a[(n, j)] = acceleration;
            }
            sampled.step_disturbed(&mut state, 0.0, 0.0);
            for (i, &index) in continuous.iter().enumerate() {
                a[(i, j)] = state.continuous[index];
            }
        }
        let mut disturbed = IdentifiedRigState::default();
        sampled.step_disturbed(&mut disturbed, 0.0, 1.0);
        for (i, &index) in continuous.iter().enumerate() {
            from_voltage[i] = disturbed.continuous[index];
        }
        if past > 0 {
            let samples = rig.sensors.acceleration.delay / period;
            let (whole, fraction) = (late as usize, samples - late);
            let scale = 1.0 + rig.sensors.acceleration.scale_error;
            // Past accelerations: the first is one sample old.
            for (age, weight) in [(whole, 1.0 - fraction), (whole + 1, fraction)] {
                if age == 0 {
                    for j in 0..n {
                        let mut state = IdentifiedRigState::default();
                        state.continuous[continuous[j]] = 1.0;
                        c[(1, j)] += scale * weight * undelayed.motion(&state).acceleration;
                    }
                } else {
                    c[(1, n + age - 1)] += scale * weight;
                }
            }
            for age in 2..=past {
                a[(n + age - 1, n + age - 2)] = 1.0;
            }
        }

        // Balance: scale the rig's states by their response to a voltage, the noises' by their size.
        let mut scale = DVector::<f64>::from_element(order, 1e-12);
        let mut response = DVector::<f64>::zeros(order);
        let mut voltage = 1.0;
        for _ in 0..300 {
            response = &a * &response + &from_voltage * voltage;
            voltage *= (-std::f64::consts::TAU * BALANCED_BELOW * period).exp();
            for i in 0..order {
                scale[i] = scale[i].max(response[i].abs());
            }
        }
        let drives = noise.unseen.iter().map(|part| part.drive().powi(2));
        let drive = drives.sum::<f64>().sqrt();
        let mut q = DMatrix::identity(order, order) * (1e-3 * drive).powi(2);
        for Follower { channel, part, at } in &followers {
            let at = *at;
            a[(at, at)] = part.lag[0];
            if part.order() == 2 {
                a[(at, at + 1)] = part.lag[1];
                a[(at + 1, at)] = 1.0;
            }
            match channel {
                None => {
                    for i in 0..n {
                        a[(i, at)] = from_voltage[i];
                    }
                }
                Some(channel) => c[(*channel, at)] = 1.0,
            }
            for state in at..at + part.order() {
                scale[state] = part.sigma.max(f64::MIN_POSITIVE);
                q[(state, state)] = 0.0;
            }
            q[(at, at)] = (part.drive() / scale[at]).powi(2);
        }
        from_voltage.component_div_assign(&scale);
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
            followers,
            from_voltage,
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

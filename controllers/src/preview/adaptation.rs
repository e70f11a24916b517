//! Mass, stiffness and strength of the specimen, estimated while the motion goes on.
//!
//! Two recursive estimates, both Gauss-Newton steps of a prediction error with a bounded covariance (L. Ljung and
//! T. Söderström, Theory and Practice of Recursive Identification, 1983):
//!
//! - stiffness and strength over the mass, from the specimen's absolute acceleration: a model of it is shaken as
//!   the table is measured to be, and two beside it with one of them changed give the gradient;
//! - the mass, from the balance of the table: `m a_s = F - M a - c v - k x` with the measured force `F` of the
//!   actuator.
//!
//! Nothing is learnt, and nothing forgotten, from a sample on which an error of the [`Adaptation::spread`] would not
//! stand out of the noise.

use std::f64::consts::LN_2;

use plant::identified::table::Table;
use plant::specimens::{YieldingSpecimen, YieldingState};
use units::Parameters;

use crate::{ModelError, Motion};

/// What the estimates take for granted.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
#[parameters(prefix = "adaptation_")]
pub struct Adaptation {
    /// Standard deviation of what is known of them, relative.
    ///
    /// Of mass, stiffness and strength.
    #[parameter(positive)]
    pub spread: f64,
    /// Standard deviation of what they change by in a second, relative.
    ///
    /// This is what the estimates forget by.
    #[parameter(non_negative)]
    pub drift: f64,
    /// What specimen and model differ by, m/s2.
    ///
    /// In the measured acceleration, beside the changes.
    #[parameter("m/s2" => "g", positive)]
    pub acceleration_noise: f64,
    /// What the balance of forces is off by, N.
    #[parameter("N" => "lbf", positive)]
    pub force_noise: f64,
}

impl Default for Adaptation {
    /// For the physical rig: some four times its sensors' noise, for errors of the models last for many samples.
    fn default() -> Self {
        Self {
            spread: 0.2,
            drift: 0.001,
            acceleration_noise: 0.1,
            force_noise: 4.0,
        }
    }
}

impl Adaptation {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that is no deviation.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }
}

/// What is measured at a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Measured {
    /// The table's motion.
    pub table: Motion,
    /// Absolute acceleration of the specimen, m/s².
    pub specimen_acceleration: f64,
    /// Force of the actuator on the table, N.
    pub actuator_force: f64,
}

/// Estimates and their covariances: plain data.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AdaptationState {
    /// Logarithms of stiffness and strength, each over the mass, over the known ones.
    shape: [f64; 2],
    /// Their covariance over that at the start.
    shape_covariance: [[f64; 2]; 2],
    /// Logarithm of the mass over the known one.
    mass: f64,
    /// Its variance over that at the start.
    mass_variance: f64,
    /// The specimen as estimated, and with one more of stiffness or strength.
    models: [YieldingState; 3],
    /// The table's acceleration a sample before, m/s².
    before: f64,
}

impl Default for AdaptationState {
    fn default() -> Self {
        Self {
            shape: [0.0; 2],
            shape_covariance: [[1.0, 0.0], [0.0, 1.0]],
            mass: 0.0,
            mass_variance: 1.0,
            models: [YieldingState::default(); 3],
            before: 0.0,
        }
    }
}

/// Time for which an error of the model of the specimen lasts, s: so many samples tell as much as one. Without it the
/// estimates lurch for the first seconds, while the models have yet to forget that they began as others.
const ERRORS_LAST: f64 = 0.1;
/// Step of a logarithm for the gradient.
const PROBE: f64 = 0.05;
/// Estimates stay between half and twice what is known.
const FURTHEST: f64 = LN_2;

/// `known` with logarithms of stiffness and strength over the mass, and of the mass, added. The damping ratio stays.
fn changed(
    known: &YieldingSpecimen,
    [stiffness, strength]: [f64; 2],
    mass: f64,
) -> YieldingSpecimen {
    let mut own = *known;
    own.mass *= mass.exp();
    own.damping *= (mass + 0.5 * stiffness).exp();
    own.columns.yield_force *= (mass + strength).exp();
    own.columns.yield_displacement *= (strength - stiffness).exp();
    own
}

impl AdaptationState {
    /// The specimen as it is estimated to be.
    pub fn specimen(&self, known: &YieldingSpecimen) -> YieldingSpecimen {
        changed(known, self.shape, self.mass)
    }

    /// Learns from a sample, `period` s after the one before.
    pub fn learn(
        &mut self,
        settings: &Adaptation,
        known: &YieldingSpecimen,
        table: &Table,
        measured: &Measured,
        period: f64,
    ) {
        let shaken = 0.5 * (self.before + measured.table.acceleration);
        self.before = measured.table.acceleration;
        let [stiffness, strength] = self.shape;
        let probes = [
            [stiffness, strength],
            [stiffness + PROBE, strength],
            [stiffness, strength + PROBE],
        ];
        let mut answers = [0.0; 3];
        for ((model, probe), answer) in self.models.iter_mut().zip(probes).zip(&mut answers) {
            let own = changed(known, probe, 0.0);
            *model = own.advance(model, shaken, period);
            *answer = own.acceleration(model);
        }
        let gradient = [1, 2].map(|i| (answers[i] - answers[0]) / PROBE);
        let error = measured.specimen_acceleration - answers[0];
        if error.is_finite() {
            self.learn_shape(settings, gradient, error, period);
        }
        let motion = &measured.table;
        let taken = measured.actuator_force
            - table.mass * motion.acceleration
            - table.damping * motion.velocity
            - table.stiffness * motion.displacement;
        let own = known.mass * self.mass.exp() * measured.specimen_acceleration;
        if (taken - own).is_finite() {
            self.learn_mass(settings, own, taken - own, period);
        }
    }

    fn learn_shape(&mut self, settings: &Adaptation, g: [f64; 2], error: f64, period: f64) {
        let variance = settings.spread * settings.spread;
        let gate = settings.acceleration_noise * settings.acceleration_noise / variance;
        if g[0] * g[0] + g[1] * g[1] < gate {
            return;
        }
        let alike = (ERRORS_LAST / period).max(1.0);
        let noise = alike * gate;
        let p = &mut self.shape_covariance;
        let pg = [0, 1].map(|i| p[i][0] * g[0] + p[i][1] * g[1]);
        let all = noise + g[0] * pg[0] + g[1] * pg[1];
        let forgotten = settings.drift * settings.drift * period / variance;
        for i in 0..2 {
            self.shape[i] = (self.shape[i] + pg[i] / all * error).clamp(-FURTHEST, FURTHEST);
            for j in 0..2 {
                p[i][j] -= pg[i] * pg[j] / all;
            }
            p[i][i] += forgotten;
        }
        for i in 0..2 {
            // No more uncertain than at the start.
            let shrunk = (1.0 / p[i][i]).sqrt().min(1.0);
            for j in 0..2 {
                p[i][j] *= shrunk;
                p[j][i] *= shrunk;
            }
        }
    }

    fn learn_mass(&mut self, settings: &Adaptation, gradient: f64, error: f64, period: f64) {
        let variance = settings.spread * settings.spread;
        let noise = settings.force_noise * settings.force_noise / variance;
        if gradient * gradient < noise {
            return;
        }
        let gain =
            self.mass_variance * gradient / (noise + self.mass_variance * gradient * gradient);
        self.mass = (self.mass + gain * error).clamp(-FURTHEST, FURTHEST);
        self.mass_variance *= 1.0 - gain * gradient;
        let forgotten = settings.drift * settings.drift * period / variance;
        self.mass_variance = (self.mass_variance + forgotten).min(1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::sensors::channel::Noise;

    const PERIOD: f64 = 0.002;

    /// Learns for `seconds` of motion from a specimen with 0.8 of the known mass, 1.2 of its stiffness and 0.8 of its
    /// strength; what it believes then, over what is true: mass, stiffness, yield force.
    fn learnt(level: f64, seconds: f64) -> [f64; 3] {
        let known = YieldingSpecimen::default();
        let truth = changed(&known, [(1.2f64 / 0.8).ln(), 0.0], 0.8f64.ln());
        let table = Table::default();
        let mut own = AdaptationState::default();
        let settings = Adaptation::default();
        let (mut state, mut before) = (YieldingState::default(), 0.0);
        for k in 0..(seconds / PERIOD) as u64 {
            let t = PERIOD * k as f64;
            let parts = [
                (5.0, 0.4),
                (9.0, 1.0),
                (13.0, 1.2),
                (29.0, 1.0),
                (47.0, 0.5),
            ];
            let sum =
                |f: &dyn Fn(f64, f64) -> f64| parts.iter().map(|(w, a)| level * f(*w, *a)).sum();
            let motion = Motion {
                displacement: sum(&|w, a| -a / (w * w) * (w * t).sin()),
                velocity: sum(&|w, a| -a / w * (w * t).cos()),
                acceleration: sum(&|w, a| a * (w * t).sin()),
            };
            state = truth.advance(&state, 0.5 * (before + motion.acceleration), PERIOD);
            before = motion.acceleration;
            let noise = |channel| {
                let seed = 1;
                Noise {
                    seed,
                    channel,
                    sample: k,
                }
                .gaussian()
            };
            let force = table.mass * motion.acceleration
                + table.damping * motion.velocity
                + table.stiffness * motion.displacement
                - truth.force(&state);
            let mut measured = Measured {
                table: motion,
                specimen_acceleration: truth.acceleration(&state) + 0.025 * noise(0),
                actuator_force: force + 1.3 * noise(1),
            };
            measured.table.acceleration += 0.038 * noise(2);
            own.learn(&settings, &known, &table, &measured, PERIOD);
        }
        let found = own.specimen(&known);
        [
            found.mass / truth.mass,
            found.columns.stiffness() / truth.columns.stiffness(),
            found.columns.yield_force / truth.columns.yield_force,
        ]
    }

    #[test]
    fn a_specimen_a_fifth_off_is_learnt_from_a_motion_that_makes_it_yield() {
        let found = learnt(1.0, 12.0);
        println!("mass, stiffness, strength over the true: {found:.3?}");
        for share in found {
            assert!((share - 1.0).abs() < 0.03, "{found:?}");
        }
    }

    #[test]
    fn nothing_is_learnt_from_noise() {
        let found = learnt(0.0, 60.0);
        let known = [1.0 / 0.8, 1.0 / 1.2, 1.0 / 0.8];
        for (share, start) in found.into_iter().zip(known) {
            assert!((share - start).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn what_is_no_deviation_is_refused_by_name() {
        let wrong = Adaptation {
            spread: 0.0,
            ..Adaptation::default()
        };
        assert!(
            wrong
                .validate()
                .unwrap_err()
                .to_string()
                .contains("`adaptation_spread`")
        );
    }
}

//! Actuator, table and specimen as one prediction model: command in; displacement, acceleration,
//! actuator force and specimen acceleration out.
//!
//! The recorded command drives the model, and the steady Kalman predictor corrects it with what
//! was measured. So the uncontrolled plant, which is slightly unstable, can be followed over a
//! minute, and feedback from noisy sensors to the command leaves no bias: every error of the
//! prediction is independent of the command up to its sample. Noise: white on every channel, on
//! the command, and a force on the table.

use nalgebra::{DMatrix, SMatrix, SVector};
use plant::linear::{StateSpace, discrete_riccati};

use super::parameters::{NoiseOn, OUTPUTS, Own, Physical, PhysicalValues, STATES};
use sysid::prediction::{self, PredictionModel};

/// The states before those of the specimen.
pub const SPECIMEN_STATES: usize = 5;
/// Rows of the rig's state space that are measured.
const ROWS: [usize; OUTPUTS] = [0, 2, 3, 6];

/// A recording as the model reads it: sample by sample and scaled.
#[derive(Debug, Clone)]
pub struct ScaledRecording {
    /// Name of the recording.
    pub name: String,
    /// Sampling period, s.
    pub period: f64,
    /// Valve command, V.
    pub command: Vec<f64>,
    /// Outputs over their scales.
    pub outputs: Vec<SVector<f64, OUTPUTS>>,
    /// Root mean square of each output, SI.
    pub scale: [f64; OUTPUTS],
    /// Root mean square of the command, V.
    pub command_scale: f64,
    /// Which outputs were recorded.
    pub measured: [bool; OUTPUTS],
    /// Whether the specimen stands on the table.
    pub specimen: bool,
}

impl ScaledRecording {
    /// Scales of the states: the force's for the actuator, the displacement's for the rest, with
    /// typical frequencies of the rig in between.
    fn state_scale(&self) -> [f64; STATES] {
        let (x, force) = (self.scale[0], self.scale[2]);
        let (fast, slow) = (100.0, 10.0);
        [
            force,
            force * fast,
            force * fast * fast,
            x,
            x * slow,
            x,
            x * slow,
        ]
    }
}

/// Several experiments on one rig.
#[derive(Debug, Clone)]
pub struct RigModel {
    /// The experiments.
    pub experiments: Vec<ScaledRecording>,
}

/// Rows of a column of the transition, one more than states: even, for the vector unit.
const ROWS_PADDED: usize = STATES + 1;
/// What the next state is made of: this one, the measured outputs, two samples of the command.
const COLUMNS: usize = STATES + OUTPUTS + 2;

/// The predictor of one experiment: `x+ = (A - K C) x + K (y - offset) + B u`, the correction
/// folded into the transition.
#[derive(Clone)]
pub struct Predictor {
    transition: [[f64; ROWS_PADDED]; COLUMNS],
    output: [[f64; OUTPUTS]; STATES],
    /// Whole samples of delay; the command of the sample before counts too.
    delay: usize,
    offset: [f64; OUTPUTS],
    state: [f64; ROWS_PADDED],
    covariance: SMatrix<f64, OUTPUTS, OUTPUTS>,
}

impl prediction::Predictor<OUTPUTS> for Predictor {
    fn covariance(&self) -> SMatrix<f64, OUTPUTS, OUTPUTS> {
        self.covariance
    }
}

impl RigModel {
    /// The predictor of an experiment; `None` where no steady one exists.
    fn steady_predictor(&self, experiment: usize, parameters: &[f64]) -> Option<Predictor> {
        let data = &self.experiments[experiment];
        let physical = PhysicalValues::of(parameters);
        let own = |which: Own| parameters[which.of(experiment)];
        let rig = physical.rig(own(Own::Payload), data.specimen);
        if !(rig.shake_table.table.mass > 0.0 && physical[Physical::SpecimenMass] > 0.0) {
            return None;
        }
        let mut system = rig.state_space();
        if !data.specimen {
            system.a[(5, 5)] = -50.0;
            system.a[(6, 6)] = -50.0;
        }
        let scale = data.state_scale();
        // Inputs: command, force on the table in units of the force's scale.
        let mut input = DMatrix::zeros(STATES, 2);
        for i in 0..STATES {
            input[(i, 0)] = system.b[(i, 0)] / scale[i];
            for j in 0..STATES {
                system.a[(i, j)] *= scale[j] / scale[i];
            }
        }
        let per_mass = data.scale[2] / rig.shake_table.table.mass;
        input[(4, 1)] = per_mass / scale[4];
        if data.specimen {
            input[(6, 1)] = -per_mass / scale[6];
        }
        let c = SMatrix::<f64, OUTPUTS, STATES>::from_fn(|i, j| {
            if data.measured[i] {
                system.c[(ROWS[i], j)] * scale[j] / data.scale[i]
            } else {
                0.0
            }
        });
        let continuous = StateSpace {
            a: system.a,
            b: input,
            c: DMatrix::zeros(0, STATES),
            d: DMatrix::zeros(0, 2),
        };
        let sampled = continuous.sample(data.period);
        if sampled.a.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let late = (physical[Physical::CommandDelay] / data.period).max(0.0);
        let delay = late.floor() as usize;
        let part = late - late.floor();
        let held = SVector::<f64, STATES>::from_fn(|i, _| sampled.b[(i, 0)]);
        let b = if part > 0.0 {
            let present = continuous.sample((1.0 - part) * data.period);
            let present = SVector::<f64, STATES>::from_fn(|i, _| present.b[(i, 0)]);
            [present, held - present]
        } else {
            [held, SVector::zeros()]
        };

        let variance = |noise: NoiseOn| (2.0 * own(Own::LogNoise(noise))).exp();
        let command = DMatrix::from_fn(STATES, 1, |i, _| sampled.b[(i, 0)] * data.command_scale);
        let force = sampled.b.columns(1, 1);
        let q = &command * command.transpose() * variance(NoiseOn::Command)
            + force * force.transpose() * variance(NoiseOn::Table);
        let noise =
            SMatrix::<f64, OUTPUTS, OUTPUTS>::from_fn(|i, j| match (i == j, data.measured[i]) {
                (false, _) => 0.0,
                (true, true) => variance(NoiseOn::Output(i)),
                (true, false) => 1.0,
            });
        let c_transposed = DMatrix::from_fn(STATES, OUTPUTS, |i, j| c[(j, i)]);
        let r = DMatrix::from_fn(OUTPUTS, OUTPUTS, |i, j| noise[(i, j)]);
        let p = discrete_riccati(&sampled.a.transpose(), &c_transposed, &q, &r).ok()?;
        let p = SMatrix::<f64, STATES, STATES>::from_fn(|i, j| p[(i, j)]);
        let a = SMatrix::<f64, STATES, STATES>::from_fn(|i, j| sampled.a[(i, j)]);
        let covariance = c * p * c.transpose() + noise;
        let covariance = (covariance + covariance.transpose()) * 0.5;
        let gain = a * p * c.transpose() * covariance.try_inverse()?;
        let closed = a - gain * c;
        let column = |own: &[f64]| std::array::from_fn(|i| own.get(i).copied().unwrap_or(0.0));
        Some(Predictor {
            transition: std::array::from_fn(|j| match j {
                0..STATES => column(closed.column(j).as_slice()),
                _ if j < STATES + OUTPUTS => column(gain.column(j - STATES).as_slice()),
                _ => column(b[j - STATES - OUTPUTS].as_slice()),
            }),
            output: std::array::from_fn(|j| std::array::from_fn(|i| c[(i, j)])),
            delay,
            offset: std::array::from_fn(|i| own(Own::Offset(i))),
            state: column(&std::array::from_fn::<_, STATES, _>(|i| {
                own(Own::InitialState(i))
            })),
            covariance,
        })
    }

    /// All outputs from the command, with nothing but the displacement to hold the model to its
    /// path (the uncontrolled plant is slightly unstable), SI, channel by channel.
    pub fn held_by_displacement(
        &self,
        experiment: usize,
        parameters: &[f64],
    ) -> Option<Vec<Vec<f64>>> {
        let mut own = parameters.to_vec();
        let data = &self.experiments[experiment];
        for i in 1..OUTPUTS {
            if data.measured[i] {
                own[Own::LogNoise(NoiseOn::Output(i)).of(experiment)] = 1e3f64.ln();
            }
        }
        self.one_step_predictions(experiment, &own)
    }

    /// Outputs predicted one sample ahead, SI, channel by channel.
    pub fn one_step_predictions(
        &self,
        experiment: usize,
        parameters: &[f64],
    ) -> Option<Vec<Vec<f64>>> {
        let data = &self.experiments[experiment];
        let errors = self.errors(experiment, parameters)?;
        Some(
            (0..OUTPUTS)
                .map(|i| {
                    let pairs = data.outputs.iter().zip(&errors);
                    pairs.map(|(y, e)| (y[i] - e[i]) * data.scale[i]).collect()
                })
                .collect(),
        )
    }
}

impl PredictionModel<OUTPUTS> for RigModel {
    type Predictor = Predictor;

    fn experiments(&self) -> usize {
        self.experiments.len()
    }

    fn samples(&self, experiment: usize) -> usize {
        self.experiments[experiment].outputs.len()
    }

    fn predictor(&self, experiment: usize, parameters: &[f64]) -> Option<Predictor> {
        self.steady_predictor(experiment, parameters)
    }

    fn predict(
        &self,
        experiment: usize,
        predictor: &mut Predictor,
        first: usize,
        errors: &mut [SVector<f64, OUTPUTS>],
    ) {
        let data = &self.experiments[experiment];
        let at = |k: usize, back: usize| data.command[k.saturating_sub(back)];
        let delay = predictor.delay;
        let (transition, output) = (&predictor.transition, &predictor.output);
        let mut state = predictor.state;
        for (k, error) in (first..).zip(errors) {
            let measured: [f64; OUTPUTS] =
                std::array::from_fn(|i| data.outputs[k][i] - predictor.offset[i]);
            let mut rest = measured;
            let mut next = [0.0; ROWS_PADDED];
            let inputs = [at(k, delay), at(k, delay + 1)];
            for (column, value) in transition[STATES..]
                .iter()
                .zip(measured.iter().chain(&inputs))
            {
                for i in 0..ROWS_PADDED {
                    next[i] += column[i] * value;
                }
            }
            for j in 0..STATES {
                for i in 0..ROWS_PADDED {
                    next[i] += transition[j][i] * state[j];
                }
                for i in 0..OUTPUTS {
                    rest[i] -= output[j][i] * state[j];
                }
            }
            *error = SVector::from(rest);
            state = next;
        }
        predictor.state = state;
    }
}

//! Preview control: the valve command of a model that follows the motion known ahead, and linear
//! quadratic Gaussian feedback of what is left.
//!
//! Every sample:
//!
//! 1. The forces that act on the table along the wanted motion, dry friction of the seals with its
//!    presliding and the specimen's reaction, are computed as far ahead as the motion is known
//!    ([`load`]).
//! 2. A model of the rig is driven along the motion against these forces by optimal preview, its
//!    command within the valve's limit ([`feedforward`]). Without noise or delay it can be as quick as
//!    the valve.
//! 3. The rig is brought to the model's state; what the forces were not, and the valve's offset, is
//!    estimated and taken off ([`feedback`]). Measurements may be late.
//!
//! [`Role::MultiMetric`] is model-based multi-metric control (B. M. Phillips, N. E. Wierschem and B. F.
//! Spencer, Earthquake Engineering and Structural Dynamics 43, 2014): the inverse of the rig shapes the command,
//! and the same feedback acts on what is left of displacement, velocity and acceleration against the
//! motion itself.
//!
//! With [`adaptation`] mass, stiffness and strength of the specimen are estimated on the way, and the forces ahead
//! follow them.
//!
//! The first two with a table that stands still make a compensation of friction and specimen that
//! any other controller can have ([`Role::Compensation`]).

pub mod adaptation;
pub mod feedback;
pub mod feedforward;
pub mod load;
pub mod model;

use nalgebra::SVector;
use units::constants::{INCH, LBF, SAMPLING_PERIOD};
use units::{Parameters as _, vocabulary};

use self::adaptation::{Adaptation, AdaptationState, Measured};
use self::feedback::{Feedback, FeedbackState, MAXIMUM_DELAY, Uncertainty};
use self::feedforward::{Feedforward, PREVIEW};
use self::load::{KnownLoad, LoadState};
use self::model::{OUTPUTS, RigModel, STATES, SampledRig};
use crate::acceleration_tracking::{SHAPES, SHAPING};
use crate::pid::VALVE_LIMIT;
use crate::{Controller, ModelError, Motion};
use plant::identified::seal_shape::SealShape;
use plant::specimens::YieldingSpecimen;

/// What the law does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Drives the valve.
    #[default]
    Control,
    /// Adds to another controller's command what keeps a table that stands still unmoved under the
    /// forces along the wanted motion: to that controller the rig has neither friction nor specimen.
    Compensation,
    /// Drives the valve by the rig's inverse, a polynomial of the motion ahead, and feeds back what the
    /// measurements differ from the motion: no model is driven along, and no force is known.
    MultiMetric,
}

/// What preview control is built from.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct Parameters {
    /// What it does.
    pub role: Role,
    /// The rig.
    pub rig: RigModel,
    /// Forces on its table.
    pub load: KnownLoad,
    /// How the specimen is learnt while the motion goes on, if it is. Not for [`Role::MultiMetric`].
    pub adaptation: Option<Adaptation>,
    /// Whether the reference ahead is connected; else it is extrapolated.
    #[parameter]
    pub preview: bool,
    /// Samples by which measurements are late.
    #[parameter(name = vocabulary::LOOP_DELAY_SAMPLES, min = 0.0, max = 4.0)]
    pub delay: usize,
    /// Largest magnitude of the valve command, V.
    #[parameter("V", name = vocabulary::VALVE_LIMIT, positive)]
    pub limit: f64,
    /// The rig's inverse for [`Role::MultiMetric`]: V/m, V s/m, V s²/m, V s³/m.
    #[parameter(0, name = SHAPES[0], about = "Multi-metric: command per displacement of the motion ahead", "V/m" => "V/in", finite)]
    #[parameter(1, name = SHAPES[1], about = "Multi-metric: command per velocity", "V.s/m" => "V.s/in", finite)]
    #[parameter(2, name = SHAPES[2], about = "Multi-metric: command per acceleration", "V.s2/m" => "V.s2/in", finite)]
    #[parameter(3, name = SHAPES[3], about = "Multi-metric: command per jerk, a difference of two samples", "V.s3/m" => "V.s3/in", finite)]
    pub shaping: [f64; SHAPING],
    /// Multi-metric: samples by which the motion shaped is ahead.
    ///
    /// At most [`PREVIEW`].
    #[parameter(name = "shaping_lead_samples", min = 0.0, max = 20.0)]
    pub shaping_lead: usize,
    /// Weights of the feedforward: displacement (1/m), velocity (s/m), acceleration (s²/m).
    #[parameter(
        0,
        name = "tracking_displacement_weight",
        about = "Feedforward: weight of the displacement's error",
        "1/m",
        positive
    )]
    #[parameter(
        1,
        name = "tracking_velocity_weight",
        about = "Feedforward: weight of the velocity's error",
        "s/m",
        positive
    )]
    #[parameter(
        2,
        name = "tracking_acceleration_weight",
        about = "Feedforward: weight of the acceleration's error",
        "s2/m",
        positive
    )]
    pub tracking_weights: [f64; OUTPUTS],
    /// Feedforward: weight of the command's change a sample, 1/V.
    #[parameter("1/V", positive)]
    pub move_weight: f64,
    /// Weights of the feedback: displacement (1/m), velocity (s/m), acceleration (s²/m).
    #[parameter(
        0,
        name = "feedback_displacement_weight",
        about = "Feedback: weight of the displacement's error",
        "1/m",
        positive
    )]
    #[parameter(
        1,
        name = "feedback_velocity_weight",
        about = "Feedback: weight of the velocity's error",
        "s/m",
        positive
    )]
    #[parameter(
        2,
        name = "feedback_acceleration_weight",
        about = "Feedback: weight of the acceleration's error",
        "s2/m",
        positive
    )]
    pub feedback_weights: [f64; OUTPUTS],
    /// Feedback: weight of the command, 1/V.
    #[parameter("1/V", positive)]
    pub command_weight: f64,
    /// What the estimates take to be uncertain.
    #[parameters]
    pub uncertainty: Uncertainty,
    /// Sampling period, s.
    pub period: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            role: Role::Control,
            rig: RigModel::default(),
            load: KnownLoad {
                friction: 0.0,
                shape: SealShape {
                    presliding: 1e-3 * INCH,
                    excess: 0.25,
                    stribeck_velocity: 0.1 * INCH,
                    sharpness: 3.0,
                    relaxation: 0.0,
                },
                specimen: None,
            },
            adaptation: None,
            preview: true,
            delay: 0,
            shaping: [0.0; SHAPING],
            shaping_lead: 0,
            tracking_weights: [100.0, 14.0, 1.0],
            move_weight: 0.05,
            feedback_weights: [100.0, 14.0, 1.0],
            command_weight: 6.0,
            uncertainty: Uncertainty {
                measurement: [5e-4 * INCH, 0.2 * INCH, 1.5 * INCH],
                valve: 0.01,
                force: 0.1 * LBF,
                force_step: 0.0125 * LBF,
                offset_step: 1e-3,
            },
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
        self.load.validate()?;
        self.adaptation
            .as_ref()
            .map_or(Ok(()), Adaptation::validate)?;
        if self.delay > MAXIMUM_DELAY {
            return Err(ModelError::Parameter {
                name: vocabulary::LOOP_DELAY_SAMPLES,
                value: self.delay as f64,
                expected: "at most 4",
            });
        }
        if self.shaping_lead > PREVIEW {
            return Err(ModelError::Parameter {
                name: Self::SHAPING_LEAD_SAMPLES,
                value: self.shaping_lead as f64,
                expected: "at most 20",
            });
        }
        self.check()?;
        ModelError::require_positive("period", self.period)
    }
}

/// What preview control is told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PreviewInput {
    /// Wanted motion: now, then sample by sample ahead. Without preview only the first counts.
    pub reference: [Motion; PREVIEW + 1],
    /// Measured motion.
    pub measured: Motion,
    /// Another controller's command, V; for [`Role::Compensation`] alone.
    pub command: f64,
    /// Measured absolute acceleration of the specimen, m/s²; for [`Parameters::adaptation`] alone.
    pub specimen_acceleration: f64,
    /// Measured force of the actuator on the table, N; for [`Parameters::adaptation`] alone.
    pub actuator_force: f64,
}

/// What preview control remembers: plain data.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Memory {
    /// The model's state.
    model: [f64; STATES],
    /// The model's latest command, V.
    command: f64,
    feedback: FeedbackState,
    /// The load at the furthest sample known.
    load: LoadState,
    /// Known forces now and ahead, N.
    forces: [f64; PREVIEW + 1],
    /// The motion at the furthest sample known; absent before the first.
    last: Option<Motion>,
    /// The wanted motions up to now, the present one first.
    past: [Motion; MAXIMUM_DELAY + 1],
    /// What was learnt of the specimen.
    adaptation: AdaptationState,
    /// The shaped acceleration of the sample before, m/s²; absent before the first.
    shaped: Option<f64>,
}

/// Preview control: what it was built from, what follows from that, and what it remembers.
#[derive(Debug, Clone, PartialEq)]
pub struct PreviewControl {
    parameters: Parameters,
    rig: SampledRig,
    feedforward: Feedforward,
    feedback: Feedback,
    /// The controller's memory.
    pub memory: Memory,
}

impl PreviewControl {
    /// Designs feedforward, feedback and filter.
    ///
    /// # Errors
    /// What [`Parameters::validate`] refuses; a Riccati equation without a stabilising solution.
    pub fn new(parameters: Parameters) -> Result<Self, ModelError> {
        parameters.validate()?;
        let p = &parameters;
        let rig = p.rig.sample(p.period);
        let ahead = if p.preview { PREVIEW } else { 0 };
        let weights = SVector::from(p.tracking_weights);
        let feedforward = Feedforward::new(&rig, &weights, p.move_weight, ahead, p.period)?;
        let weights = SVector::from(p.feedback_weights);
        let feedback = Feedback::new(&rig, &weights, p.command_weight, &p.uncertainty, p.delay)?;
        Ok(Self {
            rig,
            feedforward,
            feedback,
            memory: Memory::default(),
            parameters,
        })
    }

    /// What it was built from.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The rig it knows.
    pub fn rig(&self) -> &SampledRig {
        &self.rig
    }

    /// Its feedback.
    pub fn feedback(&self) -> &Feedback {
        &self.feedback
    }

    /// The specimen as it is known now, if one stands on the table.
    pub fn specimen(&self) -> Option<YieldingSpecimen> {
        let p = &self.parameters;
        let learnt = |known| match p.adaptation {
            Some(_) => self.memory.adaptation.specimen(&known),
            None => known,
        };
        p.load.specimen.map(learnt)
    }

    /// Learns the specimen from what is measured.
    fn adapt(&mut self, input: &PreviewInput) {
        let p = &self.parameters;
        if let (Some(settings), Some(known)) = (&p.adaptation, &p.load.specimen) {
            let measured = Measured {
                table: input.measured,
                specimen_acceleration: input.specimen_acceleration,
                actuator_force: input.actuator_force,
            };
            let table = &p.rig.shake_table.table;
            let learnt = &mut self.memory.adaptation;
            learnt.learn(settings, known, table, &measured, p.period);
        }
    }

    /// A sample of [`Role::MultiMetric`].
    fn multi_metric(&mut self, input: &PreviewInput) -> f64 {
        let p = &self.parameters;
        let memory = &mut self.memory;
        let ahead = &input.reference[p.shaping_lead];
        let before = memory.shaped.replace(ahead.acceleration);
        let jerk = (ahead.acceleration - before.unwrap_or(ahead.acceleration)) / p.period;
        let parts = [ahead.displacement, ahead.velocity, ahead.acceleration, jerk];
        let shaped: f64 = p.shaping.iter().zip(parts).map(|(f, r)| f * r).sum();
        let shaped = shaped.clamp(-p.limit, p.limit);
        memory.past.rotate_right(1);
        memory.past[0] = input.reference[0];
        let left = vector(&input.measured) - vector(&memory.past[p.delay]);
        let state = &mut memory.feedback;
        let rest = SVector::zeros();
        let command = shaped
            + self
                .feedback
                .command(state, &self.rig, &rest, 0.0, &left, 0.0);
        let command = command.clamp(-p.limit, p.limit);
        self.feedback.sent(state, &self.rig, command - shaped, 0.0);
        command
    }

    /// Brings the known forces up to the furthest sample known.
    fn look_ahead(&mut self, reference: &[Motion; PREVIEW + 1]) {
        let p = &self.parameters;
        let load = KnownLoad {
            specimen: self.specimen(),
            ..p.load
        };
        let memory = &mut self.memory;
        let furthest = if p.preview { PREVIEW } else { 0 };
        let first = if memory.last.is_none() { 0 } else { furthest };
        memory.forces.rotate_left(1);
        for slot in first..=furthest {
            let to = reference[slot];
            let from = memory.last.unwrap_or(to);
            memory.load = load.advance(&memory.load, [&from, &to], p.period);
            memory.last = Some(to);
            memory.forces[slot] = load.force(&memory.load, &to);
        }
        let beyond = memory.forces[furthest];
        memory.forces[furthest..].fill(beyond);
    }
}

fn vector(motion: &Motion) -> SVector<f64, OUTPUTS> {
    SVector::from([motion.displacement, motion.velocity, motion.acceleration])
}

impl Controller for PreviewControl {
    type Input = PreviewInput;
    /// Valve command, V.
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.parameters.validate()
    }

    fn step(&mut self, input: &PreviewInput, _period: f64) -> f64 {
        if self.parameters.role == Role::MultiMetric {
            return self.multi_metric(input);
        }
        self.adapt(input);
        self.look_ahead(&input.reference);
        let limit = self.parameters.limit;
        let compensates = self.parameters.role == Role::Compensation;
        let wanted: [_; PREVIEW + 1] = std::array::from_fn(|j| {
            if compensates {
                return SVector::zeros();
            }
            vector(&input.reference[if self.parameters.preview { j } else { 0 }])
        });
        let memory = &mut self.memory;
        let x = SVector::from(memory.model);
        let own = self
            .feedforward
            .command(&x, memory.command, &wanted, &memory.forces)
            .clamp(-limit, limit);
        let forces = [memory.forces[0], memory.forces[1]];
        let command = if compensates {
            (input.command + own).clamp(-limit, limit)
        } else {
            let measured = vector(&input.measured);
            let state = &mut memory.feedback;
            let command = self
                .feedback
                .command(state, &self.rig, &x, own, &measured, forces[0])
                .clamp(-limit, limit);
            self.feedback.sent(state, &self.rig, command, forces[1]);
            command
        };
        memory.model = self.rig.advance(&x, own, forces).into();
        memory.command = own;
        command
    }

    fn reset(&mut self) {
        self.memory = Memory::default();
    }
}

#[cfg(test)]
mod tests;

//! Sliding mode down to the valve: surfaces for motion, oil and spool, one behind the other, and a surface
//! over a receding horizon.
//!
//! With `e = x - x_d` and `S = de/dt + lambda e` as in [`sliding_mode`](crate::sliding_mode), on the oil and the
//! spool themselves in place of loops of displacement and force:
//!
//! ```text
//! S1 = S                 P_d = m (a_d - lambda de/dt - K1 S1) + c v + k x - f
//! S2 = P - P_d           y_d = (dP_d/dt + K v + p P - K2 S2)/g
//! S3 = y - y_d           u   = y + l (dy_d/dt - K3 S3) - o
//! ```
//!
//! - **Multiple surfaces** (M. Won and J. K. Hedrick, International Journal of Control 64, 1996): the derivatives of
//!   `P_d` and `y_d` are differences of two samples.
//! - **Dynamic surface** (D. Swaroop, J. K. Hedrick, P. P. Yip and J. C. Gerdes, IEEE Transactions on Automatic Control 45,
//!   2000): `P_d` and `y_d` pass lags `T dz/dt = P_d - z`, which give them.
//! - **Receding horizon** (A. Hansen and J. K. Hedrick, American Control Conference, 2015): the moves of the command over
//!   the next samples that bring `S` from where it is to zero as `exp(-K1 t)` in least squares, the motion
//!   known ahead; the first of them is made.
//!
//! State, force `f` on the table and offset `o` of the valve are those of preview control's Kalman
//! filter, [`Feedback`].

mod horizon;
mod surfaces;

use nalgebra::SVector;
use units::constants::SAMPLING_PERIOD;
use units::{Parameters as _, vocabulary};

pub use self::surfaces::SurfaceMemory;
use crate::aids::rig::KnownRig;
use crate::pid::VALVE_LIMIT;
use crate::preview::feedback::{Feedback, FeedbackState, Uncertainty};
use crate::preview::feedforward::PREVIEW;
use crate::preview::model::SampledRig;
use crate::{Controller, ModelError, Motion};

/// Which law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// Multiple surfaces.
    #[default]
    MultipleSurface,
    /// Dynamic surface.
    DynamicSurface,
    /// Receding horizon.
    RecedingHorizon,
}

/// What the law is built from.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct Parameters {
    /// Which law.
    pub variant: Variant,
    /// Largest magnitude of the valve command, V.
    #[parameter("V", name = vocabulary::VALVE_LIMIT, positive)]
    pub limit: f64,
    /// lambda, 1/s.
    #[parameter("1/s", positive)]
    pub surface_rate: f64,
    /// `K1`, `K2`, `K3`, 1/s.
    #[parameter(
        0,
        name = "motion_reaching_rate",
        about = "K1, of the motion's surface",
        "1/s",
        positive
    )]
    #[parameter(
        1,
        name = "oil_reaching_rate",
        about = "K2, of the oil's",
        "1/s",
        positive
    )]
    #[parameter(
        2,
        name = "spool_reaching_rate",
        about = "K3, of the spool's",
        "1/s",
        positive
    )]
    pub reaching_rates: [f64; 3],
    /// Time constants of the lags on `P_d` and `y_d`, s.
    #[parameter(
        0,
        name = "oil_filter_time",
        about = "Dynamic surface: lag of the wanted force",
        "s",
        positive
    )]
    #[parameter(
        1,
        name = "spool_filter_time",
        about = "Dynamic surface: lag of the wanted opening",
        "s",
        positive
    )]
    pub filter_times: [f64; 2],
    /// Surfaces: samples by which the motion that they follow is ahead.
    ///
    /// At most [`PREVIEW`]: what sampling, differences or lags make the table late by.
    #[parameter(name = "reference_lead_samples", min = 0.0, max = 20.0)]
    pub lead: usize,
    /// Receding horizon: weight of the command's change a sample, m/(V.s).
    ///
    /// Beside `S`.
    #[parameter("m/(V.s)", positive)]
    pub move_weight: f64,
    /// What the estimates take to be uncertain.
    #[parameters]
    pub uncertainty: Uncertainty,
    /// The rig.
    #[parameters]
    pub rig: KnownRig,
    /// Sampling period, s.
    pub period: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            variant: Variant::default(),
            rig: KnownRig::default(),
            surface_rate: 20.0,
            reaching_rates: [20.0, 40.0, 80.0],
            filter_times: [0.01, 0.005],
            lead: 0,
            move_weight: 0.01,
            uncertainty: crate::preview::Parameters::default().uncertainty,
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
        if self.lead > PREVIEW {
            return Err(ModelError::Parameter {
                name: Self::REFERENCE_LEAD_SAMPLES,
                value: self.lead as f64,
                expected: "at most 20",
            });
        }
        self.check()?;
        ModelError::require_positive("period", self.period)
    }
}

/// What the law is told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfaceInput {
    /// Wanted motion: now, then sample by sample ahead.
    pub reference: [Motion; PREVIEW + 1],
    /// Measured motion.
    pub measured: Motion,
}

/// What the law remembers: plain data.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Memory {
    feedback: FeedbackState,
    surfaces: SurfaceMemory,
    /// The command before, V.
    command: f64,
}

/// The law: what it was built from, what follows from that, and what it remembers.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceControl {
    parameters: Parameters,
    rig: SampledRig,
    feedback: Feedback,
    /// First move over the horizon per error of `S` at its samples, V s/m.
    moves: [f64; PREVIEW],
    /// The law's memory.
    pub memory: Memory,
}

impl SurfaceControl {
    /// Designs filter and horizon.
    ///
    /// # Errors
    /// What [`Parameters::validate`] refuses; a Riccati equation without a stabilising solution.
    pub fn new(parameters: Parameters) -> Result<Self, ModelError> {
        parameters.validate()?;
        let p = &parameters;
        let rig = p.rig.model().sample(p.period);
        let usual = crate::preview::Parameters::default();
        // Of the feedback only the filter is used.
        let feedback = Feedback::new(
            &rig,
            &SVector::from(usual.feedback_weights),
            usual.command_weight,
            &p.uncertainty,
            p.rig.delay,
        )?;
        let moves = horizon::first_move(&rig, p.surface_rate, p.move_weight)?;
        Ok(Self {
            parameters,
            rig,
            feedback,
            moves,
            memory: Memory::default(),
        })
    }

    /// What it was built from.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }
}

impl Controller for SurfaceControl {
    type Input = SurfaceInput;
    /// Valve command, V.
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.parameters.validate()
    }

    fn step(&mut self, input: &SurfaceInput, _period: f64) -> f64 {
        let p = &self.parameters;
        let Motion {
            displacement,
            velocity,
            acceleration,
        } = input.measured;
        let measured = SVector::from([displacement, velocity, acceleration]);
        let memory = &mut self.memory;
        let state = &mut memory.feedback;
        let found = self.feedback.estimate(state, &self.rig, &measured, 0.0);
        let command = match p.variant {
            Variant::RecedingHorizon => horizon::command(
                &horizon::Plan {
                    feedback: &self.feedback,
                    rig: &self.rig,
                    moves: &self.moves,
                    surface_rate: p.surface_rate,
                    left: (-p.reaching_rates[0] * p.period).exp(),
                },
                &found,
                &input.reference,
                memory.command,
            ),
            variant => {
                let is_filtered = variant == Variant::DynamicSurface;
                surfaces::command(
                    p,
                    is_filtered,
                    &found,
                    &input.reference[p.lead],
                    &mut memory.surfaces,
                )
            }
        };
        let command = command.clamp(-p.limit, p.limit);
        self.feedback.sent(state, &self.rig, command, 0.0);
        memory.command = command;
        command
    }

    fn reset(&mut self) {
        self.memory = Memory::default();
    }
}

#[cfg(test)]
mod tests;

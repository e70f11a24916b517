//! Prediction over the transport delay between a high-level law and the valve.
//!
//! A command given at sample k moves the valve at sample k + N. The law must then act on what the
//! table will do at k + N, which the commands already on their way decide: an observer with the
//! model of the table carries the measurements N samples on. The commands on their way are
//! known by running copies of the low-level loops, since those receive the very numbers that the law
//! sends and measures. What is predicted is the change from now to then, added to the measurement,
//! so that a biased sensor biases the result by no more than itself.

use nalgebra::{DMatrix, SMatrix, SVector};
use plant::identified::shake_table::ShakeTable;
use plant::linear::{discrete_riccati, zero_order_hold};
use units::constants::{INCH, LBF};
use units::vocabulary;

use crate::allocation::{ControlAllocation, LoopCommands};
use crate::hierarchy::{LowLevelReferences, SlidingModeInput, displacement_loop, force_loop};
use crate::pid::{Pid, PidInput};
use crate::{Controller, ModelError, Motion};

/// Largest delay that can be predicted over, samples.
pub const MOST_DELAY_SAMPLES: usize = 8;

/// Standard deviations that the observer assumes: valve command (V) and specimen force (N) about
/// what is known of them, measured displacement (m), velocity (m/s) and force (N).
const DISTURBANCES: [f64; 2] = [0.1, LBF];
const NOISES: [f64; 3] = [1e-3 * INCH, 1e-2 * INCH, 0.5 * LBF];

/// States of the observer: the actuator's three, displacement, velocity. Measured of them:
const MEASURED: [usize; 3] = [3, 4, 0];

/// The model, the copies of the low-level loops, and what is on its way.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PredictionOverDelay {
    /// Samples from measurement to valve, `N`.
    pub loop_delay_samples: usize,
    /// Samples from this law to the low-level loops, zero or one: one where each hop between
    /// components costs a sample.
    pub command_delay_samples: usize,
    /// True where the references given to the law are those of N samples ahead; otherwise they are
    /// extrapolated over the delay by their Taylor series with the last change of acceleration.
    pub reference_ahead: bool,
    /// Copy of the displacement loop.
    pub displacement_loop: Pid,
    /// Copy of the force loop.
    pub force_loop: Pid,
    /// Copy of the allocation.
    pub allocation: ControlAllocation,
    transition: SMatrix<f64, 5, 5>,
    input: SMatrix<f64, 5, 2>,
    observer_gain: SMatrix<f64, 5, 3>,
    memory: Memory,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
struct Memory {
    state: SVector<f64, 5>,
    commands: [f64; MOST_DELAY_SAMPLES + 1],
    pending: LowLevelReferences,
    specimen_acceleration: f64,
    reference_acceleration: f64,
}

/// Signals at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Instant {
    /// Motion of the table.
    pub motion: Motion,
    /// Force of the actuator, N.
    pub force: f64,
    /// Absolute acceleration of the specimen, m/s².
    pub specimen_acceleration: f64,
}

/// What is foreseen at a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Foreseen {
    /// The wanted motion when the valve moves.
    pub reference: Motion,
    /// When the valve moves.
    pub action: Instant,
    /// When the low-level loops receive their references.
    pub low_level: Instant,
}

impl PredictionOverDelay {
    /// For a table sampled with `period`, the low-level loops and shares of Section 4.3.
    ///
    /// # Errors
    /// A delay out of range, by name; a table that its displacement, velocity and force do not show
    /// (no stabilising Riccati solution).
    pub fn new(
        shake_table: &ShakeTable,
        period: f64,
        loop_delay_samples: usize,
        command_delay_samples: usize,
    ) -> Result<Self, ModelError> {
        ModelError::require_positive("sampling_period", period)?;
        shake_table.validate()?;
        let (a, b) = shake_table.dynamics();
        let (transition, input) = zero_order_hold(&a, &b, period);
        let allocation = ControlAllocation::default();
        let prediction = Self {
            loop_delay_samples,
            command_delay_samples,
            reference_ahead: false,
            displacement_loop: displacement_loop(&allocation),
            force_loop: force_loop(&allocation),
            allocation,
            transition,
            input,
            observer_gain: observer_gain(&transition, &input)?,
            memory: Memory::default(),
        };
        prediction.validate()?;
        Ok(prediction)
    }

    /// Checks delays and loops.
    ///
    /// # Errors
    /// A delay out of range, a low-level loop that cannot run.
    pub fn validate(&self) -> Result<(), ModelError> {
        let delay = self.loop_delay_samples;
        if delay > MOST_DELAY_SAMPLES {
            return Err(ModelError::Parameter {
                name: vocabulary::LOOP_DELAY_SAMPLES,
                value: delay as f64,
                expected: "a whole number from 0 to 8",
            });
        }
        if self.command_delay_samples > delay.min(1) {
            return Err(ModelError::Parameter {
                name: vocabulary::COMMAND_DELAY_SAMPLES,
                value: self.command_delay_samples as f64,
                expected: "0 or 1, and no more than loop_delay_samples",
            });
        }
        self.displacement_loop.validate()?;
        self.force_loop.validate()?;
        self.allocation.validate()
    }

    /// Takes in the measurements of a sample and looks ahead.
    pub(crate) fn foresee(
        &mut self,
        input: &SlidingModeInput,
        specimen_mass: f64,
        period: f64,
    ) -> Foreseen {
        if self.command_delay_samples == 1 {
            let arriving = self.memory.pending;
            self.command(&arriving, input, period);
        }
        let measured = SVector::<f64, 3>::new(
            input.measured.displacement,
            input.measured.velocity,
            input.measured_force,
        );
        let expected = SVector::<f64, 3>::from_fn(|i, _| self.memory.state[MEASURED[i]]);
        let now = self.memory.state + self.observer_gain * (measured - expected);
        let change = input.specimen_acceleration - self.memory.specimen_acceleration;
        let instant = |state: &SVector<f64, 5>, samples: usize| Instant {
            motion: Motion {
                displacement: input.measured.displacement + state[3] - now[3],
                velocity: input.measured.velocity + state[4] - now[4],
                acceleration: input.measured.acceleration,
            },
            force: input.measured_force + state[0] - now[0],
            specimen_acceleration: input.specimen_acceleration + change * samples as f64,
        };
        let mut low_level = instant(&now, 0);
        let mut state = now;
        for i in 0..self.loop_delay_samples {
            let specimen_force =
                -specimen_mass * (input.specimen_acceleration + change * (i as f64 + 0.5));
            state = self.transition * state
                + self.input.column(0) * self.memory.commands[i]
                + self.input.column(1) * specimen_force;
            if i == 0 {
                self.memory.state = state;
            }
            if i + 1 == self.command_delay_samples {
                low_level = instant(&state, i + 1);
            }
        }
        let foreseen = Foreseen {
            reference: self.reference_at_action(&input.reference, period),
            action: instant(&state, self.loop_delay_samples),
            low_level,
        };
        self.memory.specimen_acceleration = input.specimen_acceleration;
        self.memory.reference_acceleration = input.reference.acceleration;
        foreseen
    }

    fn reference_at_action(&self, reference: &Motion, period: f64) -> Motion {
        if self.reference_ahead {
            return *reference;
        }
        let t = self.loop_delay_samples as f64 * period;
        let jerk = (reference.acceleration - self.memory.reference_acceleration) / period;
        Motion {
            displacement: reference.displacement
                + t * (reference.velocity + t * (reference.acceleration / 2.0 + t * jerk / 6.0)),
            velocity: reference.velocity + t * (reference.acceleration + t * jerk / 2.0),
            acceleration: reference.acceleration + t * jerk,
        }
    }

    /// Takes note of what the law sends.
    pub(crate) fn remember(
        &mut self,
        sent: &LowLevelReferences,
        input: &SlidingModeInput,
        period: f64,
    ) {
        if self.command_delay_samples == 0 {
            self.command(sent, input, period);
        } else {
            self.memory.pending = *sent;
        }
        self.memory.commands.rotate_left(1);
    }

    /// Runs the copies of the low-level loops and puts their command on its way.
    fn command(&mut self, references: &LowLevelReferences, input: &SlidingModeInput, period: f64) {
        let commands = LoopCommands {
            displacement_loop: self.displacement_loop.step(
                &PidInput {
                    reference: references.displacement,
                    measured: input.measured.displacement,
                },
                period,
            ),
            force_loop: self.force_loop.step(
                &PidInput {
                    reference: references.force,
                    measured: input.measured_force,
                },
                period,
            ),
        };
        let place = self.loop_delay_samples - self.command_delay_samples;
        self.memory.commands[place] = self.allocation.step(&commands, period);
    }

    /// Forgets everything but the parameters.
    pub fn reset(&mut self) {
        self.memory = Memory::default();
        self.displacement_loop.reset();
        self.force_loop.reset();
    }
}

/// Steady-state Kalman gain for [`DISTURBANCES`] and [`NOISES`].
fn observer_gain(
    transition: &SMatrix<f64, 5, 5>,
    input: &SMatrix<f64, 5, 2>,
) -> Result<SMatrix<f64, 5, 3>, ModelError> {
    let a = DMatrix::from_fn(5, 5, |i, j| transition[(i, j)]);
    let c = DMatrix::from_fn(3, 5, |i, j| f64::from(u8::from(j == MEASURED[i])));
    let b = DMatrix::from_fn(5, 2, |i, j| input[(i, j)] * DISTURBANCES[j]);
    let r = DMatrix::from_fn(3, 3, |i, j| if i == j { NOISES[i].powi(2) } else { 0.0 });
    let p = discrete_riccati(&a.transpose(), &c.transpose(), &(&b * b.transpose()), &r)?;
    let innovation = &c * &p * c.transpose() + r;
    let gain = innovation
        .lu()
        .solve(&(&c * &p))
        .ok_or(ModelError::NoSolution {
            equation: "the discrete Riccati equation",
            reason: "the innovation's covariance is singular".into(),
        })?
        .transpose();
    Ok(SMatrix::from_fn(|i, j| gain[(i, j)]))
}

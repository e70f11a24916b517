//! Model predictive control over three-variable control (Section 5.3).
//!
//! It commands displacement, velocity and acceleration to three-variable control, which stays
//! what drives the valve.

pub mod disturbance;
pub mod kalman;
mod memory;
pub mod parameters;
pub mod prediction;
pub mod problem;
pub mod solver;

use nalgebra::{DMatrix, DVector};

pub use self::memory::{Counters, Memory, Plan};
pub use self::parameters::{
    LowLevelLaw, MAXIMUM_DELAY, MAXIMUM_HORIZON, MAXIMUM_ORDER, Noise, Outlook, OutputLimits,
    Parameters, SolverChoice, Weights, prediction_plant,
};

use self::kalman::SteadyStateKalmanFilter;
use self::prediction::{CHANNELS, LoopModel};
use self::problem::{Found, ReducedProblem, Workspace};
use self::solver::{Clarabel, Kwik, Solver};
use crate::three_variable::{ThreeVariableControl, ThreeVariableInput};
use crate::{Controller, ModelError, Motion};

/// Model predictive control: what it was built from, what it remembers, and what follows from the
/// first alone.
pub struct ModelPredictiveControl {
    parameters: Parameters,
    /// The controller's memory.
    pub memory: Memory,
    model: LoopModel,
    filter: SteadyStateKalmanFilter,
    problem: ReducedProblem,
    solver: Box<dyn Solver>,
    work: Workspace,
    innovation: DVector<f64>,
    estimate: DVector<f64>,
    state: DVector<f64>,
    next_state: DVector<f64>,
}

/// What model predictive control is told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ModelPredictiveInput {
    /// Wanted motion: now, then sample by sample ahead. Without preview only the first counts.
    pub reference: [Motion; MAXIMUM_HORIZON + 1],
    /// Measured motion.
    pub measured: Motion,
}

impl ModelPredictiveInput {
    /// Window of a reference that starts at `sample`; its last sample stays beyond the end.
    ///
    /// # Errors
    /// An empty reference.
    pub fn window(
        reference: &[Motion],
        sample: usize,
        measured: Motion,
    ) -> Result<Self, ModelError> {
        let Some(last) = reference.last() else {
            return Err(ModelError::Parameter {
                name: "reference",
                value: 0.0,
                expected: "at least one sample",
            });
        };
        Ok(Self {
            reference: std::array::from_fn(|i| *reference.get(sample + i).unwrap_or(last)),
            measured,
        })
    }
}

impl ModelPredictiveControl {
    /// Builds prediction, filter and problem.
    ///
    /// # Errors
    /// What [`Parameters::validate`] refuses, by name; a Riccati equation without a stabilising
    /// solution.
    pub fn new(parameters: Parameters) -> Result<Self, ModelError> {
        parameters.validate()?;
        let p = &parameters;
        let gains = &p.low_level.gains;
        let model = match p.law {
            LowLevelLaw::Sampled => {
                LoopModel::sampled(&p.plant, gains, p.loop_delay_samples, p.period)
            }
            LowLevelLaw::Continuous => LoopModel::continuous(&p.plant, gains, p.period),
        };
        let filter = design_filter(&model, p)?;
        let problem =
            ReducedProblem::new(&model, p.horizon, &p.weights, &p.limits, p.valve_limit())?;
        let (hessian, constraints) = (&problem.hessian, &problem.constraints);
        let solver: Box<dyn Solver> = match p.solver {
            SolverChoice::Kwik => Box::new(Kwik::new(
                hessian,
                constraints,
                p.iteration_limit,
                p.time_limit,
            )?),
            SolverChoice::Clarabel => Box::new(Clarabel::new(
                hessian,
                constraints,
                p.iteration_limit,
                p.time_limit,
            )?),
        };
        Ok(Self {
            memory: Memory::default(),
            work: problem.workspace(),
            estimate: DVector::zeros(model.order()),
            innovation: DVector::zeros(CHANNELS),
            state: DVector::zeros(model.order()),
            next_state: DVector::zeros(model.order()),
            model,
            filter,
            problem,
            solver,
            parameters,
        })
    }

    /// What it was built from.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The loop that predicts.
    pub fn model(&self) -> &LoopModel {
        &self.model
    }

    /// The estimator.
    pub fn filter(&self) -> &SteadyStateKalmanFilter {
        &self.filter
    }

    /// The optimisation.
    pub fn problem(&self) -> &ReducedProblem {
        &self.problem
    }

    /// The numbers of the latest step's optimisation.
    pub fn workspace(&self) -> &Workspace {
        &self.work
    }

    /// Measurement update (Eq 5-10): `self.estimate` becomes `x_c[k|k]`.
    fn correct(&mut self, measured: &Motion) {
        let n = self.estimate.len();
        self.estimate.copy_from_slice(&self.memory.prediction[..n]);
        self.innovation.copy_from_slice(&[
            measured.displacement,
            measured.velocity,
            measured.acceleration,
        ]);
        self.innovation
            .gemv(-1.0, &self.model.c, &self.estimate, 1.0);
        self.estimate
            .gemv(1.0, &self.filter.gain, &self.innovation, 1.0);
    }

    /// The loop's state at the sample at which the command of this step will be used.
    fn predict_start(&mut self) {
        self.state.copy_from(&self.estimate);
        for command in &self.memory.command_line[..self.parameters.command_delay_samples] {
            self.next_state.gemv(1.0, &self.model.a, &self.state, 0.0);
            for (j, value) in command.iter().enumerate() {
                self.next_state.axpy(*value, &self.model.b.column(j), 1.0);
            }
            std::mem::swap(&mut self.state, &mut self.next_state);
        }
    }

    /// Writes reference, state and previous command to the workspace.
    fn pose(&mut self, reference: &[Motion; MAXIMUM_HORIZON + 1]) {
        let p = &self.parameters;
        let first = 1 + p.loop_delay_samples + p.command_delay_samples;
        let now = reference[0];
        let change = match (p.outlook, self.memory.reference_acceleration) {
            (Outlook::Extrapolate, Some(before)) => (now.acceleration - before) / p.period,
            _ => 0.0,
        };
        for i in 0..p.horizon {
            let motion = match p.outlook {
                Outlook::Preview => reference[(first + i).min(MAXIMUM_HORIZON)],
                Outlook::Hold => now,
                Outlook::Extrapolate => {
                    let t = (first + i) as f64 * p.period;
                    Motion {
                        displacement: now.displacement
                            + t * (now.velocity + t * (now.acceleration / 2.0 + t * change / 6.0)),
                        velocity: now.velocity + t * (now.acceleration + t * change / 2.0),
                        acceleration: now.acceleration + t * change,
                    }
                }
            };
            self.work.given[CHANNELS * i] = motion.displacement;
            self.work.given[CHANNELS * i + 1] = motion.velocity;
            self.work.given[CHANNELS * i + 2] = motion.acceleration;
        }
        self.memory.reference_acceleration = Some(now.acceleration);
        let (offset, order) = (CHANNELS * p.horizon, self.state.len());
        // Three-variable control sees the disturbances and has integrated them.
        self.work.valve_offset = self.model.valve_feedback().map_or(0.0, |feedback| {
            let disturbances = self.state.fixed_rows::<CHANNELS>(order - CHANNELS);
            feedback.dot(&disturbances.transpose()) + self.memory.integral
                - self.estimate[self.model.integral_state]
        });
        self.work
            .given
            .rows_mut(offset, order)
            .copy_from(&self.state);
        for j in 0..CHANNELS {
            self.work.given[offset + order + j] = self.memory.command[j];
        }
    }

    /// The optimum's first command; failing that the previous plan's next, failing that the
    /// reference, which leaves the motion to three-variable control.
    fn decide(&mut self, reference: &[Motion; MAXIMUM_HORIZON + 1]) -> [f64; CHANNELS] {
        let found = self.problem.optimise(&mut self.work, &mut *self.solver);
        let counters = &mut self.memory.counters;
        counters.iterations = 0;
        let (horizon, order) = (self.parameters.horizon, self.state.len());
        let offset = CHANNELS * horizon;
        match found {
            Found::Shortcut => counters.shortcuts += 1,
            Found::Solver(iterations) => {
                counters.solved += 1;
                counters.iterations = u32::try_from(iterations).unwrap_or(u32::MAX);
                counters.total_iterations += iterations as u64;
            }
            Found::No => {
                if let Some(plan) = &mut self.memory.plan
                    && plan.age + 1 < horizon
                {
                    counters.shifted_plans += 1;
                    plan.age += 1;
                    let given = self.work.given.as_mut_slice();
                    given[offset..offset + order].copy_from_slice(&plan.state[..order]);
                    given[offset + order..].copy_from_slice(&plan.previous);
                    let solution = self.work.solution.as_mut_slice();
                    solution[..horizon].copy_from_slice(&plan.sequence[..horizon]);
                    return self.problem.command(&self.work, plan.age);
                }
                self.memory.plan = None;
                counters.low_level_alone += 1;
                let Motion {
                    displacement,
                    velocity,
                    acceleration,
                } = match self.parameters.outlook {
                    Outlook::Preview => reference[self.parameters.command_delay_samples],
                    Outlook::Hold | Outlook::Extrapolate => reference[0],
                };
                return [displacement, velocity, acceleration];
            }
        }
        let mut plan = Plan {
            previous: self.memory.command,
            ..Plan::default()
        };
        plan.sequence[..horizon].copy_from_slice(&self.work.solution.as_slice()[..horizon]);
        plan.state[..order].copy_from_slice(self.state.as_slice());
        self.memory.plan = Some(plan);
        self.problem.command(&self.work, 0)
    }

    /// Time update (Eq 5-11) for the command that reaches three-variable control now. Where its
    /// valve command hits the limit, the part cut off is taken out of the prediction too.
    fn advance(&mut self, command: [f64; CHANNELS], measured: &Motion) {
        let p = &self.parameters;
        let memory = &mut self.memory;
        let arriving = push(&mut memory.command_line[..p.command_delay_samples], command);
        memory.command = command;
        let input = ThreeVariableInput {
            reference: Motion {
                displacement: arriving[0],
                velocity: arriving[1],
                acceleration: arriving[2],
            },
            measured: *measured,
        };
        let mut limited = ThreeVariableControl {
            integral: memory.integral,
            ..p.low_level
        };
        let mut unlimited = ThreeVariableControl {
            limit: f64::INFINITY,
            ..limited
        };
        let cut = limited.step(&input, p.period) - unlimited.step(&input, p.period);
        memory.integral = limited.integral;

        let next = &mut self.next_state;
        next.gemv(1.0, &self.model.a, &self.estimate, 0.0);
        for (j, value) in arriving.iter().enumerate() {
            next.axpy(*value, &self.model.b.column(j), 1.0);
        }
        if cut != 0.0 {
            next.axpy(cut, &self.model.aside.column(0), 1.0);
            next[self.model.integral_state] += limited.integral - unlimited.integral;
        }
        memory.prediction[..next.len()].copy_from_slice(next.as_slice());
    }
}

/// Appends to a delay line and returns what leaves it; without delay that is `newest`.
fn push<T: Copy>(line: &mut [T], newest: T) -> T {
    let Some(&oldest) = line.first() else {
        return newest;
    };
    line.rotate_left(1);
    if let Some(last) = line.last_mut() {
        *last = newest;
    }
    oldest
}

impl Controller for ModelPredictiveControl {
    type Input = ModelPredictiveInput;
    /// Commands to three-variable control.
    type Output = Motion;

    fn validate(&self) -> Result<(), ModelError> {
        self.parameters.validate()
    }

    fn step(&mut self, input: &ModelPredictiveInput, _period: f64) -> Motion {
        self.correct(&input.measured);
        self.predict_start();
        self.pose(&input.reference);
        let command = self.decide(&input.reference);
        self.advance(command, &input.measured);
        Motion {
            displacement: command[0],
            velocity: command[1],
            acceleration: command[2],
        }
    }

    fn reset(&mut self) {
        self.memory = Memory::default();
    }
}

fn design_filter(model: &LoopModel, p: &Parameters) -> Result<SteadyStateKalmanFilter, ModelError> {
    let size = model.order();
    let deviations = nalgebra::dvector![p.noise.valve, p.noise.force];
    let noise = &model.aside * DMatrix::from_diagonal(&deviations);
    let mut q = &noise * noise.transpose();
    let walk = p.disturbance.step();
    for i in 0..CHANNELS {
        let state = size - CHANNELS + i;
        q[(state, state)] = walk[i].powi(2);
    }
    let r = DMatrix::from_diagonal(&DVector::from_fn(CHANNELS, |i, _| {
        p.noise.measurement[i].powi(2)
    }));
    SteadyStateKalmanFilter::new(&model.a, &model.c, &q, &r)
}

#[cfg(test)]
mod problem_tests;
#[cfg(test)]
mod process_model_tests;
#[cfg(test)]
mod tests;

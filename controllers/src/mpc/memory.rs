//! What model predictive control remembers: plain data.

use super::parameters::{MAXIMUM_DELAY, MAXIMUM_HORIZON, MAXIMUM_ORDER};
use super::prediction::CHANNELS;

/// Most states of the prediction: a plant, the commands on their way to the valve, the integral,
/// three disturbances.
const LOOP_STATES: usize = MAXIMUM_ORDER + MAXIMUM_DELAY + 1 + CHANNELS;

/// What model predictive control remembers from sample to sample: plain data.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Memory {
    /// `x_c[k|k-1]` of Eq 5-11.
    pub prediction: [f64; LOOP_STATES],
    /// Integral part of three-variable control, V.
    pub integral: f64,
    /// Commands on their way to three-variable control, oldest first.
    pub command_line: [[f64; CHANNELS]; MAXIMUM_DELAY],
    /// Latest command.
    pub command: [f64; CHANNELS],
    /// Reference acceleration one sample ago, m/s², absent before the first.
    pub reference_acceleration: Option<f64>,
    /// Latest plan.
    pub plan: Option<Plan>,
    /// What happened so far.
    pub counters: Counters,
}

/// Numbers from which the plan of a step follows.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Plan {
    /// Samples since it was made.
    pub age: usize,
    pub(super) sequence: [f64; MAXIMUM_HORIZON],
    pub(super) state: [f64; LOOP_STATES],
    pub(super) previous: [f64; CHANNELS],
}

/// Counts since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct Counters {
    /// Steps whose optimum was the minimiser without limits.
    pub shortcuts: u32,
    /// Steps that the solver solved.
    pub solved: u32,
    /// Iterations of the solver in the latest step.
    pub iterations: u32,
    /// Iterations of the solver in all steps.
    pub total_iterations: u64,
    /// Steps that went on along the previous plan because the solver failed or ran out of time.
    pub shifted_plans: u32,
    /// Steps left to three-variable control alone because no plan reached so far.
    pub low_level_alone: u32,
}

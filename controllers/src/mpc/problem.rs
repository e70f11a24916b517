//! The optimisation of a step (Eq 5-14 to 5-18), reduced to what the valve can do.
//!
//! The 3p commands act through one valve, so the outputs depend on p numbers only, the effective
//! valve sequence `w` (`HorizonResponse`). Of all commands `z` that give the same `w`, and so the
//! same outputs, the cost of Eq 5-17 prefers one. With the previous command `u`, `z = E u + z'`
//! (`E` repeats it over the horizon), `D` the differences along the horizon and `R = D' W D`, it is
//!
//! `min z' R z'` subject to `M z' = b`, `b = N w + S s - M E u`:
//! `z' = R^-1 M' P b`, at the cost `b' P b`, with `P = (M R^-1 M')^-1`.
//!
//! That is the exact minimum over the null space: p variables and the slack are left, and their
//! optimum is the optimum over all 3p and the slack.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::parameters::{OutputLimits, Weights};
use super::prediction::{CHANNELS, LoopModel};
use super::solver::{Outcome, Solver};
use crate::ModelError;

/// Matrices of the reduced problem, made once.
#[derive(Debug, Clone, PartialEq)]
pub struct ReducedProblem {
    horizon: usize,
    /// Hessian over `[w; slack]`; the cost is `x' H x` less what is linear.
    pub hessian: DMatrix<f64>,
    /// Rows `A [w; slack] >= b`.
    pub constraints: DMatrix<f64>,
    /// Minimiser without limits from `[stacked reference; state; previous command]`.
    minimiser: DMatrix<f64>,
    /// `b` is this part plus `bound_state` times the state.
    bound_constant: DVector<f64>,
    bound_state: DMatrix<f64>,
    /// Constraints from this one on are the valve's: the first half its lower, the rest its upper
    /// limit.
    first_valve_row: usize,
    valve_limit: f64,
    /// The limited outputs to `w` and to the state, and their limits.
    limited_forced: DMatrix<f64>,
    limited_free: DMatrix<f64>,
    lowest: DVector<f64>,
    highest: DVector<f64>,
    /// Stacked commands from `w`, from the state and from the previous command.
    plan_sequence: DMatrix<f64>,
    plan_state: DMatrix<f64>,
    plan_previous: DMatrix<f64>,
}

/// What a step's optimisation works in; nothing of it is remembered.
#[derive(Debug, Clone, PartialEq)]
pub struct Workspace {
    /// `[stacked reference; state; previous command]`, the numbers of the step.
    pub given: DVector<f64>,
    /// What the valve command will be beyond the model's `w`, V.
    pub valve_offset: f64,
    /// `[w; slack]`.
    pub solution: DVector<f64>,
    target: DVector<f64>,
    bound: DVector<f64>,
    limited: DVector<f64>,
}

/// How a step's optimum was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// The minimiser without limits keeps every limit: it is the optimum.
    Shortcut,
    /// By the solver, in so many iterations.
    Solver(usize),
    /// Not found: the solver failed or ran out of iterations or time.
    No,
}

impl ReducedProblem {
    /// Builds the problem of `horizon` samples; `valve_limit` (V) bounds the valve sequence where
    /// the model has one. That limit is hard, as the valve's is, and always leaves a solution; the
    /// output limits are soft.
    ///
    /// # Errors
    /// A Hessian that is not positive definite.
    pub fn new(
        model: &LoopModel,
        horizon: usize,
        weights: &Weights,
        limits: &OutputLimits,
        valve_limit: Option<f64>,
    ) -> Result<Self, ModelError> {
        let singular = |what: &str| ModelError::NoSolution {
            equation: "the prediction's least squares (Eq 5-14; its weights set it)",
            reason: format!("{what} is not positive definite"),
        };
        let (p, n) = (horizon, model.order());
        let tracking = weights.tracking();
        let response = model.respond(p, &tracking)?;
        let m = &response.commands;

        // R^-1 = D^-1 W^-1 D^-T, and D^-1 sums up.
        let rate = weights.rate();
        let sum = DMatrix::from_fn(CHANNELS * p, CHANNELS * p, |i, j| {
            f64::from(u8::from(j <= i && i % CHANNELS == j % CHANNELS))
        });
        let free_rate = DMatrix::from_diagonal(&DVector::from_fn(CHANNELS * p, |i, _| {
            1.0 / rate[i % CHANNELS]
        }));
        let inverse_r = &sum * free_rate * sum.transpose();
        let to_commands = &inverse_r * m.transpose();
        let price = Cholesky::new(m * &to_commands)
            .ok_or_else(|| singular("the cost of the valve's movement"))?
            .inverse();
        let repeat = DMatrix::from_fn(CHANNELS * p, CHANNELS, |i, j| {
            f64::from(u8::from(i % CHANNELS == j))
        });

        let (g, big_n) = (&response.forced, &response.sequence);
        let weight = DMatrix::from_diagonal(&DVector::from_fn(CHANNELS * p, |i, _| {
            tracking[i % CHANNELS]
        }));
        let tracking_gain = g.transpose() * weight;
        let price_gain = big_n.transpose() * &price;
        let small = &tracking_gain * g + &price_gain * big_n;
        let small = (&small + small.transpose()) * 0.5;

        let mut linear = DMatrix::zeros(p, CHANNELS * p + n + CHANNELS);
        linear
            .columns_mut(0, CHANNELS * p)
            .copy_from(&tracking_gain);
        linear
            .columns_mut(CHANNELS * p, n)
            .copy_from(&-(&tracking_gain * &response.free + &price_gain * &response.offset));
        linear
            .columns_mut(CHANNELS * p + n, CHANNELS)
            .copy_from(&(&price_gain * m * &repeat));
        let minimiser = Cholesky::new(small.clone())
            .ok_or_else(|| singular("its Hessian"))?
            .solve(&linear);

        let mut hessian = DMatrix::zeros(p + 1, p + 1);
        hessian.view_mut((0, 0), (p, p)).copy_from(&small);
        hessian[(p, p)] = weights.violation;

        let rows: Vec<(usize, f64, f64, f64)> = (0..CHANNELS * p)
            .flat_map(|output| {
                let channel = output % CHANNELS;
                let scale = weights.scale[channel];
                let (low, high) = (limits.minimum[channel], limits.maximum[channel]);
                [(output, 1.0, low, scale), (output, -1.0, -high, scale)]
            })
            .filter(|(_, _, bound, _)| bound.is_finite())
            .collect();
        let first_valve_row = rows.len();
        let valve_rows = if valve_limit.is_some() { 2 * p } else { 0 };
        let mut constraints = DMatrix::zeros(first_valve_row + valve_rows, p + 1);
        let mut bound_state = DMatrix::zeros(first_valve_row, n);
        let mut bound_constant = DVector::zeros(first_valve_row + valve_rows);
        if let Some(limit) = valve_limit {
            for i in 0..p {
                constraints[(first_valve_row + i, i)] = 1.0;
                constraints[(first_valve_row + p + i, i)] = -1.0;
            }
            bound_constant.rows_mut(first_valve_row, 2 * p).fill(-limit);
        }
        for (i, &(output, sign, bound, scale)) in rows.iter().enumerate() {
            constraints
                .view_mut((i, 0), (1, p))
                .copy_from(&(g.row(output) * sign));
            constraints[(i, p)] = scale;
            bound_state
                .row_mut(i)
                .copy_from(&(response.free.row(output) * -sign));
            bound_constant[i] = bound;
        }

        let limited: Vec<usize> = (0..CHANNELS * p)
            .filter(|output| {
                let channel = output % CHANNELS;
                limits.minimum[channel].is_finite() || limits.maximum[channel].is_finite()
            })
            .collect();
        let bounds = |bound: &[f64; CHANNELS]| {
            DVector::from_iterator(limited.len(), limited.iter().map(|i| bound[i % CHANNELS]))
        };

        let projection = to_commands * price;
        Ok(Self {
            horizon: p,
            hessian,
            constraints,
            minimiser,
            bound_constant,
            bound_state,
            first_valve_row,
            valve_limit: valve_limit.unwrap_or(f64::INFINITY),
            limited_forced: g.select_rows(&limited),
            limited_free: response.free.select_rows(&limited),
            lowest: bounds(&limits.minimum),
            highest: bounds(&limits.maximum),
            plan_sequence: &projection * big_n,
            plan_state: &projection * &response.offset,
            plan_previous: &repeat - &projection * m * &repeat,
        })
    }

    /// Buffers of the right sizes.
    pub fn workspace(&self) -> Workspace {
        let rows = self.constraints.nrows();
        Workspace {
            given: DVector::zeros(self.minimiser.ncols()),
            valve_offset: 0.0,
            solution: DVector::zeros(self.horizon + 1),
            target: DVector::zeros(self.horizon + 1),
            bound: DVector::zeros(rows),
            limited: DVector::zeros(self.lowest.len()),
        }
    }

    /// Number of samples looked ahead.
    pub fn horizon(&self) -> usize {
        self.horizon
    }

    /// Condition number of the Hessian over `w`.
    pub fn condition(&self) -> f64 {
        let p = self.horizon;
        let values = self
            .hessian
            .view((0, 0), (p, p))
            .into_owned()
            .symmetric_eigenvalues();
        values.max() / values.min()
    }

    /// Finds the optimum for `work.given` into `work.solution`: by the shortcut where the
    /// minimiser without limits keeps them, else by `solver`.
    pub fn optimise(&self, work: &mut Workspace, solver: &mut dyn Solver) -> Found {
        self.minimise_without_limits(work);
        if self.keeps_limits(work) {
            work.solution.copy_from(&work.target);
            return if work.solution.iter().all(|w| w.is_finite()) {
                Found::Shortcut
            } else {
                Found::No
            };
        }
        self.bound(work);
        match solver.nearest(&work.target, &work.bound, &mut work.solution) {
            Outcome::Solved { iterations } if work.solution.iter().all(|x| x.is_finite()) => {
                Found::Solver(iterations)
            }
            _ => Found::No,
        }
    }

    fn minimise_without_limits(&self, work: &mut Workspace) {
        work.target
            .rows_mut(0, self.horizon)
            .gemv(1.0, &self.minimiser, &work.given, 0.0);
    }

    /// Whether the minimiser without limits keeps them all, without slack.
    fn keeps_limits(&self, work: &mut Workspace) -> bool {
        let (p, n) = (self.horizon, self.bound_state.ncols());
        let w = work.target.rows(0, p);
        let offset = work.valve_offset;
        if w.iter().any(|w| (w + offset).abs() > self.valve_limit) {
            return false;
        }
        work.limited.gemv(1.0, &self.limited_forced, &w, 0.0);
        work.limited.gemv(
            1.0,
            &self.limited_free,
            &work.given.rows(CHANNELS * p, n),
            1.0,
        );
        let limits = self.lowest.iter().zip(&self.highest);
        work.limited
            .iter()
            .zip(limits)
            .all(|(y, (low, high))| (low..=high).contains(&y))
    }

    /// The bounds of the step.
    fn bound(&self, work: &mut Workspace) {
        let (p, n) = (self.horizon, self.bound_state.ncols());
        work.bound.copy_from(&self.bound_constant);
        work.bound.rows_mut(0, self.first_valve_row).gemv(
            1.0,
            &self.bound_state,
            &work.given.rows(CHANNELS * p, n),
            1.0,
        );
        for (i, bound) in work.bound.as_mut_slice()[self.first_valve_row..]
            .iter_mut()
            .enumerate()
        {
            *bound += if i < p {
                -work.valve_offset
            } else {
                work.valve_offset
            };
        }
    }

    /// The commands of sample `index` of the plan that belongs to `work`'s numbers and solution.
    pub fn command(&self, work: &Workspace, index: usize) -> [f64; CHANNELS] {
        let (p, n) = (self.horizon, self.bound_state.ncols());
        std::array::from_fn(|channel| {
            let row = CHANNELS * index + channel;
            let mut value = 0.0;
            for j in 0..p {
                value += self.plan_sequence[(row, j)] * work.solution[j];
            }
            for j in 0..n {
                value += self.plan_state[(row, j)] * work.given[CHANNELS * p + j];
            }
            for j in 0..CHANNELS {
                value += self.plan_previous[(row, j)] * work.given[CHANNELS * p + n + j];
            }
            value
        })
    }

    /// Target and bounds of `work.given` for a solver: the optimum is the nearest point to the
    /// first, in the metric of [`Self::hessian`], that keeps [`Self::constraints`].
    pub fn instance<'a>(&self, work: &'a mut Workspace) -> (&'a DVector<f64>, &'a DVector<f64>) {
        self.minimise_without_limits(work);
        self.bound(work);
        (&work.target, &work.bound)
    }
}

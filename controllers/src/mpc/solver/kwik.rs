use std::time::{Duration, Instant};

use nalgebra::{DMatrix, DVector};

use super::metric::Metric;
use super::{Outcome, Solver};
use crate::ModelError;

/// Dense dual active-set method (Schmid and Biegler, "Quadratic programming methods for reduced
/// Hessian SQP", 1994, called KWIK there; Goldfarb and Idnani, "A numerically stable dual method
/// for solving strictly convex quadratic programs", 1983).
///
/// It starts at the minimiser without constraints and adds the most violated constraint, dropping
/// those whose multiplier would turn negative, until none is violated. All of it happens on the
/// constraints' products with each other in the metric of the Hessian, which are made once: with
/// `n_i` the normals of length one there, a step along constraint `p` moves the margin of `i` by
/// `n_i'n_p - n_i'N r`, `N'N r = N'n_p`, `N` the active normals. `R'R = N'N` is kept up to date.
/// At the end multipliers and margins are refined against the constraints themselves.
#[derive(Debug, Clone)]
pub struct Kwik {
    iteration_limit: usize,
    time_limit: Option<Duration>,
    /// Constraint rows over the lengths of their normals, m x n.
    rows: DMatrix<f64>,
    inverse_lengths: DVector<f64>,
    /// Where a multiplier of one moves the solution, n x m.
    directions: DMatrix<f64>,
    /// Products of the normals, m x m.
    products: DMatrix<f64>,
    // Work of a solve.
    margins: DVector<f64>,
    change: DVector<f64>,
    r: DMatrix<f64>,
    forward: Vec<f64>,
    dual: Vec<f64>,
    multipliers: Vec<f64>,
    active: Vec<usize>,
    is_active: Vec<bool>,
}

/// Violations below this, in units of the largest margin, are rounding.
const TOLERANCE: f64 = 1e-13;
/// Normals closer than this (squared) to the span of the active ones depend on them.
const DEPENDENT: f64 = 1e-12;
/// Most times that the multipliers are refined after the last constraint.
const REFINEMENTS: usize = 2;

impl Kwik {
    /// Hessian (n x n, positive definite) and constraint rows (m x n); gives up after
    /// `iteration_limit` iterations or `time_limit` seconds (infinite: never).
    ///
    /// # Errors
    /// A Hessian that is not positive definite.
    pub fn new(
        hessian: &DMatrix<f64>,
        constraints: &DMatrix<f64>,
        iteration_limit: usize,
        time_limit: f64,
    ) -> Result<Self, ModelError> {
        let (m, n) = constraints.shape();
        let metric = Metric::new(hessian, constraints)?;
        Ok(Self {
            iteration_limit,
            time_limit: Duration::try_from_secs_f64(time_limit).ok(),
            rows: &metric.rows * &metric.to,
            directions: &metric.from * &metric.normals,
            products: &metric.rows * &metric.normals,
            inverse_lengths: metric.inverse_lengths,
            margins: DVector::zeros(m),
            change: DVector::zeros(m),
            r: DMatrix::zeros(n, n),
            forward: vec![0.0; n],
            dual: vec![0.0; n],
            multipliers: vec![0.0; n + 1],
            active: Vec::with_capacity(n + 1),
            is_active: vec![false; m],
        })
    }

    /// Margins of all constraints at `x`.
    fn measure(&mut self, x: &DVector<f64>, bound: &DVector<f64>) {
        self.margins.copy_from(bound);
        self.margins.component_mul_assign(&self.inverse_lengths);
        self.margins.gemv(1.0, &self.rows, x, -1.0);
    }

    /// Most violated constraint, if any is violated by more than `tolerance`.
    fn most_violated(&self, tolerance: f64) -> Option<usize> {
        let (mut worst, mut at) = (-tolerance, None);
        for (i, &margin) in self.margins.iter().enumerate() {
            if margin < worst && !self.is_active[i] {
                (worst, at) = (margin, Some(i));
            }
        }
        at
    }

    /// `self.dual = (N'N)^-1 rhs` where `self.dual` holds `rhs`; `self.forward = R^-T rhs`.
    fn solve_active(&mut self) {
        let count = self.active.len();
        for i in 0..count {
            let mut value = self.dual[i];
            for j in 0..i {
                value -= self.r[(j, i)] * self.forward[j];
            }
            self.forward[i] = value / self.r[(i, i)];
        }
        for i in (0..count).rev() {
            let mut value = self.forward[i];
            for j in i + 1..count {
                value -= self.r[(i, j)] * self.dual[j];
            }
            self.dual[i] = value / self.r[(i, i)];
        }
    }

    /// Finds the step along `constraint`: of the active multipliers (`self.dual`, downwards) and
    /// of the margins (`self.change`). Returns the squared length of its normal's part across the
    /// active ones.
    fn find_step(&mut self, constraint: usize) -> f64 {
        for (dual, &other) in self.dual.iter_mut().zip(&self.active) {
            *dual = self.products[(other, constraint)];
        }
        self.solve_active();
        let count = self.active.len();
        self.change.copy_from(&self.products.column(constraint));
        for i in 0..count {
            let column = self.products.column(self.active[i]);
            self.change.axpy(-self.dual[i], &column, 1.0);
        }
        let along: f64 = self.forward[..count].iter().map(|t| t * t).sum();
        self.products[(constraint, constraint)] - along
    }

    /// Appends the constraint of the latest [`Self::find_step`].
    fn add(&mut self, constraint: usize, across: f64) {
        let count = self.active.len();
        for i in 0..count {
            self.r[(i, count)] = self.forward[i];
        }
        self.r[(count, count)] = across.sqrt();
        self.active.push(constraint);
        self.is_active[constraint] = true;
    }

    fn drop(&mut self, position: usize) {
        let count = self.active.len();
        for j in position + 1..count {
            for i in 0..=j {
                self.r[(i, j - 1)] = self.r[(i, j)];
            }
            let (a, b) = (self.r[(j - 1, j - 1)], self.r[(j, j - 1)]);
            let length = (a * a + b * b).sqrt();
            let (cosine, sine) = (a / length, b / length);
            self.r[(j - 1, j - 1)] = length;
            // The remaining columns have not moved yet.
            for column in j + 1..count {
                let (upper, lower) = (self.r[(j - 1, column)], self.r[(j, column)]);
                self.r[(j - 1, column)] = cosine * upper + sine * lower;
                self.r[(j, column)] = cosine * lower - sine * upper;
            }
        }
        self.multipliers.copy_within(position + 1..=count, position);
        self.is_active[self.active.remove(position)] = false;
    }

    /// The solution that belongs to the multipliers, and its margins.
    fn place(&mut self, target: &DVector<f64>, bound: &DVector<f64>, x: &mut DVector<f64>) {
        x.copy_from(target);
        for (&multiplier, &constraint) in self.multipliers.iter().zip(&self.active) {
            x.axpy(multiplier, &self.directions.column(constraint), 1.0);
        }
        self.measure(x, bound);
    }

    /// Largest margin, to either side, of an active constraint.
    fn worst_active(&self) -> f64 {
        let margins = self.active.iter().map(|&i| self.margins[i].abs());
        margins.fold(0.0, f64::max)
    }

    /// Moves the multipliers so that the active constraints are met to rounding.
    fn refine(&mut self) {
        for (dual, &constraint) in self.dual.iter_mut().zip(&self.active) {
            *dual = -self.margins[constraint];
        }
        self.solve_active();
        for i in 0..self.active.len() {
            self.multipliers[i] += self.dual[i];
        }
    }
}

impl Solver for Kwik {
    fn nearest(
        &mut self,
        target: &DVector<f64>,
        bound: &DVector<f64>,
        solution: &mut DVector<f64>,
    ) -> Outcome {
        if !target.iter().chain(bound.iter()).all(|x| x.is_finite()) {
            return Outcome::Failed;
        }
        let start = self.time_limit.map(|limit| (Instant::now(), limit));
        self.active.clear();
        self.is_active.fill(false);
        self.place(target, bound, solution);
        let tolerance = TOLERANCE * (1.0 + self.margins.amax());

        let (mut iterations, mut measured) = (0, true);
        loop {
            let Some(constraint) = self.most_violated(tolerance) else {
                if measured {
                    return Outcome::Solved { iterations };
                }
                self.place(target, bound, solution);
                for _ in 0..REFINEMENTS {
                    if self.worst_active() <= tolerance {
                        break;
                    }
                    self.refine();
                    self.place(target, bound, solution);
                }
                measured = true;
                continue;
            };
            measured = false;
            let mut multiplier = 0.0;
            loop {
                iterations += 1;
                if iterations > self.iteration_limit
                    || start.is_some_and(|(since, limit)| since.elapsed() > limit)
                {
                    return Outcome::OutOfTime;
                }
                let across = self.find_step(constraint);
                let count = self.active.len();
                let (mut shortest, mut blocking) = (f64::INFINITY, None);
                for i in 0..count {
                    if self.dual[i] > DEPENDENT {
                        let length = self.multipliers[i] / self.dual[i];
                        if length < shortest {
                            (shortest, blocking) = (length, Some(i));
                        }
                    }
                }
                let full = if across > DEPENDENT && count < self.r.ncols() {
                    -self.margins[constraint] / across
                } else {
                    f64::INFINITY
                };
                let length = shortest.min(full);
                if length.is_infinite() {
                    return Outcome::Failed;
                }
                for i in 0..count {
                    self.multipliers[i] -= length * self.dual[i];
                }
                multiplier += length;
                if full.is_finite() {
                    self.margins.axpy(length, &self.change, 1.0);
                }
                match blocking {
                    Some(position) if shortest < full => self.drop(position),
                    _ => {
                        self.multipliers[count] = multiplier;
                        self.add(constraint, across);
                        break;
                    }
                }
            }
        }
    }
}

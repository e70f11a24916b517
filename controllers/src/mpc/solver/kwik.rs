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
/// those whose multiplier would turn negative, until none is violated. All of it happens in the
/// metric of the Hessian, whose factors and the constraints' normals there are made once. `Q` and
/// `R` factor the active normals.
#[derive(Debug, Clone)]
pub struct Kwik {
    n: usize,
    iteration_limit: usize,
    time_limit: Option<Duration>,
    metric: Metric,
    // Work of a solve.
    y: DVector<f64>,
    margins: DVector<f64>,
    q: DMatrix<f64>,
    r: DMatrix<f64>,
    d: DVector<f64>,
    step: DVector<f64>,
    dual: Vec<f64>,
    multipliers: Vec<f64>,
    active: Vec<usize>,
    is_active: Vec<bool>,
}

/// Violations and steps below this, in units of the largest number of the problem, are rounding.
const TOLERANCE: f64 = 1e-13;
/// Normals closer than this to the span of the active ones depend on them.
const DEPENDENT: f64 = 1e-12;

impl Kwik {
    /// Hessian (n x n, positive definite) and constraint rows (m x n); gives up after
    /// `iteration_limit` iterations or `time_limit` seconds (infinite: never).
    pub fn new(
        hessian: &DMatrix<f64>,
        constraints: &DMatrix<f64>,
        iteration_limit: usize,
        time_limit: f64,
    ) -> Result<Self, ModelError> {
        let (m, n) = constraints.shape();
        Ok(Self {
            n,
            iteration_limit,
            time_limit: Duration::try_from_secs_f64(time_limit).ok(),
            metric: Metric::new(hessian, constraints)?,
            y: DVector::zeros(n),
            margins: DVector::zeros(m),
            q: DMatrix::identity(n, n),
            r: DMatrix::zeros(n, n),
            d: DVector::zeros(n),
            step: DVector::zeros(n),
            dual: vec![0.0; n],
            multipliers: vec![0.0; n + 1],
            active: Vec::with_capacity(n),
            is_active: vec![false; m],
        })
    }

    /// Most violated constraint, if any is violated beyond rounding.
    fn most_violated(&mut self, bound: &DVector<f64>) -> Option<usize> {
        self.margins.gemv(1.0, &self.metric.rows, &self.y, 0.0);
        let size = 1.0 + self.y.amax();
        let (mut worst, mut at) = (-TOLERANCE * size, None);
        for i in 0..self.margins.len() {
            let margin = self.metric.margin(i, self.margins[i], bound);
            self.margins[i] = margin;
            if margin < worst && !self.is_active[i] {
                (worst, at) = (margin, Some(i));
            }
        }
        at
    }

    /// `d = Q' normal`, the primal step (its part across the active normals) and the dual step
    /// `R^-1 d`.
    fn find_steps(&mut self, constraint: usize) -> f64 {
        let count = self.active.len();
        let normal = self.metric.normals.column(constraint);
        if count == 0 {
            // `Q` is the identity and the normal has length one.
            self.d.copy_from(&normal);
            self.step.copy_from(&normal);
            return self.d.norm_squared();
        }
        self.d.gemv_tr(1.0, &self.q, &normal, 0.0);
        self.step.gemv(
            1.0,
            &self.q.columns(count, self.n - count),
            &self.d.rows(count, self.n - count),
            0.0,
        );
        for i in (0..count).rev() {
            let mut value = self.d[i];
            for j in i + 1..count {
                value -= self.r[(i, j)] * self.dual[j];
            }
            self.dual[i] = value / self.r[(i, i)];
        }
        self.d.rows(count, self.n - count).norm_squared()
    }

    /// Appends the constraint of the latest [`Self::find_steps`]: a reflection turns the part of
    /// `d` across the active normals into one number.
    fn add(&mut self, constraint: usize) {
        let count = self.active.len();
        let length = self.d.rows(count, self.n - count).norm();
        let pivot = if self.d[count] > 0.0 { -length } else { length };
        for i in 0..count {
            self.r[(i, count)] = self.d[i];
        }
        self.r[(count, count)] = pivot;
        self.d[count] -= pivot;
        let normal = self.d.rows(count, self.n - count);
        let mut across = self.q.columns_mut(count, self.n - count);
        self.step.gemv(1.0, &across, &normal, 0.0);
        across.ger(-2.0 / normal.norm_squared(), &self.step, &normal, 1.0);
        self.active.push(constraint);
        self.is_active[constraint] = true;
    }

    fn drop(&mut self, position: usize) {
        let count = self.active.len();
        for j in position + 1..count {
            for i in 0..=j {
                self.r[(i, j - 1)] = self.r[(i, j)];
            }
            let (cosine, sine, length) = rotation(self.r[(j - 1, j - 1)], self.r[(j, j - 1)]);
            self.r[(j - 1, j - 1)] = length;
            // The remaining columns have not moved yet.
            for column in j + 1..count {
                let (upper, lower) = (self.r[(j - 1, column)], self.r[(j, column)]);
                self.r[(j - 1, column)] = cosine * upper + sine * lower;
                self.r[(j, column)] = cosine * lower - sine * upper;
            }
            rotate_columns(&mut self.q, j - 1, cosine, sine);
        }
        self.multipliers.copy_within(position + 1..=count, position);
        self.is_active[self.active.remove(position)] = false;
    }
}

/// Cosine, sine and length that turn `(a, b)` into `(length, 0)`.
fn rotation(a: f64, b: f64) -> (f64, f64, f64) {
    if b == 0.0 {
        return (1.0, 0.0, a);
    }
    let length = (a * a + b * b).sqrt();
    (a / length, b / length, length)
}

fn rotate_columns(matrix: &mut DMatrix<f64>, first: usize, cosine: f64, sine: f64) {
    let rows = matrix.nrows();
    let pair = &mut matrix.as_mut_slice()[first * rows..(first + 2) * rows];
    let (left, right) = pair.split_at_mut(rows);
    for (l, r) in left.iter_mut().zip(right) {
        (*l, *r) = (cosine * *l + sine * *r, cosine * *r - sine * *l);
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
        self.q.fill_with_identity();
        self.y.gemv(1.0, &self.metric.to, target, 0.0);

        let mut iterations = 0;
        while let Some(constraint) = self.most_violated(bound) {
            let mut margin = self.margins[constraint];
            let mut multiplier = 0.0;
            loop {
                iterations += 1;
                if iterations > self.iteration_limit
                    || start.is_some_and(|(since, limit)| since.elapsed() > limit)
                {
                    return Outcome::OutOfTime;
                }
                let across = self.find_steps(constraint);
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
                let full = if across > DEPENDENT {
                    -margin / across
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
                    self.y.axpy(length, &self.step, 1.0);
                    margin += length * across;
                }
                match blocking {
                    Some(position) if shortest < full => self.drop(position),
                    _ => {
                        self.multipliers[count] = multiplier;
                        self.add(constraint);
                        break;
                    }
                }
            }
        }
        solution.gemv(1.0, &self.metric.from, &self.y, 0.0);
        Outcome::Solved { iterations }
    }
}

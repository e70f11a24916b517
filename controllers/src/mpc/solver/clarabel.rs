use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};
use nalgebra::{DMatrix, DVector};

use super::metric::Metric;
use super::{Outcome, Solver};
use crate::ModelError;

/// The interior point method of the crate `clarabel`.
///
/// It is given the step from the target in units of the largest violation there, in the metric
/// of the Hessian: then its tolerances are relative to what the step is about.
pub struct Clarabel {
    metric: Metric,
    y: DVector<f64>,
    margins: DVector<f64>,
    bound: Vec<f64>,
    solver: DefaultSolver<f64>,
}

fn dense(matrix: &DMatrix<f64>) -> CscMatrix<f64> {
    let (rows, columns) = matrix.shape();
    CscMatrix::new(
        rows,
        columns,
        (0..=columns).map(|j| j * rows).collect(),
        (0..columns).flat_map(|_| 0..rows).collect(),
        matrix.as_slice().to_vec(),
    )
}

impl Clarabel {
    /// Hessian (n x n, positive definite) and constraint rows (m x n); gives up after
    /// `iteration_limit` iterations or `time_limit` seconds.
    ///
    /// # Errors
    /// A Hessian that is not positive definite.
    pub fn new(
        hessian: &DMatrix<f64>,
        constraints: &DMatrix<f64>,
        iteration_limit: usize,
        time_limit: f64,
    ) -> Result<Self, ModelError> {
        let metric = Metric::new(hessian, constraints)?;
        let (m, n) = constraints.shape();
        let settings = DefaultSettings {
            verbose: false,
            max_iter: iteration_limit.try_into().unwrap_or(u32::MAX),
            time_limit,
            presolve_enable: false,
            tol_gap_abs: 1e-11,
            tol_gap_rel: 1e-11,
            tol_feas: 1e-11,
            reduced_tol_gap_abs: 1e-9,
            reduced_tol_gap_rel: 1e-9,
            reduced_tol_feas: 1e-9,
            ..DefaultSettings::default()
        };
        let cones = [NonnegativeConeT(m)];
        let solver = DefaultSolver::new(
            &CscMatrix::identity(n),
            &vec![0.0; n],
            &dense(&-&metric.rows),
            &vec![0.0; m],
            if m > 0 { &cones } else { &[] },
            settings,
        )
        .map_err(|error| ModelError::NoSolution {
            equation: "the quadratic program",
            reason: error.to_string(),
        })?;
        Ok(Self {
            metric,
            y: DVector::zeros(n),
            margins: DVector::zeros(m),
            bound: vec![0.0; m],
            solver,
        })
    }
}

impl Solver for Clarabel {
    fn nearest(
        &mut self,
        target: &DVector<f64>,
        bound: &DVector<f64>,
        solution: &mut DVector<f64>,
    ) -> Outcome {
        self.y.gemv(1.0, &self.metric.to, target, 0.0);
        self.margins.gemv(1.0, &self.metric.rows, &self.y, 0.0);
        for (i, kept) in self.bound.iter_mut().enumerate() {
            *kept = self.margins[i] - bound[i] * self.metric.inverse_lengths[i];
        }
        let violation = self
            .bound
            .iter()
            .fold(0.0, |most: f64, margin| most.max(-margin));
        if violation == 0.0 {
            solution.copy_from(target);
            return Outcome::Solved { iterations: 0 };
        }
        for kept in &mut self.bound {
            *kept /= violation;
        }
        if self.solver.update_b(&self.bound).is_err() {
            return Outcome::Failed;
        }
        self.solver.solve();
        for (y, step) in self.y.iter_mut().zip(&self.solver.solution.x) {
            *y += violation * step;
        }
        solution.gemv(1.0, &self.metric.from, &self.y, 0.0);
        match self.solver.solution.status {
            // Almost solved: within the reduced tolerances.
            SolverStatus::Solved | SolverStatus::AlmostSolved => Outcome::Solved {
                iterations: self.solver.solution.iterations as usize,
            },
            SolverStatus::MaxIterations | SolverStatus::MaxTime => Outcome::OutOfTime,
            _ => Outcome::Failed,
        }
    }
}

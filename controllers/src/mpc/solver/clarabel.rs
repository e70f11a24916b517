use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus,
};
use nalgebra::{DMatrix, DVector};

use super::{Outcome, Solver};
use crate::ModelError;

/// The interior point method of the crate `clarabel`.
pub struct Clarabel {
    hessian: DMatrix<f64>,
    linear: Vec<f64>,
    bound: Vec<f64>,
    solver: DefaultSolver<f64>,
}

fn sparse(matrix: &DMatrix<f64>, upper: bool) -> CscMatrix<f64> {
    let (rows, columns) = matrix.shape();
    let (mut starts, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for j in 0..columns {
        for i in 0..if upper { j + 1 } else { rows } {
            indices.push(i);
            values.push(matrix[(i, j)]);
        }
        starts.push(indices.len());
    }
    CscMatrix::new(rows, columns, starts, indices, values)
}

impl Clarabel {
    /// Hessian (n x n, positive definite) and constraint rows (m x n); gives up after
    /// `iteration_limit` iterations or `time_limit` seconds.
    pub fn new(
        hessian: &DMatrix<f64>,
        constraints: &DMatrix<f64>,
        iteration_limit: usize,
        time_limit: f64,
    ) -> Result<Self, ModelError> {
        let (m, n) = constraints.shape();
        let settings = DefaultSettings {
            verbose: false,
            max_iter: iteration_limit.try_into().unwrap_or(u32::MAX),
            time_limit,
            presolve_enable: false,
            tol_gap_abs: 1e-12,
            tol_gap_rel: 1e-12,
            tol_feas: 1e-12,
            reduced_tol_gap_abs: 1e-9,
            reduced_tol_gap_rel: 1e-9,
            reduced_tol_feas: 1e-9,
            ..DefaultSettings::default()
        };
        let cones = [NonnegativeConeT(m)];
        let solver = DefaultSolver::new(
            &sparse(hessian, true),
            &vec![0.0; n],
            &sparse(&-constraints, false),
            &vec![0.0; m],
            if m > 0 { &cones } else { &[] },
            settings,
        )
        .map_err(|error| ModelError::NoSolution {
            equation: "the quadratic program",
            reason: error.to_string(),
        })?;
        Ok(Self {
            hessian: hessian.clone(),
            linear: vec![0.0; n],
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
        for (linear, column) in self.linear.iter_mut().zip(self.hessian.column_iter()) {
            *linear = -column.dot(target);
        }
        for (kept, b) in self.bound.iter_mut().zip(bound.iter()) {
            *kept = -b;
        }
        let updated = self.solver.update_q(&self.linear).is_ok()
            && self.solver.update_b(&self.bound).is_ok();
        if !updated {
            return Outcome::Failed;
        }
        self.solver.solve();
        solution.copy_from_slice(&self.solver.solution.x);
        match self.solver.solution.status {
            // Almost solved: short of 1e-12 but within the reduced tolerances.
            SolverStatus::Solved | SolverStatus::AlmostSolved => Outcome::Solved {
                iterations: self.solver.solution.iterations as usize,
            },
            SolverStatus::MaxIterations | SolverStatus::MaxTime => Outcome::OutOfTime,
            _ => Outcome::Failed,
        }
    }
}

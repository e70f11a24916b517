use nalgebra::{Cholesky, DMatrix, DVector};

use crate::ModelError;

/// A quadratic program in `y = L' x`, with the Hessian `H = L L'`: there the metric is the plain
/// one and the constraints' normals have length one.
#[derive(Debug, Clone)]
pub(super) struct Metric {
    /// `L'`, to go to `y`.
    pub to: DMatrix<f64>,
    /// `L^-T`, to come back.
    pub from: DMatrix<f64>,
    /// Normals, n x m, one column a constraint.
    pub normals: DMatrix<f64>,
    /// The same, m x n.
    pub rows: DMatrix<f64>,
    /// Lengths that the normals had.
    pub lengths: DVector<f64>,
}

impl Metric {
    /// Hessian (n x n, positive definite) and constraint rows (m x n).
    pub fn new(hessian: &DMatrix<f64>, constraints: &DMatrix<f64>) -> Result<Self, ModelError> {
        let no_solution = |reason: &str| ModelError::NoSolution {
            equation: "the quadratic program",
            reason: reason.into(),
        };
        let (m, n) = constraints.shape();
        let lower = Cholesky::new(hessian.clone())
            .ok_or_else(|| no_solution("its Hessian is not positive definite"))?
            .unpack();
        let mut normals = lower
            .solve_lower_triangular(&constraints.transpose())
            .ok_or_else(|| no_solution("its Hessian is singular"))?;
        let from = lower
            .transpose()
            .solve_upper_triangular(&DMatrix::identity(n, n))
            .ok_or_else(|| no_solution("its Hessian is singular"))?;
        let lengths = DVector::from_fn(m, |i, _| normals.column(i).norm());
        for (mut normal, &length) in normals.column_iter_mut().zip(lengths.iter()) {
            if length > 0.0 {
                normal /= length;
            }
        }
        Ok(Self {
            to: lower.transpose(),
            from,
            rows: normals.transpose(),
            normals,
            lengths,
        })
    }

    /// Distance by which constraint `i` is kept, given its normal's product with `y`.
    pub fn margin(&self, i: usize, product: f64, bound: &DVector<f64>) -> f64 {
        if self.lengths[i] > 0.0 {
            product - bound[i] / self.lengths[i]
        } else {
            -bound[i]
        }
    }
}

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
    /// One over the lengths that the normals had; one for a normal of length zero.
    pub inverse_lengths: DVector<f64>,
}

impl Metric {
    /// Hessian (n x n, positive definite) and constraint rows (m x n).
    ///
    /// # Errors
    /// A Hessian that is not positive definite.
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
        let inverse_lengths = DVector::from_fn(m, |i, _| match normals.column(i).norm() {
            0.0 => 1.0,
            length => 1.0 / length,
        });
        for (mut normal, &factor) in normals.column_iter_mut().zip(inverse_lengths.iter()) {
            normal *= factor;
        }
        Ok(Self {
            to: lower.transpose(),
            from,
            rows: normals.transpose(),
            normals,
            inverse_lengths,
        })
    }
}

//! Tall least-squares problems by orthogonal reduction, block after block, so that neither the
//! whole regression matrix nor its squared condition number ever stands in memory.

use nalgebra::DMatrix;

use recordings::IdentificationError;

/// Rows taken in at a time.
const BLOCK: usize = 512;

/// The triangular factor of `[regressors, targets]`.
#[derive(Debug, Clone)]
pub struct Triangular {
    regressors: usize,
    factor: DMatrix<f64>,
}

/// Reduces `rows` rows of `regressors + targets` columns; `fill(k, row)` writes row `k`.
pub fn reduce(
    rows: usize,
    regressors: usize,
    targets: usize,
    mut fill: impl FnMut(usize, &mut [f64]),
) -> Triangular {
    let columns = regressors + targets;
    let mut factor = DMatrix::zeros(0, columns);
    let mut row = vec![0.0; columns];
    let block = BLOCK.max(3 * columns);
    let mut first = 0;
    while first < rows {
        let count = block.min(rows - first);
        let kept = factor.nrows();
        let mut stacked = DMatrix::zeros(kept + count, columns);
        stacked.rows_mut(0, kept).copy_from(&factor);
        for k in 0..count {
            fill(first + k, &mut row);
            for (column, &value) in row.iter().enumerate() {
                stacked[(kept + k, column)] = value;
            }
        }
        factor = stacked.qr().r();
        first += count;
    }
    Triangular { regressors, factor }
}

impl Triangular {
    /// From the products `[regressors, targets]' [regressors, targets]`, where these are so well
    /// conditioned that squaring costs no more than half of the digits.
    pub fn from_products(products: DMatrix<f64>, regressors: usize) -> Option<Self> {
        const CONDITION: f64 = 1e-4;
        let lengths: Vec<f64> = products.diagonal().iter().map(|d| d.sqrt()).collect();
        let factor = products.cholesky()?.unpack().transpose();
        let well = (0..factor.ncols()).all(|i| factor[(i, i)] > CONDITION * lengths[i]);
        well.then_some(Self { regressors, factor })
    }

    /// Coefficients, regressors x targets, where no direction need be left out.
    pub fn solve_directly(&self) -> Option<DMatrix<f64>> {
        let n = self.regressors;
        let targets = self.factor.ncols() - n;
        let mut solution = self.factor.view((0, n), (n, targets)).into_owned();
        let regressors = self.factor.view((0, 0), (n, n));
        regressors
            .solve_upper_triangular_mut(&mut solution)
            .then_some(solution)
    }

    /// Sum of squares that the first `columns` columns leave of the last one.
    pub fn left(&self, columns: usize) -> f64 {
        let last = self.factor.ncols() - 1;
        let rows = columns.min(self.factor.nrows())..self.factor.nrows();
        rows.map(|row| self.factor[(row, last)].powi(2)).sum()
    }

    /// The factor of the regressors alone, square.
    pub fn regressor_factor(&self) -> DMatrix<f64> {
        let n = self.regressors;
        let mut square = DMatrix::zeros(n, n);
        let rows = n.min(self.factor.nrows());
        square
            .rows_mut(0, rows)
            .copy_from(&self.factor.view((0, 0), (rows, n)));
        square
    }

    /// Coefficients, regressors x targets. Directions whose singular value is below `tolerance`
    /// of the largest (columns scaled to unit length) are left out; their number is returned too.
    ///
    /// # Errors
    /// The singular values do not converge.
    pub fn solve(&self, tolerance: f64) -> Result<(DMatrix<f64>, usize), IdentificationError> {
        let n = self.regressors;
        let r = self.regressor_factor();
        let rows = n.min(self.factor.nrows());
        let targets = self.factor.ncols() - n;
        let mut right = DMatrix::zeros(n, targets);
        right
            .rows_mut(0, rows)
            .copy_from(&self.factor.view((0, n), (rows, targets)));
        let lengths: Vec<f64> = (0..n)
            .map(|j| r.column(j).norm().max(f64::MIN_POSITIVE))
            .collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| r[(i, j)] / lengths[j]);
        let svd = scaled
            .try_svd(true, true, f64::EPSILON, 0)
            .ok_or_else(not_converged)?;
        let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else {
            return Err(not_converged());
        };
        let largest = svd.singular_values.max();
        let mut coordinates = u.tr_mul(&right);
        let mut lost = 0;
        for i in 0..n {
            let value = svd.singular_values[i];
            if value > tolerance * largest && value > 0.0 {
                coordinates.row_mut(i).scale_mut(1.0 / value);
            } else {
                coordinates.row_mut(i).fill(0.0);
                lost += 1;
            }
        }
        let mut solution = v_t.tr_mul(&coordinates);
        for j in 0..n {
            solution.row_mut(j).scale_mut(1.0 / lengths[j]);
        }
        Ok((solution, lost))
    }
}

fn not_converged() -> IdentificationError {
    IdentificationError::NotConverged {
        method: "the singular value decomposition",
        reason: "the regression contains numbers that are not finite".into(),
    }
}

use nalgebra::{Complex, DMatrix, DVector, SMatrix};

use crate::ModelError;

/// A continuous-time linear system `dx/dt = A x + B u`, `y = C x + D u` (Eq 2-6 in continuous
/// time).
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// Dynamics, n x n, 1/s.
    pub a: DMatrix<f64>,
    /// Input, n x m.
    pub b: DMatrix<f64>,
    /// Output, p x n.
    pub c: DMatrix<f64>,
    /// Feedthrough, p x m.
    pub d: DMatrix<f64>,
}

/// A sampled linear system `x[k+1] = A x[k] + B u[k]`, `y[k] = C x[k] + D u[k]` (Eq 5-1).
#[derive(Debug, Clone, PartialEq)]
pub struct DiscreteStateSpace {
    /// Transition, n x n.
    pub a: DMatrix<f64>,
    /// Input, n x m.
    pub b: DMatrix<f64>,
    /// Output, p x n.
    pub c: DMatrix<f64>,
    /// Feedthrough, p x m.
    pub d: DMatrix<f64>,
    /// Sampling period in seconds.
    pub period: f64,
}

fn check_shapes(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    c: &DMatrix<f64>,
    d: &DMatrix<f64>,
) -> Result<(), ModelError> {
    let (n, m, p) = (a.nrows(), b.ncols(), c.nrows());
    for (what, matrix, rows, columns) in [
        ("A", a, n, n),
        ("B", b, n, m),
        ("C", c, p, n),
        ("D", d, p, m),
    ] {
        if matrix.shape() != (rows, columns) {
            return Err(ModelError::Shape {
                what,
                expected: format!("{rows} x {columns}"),
                got: format!("{} x {}", matrix.nrows(), matrix.ncols()),
            });
        }
    }
    Ok(())
}

impl StateSpace {
    /// Joins four matrices.
    ///
    /// # Errors
    /// Shapes that do not fit.
    pub fn new(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
    ) -> Result<Self, ModelError> {
        check_shapes(&a, &b, &c, &d)?;
        Ok(Self { a, b, c, d })
    }

    /// Number of states.
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// Eigenvalues of `A`, 1/s.
    pub fn poles(&self) -> DVector<Complex<f64>> {
        self.a.complex_eigenvalues()
    }

    /// True when every pole lies in the open left half plane.
    pub fn is_stable(&self) -> bool {
        self.poles().iter().all(|pole| pole.re < 0.0)
    }

    /// `C (s I - A)^-1 B + D` (Eq 2-12), p x m; `None` where `s` is a pole.
    pub fn evaluate(&self, s: Complex<f64>) -> Option<DMatrix<Complex<f64>>> {
        evaluate(&self.a, &self.b, &self.c, &self.d, s)
    }

    /// The system sampled with its inputs held over each `period`.
    pub fn sample(&self, period: f64) -> DiscreteStateSpace {
        let (n, m) = (self.order(), self.b.ncols());
        let mut block = DMatrix::zeros(n + m, n + m);
        block
            .view_mut((0, 0), (n, n))
            .copy_from(&(&self.a * period));
        block
            .view_mut((0, n), (n, m))
            .copy_from(&(&self.b * period));
        let exponential = block.exp();
        DiscreteStateSpace {
            a: exponential.view((0, 0), (n, n)).into_owned(),
            b: exponential.view((0, n), (n, m)).into_owned(),
            c: self.c.clone(),
            d: self.d.clone(),
            period,
        }
    }
}

impl DiscreteStateSpace {
    /// Joins four matrices.
    ///
    /// # Errors
    /// Shapes that do not fit.
    pub fn new(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
        period: f64,
    ) -> Result<Self, ModelError> {
        check_shapes(&a, &b, &c, &d)?;
        ModelError::require_positive("period", period)?;
        Ok(Self { a, b, c, d, period })
    }

    /// Number of states.
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// Eigenvalues of `A`.
    pub fn poles(&self) -> DVector<Complex<f64>> {
        self.a.complex_eigenvalues()
    }

    /// True when every pole lies inside the unit circle.
    pub fn is_stable(&self) -> bool {
        self.poles().iter().all(|pole| pole.norm() < 1.0)
    }

    /// `C (z I - A)^-1 B + D`, p x m; `None` where `z` is a pole.
    pub fn evaluate(&self, z: Complex<f64>) -> Option<DMatrix<Complex<f64>>> {
        evaluate(&self.a, &self.b, &self.c, &self.d, z)
    }

    /// Outputs for the state `x` and the input `u`.
    pub fn output(&self, x: &DVector<f64>, u: &DVector<f64>) -> DVector<f64> {
        &self.c * x + &self.d * u
    }

    /// The state one sample later.
    pub fn advance(&self, x: &DVector<f64>, u: &DVector<f64>) -> DVector<f64> {
        &self.a * x + &self.b * u
    }
}

fn evaluate(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    c: &DMatrix<f64>,
    d: &DMatrix<f64>,
    s: Complex<f64>,
) -> Option<DMatrix<Complex<f64>>> {
    let complex = |m: &DMatrix<f64>| m.map(|value| Complex::new(value, 0.0));
    let resolvent = DMatrix::identity(a.nrows(), a.nrows()) * s - complex(a);
    let response = resolvent.lu().solve(&complex(b))?;
    Some(complex(c) * response + complex(d))
}

/// Transition and input matrix of `dx/dt = A x + B u` with `u` held over `period`, without heap
/// allocation.
pub fn zero_order_hold<const N: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, M>,
    period: f64,
) -> (SMatrix<f64, N, N>, SMatrix<f64, N, M>) {
    // Scaling and squaring of the Taylor series of phi_1(A h) = integral of exp: the norms met
    // here (A h of order one) are reduced below 2^-6, where twelve terms reach rounding.
    let ah = a * period;
    let mut halvings = 0;
    let mut scale = 1.0;
    while ah.norm() * scale > 1.0 / 64.0 && halvings < 60 {
        scale *= 0.5;
        halvings += 1;
    }
    let x = ah * scale;
    let mut phi = SMatrix::<f64, N, N>::identity();
    for k in (2..=12).rev() {
        phi = SMatrix::identity() + x * phi / f64::from(k);
    }
    // exp(x) = I + x phi_1(x); doubling: phi_1(2x) = (exp(x) + I) phi_1(x) / 2. Working with
    // exp - I keeps the digits of slow modes.
    let mut exp_minus_one = x * phi;
    for _ in 0..halvings {
        phi += exp_minus_one * phi * 0.5;
        exp_minus_one = exp_minus_one * 2.0 + exp_minus_one * exp_minus_one;
    }
    (SMatrix::identity() + exp_minus_one, phi * b * period)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2, dmatrix};

    #[test]
    fn sampling_an_oscillator_matches_its_closed_form() {
        let (omega, h) = (7.0_f64, 0.01);
        let system = StateSpace::new(
            dmatrix![0.0, 1.0; -omega * omega, 0.0],
            dmatrix![0.0; 1.0],
            dmatrix![1.0, 0.0],
            dmatrix![0.0],
        )
        .unwrap();
        let sampled = system.sample(h);
        let (s, c) = (omega * h).sin_cos();
        let a = dmatrix![c, s / omega; -omega * s, c];
        let b = dmatrix![(1.0 - c) / (omega * omega); s / omega];
        assert!((&sampled.a - &a).amax() < 1e-13);
        assert!((&sampled.b - &b).amax() < 1e-15);

        let (fixed_a, fixed_b) = zero_order_hold(
            &Matrix2::new(0.0, 1.0, -omega * omega, 0.0),
            &Vector2::new(0.0, 1.0),
            h,
        );
        assert!((fixed_a - Matrix2::new(c, s / omega, -omega * s, c)).amax() < 1e-14);
        assert!((fixed_b - Vector2::new((1.0 - c) / (omega * omega), s / omega)).amax() < 1e-16);
    }

    #[test]
    fn shapes_that_do_not_fit_are_named() {
        let error = StateSpace::new(
            DMatrix::zeros(2, 2),
            DMatrix::zeros(3, 1),
            DMatrix::zeros(1, 2),
            DMatrix::zeros(1, 1),
        )
        .unwrap_err();
        assert_eq!(error.to_string(), "B: expected 2 x 1, got 3 x 1");
    }
}

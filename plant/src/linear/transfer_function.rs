use nalgebra::{Complex, DMatrix, DVector};

use super::StateSpace;
use crate::ModelError;

/// A ratio of polynomials in `s` (or `z`), coefficients in descending powers (Eq 2-15).
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    /// Numerator, highest power first.
    pub numerator: Vec<f64>,
    /// Denominator, highest power first.
    pub denominator: Vec<f64>,
}

impl TransferFunction {
    /// Takes coefficients in descending powers; leading zeros are dropped.
    ///
    /// # Errors
    /// A denominator that is zero.
    pub fn new(numerator: &[f64], denominator: &[f64]) -> Result<Self, ModelError> {
        let denominator = trim(denominator);
        if denominator == [0.0] {
            return Err(ModelError::Parameter {
                name: "denominator",
                value: 0.0,
                expected: "a polynomial that is not zero",
            });
        }
        Ok(Self {
            numerator: trim(numerator),
            denominator,
        })
    }

    /// A constant.
    pub fn gain(value: f64) -> Self {
        Self {
            numerator: vec![value],
            denominator: vec![1.0],
        }
    }

    /// The value at a point of the complex plane.
    pub fn evaluate(&self, s: Complex<f64>) -> Complex<f64> {
        horner(&self.numerator, s) / horner(&self.denominator, s)
    }

    /// Roots of the denominator.
    pub fn poles(&self) -> Vec<Complex<f64>> {
        roots(&self.denominator)
    }

    /// Roots of the numerator.
    pub fn zeros(&self) -> Vec<Complex<f64>> {
        roots(&self.numerator)
    }

    /// `self * other`.
    pub fn series(&self, other: &Self) -> Self {
        Self {
            numerator: multiply(&self.numerator, &other.numerator),
            denominator: multiply(&self.denominator, &other.denominator),
        }
    }

    /// `self + other`.
    pub fn parallel(&self, other: &Self) -> Self {
        Self {
            numerator: trim(&add(
                &multiply(&self.numerator, &other.denominator),
                &multiply(&other.numerator, &self.denominator),
            )),
            denominator: multiply(&self.denominator, &other.denominator),
        }
    }

    /// `self / (1 + self)`, unity negative feedback (Eq 3-9).
    pub fn closed_loop(&self) -> Self {
        Self {
            numerator: self.numerator.clone(),
            denominator: trim(&add(&self.numerator, &self.denominator)),
        }
    }

    /// Observer canonical form: the first state is the output less the feedthrough.
    ///
    /// # Errors
    /// A numerator of higher order than the denominator.
    pub fn to_state_space(&self) -> Result<StateSpace, ModelError> {
        let n = self.denominator.len() - 1;
        if self.numerator.len() > n + 1 {
            return Err(ModelError::Shape {
                what: "transfer function",
                expected: "a numerator of no higher order than the denominator".into(),
                got: format!("order {} over {n}", self.numerator.len() - 1),
            });
        }
        let lead = self.denominator[0];
        let mut numerator = vec![0.0; n + 1 - self.numerator.len()];
        numerator.extend(self.numerator.iter().map(|value| value / lead));
        let feedthrough = numerator[0];
        let mut a = DMatrix::zeros(n, n);
        let mut b = DMatrix::zeros(n, 1);
        let mut c = DMatrix::zeros(1, n);
        for i in 0..n {
            let coefficient = self.denominator[i + 1] / lead;
            a[(i, 0)] = -coefficient;
            if i + 1 < n {
                a[(i, i + 1)] = 1.0;
            }
            b[(i, 0)] = numerator[i + 1] - coefficient * feedthrough;
        }
        if n > 0 {
            c[(0, 0)] = 1.0;
        }
        StateSpace::new(a, b, c, DMatrix::from_element(1, 1, feedthrough))
    }
}

/// Characteristic polynomial `det(s I - A)`, highest power first (Faddeev and Le Verrier).
pub(crate) fn characteristic_polynomial(a: &DMatrix<f64>) -> Vec<f64> {
    let n = a.nrows();
    let mut coefficients = vec![1.0];
    let mut m = DMatrix::<f64>::identity(n, n);
    for k in 1..=n {
        let am = a * &m;
        let coefficient = -am.trace() / k as f64;
        coefficients.push(coefficient);
        m = am + DMatrix::identity(n, n) * coefficient;
    }
    coefficients
}

/// Numerator `C adj(s I - A) B`, highest power first, for one input and one output without
/// feedthrough.
pub(crate) fn numerator_polynomial(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    c: &DVector<f64>,
) -> Vec<f64> {
    let n = a.nrows();
    let denominator = characteristic_polynomial(a);
    let mut m = DMatrix::<f64>::identity(n, n);
    let mut coefficients = Vec::with_capacity(n);
    for &coefficient in &denominator[1..] {
        coefficients.push(c.dot(&(&m * b)));
        m = a * &m + DMatrix::identity(n, n) * coefficient;
    }
    coefficients
}

fn horner(coefficients: &[f64], s: Complex<f64>) -> Complex<f64> {
    coefficients
        .iter()
        .fold(Complex::new(0.0, 0.0), |sum, &value| sum * s + value)
}

fn trim(coefficients: &[f64]) -> Vec<f64> {
    let start = coefficients.iter().position(|&value| value != 0.0);
    start.map_or_else(|| vec![0.0], |start| coefficients[start..].to_vec())
}

fn multiply(p: &[f64], q: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; p.len() + q.len() - 1];
    for (i, a) in p.iter().enumerate() {
        for (j, b) in q.iter().enumerate() {
            product[i + j] += a * b;
        }
    }
    product
}

fn add(p: &[f64], q: &[f64]) -> Vec<f64> {
    let n = p.len().max(q.len());
    let mut sum = vec![0.0; n];
    for (i, value) in p.iter().enumerate() {
        sum[n - p.len() + i] += value;
    }
    for (i, value) in q.iter().enumerate() {
        sum[n - q.len() + i] += value;
    }
    sum
}

fn roots(coefficients: &[f64]) -> Vec<Complex<f64>> {
    let coefficients = trim(coefficients);
    let n = coefficients.len() - 1;
    if n == 0 {
        return Vec::new();
    }
    let companion = DMatrix::from_fn(n, n, |i, j| {
        if i == 0 {
            -coefficients[j + 1] / coefficients[0]
        } else if i == j + 1 {
            1.0
        } else {
            0.0
        }
    });
    companion.complex_eigenvalues().iter().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn state_space_and_polynomials_agree() {
        let g = TransferFunction::new(&[2.0, 3.0, 5.0], &[4.0, 1.0, 7.0, 6.0]).unwrap();
        let system = g.to_state_space().unwrap();
        for omega in [0.1, 1.0, 1.3, 20.0] {
            let s = Complex::new(0.0, omega);
            let difference = system.evaluate(s).unwrap()[(0, 0)] - g.evaluate(s);
            assert!(difference.norm() < 1e-13, "at {omega} rad/s");
        }
        let denominator = characteristic_polynomial(&system.a);
        let numerator = numerator_polynomial(
            &system.a,
            &system.b.column(0).into(),
            &system.c.row(0).transpose(),
        );
        for (got, want) in denominator.iter().zip([1.0, 0.25, 1.75, 1.5]) {
            assert!((got - want).abs() < 1e-14);
        }
        for (got, want) in numerator.iter().zip([0.5, 0.75, 1.25]) {
            assert!((got - want).abs() < 1e-14);
        }
    }

    #[test]
    fn roots_of_a_known_polynomial() {
        let g = TransferFunction::new(&[1.0], &[1.0, -6.0, 11.0, -6.0]).unwrap();
        let mut poles: Vec<f64> = g.poles().iter().map(|pole| pole.re).collect();
        poles.sort_by(f64::total_cmp);
        for (got, want) in poles.iter().zip([1.0, 2.0, 3.0]) {
            assert!((got - want).abs() < 1e-12);
        }
    }

    #[test]
    fn closed_loop_of_an_integrator_is_a_lag() {
        let integrator = TransferFunction::new(&[5.0], &[1.0, 0.0]).unwrap();
        assert_eq!(integrator.closed_loop().denominator, [1.0, 5.0]);
    }
}

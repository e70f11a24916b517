//! Riccati equations by the structure-preserving doubling algorithm (Chu, Fan, Lin and Wang,
//! "Structure-preserving algorithms for periodic discrete-time algebraic Riccati equations", 2004;
//! Chu, Fan and Lin, 2005, for the continuous one).

use nalgebra::DMatrix;

use crate::ModelError;

const MAX_DOUBLINGS: usize = 80;

/// Stabilising `X` of `A' X A - X - A' X B (R + B' X B)^-1 B' X A + Q = 0` (Eq 5-8 with `A`, `C`
/// transposed).
///
/// Shapes: `A`, `Q` n x n, `B` n x m, `R` m x m.
///
/// # Errors
/// A singular `R`, or no stabilising solution.
pub fn discrete_riccati(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>, ModelError> {
    const NAME: &str = "the discrete Riccati equation";
    let r_inverse = invert(r, NAME, "the input weight is singular")?;
    let g = b * r_inverse * b.transpose();
    let x = double(a.clone(), g, q.clone(), NAME)?;
    let gain = invert(&(r + b.transpose() * &x * b), NAME, "R + B'XB is singular")?
        * b.transpose()
        * &x
        * a;
    if (a - b * gain)
        .complex_eigenvalues()
        .iter()
        .any(|pole| pole.norm() >= 1.0)
    {
        return Err(no_solution(NAME, "the closed loop is not stable"));
    }
    Ok(x)
}

/// Left-hand side of the discrete equation at `x`.
pub fn discrete_riccati_residual(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    x: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let gain = (r + b.transpose() * x * b)
        .lu()
        .solve(&(b.transpose() * x * a))?;
    Some(a.transpose() * x * a - x - a.transpose() * x * b * gain + q)
}

/// Stabilising `X` of `A' X + X A - X B R^-1 B' X + Q = 0`.
///
/// Shapes: `A`, `Q` n x n, `B` n x m, `R` m x m.
///
/// # Errors
/// A singular `R`, or no stabilising solution.
pub fn continuous_riccati(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Result<DMatrix<f64>, ModelError> {
    const NAME: &str = "the continuous Riccati equation";
    let n = a.nrows();
    let g = b * invert(r, NAME, "the input weight is singular")? * b.transpose();
    // Cayley shift: of the size of A, away from its eigenvalues.
    let gamma = 1.1
        * a.norm()
            .max(g.norm() * q.norm())
            .max(1e-3)
            .sqrt()
            .max(a.norm() * 0.5);
    let singular = "the Cayley shift meets an eigenvalue";
    let shifted = invert(&(a - DMatrix::identity(n, n) * gamma), NAME, singular)?;
    let w = (a - DMatrix::identity(n, n) * gamma).transpose() + q * &shifted * &g;
    let w = invert(&w, NAME, singular)?;
    let x = double(
        DMatrix::identity(n, n) + w.transpose() * (2.0 * gamma),
        &shifted * &g * &w * (2.0 * gamma),
        &w * q * &shifted * (2.0 * gamma),
        NAME,
    )?;
    if (a - &g * &x)
        .complex_eigenvalues()
        .iter()
        .any(|pole| pole.re >= 0.0)
    {
        return Err(no_solution(NAME, "the closed loop is not stable"));
    }
    Ok(x)
}

/// Left-hand side of the continuous equation at `x`.
pub fn continuous_riccati_residual(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    x: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let gain = r.clone().lu().solve(&(b.transpose() * x))?;
    Some(a.transpose() * x + x * a - x * b * gain + q)
}

fn double(
    mut a: DMatrix<f64>,
    mut g: DMatrix<f64>,
    mut h: DMatrix<f64>,
    name: &'static str,
) -> Result<DMatrix<f64>, ModelError> {
    let identity = DMatrix::identity(a.nrows(), a.nrows());
    for _ in 0..MAX_DOUBLINGS {
        let w = invert(
            &(&identity + &g * &h),
            name,
            "the doubling step is singular",
        )?;
        let step = a.transpose() * &h * &w * &a;
        g += &a * &w * &g * a.transpose();
        a = &a * &w * &a;
        h += &step;
        h = (&h + h.transpose()) * 0.5;
        g = (&g + g.transpose()) * 0.5;
        if !h.iter().all(|value| value.is_finite()) {
            return Err(no_solution(name, "the doubling iteration diverges"));
        }
        if step.norm() <= f64::EPSILON * h.norm() {
            return Ok(h);
        }
    }
    Err(no_solution(
        name,
        "the doubling iteration does not converge (an eigenvalue on the border)",
    ))
}

fn invert(
    matrix: &DMatrix<f64>,
    equation: &'static str,
    reason: &str,
) -> Result<DMatrix<f64>, ModelError> {
    matrix
        .clone()
        .try_inverse()
        .ok_or_else(|| no_solution(equation, reason))
}

fn no_solution(equation: &'static str, reason: &str) -> ModelError {
    ModelError::NoSolution {
        equation,
        reason: reason.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;
    use proptest::prelude::*;

    #[test]
    fn scalar_equations_have_their_closed_forms() {
        let one = dmatrix![1.0];
        // x^2 = x + 1 for a = b = q = r = 1.
        let x = discrete_riccati(&one, &one, &one, &one).unwrap();
        assert!((x[(0, 0)] - (1.0 + 5f64.sqrt()) / 2.0).abs() < 1e-14);
        // 2x - x^2 + 1 = 0.
        let x = continuous_riccati(&one, &one, &one, &one).unwrap();
        assert!((x[(0, 0)] - (1.0 + 2f64.sqrt())).abs() < 1e-13);
    }

    #[test]
    fn an_uncontrollable_unstable_mode_is_refused() {
        let error = discrete_riccati(
            &dmatrix![1.5, 0.0; 0.0, 0.5],
            &dmatrix![0.0; 1.0],
            &DMatrix::identity(2, 2),
            &dmatrix![1.0],
        )
        .unwrap_err();
        assert!(
            error.to_string().contains("no stabilising solution"),
            "{error}"
        );
    }

    proptest! {
        // Over the size of the equation's terms; a pair that is hardly controllable has a solution
        // above 1e3 and costs digits.
        #[test]
        fn residuals_vanish(values in prop::collection::vec(-1.0..1.0f64, 16 + 8)) {
            let a = DMatrix::from_row_slice(4, 4, &values[..16]);
            let b = DMatrix::from_row_slice(4, 2, &values[16..]);
            let (q, r) = (DMatrix::identity(4, 4), DMatrix::identity(2, 2));
            let apart = |residual: &DMatrix<f64>, terms: f64| residual.norm() / (terms + q.norm());
            if let Ok(x) = discrete_riccati(&(&a * 1.5), &b, &q, &r) {
                let residual = discrete_riccati_residual(&(&a * 1.5), &b, &q, &r, &x).unwrap();
                let terms = x.norm() * (1.0 + (&a * 1.5).norm().powi(2));
                prop_assert!(x.norm() > 1e3 || apart(&residual, terms) <= 1e-9);
            }
            if let Ok(x) = continuous_riccati(&a, &b, &q, &r) {
                let residual = continuous_riccati_residual(&a, &b, &q, &r, &x).unwrap();
                let terms = 2.0 * x.norm() * a.norm() + (&x * &b).norm().powi(2);
                prop_assert!(x.norm() > 1e3 || apart(&residual, terms) <= 1e-7);
            }
        }
    }
}

//! Order reduction by balanced residualisation (Moore 1981; Fernando and Nicholson 1982): the states
//! that pass least from input to output are replaced by their static response, so that the result
//! meets the original at frequency zero and errs nowhere by more than twice the sum of the Hankel
//! singular values left out.

use nalgebra::{DMatrix, DVector};
use plant::linear::StateSpace;

use super::no_solution;
use crate::ModelError;

/// Controllability and observability Gramians of a stable system.
///
/// # Errors
/// A Lyapunov equation that is singular.
pub fn gramians(system: &StateSpace) -> Result<(DMatrix<f64>, DMatrix<f64>), ModelError> {
    let StateSpace { a, b, c, .. } = system;
    Ok((
        lyapunov(a, &(b * b.transpose()))?,
        lyapunov(&a.transpose(), &(c.transpose() * c))?,
    ))
}

/// `X` of `A X + X A' + Q = 0`, by its Kronecker form: for the few states of a controller.
///
/// # Errors
/// Two eigenvalues of `A` whose sum is zero.
pub fn lyapunov(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<DMatrix<f64>, ModelError> {
    let n = a.nrows();
    let one = DMatrix::identity(n, n);
    let operator = one.kronecker(a) + a.kronecker(&one);
    let x = operator
        .lu()
        .solve(&-DVector::from_column_slice(q.as_slice()))
        .ok_or_else(|| no_solution("a Lyapunov equation is singular".into()))?;
    let x = DMatrix::from_column_slice(n, n, x.as_slice());
    Ok((&x + x.transpose()) * 0.5)
}

/// The stable `system` with `order` states, and all its Hankel singular values, descending.
///
/// # Errors
/// A system that is not stable, an order of zero or beyond the system's.
pub fn residualise(
    system: &StateSpace,
    order: usize,
) -> Result<(StateSpace, Vec<f64>), ModelError> {
    if !system.is_stable() {
        return Err(no_solution("the system to reduce is not stable".into()));
    }
    if order == 0 || order > system.order() {
        return Err(ModelError::Parameter {
            name: "order",
            value: order as f64,
            expected: "at least one and at most the system's",
        });
    }
    let (p, q) = gramians(system)?;
    let (left, right) = (square_root(p), square_root(q));
    let svd = (right.transpose() * &left).svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
        return Err(no_solution("no singular vectors".into()));
    };
    let mut places: Vec<usize> = (0..svd.singular_values.len()).collect();
    places.sort_by(|&i, &j| svd.singular_values[j].total_cmp(&svd.singular_values[i]));
    let hankel: Vec<f64> = places.iter().map(|&i| svd.singular_values[i]).collect();
    if hankel[order - 1] <= 0.0 {
        return Err(no_solution(
            "the system has fewer significant states".into(),
        ));
    }
    let kept = &places[..order];
    let scale = DMatrix::from_fn(order, order, |i, j| {
        if i == j {
            hankel[i].sqrt().recip()
        } else {
            0.0
        }
    });
    let onto = &scale * u.select_columns(kept).transpose() * right.transpose();
    let from = left * v.select_rows(kept).transpose() * &scale;

    // Residualising is truncating the reciprocal system G(1/s) = (A^-1, A^-1 B, -C A^-1,
    // D - C A^-1 B), which has the same Gramians, and taking the reciprocal of the result.
    let singular = || no_solution("the system to reduce integrates".into());
    let inverse = system.a.clone().try_inverse().ok_or_else(singular)?;
    let into = &inverse * &system.b;
    let a = (&onto * &inverse * &from)
        .try_inverse()
        .ok_or_else(singular)?;
    let b = &a * (&onto * &into);
    let out = -(&system.c * &inverse * &from);
    let d = &system.d - &system.c * &into - &out * &b;
    let c = -(out * &a);
    Ok((StateSpace::new(a, b, c, d)?, hankel))
}

/// A factor `S` with `S S' = matrix` for a symmetric matrix that may be singular to rounding.
fn square_root(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let eigen = matrix.symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * DMatrix::from_diagonal(&roots)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Complex, dmatrix};

    #[test]
    fn a_fast_lag_beside_a_slow_one_becomes_a_constant() {
        // 1000 / (s + 0.01) + 3 / (s + 50).
        let system = StateSpace::new(
            dmatrix![-0.01, 0.0; 0.0, -50.0],
            dmatrix![1.0; 1.0],
            dmatrix![1000.0, 3.0],
            dmatrix![0.0],
        )
        .unwrap();
        let (small, hankel) = residualise(&system, 1).unwrap();
        let at = |system: &StateSpace, omega: f64| {
            system.evaluate(Complex::new(0.0, omega)).unwrap()[(0, 0)]
        };
        assert!((at(&small, 0.0) - at(&system, 0.0)).norm() < 1e-9 * at(&system, 0.0).norm());
        for omega in [0.01, 1.0, 30.0, 500.0] {
            let error = (at(&small, omega) - at(&system, omega)).norm();
            assert!(
                error <= 2.0 * hankel[1] * (1.0 + 1e-9),
                "{error} at {omega}"
            );
        }
        assert!((small.d[(0, 0)] - 0.06).abs() < 1e-4, "{}", small.d);
        assert!((small.a[(0, 0)] + 0.01).abs() < 1e-6);
    }

    #[test]
    fn what_cannot_be_reduced_is_refused() {
        let integrator =
            StateSpace::new(dmatrix![0.0], dmatrix![1.0], dmatrix![1.0], dmatrix![0.0]).unwrap();
        let error = residualise(&integrator, 1).unwrap_err().to_string();
        assert!(error.contains("not stable"), "{error}");
        let lag = StateSpace {
            a: dmatrix![-1.0],
            ..integrator
        };
        assert!(
            residualise(&lag, 2)
                .unwrap_err()
                .to_string()
                .contains("`order` is 2")
        );
    }
}

//! Robust stabilisation of normalised coprime factors (Glover and McFarlane, "Robust stabilization
//! of normalized coprime factor plant descriptions with H-infinity-bounded uncertainty", IEEE Trans.
//! Automatic Control 34, 1989).

use nalgebra::DMatrix;
use plant::linear::{StateSpace, continuous_riccati};

use super::no_solution;
use crate::ModelError;

/// The central controller for `gamma`, to be used in negative feedback.
#[derive(Debug, Clone)]
pub struct RobustController {
    /// The smallest `gamma` that any controller reaches.
    pub gamma_min: f64,
    /// The `gamma` of this one: the norm of `[K; 1] (1 + G K)^-1 [1, G]` is below it, and
    /// `1 / gamma` is the size of the coprime-factor uncertainty that it withstands.
    pub gamma: f64,
    /// `K`, of the order of the plant.
    pub controller: StateSpace,
}

/// Both Riccati solutions of a strictly proper system: `(X, Z)` of
/// `A'X + XA - XBB'X + C'C = 0` and `AZ + ZA' - ZC'CZ + BB' = 0`.
///
/// # Errors
/// An equation without a stabilising solution.
pub fn riccati_pair(system: &StateSpace) -> Result<(DMatrix<f64>, DMatrix<f64>), ModelError> {
    let StateSpace { a, b, c, .. } = system;
    let one = |size: usize| DMatrix::identity(size, size);
    let x = continuous_riccati(a, b, &(c.transpose() * c), &one(b.ncols()))?;
    let z = continuous_riccati(
        &a.transpose(),
        &c.transpose(),
        &(b * b.transpose()),
        &one(c.nrows()),
    )?;
    Ok((x, z))
}

/// Stabilises the strictly proper `system` with `gamma = factor * gamma_min`, where
/// `gamma_min = sqrt(1 + largest eigenvalue of X Z)`.
///
/// # Errors
/// A factor that is not above one, a system with feedthrough, a Riccati equation without a
/// stabilising solution.
pub fn stabilise(system: &StateSpace, factor: f64) -> Result<RobustController, ModelError> {
    if !(factor > 1.0 && factor.is_finite()) {
        return Err(ModelError::Parameter {
            name: "gamma_factor",
            value: factor,
            expected: "a number above one",
        });
    }
    if system.d.amax() != 0.0 {
        return Err(no_solution("the shaped plant has feedthrough".into()));
    }
    let (x, z) = riccati_pair(system)?;
    let xz = &x * &z;
    let largest = xz
        .complex_eigenvalues()
        .iter()
        .map(|value| value.re)
        .fold(0.0, f64::max);
    let gamma_min = (1.0 + largest).sqrt();
    let gamma = factor * gamma_min;
    let n = system.order();
    let l = DMatrix::identity(n, n) * (1.0 - gamma * gamma) + xz;
    let zc = &z * system.c.transpose();
    let Some(gain) = l.transpose().lu().solve(&zc) else {
        return Err(no_solution("gamma is optimal to rounding".into()));
    };
    let gain = gain * (gamma * gamma);
    let bx = system.b.transpose() * &x;
    Ok(RobustController {
        gamma_min,
        gamma,
        controller: StateSpace::new(
            &system.a - &system.b * &bx + &gain * &system.c,
            gain,
            -bx,
            DMatrix::zeros(system.b.ncols(), system.c.nrows()),
        )?,
    })
}

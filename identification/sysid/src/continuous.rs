//! From sampled to continuous time: matrix logarithm, inverse zero-order hold, delay.

use nalgebra::DMatrix;
use plant::linear::{DiscreteStateSpace, StateSpace};

use recordings::IdentificationError;

/// The continuous system whose zero-order-hold sampling is `sampled`.
///
/// # Errors
/// An eigenvalue on the negative real axis or at zero: no real continuous system samples to it
/// (a pole faster than the sampling, or a pure delay).
pub fn inverse_zero_order_hold(
    sampled: &DiscreteStateSpace,
) -> Result<StateSpace, IdentificationError> {
    let (n, m) = (sampled.order(), sampled.b.ncols());
    let poles = sampled.poles();
    if let Some(pole) = poles
        .iter()
        .find(|pole| pole.re <= 0.0 && pole.im.abs() <= 1e-9 * pole.norm().max(1e-9))
    {
        return Err(IdentificationError::Unstable {
            what: format!(
                "the sampled model has a pole at {:.4}, which has no continuous equivalent",
                pole.re
            ),
            remedy: "lower the order, or give the delay of the input".into(),
        });
    }
    let mut block = DMatrix::identity(n + m, n + m);
    block.view_mut((0, 0), (n, n)).copy_from(&sampled.a);
    block.view_mut((0, n), (n, m)).copy_from(&sampled.b);
    let logarithm = matrix_logarithm(&block)? / sampled.period;
    Ok(StateSpace {
        a: logarithm.view((0, 0), (n, n)).into_owned(),
        b: logarithm.view((0, n), (n, m)).into_owned(),
        c: sampled.c.clone(),
        d: sampled.d.clone(),
    })
}

/// Principal logarithm by inverse scaling and squaring: square roots until the matrix is near the
/// identity, then the series of `2 artanh((X - I)(X + I)^-1)`.
///
/// # Errors
/// A singular matrix or eigenvalues on the negative real axis.
pub fn matrix_logarithm(matrix: &DMatrix<f64>) -> Result<DMatrix<f64>, IdentificationError> {
    let failed = || IdentificationError::NotConverged {
        method: "the matrix logarithm",
        reason: "the matrix is singular or has an eigenvalue on the negative real axis".into(),
    };
    let identity = DMatrix::identity(matrix.nrows(), matrix.nrows());
    let mut x = matrix.clone();
    let mut doublings = 0;
    while (&x - &identity).norm() > 0.25 {
        if doublings > 60 {
            return Err(failed());
        }
        x = square_root(&x).ok_or_else(failed)?;
        doublings += 1;
    }
    let z = (&x - &identity) * (&x + &identity).try_inverse().ok_or_else(failed)?;
    let square = &z * &z;
    let mut term = z.clone();
    let mut sum = z;
    for k in 1..40 {
        term = &term * &square;
        let part = &term / f64::from(2 * k + 1);
        sum += &part;
        if part.norm() <= f64::EPSILON * sum.norm() {
            break;
        }
    }
    let logarithm = sum * 2.0 * 2f64.powi(doublings);
    logarithm
        .iter()
        .all(|value| value.is_finite())
        .then_some(logarithm)
        .ok_or_else(failed)
}

/// Principal square root by the product form of the iteration of Denman and Beavers (Cheng,
/// Higham, Kenney and Laub, 2001).
fn square_root(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let identity = DMatrix::<f64>::identity(matrix.nrows(), matrix.nrows());
    let mut m = matrix.clone();
    let mut root = matrix.clone();
    for _ in 0..60 {
        let inverse = m.clone().try_inverse()?;
        root = &root * (&identity + &inverse) * 0.5;
        m = (&identity + (&m + &inverse) * 0.5) * 0.5;
        if !root.iter().all(|value| value.is_finite()) {
            return None;
        }
        if (&m - &identity).norm() <= 1e-14 * identity.norm() {
            return Some(root);
        }
    }
    // Rounding keeps some matrices from the last digits.
    ((&m - &identity).norm() <= 1e-8).then_some(root)
}

/// Delay in seconds of `output` behind `input`, where their cross-correlation is largest, refined
/// by a parabola; looked for between zero and `longest`.
///
/// Both are differenced first, so that drift does not hide the delay.
pub fn delay_by_correlation(input: &[f64], output: &[f64], period: f64, longest: f64) -> f64 {
    let difference =
        |values: &[f64]| -> Vec<f64> { values.windows(2).map(|pair| pair[1] - pair[0]).collect() };
    let (u, y) = (difference(input), difference(output));
    let most = ((longest / period) as usize).min(y.len().saturating_sub(2));
    let correlation: Vec<f64> = (0..=most + 1)
        .map(|lag| u.iter().zip(y.iter().skip(lag)).map(|(a, b)| a * b).sum())
        .collect();
    let Some(best) = (0..=most).max_by(|&a, &b| correlation[a].total_cmp(&correlation[b])) else {
        return 0.0;
    };
    if best == 0 {
        return 0.0;
    }
    let (before, at, after) = (
        correlation[best - 1],
        correlation[best],
        correlation[best + 1],
    );
    let curvature = before - 2.0 * at + after;
    let shift = if curvature < 0.0 {
        0.5 * (before - after) / curvature
    } else {
        0.0
    };
    // At the longest the correlation may still rise, and the parabola's top be anywhere beyond.
    ((best as f64 + shift) * period).min(longest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::identified::shake_table::ShakeTable;

    #[test]
    fn sampling_and_back_is_the_identity() {
        let system = ShakeTable::derounded().state_space();
        let back = inverse_zero_order_hold(&system.sample(0.002)).unwrap();
        // The actuator's observer form holds 1e4 beside 1: compare by response.
        for omega in [0.3, 4.0, 60.0, 300.0] {
            let s = nalgebra::Complex::new(0.0, omega);
            let (want, got) = (system.evaluate(s).unwrap(), back.evaluate(s).unwrap());
            let error = (&want - &got).norm() / want.norm();
            assert!(error < 1e-5, "{error:e} at {omega} rad/s");
        }
    }

    #[test]
    fn a_pole_that_no_continuous_system_has_is_named() {
        let sampled = DiscreteStateSpace {
            a: DMatrix::from_element(1, 1, -0.5),
            b: DMatrix::from_element(1, 1, 1.0),
            c: DMatrix::from_element(1, 1, 1.0),
            d: DMatrix::zeros(1, 1),
            period: 0.01,
        };
        let error = inverse_zero_order_hold(&sampled).unwrap_err().to_string();
        assert!(error.contains("a pole at -0.5000, which has no continuous equivalent"));
    }

    #[test]
    fn a_shifted_signal_has_its_delay() {
        let wave = |t: f64| (11.0 * t).sin() + (37.0 * t).cos() + (80.0 * t).sin();
        let (h, delay) = (0.002, 0.0131);
        let input: Vec<f64> = (0..5000).map(|k| wave(h * k as f64)).collect();
        let output: Vec<f64> = (0..5000).map(|k| wave(h * k as f64 - delay)).collect();
        let got = delay_by_correlation(&input, &output, h, 0.05);
        assert!((got - delay).abs() < 1e-4, "{got}");
        for delay in [0.0122, 0.0144] {
            let output: Vec<f64> = (0..5000).map(|k| wave(h * k as f64 - delay)).collect();
            let got = delay_by_correlation(&input, &output, h, 0.05);
            assert!((got - delay).abs() < 1e-4, "{got}");
        }
        // A drift that is much larger than the signals does not hide it.
        let drifting = |values: &[f64], rate: f64| -> Vec<f64> {
            let all = values.iter().enumerate();
            all.map(|(k, value)| value + rate * h * k as f64).collect()
        };
        let (input, output) = (drifting(&input, 30.0), drifting(&output, -20.0));
        let got = delay_by_correlation(&input, &output, h, 0.05);
        assert!((got - delay).abs() < 1e-3, "{got}");
        // Nor is it looked for beyond the longest.
        let got = delay_by_correlation(&input, &output, h, 0.004);
        assert!(got <= 0.004, "{got}");
        assert_eq!(delay_by_correlation(&input, &input, h, 0.05), 0.0);
        assert_eq!(delay_by_correlation(&[1.0], &[1.0], h, 0.05), 0.0);
    }
}

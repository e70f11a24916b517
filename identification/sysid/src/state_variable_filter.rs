//! State-variable filters (Eq 2-17 to 2-20): a signal and its derivatives, all through
//! `L(s) = (lambda / (s + lambda))^n`.

use nalgebra::{DMatrix, DVector};
use plant::linear::StateSpace;

/// How a sampled signal runs between its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Between {
    /// Held: a command from a computer.
    Held,
    /// On a straight line: a measurement.
    Straight,
}

/// `s^i L(s)` of `signal` for `i = 0..=order`, with `L = lambda^order / denominator(s)`.
///
/// `denominator` is monic in descending powers, of degree `order`, and stable. The filter starts
/// at rest at the first sample's value.
pub fn filter(signal: &[f64], period: f64, denominator: &[f64], between: Between) -> Vec<Vec<f64>> {
    let n = denominator.len() - 1;
    let gain = denominator[n];
    let (a, now, next) = transition(denominator, period, between);
    let mut state = DVector::zeros(n);
    let mut advanced = DVector::zeros(n);
    if let Some(&first) = signal.first() {
        state[0] = first;
    }
    let mut outputs = vec![Vec::with_capacity(signal.len()); n + 1];
    for (k, &value) in signal.iter().enumerate() {
        let mut highest = gain * value;
        for i in 0..n {
            outputs[i].push(state[i]);
            highest -= denominator[n - i] * state[i];
        }
        outputs[n].push(highest);
        let following = signal.get(k + 1).copied().unwrap_or(value);
        advanced.gemv(1.0, &a, &state, 0.0);
        advanced.axpy(value, &now, 1.0);
        advanced.axpy(following, &next, 1.0);
        std::mem::swap(&mut state, &mut advanced);
    }
    outputs
}

/// `(s + lambda)^order` in descending powers.
pub fn equal_lags(lambda: f64, order: usize) -> Vec<f64> {
    let mut polynomial = vec![1.0];
    for _ in 0..order {
        let mut next = polynomial.clone();
        next.push(0.0);
        for (i, &c) in polynomial.iter().enumerate() {
            next[i + 1] += lambda * c;
        }
        polynomial = next;
    }
    polynomial
}

/// Transition of the filter in controller form, and how the present and the next sample enter.
fn transition(
    denominator: &[f64],
    period: f64,
    between: Between,
) -> (DMatrix<f64>, DVector<f64>, DVector<f64>) {
    let n = denominator.len() - 1;
    // States: the filter's, the signal, its slope times the period.
    let mut a = DMatrix::zeros(n + 2, n + 2);
    for i in 0..n.saturating_sub(1) {
        a[(i, i + 1)] = 1.0;
    }
    for i in 0..n {
        a[(n - 1, i)] = -denominator[n - i];
    }
    a[(n - 1, n)] = denominator[n];
    a[(n, n + 1)] = 1.0 / period;
    let all = StateSpace {
        a,
        b: DMatrix::zeros(n + 2, 0),
        c: DMatrix::zeros(0, n + 2),
        d: DMatrix::zeros(0, 0),
    }
    .sample(period)
    .a;
    let transition = all.view((0, 0), (n, n)).into_owned();
    let held = all.view((0, n), (n, 1)).column(0).into_owned();
    match between {
        Between::Held => (transition, held, DVector::zeros(n)),
        Between::Straight => {
            let slope = all.view((0, n + 1), (n, 1)).column(0).into_owned();
            (transition, held - &slope, slope)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filtered_derivatives_of_a_sine_follow_the_filter() {
        let (omega, lambda, h) = (12.0_f64, 30.0_f64, 0.001);
        let signal: Vec<f64> = (0..4000).map(|k| (omega * h * k as f64).sin()).collect();
        let denominator = equal_lags(lambda, 3);
        let got = filter(&signal, h, &denominator, Between::Straight);
        let s = nalgebra::Complex::new(0.0, omega);
        let l = (lambda / (s + lambda)).powu(3);
        for k in 2000..4000 {
            let phasor = nalgebra::Complex::new(0.0, omega * h * k as f64).exp();
            for (i, derivative) in got.iter().enumerate() {
                let want = (s.powu(i as u32) * l * phasor).im;
                assert!(
                    (derivative[k] - want).abs() < 2e-4 * omega.powi(i as i32),
                    "{i}"
                );
            }
        }
    }

    #[test]
    fn a_held_step_gives_the_closed_form() {
        let got = filter(&[0.0, 1.0, 1.0, 1.0], 0.1, &[1.0, 2.0], Between::Held);
        for k in 1..4 {
            let want = 1.0 - (-0.2 * (k as f64 - 1.0)).exp();
            assert!((got[0][k] - want).abs() < 1e-14);
        }
    }
}

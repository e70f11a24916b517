//! Response spectra: the largest responses of linear oscillators to a ground acceleration.

use std::f64::consts::TAU;

/// Damping ratio of the usual spectra.
pub const USUAL_DAMPING: f64 = 0.05;

/// Pseudo-acceleration `omega² max|x|` (the unit of `acceleration`) of oscillators with the natural
/// `frequencies` (Hz) and the damping ratio `damping`, at rest before a ground acceleration sampled
/// every `dt` seconds. The ground acceleration is linear between samples, for which the recurrence
/// is exact (Nigam and Jennings 1969).
#[must_use]
pub fn pseudo_acceleration(
    acceleration: &[f64],
    dt: f64,
    frequencies: &[f64],
    damping: f64,
) -> Vec<f64> {
    let largest = |frequency: &f64| {
        let omega = TAU * frequency;
        let oscillator = Oscillator::new(omega, damping, dt);
        let (mut x, mut v, mut largest) = (0.0, 0.0, 0.0_f64);
        for pair in acceleration.windows(2) {
            (x, v) = oscillator.step(x, v, pair[0], pair[1]);
            largest = largest.max(x.abs());
        }
        omega * omega * largest
    };
    frequencies.iter().map(largest).collect()
}

/// One step of `x'' + 2 zeta omega x' + omega² x = -a`, `a` linear over the step.
struct Oscillator {
    omega: f64,
    zeta: f64,
    dt: f64,
    decay: f64,
    sine: f64,
    cosine: f64,
    damped: f64,
}

impl Oscillator {
    fn new(omega: f64, zeta: f64, dt: f64) -> Self {
        let damped = omega * (1.0 - zeta * zeta).sqrt();
        let (sine, cosine) = (damped * dt).sin_cos();
        Self {
            omega,
            zeta,
            dt,
            decay: (-zeta * omega * dt).exp(),
            sine,
            cosine,
            damped,
        }
    }

    fn step(&self, x: f64, v: f64, from: f64, to: f64) -> (f64, f64) {
        // Particular solution p + q t of the linear load, then the free decay of the rest.
        let Self { omega, zeta, .. } = *self;
        let slope = (to - from) / self.dt;
        let q = -slope / (omega * omega);
        let p = -from / (omega * omega) + 2.0 * zeta * slope / omega.powi(3);
        let (a, b) = (x - p, (v - q + zeta * omega * (x - p)) / self.damped);
        let free = self.decay * (a * self.cosine + b * self.sine);
        let turned = self.decay * (b * self.cosine - a * self.sine);
        (
            free + p + q * self.dt,
            -zeta * omega * free + self.damped * turned + q,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Resonance of a steady sine: amplification 1/(2 zeta); far above, the ground's own peak.
    #[test]
    fn a_long_sine_is_amplified_as_in_the_closed_form() {
        let dt = 0.002;
        let ground: Vec<f64> = (0..40_000)
            .map(|n| 3.0 * (TAU * 2.0 * f64::from(n) * dt).sin())
            .collect();
        let found = pseudo_acceleration(&ground, dt, &[2.0, 100.0, 1.0], 0.05);
        assert!((found[0] - 30.0).abs() < 0.05, "{}", found[0]);
        assert!((found[1] - 3.0).abs() < 0.02, "{}", found[1]);
        // Ratio of frequencies 2: 1/sqrt((1 - 4)² + (2 0.05 2)²), the transient beside it.
        let steady = 3.0 / (9.0_f64 + 0.04).sqrt();
        assert!(found[2] > steady && found[2] < 2.5 * steady, "{}", found[2]);
    }

    /// A step of the ground's acceleration: `1 + exp(-zeta pi / sqrt(1 - zeta²))`.
    #[test]
    fn a_step_overshoots_as_in_the_closed_form() {
        let ground = vec![1.0; 5000];
        let zeta = 0.1_f64;
        let found = pseudo_acceleration(&ground, 0.001, &[1.0], zeta)[0];
        let expected = 1.0 + (-zeta * std::f64::consts::PI / (1.0 - zeta * zeta).sqrt()).exp();
        assert!((found - expected).abs() < 1e-4, "{found}");
    }
}

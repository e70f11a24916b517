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
    let mut oscillators: Vec<Oscillator> = frequencies
        .iter()
        .map(|frequency| Oscillator::new(TAU * frequency, damping, dt))
        .collect();
    for pair in acceleration.windows(2) {
        // All of them a sample on: a step waits for no other's.
        for oscillator in &mut oscillators {
            oscillator.step(pair[0], pair[1]);
        }
    }
    let spectral = |(oscillator, frequency): (&Oscillator, &f64)| {
        (TAU * frequency).powi(2) * oscillator.largest
    };
    oscillators.iter().zip(frequencies).map(spectral).collect()
}

/// `x'' + 2 zeta omega x' + omega² x = -a`, `a` linear over a step: displacement and velocity after it
/// are the recurrence's rows times displacement, velocity, and the load at either end.
struct Oscillator {
    displacement: [f64; 4],
    velocity: [f64; 4],
    x: f64,
    v: f64,
    largest: f64,
}

impl Oscillator {
    fn new(omega: f64, damping: f64, dt: f64) -> Self {
        let mut unit = [[0.0; 4]; 4];
        for (n, row) in unit.iter_mut().enumerate() {
            row[n] = 1.0;
        }
        let columns = unit.map(|state| closed_form(omega, damping, dt, state));
        Self {
            displacement: columns.map(|[x, _]| x),
            velocity: columns.map(|[_, v]| v),
            x: 0.0,
            v: 0.0,
            largest: 0.0,
        }
    }

    fn step(&mut self, from: f64, to: f64) {
        let state = [self.x, self.v, from, to];
        let times = |row: &[f64; 4]| {
            (row[0] * state[0] + row[1] * state[1]) + (row[2] * state[2] + row[3] * state[3])
        };
        (self.x, self.v) = (times(&self.displacement), times(&self.velocity));
        self.largest = self.largest.max(self.x.abs());
    }
}

/// Displacement and velocity after a step from displacement, velocity and the load at either end.
fn closed_form(omega: f64, zeta: f64, dt: f64, [x, v, from, to]: [f64; 4]) -> [f64; 2] {
    let damped = omega * (1.0 - zeta * zeta).sqrt();
    let (sine, cosine) = (damped * dt).sin_cos();
    let decay = (-zeta * omega * dt).exp();
    // Particular solution p + q t of the linear load, then the free decay of the rest.
    let slope = (to - from) / dt;
    let q = -slope / (omega * omega);
    let p = -from / (omega * omega) + 2.0 * zeta * slope / omega.powi(3);
    let (a, b) = (x - p, (v - q + zeta * omega * (x - p)) / damped);
    let free = decay * (a * cosine + b * sine);
    let turned = decay * (b * cosine - a * sine);
    [
        free + p + q * dt,
        -zeta * omega * free + damped * turned + q,
    ]
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

//! Response spectra: what the motion does to oscillators.

use std::f64::consts::TAU;

/// Largest pseudo-acceleration of an oscillator of natural `frequency` (Hz) and `damping` ratio at
/// rest under `acceleration` (a sample every `dt` s, straight between), in the unit of the
/// acceleration. The recursion is exact for that excitation (Nigam and Jennings, Bulletin of the
/// Seismological Society of America 59, 1969).
#[must_use]
pub fn pseudo_acceleration(acceleration: &[f64], dt: f64, frequency: f64, damping: f64) -> f64 {
    let omega = TAU * frequency;
    let damped = omega * (1.0 - damping * damping).sqrt();
    let decay = (-damping * omega * dt).exp();
    let (sin, cos) = (damped * dt).sin_cos();
    let (mut x, mut v, mut largest) = (0.0f64, 0.0f64, 0.0f64);
    for pair in acceleration.windows(2) {
        // x'' + 2 z w x' + w² x = -a0 - slope t: particular solution p0 + p1 t, the rest decays.
        let slope = (pair[1] - pair[0]) / dt;
        let p1 = -slope / (omega * omega);
        let p0 = -(pair[0] + 2.0 * damping * omega * p1) / (omega * omega);
        let free = x - p0;
        let rate = (v - p1 + damping * omega * free) / damped;
        x = decay * (free * cos + rate * sin) + p0 + p1 * dt;
        v = decay
            * ((rate * damped - damping * omega * free) * cos
                - (free * damped + damping * omega * rate) * sin)
            + p1;
        largest = largest.max(x.abs());
    }
    largest * omega * omega
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_acceleration_overshoots_by_the_closed_form() {
        let damping: f64 = 0.05;
        let acceleration = vec![2.0; 20_000];
        let got = pseudo_acceleration(&acceleration, 0.001, 1.0, damping);
        // Step response of an oscillator: 1 + exp(-pi z / sqrt(1 - z²)).
        let root = (1.0 - damping * damping).sqrt();
        let expected = 2.0 * (1.0 + (-std::f64::consts::PI * damping / root).exp());
        assert!((got / expected - 1.0).abs() < 1e-5, "{got} {expected}");
    }

    #[test]
    fn a_sine_at_resonance_reaches_the_closed_form_amplitude() {
        let (dt, frequency, damping) = (0.002, 2.0, 0.05);
        let sine: Vec<f64> = (0..20_000)
            .map(|n| (TAU * frequency * n as f64 * dt).sin())
            .collect();
        let got = pseudo_acceleration(&sine, dt, frequency, damping);
        assert!((got * 2.0 * damping - 1.0).abs() < 1e-3, "{got}");
    }
}

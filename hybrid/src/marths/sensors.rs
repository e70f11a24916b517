//! Noise of the stroke sensors.

use plant::sensors::channel::Noise;

use super::Pair;
use crate::vrths::PublishedNoise;

/// Standard deviation of each stroke sensor's noise, m: `sqrt(1.5e-7 mm^2/Hz * 1024 Hz)`.
pub const NOISE: f64 = 1.239_354_670_786_373_3e-5;

/// State with which the published program starts its generator.
const PUBLISHED_START: u64 = 123 * 65_536;

/// Noise, a pair a sample (m): independent draws, others for every `stream` of a seed.
#[must_use]
pub fn independent_noise(seed: u64, stream: u64, samples: usize) -> Vec<Pair> {
    let draw = |sensor: u64, sample: u64| {
        let draw = Noise {
            seed,
            channel: stream << 1 | sensor,
            sample,
        };
        NOISE * draw.gaussian()
    };
    (0..samples as u64)
        .map(|sample| [draw(0, sample), draw(1, sample)])
        .collect()
}

/// The published program's noise (m): it gives both sensors the same draws.
#[must_use]
pub fn published_noise(samples: usize) -> Vec<Pair> {
    PublishedNoise::starting_at(PUBLISHED_START)
        .take(samples)
        .map(|z| [NOISE * z; 2])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn independent_noise_has_its_size_and_is_independent() {
        let noise = independent_noise(4, 2, 20_000);
        let mean = |f: &dyn Fn(&Pair) -> f64| noise.iter().map(f).sum::<f64>() / 20_000.0;
        for i in 0..2 {
            assert!((mean(&|n| n[i] * n[i]).sqrt() / NOISE - 1.0).abs() < 0.02);
        }
        assert!(mean(&|n| n[0] * n[1]).abs() < 0.03 * NOISE * NOISE);
        assert_ne!(noise[0], independent_noise(4, 3, 1)[0]);
    }
}

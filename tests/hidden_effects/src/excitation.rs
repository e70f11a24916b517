//! References that a laboratory plays: multisine, earthquake, sweep, triangle.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Kind of reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Excitation {
    /// Odd multiples of 0.1 Hz up to 15 Hz of random phase, a quarter of them left out.
    Multisine,
    /// Filtered noise under an envelope.
    Earthquake,
    /// Sine of rising frequency and falling amplitude.
    Sweep,
    /// Triangle of low frequency, corners rounded by a short average.
    Triangle,
}

/// All kinds.
pub const EXCITATIONS: [Excitation; 4] = [
    Excitation::Multisine,
    Excitation::Earthquake,
    Excitation::Sweep,
    Excitation::Triangle,
];

impl Excitation {
    /// `n` samples at `rate` (Hz), faded in and out, with the peak `peak` (in).
    pub fn draw(self, n: usize, rate: f64, peak: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let duration = n as f64 / rate;
        let time = |k: usize| k as f64 / rate;
        let mut reference: Vec<f64> = match self {
            Self::Multisine => {
                let lines: Vec<(f64, f64, f64)> = (0..75)
                    .filter_map(|i| {
                        let frequency = 0.1 * f64::from(2 * i + 1);
                        let amplitude = 1.0 / (1.0 + (frequency / 1.2).powi(2));
                        let phase = rng.random_range(0.0..TAU);
                        (!rng.random_bool(0.25)).then_some((frequency, amplitude, phase))
                    })
                    .collect();
                (0..n)
                    .map(|k| {
                        lines
                            .iter()
                            .map(|(f, a, p)| a * (TAU * f * time(k) + p).sin())
                            .sum()
                    })
                    .collect()
            }
            Self::Earthquake => {
                let (centre, damping) = (rng.random_range(1.2..3.0), rng.random_range(0.4..0.7));
                let (omega, h) = (TAU * centre, 1.0 / rate);
                let (mut x, mut v, mut low, mut slow) = (0.0, 0.0, 0.0, 0.0);
                (0..n)
                    .map(|k| {
                        let t = time(k) / duration;
                        let envelope =
                            (t / 0.12).min(1.0).powi(2) * (-4.0 * (t - 0.45).max(0.0)).exp();
                        let noise: f64 = envelope * rng.random_range(-1.0..1.0);
                        v += h * (omega * omega * (noise - x) - 2.0 * damping * omega * v);
                        x += h * v;
                        low += h * TAU * 1.5 * (x - low);
                        slow += h * TAU * 0.2 * (low - slow);
                        low - slow
                    })
                    .collect()
            }
            Self::Sweep => {
                let (first, last) = (0.2f64, rng.random_range(8.0..12.0f64));
                let rate = (last / first).ln() / duration;
                (0..n)
                    .map(|k| {
                        let f = first * (rate * time(k)).exp();
                        (TAU * (f - first) / rate).sin() / (1.0 + (f / 0.8).powf(1.3))
                    })
                    .collect()
            }
            Self::Triangle => {
                let frequency = rng.random_range(0.3..0.7);
                let half = (0.02 * rate) as usize;
                let raw: Vec<f64> = (0..n + 2 * half)
                    .map(|k| {
                        let phase = (frequency * time(k)).fract();
                        1.0 - 4.0 * (phase - 0.5).abs()
                    })
                    .collect();
                // Two averages in a row leave a continuous acceleration.
                let average = |x: &[f64]| -> Vec<f64> {
                    x.windows(half + 1)
                        .map(|w| w.iter().sum::<f64>() / w.len() as f64)
                        .collect()
                };
                average(&average(&raw))
            }
        };
        reference.truncate(n);
        let fade = rate; // one second
        for k in 0..n {
            let edge = (k.min(n - 1 - k) as f64 / fade).min(1.0);
            reference[k] *= edge * edge * (3.0 - 2.0 * edge);
        }
        let largest = reference.iter().fold(0.0f64, |m, r| m.max(r.abs()));
        reference.iter_mut().for_each(|r| *r *= peak / largest);
        reference
    }
}

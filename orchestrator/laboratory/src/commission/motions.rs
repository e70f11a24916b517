//! What a rig is asked to do while it is commissioned.

use std::f64::consts::TAU;

use plant::sensors::channel::Noise;

use motion::Motion;

/// Time in which a motion is faded in, and out, s.
const FADE: f64 = 2.0;

/// Sines of random phase, a motion of unit root mean square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sines {
    /// Lowest and highest frequency, Hz.
    pub band: (f64, f64),
    /// So many, spaced evenly in their logarithm; none: every line of the motion's length.
    pub lines: Option<usize>,
    /// Length, s.
    pub duration: f64,
    /// Sample time, s.
    pub dt: f64,
    /// Seed of the phases.
    pub seed: u64,
}

impl Sines {
    /// The displacement in m, of unit root mean square. Under a displacement loop that follows to
    /// some 2 Hz the acceleration is about flat from 0.5 Hz up.
    pub fn shape(&self) -> Vec<f64> {
        let count = (self.duration / self.dt).round() as usize;
        let (low, high) = self.band;
        let frequencies: Vec<f64> = match self.lines {
            Some(lines) => {
                let last = lines.saturating_sub(1).max(1) as f64;
                (0..lines)
                    .map(|i| low * (high / low).powf(i as f64 / last))
                    .collect()
            }
            None => {
                let step = 1.0 / self.duration;
                let first = (low / step).ceil() as usize;
                (first..=(high / step) as usize)
                    .map(|i| i as f64 * step)
                    .collect()
            }
        };
        let mut sum = vec![0.0; count];
        for (i, &f) in frequencies.iter().enumerate() {
            let noise = Noise {
                seed: self.seed ^ 0x5151,
                channel: 9,
                sample: i as u64,
            };
            let phase = TAU * 1e3 * noise.gaussian();
            let amplitude = (1.0 + f / 2.0) / (1.0 + (f / 0.5).powi(2));
            // A rotating phasor: one complex product a sample.
            let (mut re, mut im) = (phase.cos() * amplitude, phase.sin() * amplitude);
            let (s, c) = (TAU * f * self.dt).sin_cos();
            for value in &mut sum {
                *value += re;
                (re, im) = (re * c - im * s, re * s + im * c);
            }
        }
        fade(&mut sum, self.dt);
        let square: f64 = sum.iter().map(|v| v * v).sum();
        let scale = (square / count.max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
        sum.iter().map(|v| v / scale).collect()
    }
}

/// A slow triangle of unit amplitude: `cycles` in `duration` seconds.
pub fn triangle(cycles: f64, duration: f64, dt: f64) -> Vec<f64> {
    let count = (duration / dt).round() as usize;
    (0..count)
        .map(|k| {
            let turn = (cycles * k as f64 / count.max(1) as f64 + 0.25).fract();
            1.0 - 4.0 * (turn - 0.5).abs()
        })
        .collect()
}

/// `shape` times `scale` as a motion; its derivatives by differences.
pub fn motion(name: &str, shape: &[f64], scale: f64, dt: f64, seed: Option<u64>) -> Motion {
    let displacement: Vec<f64> = shape.iter().map(|v| v * scale).collect();
    let slope = |values: &[f64]| -> Vec<f64> {
        let last = values.len().saturating_sub(1);
        (0..values.len())
            .map(|k| {
                let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
                (values[to] - values[from]) / ((to - from).max(1) as f64 * dt)
            })
            .collect()
    };
    let velocity = slope(&displacement);
    Motion {
        name: name.to_string(),
        dt,
        acceleration: slope(&velocity),
        velocity,
        displacement,
        notes: Vec::new(),
        seed,
        across: None,
    }
}

fn fade(values: &mut [f64], dt: f64) {
    let count = values.len();
    let edge = ((FADE / dt) as usize).min(count / 2);
    for k in 0..edge {
        let t = k as f64 / edge as f64;
        let weight = t * t * (3.0 - 2.0 * t);
        values[k] *= weight;
        values[count - 1 - k] *= weight;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_begins_and_ends_at_rest_and_meets_both_ends() {
        let values = triangle(2.0, 20.0, 0.002);
        let (low, high) = values
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!((low + 1.0).abs() < 1e-3 && (high - 1.0).abs() < 1e-3);
        assert!(values[0].abs() < 1e-12 && values[values.len() - 1].abs() < 1e-3);
        // Constant speed: 4 a cycle of 10 s.
        assert!(((values[600] - values[500]) / 0.2).abs() - 0.4 < 1e-9);
    }

    #[test]
    fn sines_are_of_unit_size_and_seeded() {
        let sines = Sines {
            band: (0.05, 30.0),
            lines: None,
            duration: 20.0,
            dt: 0.002,
            seed: 3,
        };
        let shape = sines.shape();
        let square: f64 = shape.iter().map(|v| v * v).sum();
        assert!((square / shape.len() as f64 - 1.0).abs() < 1e-9);
        assert_eq!(shape, sines.shape());
        assert_ne!(shape, Sines { seed: 4, ..sines }.shape());
    }
}

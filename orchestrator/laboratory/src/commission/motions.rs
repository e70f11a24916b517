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

    #[test]
    fn a_triangle_is_straight_between_its_corners() {
        let found = triangle(1.0, 4.0, 0.5);
        assert_eq!(found, [0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5]);
        assert_eq!(triangle(3.0, 0.0, 0.5), [0.0; 0]);
    }

    #[test]
    fn a_motion_fades_over_two_seconds_at_either_end() {
        let dt = 0.5;
        let mut values = vec![1.0; 12];
        fade(&mut values, dt);
        // A cubic that is level at both ends: 0, 5/32, 1/2 and 27/32.
        let edge = [0.0, 0.15625, 0.5, 0.84375];
        assert_eq!(values[..4], edge);
        assert_eq!(values[4..8], [1.0; 4]);
        let mut end = values[8..].to_vec();
        end.reverse();
        assert_eq!(end, edge);
        // A short one fades over its halves.
        let mut short = vec![1.0; 4];
        fade(&mut short, dt);
        assert_eq!(short, [0.0, 0.5, 0.5, 0.0]);
    }

    /// Size of a sine of that frequency in `values`.
    fn content(values: &[f64], frequency: f64, dt: f64) -> f64 {
        let turned = values.iter().enumerate().map(|(k, value)| {
            let (s, c) = (TAU * frequency * k as f64 * dt).sin_cos();
            [value * c, value * s]
        });
        let [re, im] = turned.fold([0.0; 2], |[re, im], [c, s]| [re + c, im + s]);
        re.hypot(im)
    }

    #[test]
    fn lines_are_where_they_are_asked_for_and_of_their_size() {
        let dt = 0.005;
        let sines = Sines {
            band: (1.0, 16.0),
            lines: Some(3),
            duration: 40.0,
            dt,
            seed: 5,
        };
        let shape = sines.shape();
        assert_eq!(shape.len(), 8000);
        let size = |frequency: f64| content(&shape, frequency, dt);
        let wanted = |f: f64| (1.0 + f / 2.0) / (1.0 + (f / 0.5).powi(2));
        for frequency in [4.0, 16.0] {
            let ratio = size(frequency) / size(1.0);
            let expected = wanted(frequency) / wanted(1.0);
            assert!((ratio / expected - 1.0).abs() < 0.01, "{frequency} Hz");
        }
        for frequency in [0.5, 2.0, 8.0, 30.0] {
            assert!(size(frequency) < 1e-3 * size(1.0), "{frequency} Hz");
        }
        // One line has no second one to be spaced from.
        let one = Sines {
            lines: Some(1),
            ..sines
        };
        let shape = one.shape();
        assert!(content(&shape, 16.0, dt) < 1e-3 * content(&shape, 1.0, dt));
        // All lines of 10 s from 0.45 to 2.04 Hz are those from 0.5 to 2 Hz.
        let all = Sines {
            band: (0.45, 2.04),
            lines: None,
            duration: 10.0,
            ..sines
        };
        let shape = all.shape();
        let largest = |from: f64, to: f64| {
            let places = (0..=20).map(|i| from + (to - from) * f64::from(i) / 20.0);
            places.fold(0.0, |most: f64, f| most.max(content(&shape, f, dt)))
        };
        let inside = largest(0.5, 2.0);
        assert!(largest(0.05, 0.25) < 0.1 * inside && largest(2.4, 4.0) < 0.1 * inside);
    }

    #[test]
    fn a_motion_is_its_shape_times_its_scale_with_its_rates() {
        let shape: Vec<f64> = (0..5).map(|k| f64::from(k * k)).collect();
        let own = motion("own", &shape, 0.5, 0.5, Some(7));
        assert_eq!((own.name.as_str(), own.dt, own.seed), ("own", 0.5, Some(7)));
        assert_eq!(own.displacement, [0.0, 0.5, 2.0, 4.5, 8.0]);
        assert_eq!(own.velocity, [1.0, 2.0, 4.0, 6.0, 7.0]);
        assert_eq!(own.acceleration, [2.0, 3.0, 4.0, 3.0, 2.0]);
        assert_eq!(motion("point", &[1.0], 1.0, 0.5, None).velocity, [0.0]);
    }
}

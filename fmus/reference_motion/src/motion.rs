//! Samples of a motion.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

/// Sample time where there is no motion, s.
const USUAL: f64 = 0.002;

/// A text that is not a motion.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// A line without four finite numbers.
    #[error("line {number}: `{line}`, expected four numbers")]
    Line {
        /// The line, from 1.
        number: usize,
        /// Its text.
        line: String,
    },
    /// No samples.
    #[error("there is no sample")]
    Empty,
    /// One sample only.
    #[error("one sample has no sample time")]
    Single,
    /// Times with unequal steps.
    #[error("the times are not evenly spaced")]
    Uneven,
}

/// A motion, evenly sampled, SI; or none.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Motion {
    sample_time: f64,
    /// Displacement, velocity and acceleration of each sample.
    samples: Vec<[f64; 3]>,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            sample_time: USUAL,
            samples: Vec::new(),
        }
    }
}

impl Motion {
    /// Reads `time,displacement,velocity,acceleration` in SI, a line of names first.
    ///
    /// # Errors
    /// The line that cannot be read; fewer than two samples; times that are not even.
    pub fn parse(text: &str) -> Result<Self, MotionError> {
        let mut samples = Vec::new();
        let mut times = Vec::new();
        let lines = text.lines().enumerate().skip(1);
        for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
            let cells: Option<Vec<f64>> = line
                .split(',')
                .map(|cell| cell.trim().parse().ok())
                .collect();
            match cells.as_deref() {
                Some(&[time, x, v, a]) if [time, x, v, a].iter().all(|value| value.is_finite()) => {
                    times.push(time);
                    samples.push([x, v, a]);
                }
                _ => {
                    return Err(MotionError::Line {
                        number: number + 1,
                        line: line.to_string(),
                    });
                }
            }
        }
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Err(MotionError::Empty);
        };
        if times.len() < 2 {
            return Err(MotionError::Single);
        }
        let mean = (last - first) / (times.len() - 1) as f64;
        // As it was written, where the mean only rounds it.
        let sample_time = [times[1] - times[0], (mean * 1e12).round() / 1e12]
            .into_iter()
            .find(|step| (step / mean - 1.0).abs() < 1e-12)
            .unwrap_or(mean);
        let even =
            |(k, time): (usize, &f64)| (time - first - k as f64 * mean).abs() <= 1e-6 * mean.abs();
        if mean <= 0.0 || !times.iter().enumerate().all(even) {
            return Err(MotionError::Uneven);
        }
        Ok(Self {
            sample_time,
            samples,
        })
    }

    /// The last sample that is not later than `time`, s, with the slack of its rounding.
    pub fn sample_at(&self, time: f64) -> usize {
        let place = time / self.sample_time;
        let rounded = place.round();
        let sample = match (place - rounded).abs() < 1e-6 * rounded.abs().max(1.0).sqrt() {
            true => rounded,
            false => place.floor(),
        };
        sample.max(0.0) as usize
    }

    /// A sample; of the sine of that amplitude, m, and frequency, Hz, where there is no motion.
    pub fn at(&self, sample: usize, (amplitude, frequency): (f64, f64)) -> [f64; 3] {
        if let Some(sample) = self.samples.get(sample) {
            return *sample;
        }
        if let Some([x, _, _]) = self.samples.last() {
            return [*x, 0.0, 0.0];
        }
        let rate = TAU * frequency;
        let (sin, cos) = (rate * sample as f64 * self.sample_time).sin_cos();
        let half = 0.5 * amplitude;
        [
            half * (1.0 - cos),
            half * rate * sin,
            half * rate * rate * cos,
        ]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
    use super::*;

    #[test]
    fn samples_are_held_and_the_end_rests() {
        let text = "time,displacement,velocity,acceleration\n0,0,1,2\n0.1,1,3,4\n0.2,5,6,7\n";
        let motion = Motion::parse(text).unwrap();
        let at = |time: f64| motion.at(motion.sample_at(time), (1.0, 1.0));
        assert_eq!(at(0.0), [0.0, 1.0, 2.0]);
        assert_eq!(at(0.0999), [0.0, 1.0, 2.0]);
        assert_eq!(at(0.1 - 1e-12), [1.0, 3.0, 4.0]);
        assert_eq!(at(0.2), [5.0, 6.0, 7.0]);
        assert_eq!(at(9.0), [5.0, 0.0, 0.0]);
        // A clock that adds up steps does not lose samples.
        let mut time = 0.0;
        let fine = Motion::default();
        for sample in 0..1_000_000 {
            assert_eq!(fine.sample_at(time), sample);
            time += USUAL;
        }
    }

    #[test]
    fn bad_files_are_refused_with_their_line() {
        let head = "time,displacement,velocity,acceleration\n";
        for (rows, words) in [
            ("", "no sample"),
            ("0,0,0,0\n", "one sample"),
            ("0,0,0,0\n0.1,0,0\n", "line 3"),
            ("0,0,0,0\n0.1,0,NaN,0\n", "line 3"),
            ("0,0,0,0\n0.1,0,0,0\n0.3,0,0,0\n", "evenly"),
            ("0,0,0,0\n0,0,0,0\n", "evenly"),
        ] {
            let problem = Motion::parse(&format!("{head}{rows}"))
                .unwrap_err()
                .to_string();
            assert!(problem.contains(words), "{problem}");
        }
    }
}

//! The past of a sampled signal.

use crate::ModelError;

/// Samples that a signal can be late.
pub const MAX_DELAY_SAMPLES: usize = 30;

/// One more for a delay between samples, one more for the newest.
const LENGTH: usize = MAX_DELAY_SAMPLES + 2;

/// The newest samples of a signal, a ring; at first a signal that was always zero.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct DelayLine {
    past: [f64; LENGTH],
    at: usize,
}

impl DelayLine {
    /// The memory of a signal that was always `value`.
    pub fn filled(value: f64) -> Self {
        Self {
            past: [value; LENGTH],
            at: 0,
        }
    }

    /// Takes the newest sample.
    #[inline]
    pub fn push(&mut self, value: f64) {
        self.at = (self.at + 1) % LENGTH;
        self.past[self.at] = value;
    }

    #[inline]
    fn place(&self, age: usize) -> usize {
        (self.at + LENGTH - age.min(LENGTH - 1)) % LENGTH
    }

    /// The sample of `age` samples ago.
    #[inline]
    pub fn ago(&self, age: usize) -> f64 {
        self.past[self.place(age)]
    }

    /// The signal of `samples` ago, straight between samples.
    #[inline]
    pub fn behind(&self, samples: f64) -> f64 {
        let whole = (samples as usize).min(MAX_DELAY_SAMPLES);
        let part = samples - whole as f64;
        let later = self.ago(whole);
        later + part * (self.ago(whole + 1) - later)
    }

    /// Adds `correction` to the sample of `age` samples ago.
    #[inline]
    pub fn correct(&mut self, age: usize, correction: f64) {
        self.past[self.place(age)] += correction;
    }
}

/// Refuses a delay (s) of more than [`MAX_DELAY_SAMPLES`] sampling periods (s).
pub(crate) fn require_delay(name: &'static str, delay: f64, period: f64) -> Result<(), ModelError> {
    if delay <= MAX_DELAY_SAMPLES as f64 * period {
        return Ok(());
    }
    Err(ModelError::Parameter {
        name,
        value: delay,
        expected: "at most thirty sampling periods",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_past_of_a_ramp_is_the_ramp_of_then() {
        let mut line = DelayLine::filled(-1.0);
        assert_eq!(line.behind(7.0), -1.0);
        for k in 0..100 {
            line.push(f64::from(k));
        }
        for late in [0.0, 0.25, 7.0, 29.5, 30.0] {
            assert_eq!(line.behind(late), 99.0 - late);
        }
        line.correct(3, 0.5);
        assert_eq!((line.ago(3), line.ago(2)), (96.5, 97.0));
    }
}

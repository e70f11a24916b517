//! A notch on the valve command: a resonance is taken out of the loop.

use crate::ModelError;
use crate::loop_shaping::Section;

/// `(s² + 2 D0 w s + w²)/(s² + 2 D1 w s + w²)`: cancels poles of frequency `w` and damping ratio `D0`
/// and puts some of ratio `D1` in their place.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Notch {
    /// `w`, rad/s.
    pub frequency: f64,
    /// `D0`.
    pub depth: f64,
    /// `D1`.
    pub width: f64,
    /// Memory of the section.
    pub memory: [f64; 2],
}

impl Default for Notch {
    /// On the oil column of the physical rig, 15 Hz.
    fn default() -> Self {
        Self {
            frequency: 95.0,
            depth: 0.2,
            width: 0.7,
            memory: [0.0; 2],
        }
    }
}

impl Notch {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that is no notch's.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_positive("notch_frequency", self.frequency)?;
        ModelError::require_non_negative("notch_depth", self.depth)?;
        ModelError::require_positive("notch_width", self.width)
    }

    /// The command that passes, V.
    #[inline]
    pub fn step(&mut self, command: f64, period: f64) -> f64 {
        // Sampled so that the frequency stays where it is.
        let frequency = 2.0 / period * (0.5 * self.frequency * period).tan();
        let (two, one) = (frequency.powi(-2), 2.0 / frequency);
        let section = Section {
            b2: two,
            b1: self.depth * one,
            a2: two,
            a1: self.width * one,
        };
        section.step(&mut self.memory, command, period)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_at_the_notch_is_left_by_the_ratio_of_the_dampings() {
        let mut notch = Notch::default();
        let period = 0.002;
        let mut size = |omega: f64| {
            notch.memory = [0.0; 2];
            let mut most = 0.0_f64;
            for k in 0..5000 {
                let out = notch.step((omega * period * f64::from(k)).sin(), period);
                if k > 3000 {
                    most = most.max(out.abs());
                }
            }
            most
        };
        let at = size(95.0);
        assert!((at - 0.2 / 0.7).abs() < 5e-3, "{at}");
        // |(w² - s²) + 2 D0 w s j| / |... D1 ...| a decade below.
        let r: f64 = 0.1;
        let expected = (1.0 - r * r).hypot(0.4 * r) / (1.0 - r * r).hypot(1.4 * r);
        let below = size(9.5);
        assert!((below - expected).abs() < 1e-3, "{below} {expected}");
    }
}

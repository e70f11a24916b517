//! A low-pass filter that gives the derivatives of what it filters.

use super::extrapolation::DERIVATIVES;

/// Equal first-order lags in a row, `(w / (s + w))^5`, made discrete by Tustin's rule. Since
/// `s / w` of a lag's output is the difference of its input and output, derivatives are
/// differences along the chain.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct LagChain {
    /// The input and the outputs of the lags.
    stages: [f64; DERIVATIVES],
}

impl LagChain {
    /// Takes the latest `value`; lags of `corner` (rad/s), samples `period` (s) apart.
    #[inline]
    pub fn step(&mut self, value: f64, corner: f64, period: f64) -> &Self {
        let x = corner * period;
        let share = x / (2.0 + x);
        let (mut before, mut now) = (self.stages[0], value);
        self.stages[0] = value;
        for stage in &mut self.stages[1..] {
            let old = *stage;
            *stage = old + share * (now + before - 2.0 * old);
            (before, now) = (old, *stage);
        }
        self
    }

    /// The filtered value.
    #[inline]
    pub fn value(&self) -> f64 {
        self.stages[DERIVATIVES - 1]
    }

    /// The filtered derivatives, derivative i over `corner^i`.
    #[inline]
    pub fn differences(&self) -> [f64; DERIVATIVES] {
        let mut row = self.stages;
        let mut result = [0.0; DERIVATIVES];
        for (i, slot) in result.iter_mut().enumerate() {
            *slot = row[DERIVATIVES - 1];
            for j in (i + 1..DERIVATIVES).rev() {
                row[j] = row[j - 1] - row[j];
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_of_a_sine_are_its_derivatives_filtered() {
        let (corner, omega, h) = (100.0, 40.0, 1e-4);
        let mut chain = LagChain::default();
        let mut got = [0.0; DERIVATIVES];
        let n = 20_000;
        for k in 0..=n {
            let t = k as f64 * h;
            got = chain.step((omega * t).sin(), corner, h).differences();
        }
        let t = n as f64 * h;
        let ratio = omega / corner;
        // Gain and phase of five lags.
        let gain = (1.0 + ratio * ratio).powf(-2.5);
        let phase = omega * t - 5.0 * ratio.atan();
        for (i, value) in got.iter().enumerate() {
            let quarter = std::f64::consts::FRAC_PI_2 * i as f64;
            let wanted = gain * ratio.powi(i as i32) * (phase + quarter).sin();
            assert!((value - wanted).abs() < 1e-4, "{i}: {value} {wanted}");
        }
    }
}

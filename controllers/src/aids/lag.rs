//! A lag of second order that gives the rate of what it follows.

/// `w²/(s² + 2 D w s + w²)`, by the trapezoidal rule.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Lag {
    /// What comes out.
    pub value: f64,
    /// Its rate, 1/s.
    pub rate: f64,
}

impl Lag {
    /// A period (s) later, `input` its mean over the period; corner `omega` in rad/s.
    #[inline]
    pub fn step(&mut self, input: f64, omega: f64, damping: f64, period: f64) {
        let half = 0.5 * period;
        let (square, twice) = (omega * omega, 2.0 * damping * omega);
        let rate = ((1.0 - twice * half - square * half * half) * self.rate
            + square * period * (input - self.value))
            / (1.0 + twice * half + square * half * half);
        self.value += half * (self.rate + rate);
        self.rate = rate;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_answered_as_the_closed_form_has_it() {
        let (omega, period) = (30.0, 5e-4);
        let mut lag = Lag::default();
        for k in 1..=600 {
            lag.step(1.0, omega, 1.0, period);
            let wt = omega * period * f64::from(k);
            let expected = 1.0 - (1.0 + wt) * (-wt).exp();
            let rate = omega * wt * (-wt).exp();
            assert!((lag.value - expected).abs() < 1e-4);
            assert!((lag.rate - rate).abs() < 1e-2);
        }
    }
}

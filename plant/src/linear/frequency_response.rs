use nalgebra::Complex;

/// Values of a transfer path on a grid of frequencies.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyResponse {
    /// Angular frequencies, rad/s, ascending.
    pub omega: Vec<f64>,
    /// The response at each frequency.
    pub value: Vec<Complex<f64>>,
}

/// `count` angular frequencies from `first` to `last`, evenly spaced in logarithm.
pub fn log_space(first: f64, last: f64, count: usize) -> Vec<f64> {
    let ratio = (last / first).ln() / (count.max(2) - 1) as f64;
    (0..count)
        .map(|i| first * (ratio * i as f64).exp())
        .collect()
}

impl FrequencyResponse {
    /// Evaluates `response` at `s = j omega`.
    pub fn continuous(
        omega: &[f64],
        mut response: impl FnMut(Complex<f64>) -> Complex<f64>,
    ) -> Self {
        Self {
            omega: omega.to_vec(),
            value: omega
                .iter()
                .map(|&w| response(Complex::new(0.0, w)))
                .collect(),
        }
    }

    /// Evaluates `response` at `z = exp(j omega period)`.
    pub fn sampled(
        omega: &[f64],
        period: f64,
        mut response: impl FnMut(Complex<f64>) -> Complex<f64>,
    ) -> Self {
        Self {
            omega: omega.to_vec(),
            value: omega
                .iter()
                .map(|&w| response(Complex::new(0.0, w * period).exp()))
                .collect(),
        }
    }

    /// Gains in decibels.
    pub fn gain_db(&self) -> Vec<f64> {
        self.value
            .iter()
            .map(|value| 20.0 * value.norm().log10())
            .collect()
    }

    /// Phases in degrees, continued without jumps of 360 degrees.
    pub fn phase_deg(&self) -> Vec<f64> {
        let mut previous: Option<f64> = None;
        self.value
            .iter()
            .map(|value| {
                let mut phase = value.arg().to_degrees();
                if let Some(before) = previous {
                    phase -= ((phase - before) / 360.0).round() * 360.0;
                }
                previous = Some(phase);
                phase
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_of_a_triple_integrator_does_not_wrap() {
        let response = FrequencyResponse::continuous(&log_space(0.1, 10.0, 5), |s| {
            1.0 / (s * s * s * (s + 1.0))
        });
        let phase = response.phase_deg();
        assert!(
            phase
                .windows(2)
                .all(|pair| (pair[1] - pair[0]).abs() < 60.0)
        );
        let last = (phase[4] - phase[0]).abs();
        let expected = (10f64.atan() - 0.1f64.atan()).to_degrees();
        assert!((last - expected).abs() < 1e-9);
    }
}

//! Loop shaping: the displacement controller of Section 3.4 as a sampled law, of second order as
//! printed or with further sections of second order.

use nalgebra::Complex;
use units::constants::INCH;
use units::{Parameters, vocabulary};

use crate::pid::{PidInput, VALVE_LIMIT, limit_and_integrate};
use crate::{Controller, ModelError};

/// `C(s) = g (s² + n1 s + n0) / (s (s + p))` on the displacement error (Eq 3-10).
///
/// As a sampled law it is discretised by the trapezoidal rule (Tustin) in the form
/// `u = g (e + (n1 - p) l + n0 ∫l dt)`, `dl/dt = e - p l`: exact for its integrator under an error
/// that is linear between samples. The integral stands still while the command is at its limit
/// and would be pushed further. Further sections, discretised in the same way, stand before it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LoopShaping {
    /// The coefficients.
    pub coefficients: LoopShapingCoefficients,
    /// Further sections.
    pub sections: [Section; SECTIONS],
    /// Largest magnitude of the valve command, V.
    pub limit: f64,
    /// What the law remembers.
    pub memory: LoopShapingMemory,
}

/// Coefficients of a controller of the form of Eq 3-10.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct LoopShapingCoefficients {
    /// g of Eq 3-10, V/m.
    #[parameter("V/m" => "V/in", positive)]
    pub gain: f64,
    /// Coefficient of s in the numerator, 1/s.
    #[parameter("1/s", finite)]
    pub numerator_rate: f64,
    /// Constant of the numerator, 1/s2.
    #[parameter("1/s2", finite)]
    pub numerator_constant: f64,
    /// Rate p of the slow pole, 1/s.
    #[parameter("1/s", non_negative)]
    pub pole: f64,
}

/// Number of further sections.
pub const SECTIONS: usize = 2;

/// `(b2 s² + b1 s + 1) / (a2 s² + a1 s + 1)`; one by default.
#[derive(
    Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize, Parameters,
)]
pub struct Section {
    /// Numerator, s^2, s2.
    #[parameter("s2", finite)]
    pub b2: f64,
    /// Numerator, s, s.
    #[parameter("s", finite)]
    pub b1: f64,
    /// Denominator, s^2, s2.
    #[parameter("s2", non_negative)]
    pub a2: f64,
    /// Denominator, s, s.
    #[parameter("s", non_negative)]
    pub a1: f64,
}

impl Section {
    /// Checks that it is stable.
    ///
    /// # Errors
    /// A coefficient that is not finite, or a pole that does not decay.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        if self.a2 > 0.0 {
            return ModelError::require_positive(Self::A1, self.a1);
        }
        Ok(())
    }

    /// The difference equation by the trapezoidal rule at `period` s, in powers of `1/z`:
    /// numerator, then denominator less its leading one.
    pub fn sampled(&self, period: f64) -> ([f64; 3], [f64; 2]) {
        let (w, w2) = (2.0 / period, 4.0 / (period * period));
        let powers = |two: f64, one: f64| {
            [
                two * w2 + one * w + 1.0,
                2.0 - 2.0 * two * w2,
                two * w2 - one * w + 1.0,
            ]
        };
        let (b, a) = (powers(self.b2, self.b1), powers(self.a2, self.a1));
        (b.map(|own| own / a[0]), [a[1] / a[0], a[2] / a[0]])
    }

    /// Whether it is one at all frequencies.
    pub fn is_one(&self) -> bool {
        *self == Self::default()
    }

    /// One sample, by the transposed second direct form.
    pub(crate) fn step(&self, memory: &mut [f64; 2], input: f64, period: f64) -> f64 {
        if self.is_one() {
            return input;
        }
        let (b, a) = self.sampled(period);
        let output = b[0] * input + memory[0];
        memory[0] = b[1] * input - a[0] * output + memory[1];
        memory[1] = b[2] * input - a[1] * output;
        output
    }
}

/// Memory of [`LoopShaping`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct LoopShapingMemory {
    /// Error at the previous sample, m.
    pub error: f64,
    /// Lagged error, m s.
    pub lag: f64,
    /// Integral part of the command, V.
    pub integral: f64,
    /// Of the further sections.
    pub sections: [[f64; 2]; SECTIONS],
}

impl LoopShapingCoefficients {
    /// Eq 3-10, `6.986 (s² + 0.2975 s + 0.5892) / (s (s + 0.01046))` V/in.
    pub fn equation_3_10() -> Self {
        Self {
            gain: 6.986 / INCH,
            numerator_rate: 0.2975,
            numerator_constant: 0.5892,
            pole: 0.01046,
        }
    }

    /// Checks the coefficients.
    ///
    /// # Errors
    /// A coefficient with which there is no such controller, by name.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }
}

impl LoopShaping {
    /// The law with these coefficients.
    pub fn new(coefficients: LoopShapingCoefficients) -> Self {
        Self {
            coefficients,
            sections: [Section::default(); SECTIONS],
            limit: VALVE_LIMIT,
            memory: LoopShapingMemory::default(),
        }
    }

    /// Response at `omega` (rad/s) from the error to the command, sampled every `period` s, V/m.
    pub fn response(&self, omega: f64, period: f64) -> Complex<f64> {
        let s = Complex::new(0.0, 2.0 / period * (0.5 * omega * period).tan());
        let c = &self.coefficients;
        let mut value =
            c.gain * ((s + c.numerator_rate) * s + c.numerator_constant) / (s * (s + c.pole));
        for own in &self.sections {
            value *= ((s * own.b2 + own.b1) * s + 1.0) / ((s * own.a2 + own.a1) * s + 1.0);
        }
        value
    }

    /// Root mean square of the command that white noise of unit size makes of the error, V/m.
    pub fn noise_gain(&self, period: f64) -> f64 {
        const LINES: usize = 200;
        let nyquist = std::f64::consts::PI / period;
        // Midpoints: the integral's pole at zero and the Nyquist frequency stay out.
        let square: f64 = (0..LINES)
            .map(|line| (line as f64 + 0.5) / LINES as f64 * nyquist)
            .map(|omega| self.response(omega, period).norm_sqr())
            .sum();
        (square / LINES as f64).sqrt()
    }

    /// The parameters with the names that the component gives them.
    pub fn named(&self) -> Vec<(String, f64)> {
        let own = self.coefficients.named().into_iter();
        let mut all: Vec<_> = own.map(|(name, value)| (name.to_string(), value)).collect();
        for (number, section) in (1..).zip(&self.sections) {
            let own = section.named().into_iter();
            all.extend(own.map(|(name, value)| (format!("section_{number}_{name}"), value)));
        }
        all
    }

    /// The controller of Eq 3-10.
    pub fn equation_3_10() -> Self {
        Self::new(LoopShapingCoefficients::equation_3_10())
    }
}

impl Default for LoopShaping {
    fn default() -> Self {
        Self::equation_3_10()
    }
}

impl Controller for LoopShaping {
    type Input = PidInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        self.coefficients.validate()?;
        self.sections.iter().try_for_each(Section::validate)?;
        ModelError::require_positive(vocabulary::VALVE_LIMIT, self.limit)
    }

    fn step(&mut self, input: &PidInput, period: f64) -> f64 {
        let LoopShapingCoefficients {
            gain,
            numerator_rate,
            numerator_constant,
            pole,
        } = self.coefficients;
        let memory = &mut self.memory;
        let half = 0.5 * period;
        let mut error = input.reference - input.measured;
        for (section, memory) in self.sections.iter().zip(&mut memory.sections) {
            error = section.step(memory, error, period);
        }
        let lag = ((1.0 - pole * half) * memory.lag + half * (error + memory.error))
            / (1.0 + pole * half);
        let increment = gain * numerator_constant * half * (lag + memory.lag);
        let others = gain * (error + (numerator_rate - pole) * lag);
        memory.error = error;
        memory.lag = lag;
        limit_and_integrate(&mut memory.integral, increment, others, self.limit)
    }

    fn reset(&mut self) {
        self.memory = LoopShapingMemory::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sampled_law_is_tustins_transform_of_equation_3_10() {
        // Difference equation from s = (2 / h)(z - 1)/(z + 1), multiplied out by hand.
        let h = 0.002;
        let mut law = LoopShaping {
            limit: 1e9,
            ..LoopShaping::equation_3_10()
        };
        let LoopShapingCoefficients {
            gain: g,
            numerator_rate: n1,
            numerator_constant: n0,
            pole: p,
        } = law.coefficients;
        let w = 2.0 / h;
        let b = [w * w + n1 * w + n0, 2.0 * (n0 - w * w), w * w - n1 * w + n0];
        let a = [w * (w + p), -2.0 * w * w, w * (w - p)];
        let (mut e, mut u) = ([0.0; 2], [0.0; 2]);
        for k in 0..2000_i32 {
            let error = (f64::from(k) * 0.013).sin() * 1e-3;
            let command = law.step(
                &PidInput {
                    reference: error,
                    measured: 0.0,
                },
                h,
            );
            let expected =
                (g * (b[0] * error + b[1] * e[0] + b[2] * e[1]) - a[1] * u[0] - a[2] * u[1]) / a[0];
            assert!((command - expected).abs() < 1e-9, "{command} {expected}");
            e = [error, e[0]];
            u = [expected, u[0]];
        }
    }

    #[test]
    fn a_section_turns_a_sine_as_its_transfer_function_does() {
        // A notch at 90 rad/s with its poles at 200 rad/s, Tustin at 2 ms.
        let h: f64 = 0.002;
        let section = Section {
            b2: 1.0 / 8100.0,
            b1: 0.3 / 90.0,
            a2: 1.0 / 4e4,
            a1: 1.4 / 200.0,
        };
        section.validate().unwrap();
        let omega: f64 = 75.0;
        let s = nalgebra::Complex::new(0.0, 2.0 / h * (0.5 * omega * h).tan());
        let expected = (section.b2 * s * s + section.b1 * s + 1.0)
            / (section.a2 * s * s + section.a1 * s + 1.0);
        let mut memory = [0.0; 2];
        for k in 0..5000 {
            let phase = omega * h * f64::from(k);
            let got = section.step(&mut memory, phase.cos(), h);
            let wanted = (expected * nalgebra::Complex::new(0.0, phase).exp()).re;
            assert!(
                k < 1000 || (got - wanted).abs() < 1e-9,
                "{k} {got} {wanted}"
            );
        }
    }

    #[test]
    fn bad_coefficients_are_refused_by_name() {
        let mut law = LoopShaping::equation_3_10();
        law.coefficients.pole = -0.1;
        let error = law.validate().unwrap_err().to_string();
        assert!(error.contains("`pole` is -0.1"), "{error}");
        let mut law = LoopShaping::equation_3_10();
        law.coefficients.gain = 0.0;
        assert!(law.validate().unwrap_err().to_string().contains("`gain`"));
    }
}

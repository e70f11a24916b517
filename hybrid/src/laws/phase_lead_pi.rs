//! Proportional and integral control with a phase lead on the desired displacement: the sample
//! controller of the benchmark (Silva et al. 2020).

use crate::vrths::Converter;
use units::vocabulary;

use super::TrackingInput;
use controllers::{Controller, ModelError};

/// `u = (P + I / s) (L(s) x_n - x_m)` with the lead `L(s) = (g s + n) / (s + p)`, both made
/// discrete by Tustin's rule, with a converter before and behind each.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PhaseLeadPi {
    /// `P`.
    pub proportional: f64,
    /// `I`, 1/s.
    pub integral: f64,
    /// `g`, gain of the lead at high frequency.
    pub lead_gain: f64,
    /// `n`, 1/s.
    pub lead_numerator: f64,
    /// `p`, 1/s.
    pub lead_pole: f64,
    /// The converters around both filters.
    pub converter: Converter,
    /// What the law remembers.
    pub memory: PhaseLeadPiMemory,
}

/// Memory of [`PhaseLeadPi`], m.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct PhaseLeadPiMemory {
    desired: f64,
    led: f64,
    error: f64,
    integral: f64,
}

impl Default for PhaseLeadPi {
    /// The published sample controller.
    fn default() -> Self {
        Self {
            proportional: 2.0,
            integral: 95.0,
            lead_gain: 50.831_633_602_736_12,
            lead_numerator: 8_570.397_339_444_286,
            lead_pole: 8_570.397_339_444_286,
            converter: Converter::default(),
            memory: PhaseLeadPiMemory::default(),
        }
    }
}

impl Controller for PhaseLeadPi {
    type Input = TrackingInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite(vocabulary::PROPORTIONAL_GAIN, self.proportional)?;
        ModelError::require_finite(vocabulary::INTEGRAL_GAIN, self.integral)?;
        ModelError::require_finite("lead_gain", self.lead_gain)?;
        ModelError::require_finite("lead_numerator", self.lead_numerator)?;
        ModelError::require_positive("lead_pole", self.lead_pole)?;
        ModelError::require_non_negative("converter_quantum", self.converter.quantum)?;
        ModelError::require_non_negative("converter_limit", self.converter.limit)
    }

    fn step(&mut self, input: &TrackingInput, period: f64) -> f64 {
        let rate = 2.0 / period;
        let memory = &mut self.memory;
        let desired = self.converter.read(input.desired);
        let led = ((self.lead_numerator + self.lead_gain * rate) * desired
            + (self.lead_numerator - self.lead_gain * rate) * memory.desired
            - (self.lead_pole - rate) * memory.led)
            / (self.lead_pole + rate);
        (memory.desired, memory.led) = (desired, led);
        let error = self
            .converter
            .read(self.converter.write(led) - input.measured);
        memory.integral += self.integral * 0.5 * period * (error + memory.error);
        memory.error = error;
        self.converter
            .write(self.proportional * error + memory.integral)
    }

    fn reset(&mut self) {
        self.memory = PhaseLeadPiMemory::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_ramp_is_led_by_the_phase_lead() {
        let mut law = PhaseLeadPi {
            converter: Converter {
                quantum: 0.0,
                limit: 0.0,
            },
            integral: 0.0,
            ..PhaseLeadPi::default()
        };
        let h = 1.0 / 4096.0;
        let mut command = 0.0;
        for k in 0..4096 {
            let input = TrackingInput {
                desired: k as f64 * h,
                ..TrackingInput::default()
            };
            command = law.step(&input, h);
        }
        // The ramp at its last sample, led by (g - 1) / p.
        let lead = (law.lead_gain - 1.0) / law.lead_pole;
        assert!((command / 2.0 - (4095.0 * h + lead)).abs() < 1e-9);
    }
}

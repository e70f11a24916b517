//! The adaptive model-based compensator of C. Gálmez and G. Fermandois, "Robust adaptive
//! model-based compensator for the real-time hybrid simulation benchmark", Structural Control and
//! Health Monitoring 29 (2022), e2962, with the constants of its published program.

use std::f64::consts::{PI, SQRT_2};

use super::TrackingInput;
use super::model_inverse::ModelInverse;
use controllers::{Controller, ModelError};

/// Coefficients that are adapted: up to the third derivative.
const COUNT: usize = 4;

/// `u = sum_i a_i D^i x_d` with backward differences `D`, and the gradient law
/// `da/dt = Gamma phi (u_f - a' phi) / (1 + phi' phi)`, `phi_i = D^i x_f`, where `u_f` and `x_f` are
/// command and measured displacement behind a low-pass filter of Butterworth. Without the
/// denominator the published gains diverge on this plant.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct GradientInverse {
    /// Coefficients at the start, s^i: those of the transfer system without a specimen.
    pub initial: [f64; COUNT],
    /// Diagonal of `Gamma`.
    pub gains: [f64; COUNT],
    /// Corner of the filter, Hz.
    pub corner: f64,
    /// What the law remembers.
    pub memory: GradientInverseMemory,
}

/// Memory of [`GradientInverse`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct GradientInverseMemory {
    started: bool,
    coefficients: [f64; COUNT],
    desired: [f64; COUNT],
    measured: [f64; COUNT],
    filters: [[Section; 2]; 2],
}

/// A second-order low-pass section, transposed direct form II.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
struct Section {
    state: [f64; 2],
}

impl Section {
    /// Butterworth's section of quality `q` by the bilinear rule; `w` is `tan(pi f / rate)`.
    fn step(&mut self, value: f64, w: f64, q: f64) -> f64 {
        let scale = 1.0 / (1.0 + w / q + w * w);
        let b = w * w * scale;
        let a1 = 2.0 * (w * w - 1.0) * scale;
        let a2 = (1.0 - w / q + w * w) * scale;
        let out = b * value + self.state[0];
        self.state[0] = 2.0 * b * value - a1 * out + self.state[1];
        self.state[1] = b * value - a2 * out;
        out
    }
}

impl Default for GradientInverse {
    fn default() -> Self {
        let inverse = ModelInverse::without_specimen().inverse();
        Self {
            // The published start does not know of the command gain.
            initial: std::array::from_fn(|i| {
                inverse[i] * ModelInverse::without_specimen().command_gain
            }),
            gains: [8.4, 6.2, 2.1, 0.8].map(|power: f64| 10f64.powf(power)),
            corner: 20.0,
            memory: GradientInverseMemory::default(),
        }
    }
}

/// Backward differences of orders 0 to 3 of the latest samples, newest first.
fn differences(past: &[f64; COUNT], period: f64) -> [f64; COUNT] {
    let [a, b, c, d] = *past;
    [
        a,
        (a - b) / period,
        (a - 2.0 * b + c) / period.powi(2),
        (a - 3.0 * (b - c) - d) / period.powi(3),
    ]
}

fn push(past: &mut [f64; COUNT], value: f64) {
    past.rotate_right(1);
    past[0] = value;
}

impl Controller for GradientInverse {
    type Input = TrackingInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        for value in self.initial {
            ModelError::require_finite("coefficients", value)?;
        }
        for value in self.gains {
            ModelError::require_non_negative("adaptation_gains", value)?;
        }
        ModelError::require_positive("corner", self.corner)
    }

    fn step(&mut self, input: &TrackingInput, period: f64) -> f64 {
        let memory = &mut self.memory;
        if !memory.started {
            (memory.coefficients, memory.started) = (self.initial, true);
        }
        push(&mut memory.desired, input.desired);
        let dot = |a: &[f64; COUNT], b: &[f64; COUNT]| -> f64 {
            a.iter().zip(b).map(|(a, b)| a * b).sum()
        };
        let command = dot(&memory.coefficients, &differences(&memory.desired, period));

        let w = (PI * self.corner * period).tan();
        // Quality factors of Butterworth's fourth order.
        let qualities = [1.0 / (2.0 - SQRT_2).sqrt(), 1.0 / (2.0 + SQRT_2).sqrt()];
        let mut filtered = [command, input.measured];
        for (value, sections) in filtered.iter_mut().zip(&mut memory.filters) {
            for (section, quality) in sections.iter_mut().zip(qualities) {
                *value = section.step(*value, w, quality);
            }
        }
        push(&mut memory.measured, filtered[1]);
        let regressor = differences(&memory.measured, period);
        let error = filtered[0] - dot(&memory.coefficients, &regressor);
        let error = error / (1.0 + dot(&regressor, &regressor));
        for i in 0..COUNT {
            let rate = self.gains[i] * regressor[i] * error;
            memory.coefficients[i] = (memory.coefficients[i] + period * rate).max(0.0);
        }
        command
    }

    fn reset(&mut self) {
        self.memory = GradientInverseMemory::default();
    }
}

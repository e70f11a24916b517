//! PID control of one measured quantity (Eq 3-1).

use units::constants::{INCH, LBF};
use units::{Parameters, vocabulary};

use crate::{Controller, ModelError};

/// PID gains, from the error's unit to volt, and the memory of the law.
///
/// The integral takes in the error of the present sample and stands still while the command is at
/// its limit and the error would push it further.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct Pid {
    /// Proportional gain, V per unit.
    #[parameter(name = vocabulary::PROPORTIONAL_GAIN, about = "Proportional gain", finite)]
    pub proportional: f64,
    /// Integral gain, V per unit and second.
    #[parameter(name = vocabulary::INTEGRAL_GAIN, about = "Integral gain", finite)]
    pub integral: f64,
    /// Rate at which the integral leaks away, 1/s.
    ///
    /// `I / (s + leak)` in place of `I / s`. Two loops that integrate through one valve need it in
    /// one of them (see [`crate::sliding_mode`]).
    #[parameter("1/s", non_negative)]
    pub integral_leak: f64,
    /// Derivative gain, V s per unit.
    #[parameter(name = "derivative_gain", about = "Derivative gain", finite)]
    pub derivative: f64,
    /// Time constant of the derivative's lag, s.
    #[parameter("s", non_negative)]
    pub derivative_lag: f64,
    /// Largest magnitude of the valve command, V.
    #[parameter("V", name = vocabulary::VALVE_LIMIT, positive)]
    pub limit: f64,
    /// What the law remembers.
    pub memory: PidMemory,
}

/// Memory of [`Pid`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct PidMemory {
    /// Integral part of the command, V.
    pub integral: f64,
    /// Filtered rate of the error, unit/s.
    pub rate: f64,
    /// Error at the previous sample, absent before the first.
    pub error: Option<f64>,
}

/// What a PID law is told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PidInput {
    /// Wanted value.
    pub reference: f64,
    /// Measured value.
    pub measured: f64,
}

/// Largest valve command of the laboratory, V.
pub const VALVE_LIMIT: f64 = 10.0;

impl Pid {
    /// Displacement control, `C_d = (3 s + 0.4) / s` V/in (Eq 3-6).
    pub fn equation_3_6() -> Self {
        Self::proportional_integral(3.0 / INCH, 0.4 / INCH)
    }

    /// Force control, `C_f = (0.366 s + 3.222) / s` V/lbf (Eq 3-7).
    pub fn equation_3_7() -> Self {
        Self::proportional_integral(0.366 / LBF, 3.222 / LBF)
    }

    fn proportional_integral(proportional: f64, integral: f64) -> Self {
        Self {
            proportional,
            integral,
            integral_leak: 0.0,
            derivative: 0.0,
            derivative_lag: 0.0,
            limit: VALVE_LIMIT,
            memory: PidMemory::default(),
        }
    }
}

impl Controller for Pid {
    type Input = PidInput;
    type Output = f64;

    fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }

    fn step(&mut self, input: &PidInput, period: f64) -> f64 {
        let error = input.reference - input.measured;
        let rate = (error - self.memory.error.unwrap_or(error)) / period;
        self.memory.rate += (rate - self.memory.rate) * period / (period + self.derivative_lag);
        self.memory.error = Some(error);
        self.memory.integral *= (-self.integral_leak * period).exp();
        let increment = self.integral * error * period;
        let others = self.proportional * error + self.derivative * self.memory.rate;
        limit_and_integrate(&mut self.memory.integral, increment, others, self.limit)
    }

    fn reset(&mut self) {
        self.memory = PidMemory::default();
    }
}

/// Adds `increment` to the integral unless that drives the command further beyond `limit`, and
/// returns the limited sum of integral and `others`.
pub(crate) fn limit_and_integrate(
    integral: &mut f64,
    increment: f64,
    others: f64,
    limit: f64,
) -> f64 {
    let command = others + *integral + increment;
    if command.abs() <= limit || command * increment < 0.0 {
        *integral += increment;
    }
    command.clamp(-limit, limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_of_error_gives_the_three_parts() {
        let mut pid = Pid {
            proportional: 2.0,
            integral: 3.0,
            derivative: 0.5,
            limit: 1e3,
            ..Pid::equation_3_6()
        };
        let mut command = 0.0;
        for k in 1..=100 {
            command = pid.step(
                &PidInput {
                    reference: f64::from(k) * 0.01,
                    measured: 0.0,
                },
                0.01,
            );
        }
        // Error 1 at a slope of 1: 2 + 3 * sum(k / 100) / 100 + 0.5.
        assert!(
            (command - (2.0 + 3.0 * 0.505 + 0.5)).abs() < 1e-12,
            "{command}"
        );
    }

    #[test]
    fn a_leaking_integral_settles_at_gain_over_leak() {
        let mut pid = Pid {
            proportional: 0.0,
            integral: 3.0,
            integral_leak: 2.0,
            ..Pid::equation_3_6()
        };
        let h = 1e-4;
        let mut at = |samples: u32| {
            let input = PidInput {
                reference: 1.0,
                measured: 0.0,
            };
            (0..samples).fold(0.0, |_, _| pid.step(&input, h))
        };
        // 3 / 2 (1 - exp(-2 t)).
        assert!((at(5000) - 1.5 * (1.0 - (-1f64).exp())).abs() < 3e-4);
        assert!((at(100_000) - 1.5).abs() < 3e-4);
    }

    #[test]
    fn the_integral_does_not_wind_up_at_the_limit() {
        let mut pid = Pid::equation_3_6();
        for _ in 0..5000 {
            assert_eq!(
                pid.step(
                    &PidInput {
                        reference: 1.0,
                        measured: 0.0
                    },
                    0.002
                ),
                10.0
            );
        }
        assert_eq!(pid.memory.integral, 0.0);
        let command = pid.step(
            &PidInput {
                reference: 0.0,
                measured: 0.001,
            },
            0.002,
        );
        assert!(command < 0.0);
    }
}

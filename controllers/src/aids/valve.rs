//! Compensation of a valve that is not ideal: the inverse of its curve, with a bounded slope.

use plant::identified::valve_curve::ValveCurve;
use units::Parameters;

use crate::ModelError;

/// `u = h⁻¹(o)`: the command with which the valve opens by what the controller asks for (G. Tao and P. V. Kokotović,
/// Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996, chapter 2).
///
/// Within the overlap the exact inverse jumps. A jump that the valve does not need is a relay in the loop, which
/// oscillates. So the command is at most `slope_limit` times the opening: a curve that is wrong raises
/// the gain of the loop by no more than that.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct ValveCompensation {
    /// The valve's curve.
    #[parameters]
    pub curve: ValveCurve,
    /// Largest command per opening near null.
    #[parameter(name = "valve_slope_limit", min = 1.0, positive)]
    pub slope_limit: f64,
}

/// Slope at which a rig whose valve lacks the curve's whole overlap runs to its end (docs/commissioning.md): friction
/// holds small oscillations.
const SLOPE: f64 = 10.0;

impl Default for ValveCompensation {
    fn default() -> Self {
        Self {
            curve: ValveCurve::default(),
            slope_limit: SLOPE,
        }
    }
}

impl ValveCompensation {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first with which no command opens the valve as asked.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        if !(self.slope_limit.is_finite() && self.slope_limit >= 1.0) {
            return Err(ModelError::Parameter {
                name: Self::VALVE_SLOPE_LIMIT,
                value: self.slope_limit,
                expected: "a number of at least 1",
            });
        }
        self.curve.validate()
    }

    /// The command (V) that opens the valve by `opening` (V).
    #[inline]
    #[must_use]
    pub fn command(&self, opening: f64) -> f64 {
        self.curve.spool(opening, self.slope_limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beyond_the_bound_the_valve_opens_by_what_is_asked_for() {
        let own = ValveCompensation {
            curve: ValveCurve {
                overlap: 0.06,
                null_bias: 0.01,
                ..ValveCurve::default()
            },
            slope_limit: 4.0,
        };
        // The bound ends at an opening of a third of the overlap.
        for (wanted, opening) in [(0.02, 0.02), (-0.3, -0.3), (0.01, 0.0), (0.016, 0.004)] {
            let got = own.curve.opening(own.command(wanted));
            assert!((got - opening).abs() < 1e-12, "{wanted}: {got}");
        }
    }
}

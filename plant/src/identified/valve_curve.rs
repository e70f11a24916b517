//! What a servo valve opens at a position of its spool, as recordings show it.

use units::Parameters;

use crate::ModelError;

/// Opening of the valve over the position of its spool, both in volts:
/// `o = p (1 - l exp(-(p/w)²)) (1 ± q)`, where `p = y - clamp(y, -d, d)` is what the spool has moved past the
/// overlap `d` and `y` its position with the null bias added. A negative `d` is an underlap, within which both
/// edges of a land pass oil: `p = y + clamp(y, d, -d)`, twice the gain (Merritt, Hydraulic Control Systems, 1967,
/// section 5.7). The default is an ideal valve.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
#[parameters(prefix = "valve_curve_")]
pub struct ValveCurve {
    /// Half width of the valve's overlap, V; negative for an underlap.
    #[parameter("V", finite)]
    pub overlap: f64,
    /// Share of the flow gain that is lost at null.
    #[parameter(non_negative)]
    pub null_loss: f64,
    /// Opening over which the lost gain comes back, V.
    #[parameter("V", positive)]
    pub null_width: f64,
    /// q of the flow gains 1 + q and 1 - q.
    #[parameter(finite)]
    pub asymmetry: f64,
    /// Position of the spool at zero command, V.
    #[parameter("V", finite)]
    pub null_bias: f64,
}

impl Default for ValveCurve {
    fn default() -> Self {
        Self {
            overlap: 0.0,
            null_loss: 0.0,
            null_width: 0.15,
            asymmetry: 0.0,
            null_bias: 0.0,
        }
    }
}

impl ValveCurve {
    /// Whether the opening is the spool's position.
    #[must_use]
    pub fn is_ideal(&self) -> bool {
        [self.overlap, self.null_loss, self.asymmetry, self.null_bias] == [0.0; 4]
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// Names the first with which the opening does not grow with the spool's position.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        let shares = [
            (Self::VALVE_CURVE_NULL_LOSS, self.null_loss),
            (Self::VALVE_CURVE_ASYMMETRY, self.asymmetry),
        ];
        match shares.into_iter().find(|(_, value)| value.abs() >= 1.0) {
            None => Ok(()),
            Some((name, value)) => Err(ModelError::Parameter {
                name,
                value,
                expected: "a number between -1 and 1",
            }),
        }
    }

    /// Opening (V) at a position of the spool (V).
    #[inline]
    #[must_use]
    pub fn opening(&self, spool: f64) -> f64 {
        let y = spool + self.null_bias;
        let lap = self.overlap.abs();
        let past = y - self.overlap.signum() * y.clamp(-lap, lap);
        let mut open = past;
        if self.null_loss != 0.0 {
            open *= 1.0 - self.null_loss * (-(past / self.null_width).powi(2)).exp();
        }
        open * (1.0 + self.asymmetry * past.signum())
    }

    /// Position of the spool (V) that opens the valve by `opening` (V), its distance from null at most
    /// `steepest` times the opening: where the true curve has no overlap a loop's gain is raised by no more.
    #[must_use]
    pub fn spool(&self, opening: f64, steepest: f64) -> f64 {
        let size = opening.abs() / (1.0 + self.asymmetry * opening.signum());
        let mut past = size;
        if self.null_loss != 0.0 {
            // The opening grows with `past`: between no loss and all of it.
            let (mut low, mut high) = (size, size / (1.0 - self.null_loss.clamp(0.0, 0.99)));
            for _ in 0..40 {
                past = 0.5 * (low + high);
                let lost = self.null_loss * (-(past / self.null_width).powi(2)).exp();
                if past * (1.0 - lost) < size {
                    low = past;
                } else {
                    high = past;
                }
            }
        }
        let position = if self.overlap >= 0.0 {
            past + self.overlap
        } else {
            (0.5 * past).max(past + self.overlap)
        };
        position.min(steepest * opening.abs()) * opening.signum() - self.null_bias
    }
}

/// What a spool of `lag` (s) and `inertia` (s²), `y + l dy/dt + j d²y/dt² = u`, that follows a constant command is away
/// from it, and its rate, after `time` (s) over those before.
#[must_use]
pub fn spool_transition(lag: f64, inertia: f64, time: f64) -> nalgebra::Matrix2<f64> {
    let rates = nalgebra::Matrix2::new(0.0, 1.0, -1.0 / inertia, -lag / inertia);
    (rates * time).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curves() -> [ValveCurve; 4] {
        let own = ValveCurve::default();
        [
            ValveCurve {
                overlap: 0.05,
                null_bias: 0.02,
                ..own
            },
            ValveCurve {
                overlap: -0.1,
                asymmetry: 0.04,
                ..own
            },
            ValveCurve {
                null_loss: 0.5,
                null_width: 0.2,
                ..own
            },
            ValveCurve {
                overlap: 0.1,
                null_loss: 0.3,
                asymmetry: -0.05,
                ..own
            },
        ]
    }

    #[test]
    fn openings_are_those_of_the_laps() {
        let [over, under, lost, _] = curves();
        for (spool, opening) in [(0.02, 0.0), (0.08, 0.05), (-0.2, -0.13)] {
            assert!((over.opening(spool) - opening).abs() < 1e-15);
        }
        for (spool, opening) in [(0.05, 0.104), (0.3, 0.416), (-0.3, -0.384)] {
            assert!((under.opening(spool) - opening).abs() < 1e-12);
        }
        assert!((lost.opening(1e-6) / 1e-6 - 0.5).abs() < 1e-6);
        assert!((lost.opening(2.0) / 2.0 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_inverse_opens_the_valve_by_what_is_wanted() {
        for curve in curves() {
            curve.validate().unwrap();
            for k in -40..=40 {
                let wanted = 0.013 * f64::from(k);
                let got = curve.opening(curve.spool(wanted, 1e9));
                assert!((got - wanted).abs() < 1e-9, "{curve:?}: {wanted} {got}");
            }
        }
    }

    /// On a valve without overlap the compensated gain stays below the bound.
    #[test]
    fn a_wrong_curve_raises_the_gain_by_no_more_than_the_bound() {
        let curve = ValveCurve {
            null_bias: 0.0,
            ..curves()[0]
        };
        for k in 1..=400 {
            let wanted = 0.001 * f64::from(k);
            assert!(curve.spool(wanted, 3.0) <= 3.0 * wanted + 1e-15);
            let exact = curve.spool(wanted, 1e9);
            assert!(3.0 * wanted < exact || curve.spool(wanted, 3.0) == exact);
        }
    }
}

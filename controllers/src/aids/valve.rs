//! Compensation of a valve that is not ideal: the inverse of its curve, with a bounded slope, and what brings the
//! spool there in time.

use nalgebra::{Matrix2, Vector2};
use plant::identified::valve_curve::{ValveCurve, spool_transition};
use units::Parameters;

use crate::ModelError;
use crate::preview::model::Hydraulics;

/// `u = h⁻¹(o)`: the command with which the valve opens by what the controller asks for (G. Tao and P. V. Kokotović,
/// Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996, chapter 2).
///
/// The curve is behind the spool, which takes some milliseconds through the overlap. A controller counts on the opening
/// `o` of an ideal valve behind the same spool. So to `h⁻¹` of its command is added what brings the real spool nearest
/// to `h⁻¹(o)`, by least squares over the two samples to come, all under the present commands. Where the curve is
/// straight nothing is added. Both spools are models: nothing is fed back.
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
    /// What the law remembers.
    pub memory: Spools,
}

/// Positions (V) and their rates (V/s) of the spool of an ideal valve, and of the real one.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Spools {
    ideal: [f64; 2],
    real: [f64; 2],
    /// How both move. It is computed again only if what it was computed from changes.
    spool: Option<Spool>,
}

/// Samples over which the real spool is brought to where it should be: one alone would swing.
const AHEAD: usize = 2;

/// A spool under a command that is held for a sample.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
struct Spool {
    /// Lag (s), inertia (s²) and the sample's duration (s).
    of: [f64; 3],
    /// Columns of the transition over the sample.
    transition: [[f64; 2]; 2],
}

impl Spool {
    fn new(of: [f64; 3]) -> Self {
        let [lag, inertia, period] = of;
        Self {
            of,
            transition: spool_transition(lag, inertia, period).into(),
        }
    }

    fn moved(&self, at: Vector2<f64>, command: f64) -> Vector2<f64> {
        let end = Vector2::new(command, 0.0);
        end + Matrix2::from(self.transition) * (at - end)
    }
}

/// Slope at which a rig whose valve lacks the curve's whole overlap runs to its end (docs/commissioning.md): friction
/// holds small oscillations.
const SLOPE: f64 = 10.0;

impl Default for ValveCompensation {
    fn default() -> Self {
        Self {
            curve: ValveCurve::default(),
            slope_limit: SLOPE,
            memory: Spools::default(),
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

    /// The command (V) that holds the valve open by `opening` (V).
    #[inline]
    #[must_use]
    pub fn command(&self, opening: f64) -> f64 {
        self.curve.spool(opening, self.slope_limit)
    }

    /// The command (V) of this sample, with which the valve opens as an ideal one does under `asked` (V). The spool
    /// gets it within `limit` (V).
    #[must_use]
    pub fn step(&mut self, asked: f64, hydraulics: &Hydraulics, limit: f64, period: f64) -> f64 {
        let of = [hydraulics.spool_lag, hydraulics.spool_inertia, period];
        let known = self.memory.spool.filter(|own| own.of == of);
        let spool = known.unwrap_or_else(|| Spool::new(of));
        let still = self.command(asked);
        let [mut ideal, mut real] = [self.memory.ideal, self.memory.real].map(Vector2::from);
        let mut unit = Vector2::zeros();
        let (mut missing, mut reach) = (0.0, 0.0);
        for _ in 0..AHEAD {
            ideal = spool.moved(ideal, asked);
            real = spool.moved(real, still);
            unit = spool.moved(unit, 1.0);
            missing += unit.x * (self.command(ideal.x) - real.x);
            reach += unit.x * unit.x;
        }
        let more = if reach > 0.0 { missing / reach } else { 0.0 };
        let command = still + more;
        let sent = command.clamp(-limit, limit);
        let [ideal, real] = [(self.memory.ideal, asked), (self.memory.real, sent)]
            .map(|(at, command)| spool.moved(at.into(), command).into());
        self.memory = Spools {
            ideal,
            real,
            spool: Some(spool),
        };
        command
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
            ..ValveCompensation::default()
        };
        // The bound ends at an opening of a third of the overlap.
        for (wanted, opening) in [(0.02, 0.02), (-0.3, -0.3), (0.01, 0.0), (0.016, 0.004)] {
            let got = own.curve.opening(own.command(wanted));
            assert!((got - opening).abs() < 1e-12, "{wanted}: {got}");
        }
    }

    const PERIOD: f64 = 0.002;

    /// A valve of 60 Hz whose spool is stepped finely on its own.
    struct Valve {
        spool: [f64; 2],
        curve: ValveCurve,
    }

    impl Valve {
        /// Mean of its opening over a period under a command, of 200 steps (Euler and Cromer).
        fn opening(&mut self, command: f64, own: &Hydraulics) -> f64 {
            let mut sum = 0.0;
            for _ in 0..200 {
                let [at, rate] = self.spool;
                let more = (command - at - own.spool_lag * rate) / own.spool_inertia;
                let rate = rate + more * PERIOD / 200.0;
                self.spool = [at + rate * PERIOD / 200.0, rate];
                sum += self.curve.opening(self.spool[0]);
            }
            sum / 200.0
        }
    }

    fn hydraulics() -> Hydraulics {
        Hydraulics {
            spool_lag: 4.2e-3,
            spool_inertia: 7e-6,
            ..Hydraulics::default()
        }
    }

    /// Root mean square of the opening's error against an ideal valve under 3 and 7 Hz, with `compensated` commands.
    fn error(curve: ValveCurve, mut compensated: impl FnMut(f64) -> f64) -> f64 {
        let own = hydraulics();
        let valve = |curve| Valve {
            spool: [0.0; 2],
            curve,
        };
        let (mut ideal, mut real) = (valve(ValveCurve::default()), valve(curve));
        let mut sum = 0.0;
        for k in 0..2000 {
            let t = PERIOD * f64::from(k);
            let asked = 0.2 * (19.0 * t).sin() + 0.15 * (44.0 * t).sin();
            let difference = ideal.opening(asked, &own) - real.opening(compensated(asked), &own);
            sum += difference * difference;
        }
        (sum / 2000.0).sqrt()
    }

    #[test]
    fn the_spool_passes_an_overlap_in_time() {
        let curve = ValveCurve {
            overlap: 0.12,
            null_loss: 0.3,
            null_bias: 0.02,
            ..ValveCurve::default()
        };
        let mut own = ValveCompensation {
            curve,
            ..ValveCompensation::default()
        };
        let still = error(curve, |asked| own.command(asked));
        let own = &mut own;
        let led = error(curve, |asked| own.step(asked, &hydraulics(), 10.0, PERIOD));
        assert!(led < 0.65 * still, "{led} {still}");
    }

    /// An asymmetric valve has a straight curve on either side: a step that keeps its sign needs no more than the
    /// inverse.
    #[test]
    fn where_the_curve_is_straight_nothing_is_added() {
        let mut own = ValveCompensation {
            curve: ValveCurve {
                asymmetry: 0.1,
                ..ValveCurve::default()
            },
            ..ValveCompensation::default()
        };
        for k in 0..300 {
            let asked = 0.3 - 0.2 * f64::from(k % 50) / 50.0;
            let sent = own.step(asked, &hydraulics(), 10.0, PERIOD);
            assert!((sent - own.command(asked)).abs() < 1e-12, "{k}");
        }
    }

    /// A parameter that is tuned during a run acts from the next sample on.
    #[test]
    fn a_changed_spool_moves_as_its_new_parameters_have_it() {
        let mut own = ValveCompensation::default();
        own.curve.overlap = 0.1;
        for _ in 0..5 {
            let _ = own.step(0.3, &hydraulics(), 10.0, PERIOD);
        }
        let slower = Hydraulics {
            spool_lag: 9e-3,
            ..hydraulics()
        };
        let mut fresh = own;
        fresh.memory.spool = None;
        let mut stale = own;
        assert_eq!(
            own.step(-0.2, &slower, 10.0, PERIOD),
            fresh.step(-0.2, &slower, 10.0, PERIOD)
        );
        assert_ne!(own.memory.real, {
            let _ = stale.step(-0.2, &hydraulics(), 10.0, PERIOD);
            stale.memory.real
        });
    }
}

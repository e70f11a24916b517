//! The servo valve: spool dynamics, its travel limit and overlap, and the flow through its edges.

use std::f64::consts::TAU;
use units::vocabulary;

use crate::ModelError;
use units::Parameters as _;
use units::constants::{INCH, PSI};

/// A four-edge servo valve with matched, symmetrical edges (Merritt, Hydraulic Control Systems,
/// 1967, chapter 5). Spool positions are measured in volts of command.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct ServoValve {
    /// Natural frequency of the spool, Hz.
    #[parameter("Hz", name = vocabulary::VALVE_FREQUENCY, positive)]
    pub frequency: f64,
    /// Damping ratio of the spool.
    #[parameter(name = "valve_damping_ratio", positive)]
    pub damping_ratio: f64,
    /// Largest velocity of the spool, V/s.
    #[parameter("V/s", name = "spool_slew_limit", positive)]
    pub slew_limit: f64,
    /// Travel limit of the spool, V.
    #[parameter("V", name = "spool_travel_limit", positive)]
    pub travel_limit: f64,
    /// Overlap of the edges (dead band, half width), V.
    #[parameter("V", name = "valve_overlap", non_negative)]
    pub overlap: f64,
    /// Share of the flow gain that is lost at null.
    #[parameter(name = "valve_null_loss", non_negative)]
    pub null_loss: f64,
    /// Opening over which the lost gain comes back, V.
    #[parameter("V", name = "valve_null_width", positive)]
    pub null_width: f64,
    /// Position of the spool at zero command, V.
    #[parameter("V", name = vocabulary::VALVE_NULL_BIAS, finite)]
    pub null_bias: f64,
    /// Flow through an edge per volt and root of pressure, m3/(s V sqrt(Pa)).
    #[parameter(positive)]
    pub flow_coefficient: f64,
    /// q of the flow gains 1 + q and 1 - q.
    #[parameter(name = "valve_asymmetry")]
    pub asymmetry: f64,
    /// Laminar flow past a closed edge, m3/(s.Pa).
    #[parameter("m3/(s.Pa)" => "in3/(s.psi)", non_negative)]
    pub null_leakage: f64,
}

impl Default for ServoValve {
    fn default() -> Self {
        // Values chosen so that the rig comes near Eq 2-13 and 2-14: 0.0418 in³/s/V/√psi, 60 Hz,
        // 0.9. A slew limit that a spool of that frequency does not reach. Null leakage: a tenth of the leakage of 4e-4 in³/s/psi, assumed.
        Self {
            frequency: 60.0,
            damping_ratio: 0.9,
            slew_limit: 1e4,
            travel_limit: 10.0,
            overlap: 0.0,
            null_loss: 0.0,
            null_width: 0.15,
            null_bias: 0.0,
            flow_coefficient: 0.0418 * INCH.powi(3) / PSI.sqrt(),
            asymmetry: 0.0,
            null_leakage: 4e-5 * INCH.powi(3) / PSI,
        }
    }
}

/// Flows at the four ports of the valve, m³/s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ValveFlows {
    /// Into chamber A.
    pub into_a: f64,
    /// Into chamber B.
    pub into_b: f64,
    /// Out of the supply.
    pub from_supply: f64,
}

/// Below this drop the edge flow goes over from turbulent to laminar, Pa. At the working pressures
/// the flow departs from the square root by less than 1e-6.
const TRANSITION: f64 = PSI;

/// `sign(drop) sqrt(|drop|)` without the infinite slope at zero.
fn turbulent(drop: f64) -> f64 {
    drop / (drop * drop + TRANSITION * TRANSITION).sqrt().sqrt()
}

impl ServoValve {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        if self.asymmetry.abs() < 1.0 {
            return Ok(());
        }
        Err(ModelError::Parameter {
            name: Self::VALVE_ASYMMETRY,
            value: self.asymmetry,
            expected: "a number between -1 and 1",
        })
    }

    /// Acceleration of the spool, V/s², under `command` (V). The pilot stage gives no more than
    /// drives the spool at its slew limit against its damping.
    pub fn spool_acceleration(&self, spool: f64, spool_velocity: f64, command: f64) -> f64 {
        let omega = TAU * self.frequency;
        let wanted = (command + self.null_bias).clamp(-self.travel_limit, self.travel_limit);
        let most = 2.0 * self.damping_ratio * self.slew_limit;
        let driven = (omega * (wanted - spool)).clamp(-most, most);
        omega * (driven - 2.0 * self.damping_ratio * spool_velocity)
    }

    /// The steepest slope of an edge's flow by its pressure drop, m³/(s Pa): fully open, without a
    /// drop.
    pub(super) fn steepest_edge(&self) -> f64 {
        let open = (self.travel_limit - self.overlap).max(0.0) * (1.0 + self.asymmetry.abs());
        self.flow_coefficient * open / TRANSITION.sqrt() + self.null_leakage
    }

    /// Opening of the edges, V: the spool's position within its travel, less the overlap and less what is
    /// lost near null, `1 - l exp(-(o/w)²)`.
    pub fn opening(&self, spool: f64) -> f64 {
        let spool = spool.clamp(-self.travel_limit, self.travel_limit);
        let past = spool - spool.clamp(-self.overlap, self.overlap);
        if self.null_loss == 0.0 {
            return past;
        }
        past * (1.0 - self.null_loss * (-(past / self.null_width).powi(2)).exp())
    }

    /// Flows at pressures `a` and `b` of the chambers and `supply`, all Pa above the tank's. With
    /// `a + b = supply` the edges in series give the load flow
    /// `k_v u sqrt((P_s - sign(u) P_L) / 2)`.
    pub fn flows(&self, spool: f64, [a, b]: [f64; 2], supply: f64) -> ValveFlows {
        let opening = self.opening(spool);
        let area = self.flow_coefficient * (opening.abs() + self.asymmetry * opening);
        let (to_a, to_b) = (
            self.null_leakage * (supply - a),
            self.null_leakage * (supply - b),
        );
        let mut flows = ValveFlows {
            into_a: to_a - self.null_leakage * a,
            into_b: to_b - self.null_leakage * b,
            from_supply: to_a + to_b,
        };
        if opening >= 0.0 {
            let q = area * turbulent(supply - a);
            flows.into_a += q;
            flows.into_b -= area * turbulent(b);
            flows.from_supply += q;
        } else {
            let q = area * turbulent(supply - b);
            flows.into_b += q;
            flows.into_a -= area * turbulent(a);
            flows.from_supply += q;
        }
        flows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_flow_follows_the_square_root_law() {
        let valve = ServoValve {
            null_leakage: 0.0,
            ..ServoValve::default()
        };
        let supply = 3000.0 * PSI;
        for (u, load) in [(2.0, 400.0), (-3.0, 400.0), (5.0, -900.0)] {
            let load_pressure = load * PSI;
            let chambers = [
                (supply + load_pressure) / 2.0,
                (supply - load_pressure) / 2.0,
            ];
            let flows = valve.flows(u, chambers, supply);
            let q = (flows.into_a - flows.into_b) / 2.0;
            // Thesis units: in³/s from V and psi.
            let expected = 0.0418 * u * ((3000.0 - u.signum() * load) / 2.0_f64).sqrt();
            let got = q / INCH.powi(3);
            assert!(
                (got - expected).abs() < 1e-6 * expected.abs(),
                "{got} {expected}"
            );
        }
    }

    #[test]
    fn the_opening_lacks_the_overlap_and_what_is_lost_near_null() {
        let valve = ServoValve {
            travel_limit: 5.0,
            overlap: 0.2,
            ..ServoValve::default()
        };
        for (spool, opening) in [
            (0.1, 0.0),
            (-0.2, 0.0),
            (1.2, 1.0),
            (-1.2, -1.0),
            (9.0, 4.8),
        ] {
            assert!((valve.opening(spool) - opening).abs() < 1e-12, "{spool}");
        }
        let lossy = ServoValve {
            null_loss: 0.4,
            null_width: 0.3,
            ..valve
        };
        // One width past the overlap, 0.4/e is lost; far from null nothing.
        let expected = 0.3 * (1.0 - 0.4 * f64::exp(-1.0));
        assert!((lossy.opening(0.5) - expected).abs() < 1e-12);
        assert!((lossy.opening(-0.5) + expected).abs() < 1e-12);
        assert!((lossy.opening(4.0) - 3.8).abs() < 1e-12);
    }

    #[test]
    fn a_valve_that_opens_to_one_side_alone_is_refused() {
        let with = |asymmetry| ServoValve {
            asymmetry,
            ..ServoValve::default()
        };
        for asymmetry in [-0.9, 0.0, 0.9] {
            assert_eq!(with(asymmetry).validate(), Ok(()));
        }
        for asymmetry in [-1.0, 1.0, 2.0] {
            let said = with(asymmetry).validate().unwrap_err().to_string();
            assert!(
                said.contains("expected a number between -1 and 1"),
                "{said}"
            );
        }
        let backwards = ServoValve {
            frequency: -1.0,
            ..ServoValve::default()
        };
        assert!(backwards.validate().is_err());
    }

    #[test]
    fn the_spool_slews_no_faster_than_its_limit_and_small_steps_do_not_meet_it() {
        let valve = ServoValve {
            slew_limit: 500.0,
            ..ServoValve::default()
        };
        let free = ServoValve::default();
        // A step of `height`, by Euler steps of 1 us: largest velocity and time to 90 %.
        let step = |valve: &ServoValve, height: f64| {
            let (mut spool, mut velocity, mut most, mut time) = (0.0, 0.0_f64, 0.0_f64, 0.0);
            while spool < 0.9 * height {
                velocity += 1e-6 * valve.spool_acceleration(spool, velocity, height);
                spool += 1e-6 * velocity;
                most = most.max(velocity);
                time += 1e-6;
            }
            (most, time)
        };
        let (most, time) = step(&valve, 10.0);
        assert!(most <= 500.0 && most > 490.0, "{most}");
        assert!(time > 9.0 / 500.0, "{time}");
        assert_eq!(step(&valve, 1.0), step(&free, 1.0));
    }

    #[test]
    fn overlap_and_travel_limit_shape_the_opening() {
        let valve = ServoValve {
            overlap: 0.2,
            travel_limit: 5.0,
            ..ServoValve::default()
        };
        for (spool, opening) in [(0.1, 0.0), (-0.2, 0.0), (1.0, 0.8), (-7.0, -4.8)] {
            assert!((valve.opening(spool) - opening).abs() < 1e-15);
        }
    }

    #[test]
    fn an_asymmetric_valve_passes_more_for_positive_openings_and_less_for_negative_ones() {
        let (asymmetry, supply) = (0.2, 3000.0 * PSI);
        let even = ServoValve::default();
        let valve = ServoValve { asymmetry, ..even };
        let load_flow = |valve: &ServoValve, spool: f64| {
            let without_leak = ServoValve {
                null_leakage: 0.0,
                ..*valve
            };
            let flows = without_leak.flows(spool, [0.5 * supply; 2], supply);
            (flows.into_a - flows.into_b) / 2.0
        };
        for (spool, gain) in [(3.0, 1.0 + asymmetry), (-3.0, 1.0 - asymmetry)] {
            let ratio = load_flow(&valve, spool) / load_flow(&even, spool);
            assert!((ratio - gain).abs() < 1e-12, "{spool} V: {ratio}");
        }
    }

    #[test]
    fn oil_comes_from_the_supply_and_leaves_for_the_tank() {
        let valve = ServoValve::default();
        let supply = 3000.0 * PSI;
        for spool in [-4.0, -0.5, 0.0, 0.5, 4.0] {
            let chambers = [2000.0 * PSI, 700.0 * PSI];
            let flows = valve.flows(spool, chambers, supply);
            // The open edges: supply to A and B to the tank, or the reverse.
            let k = valve.flow_coefficient * spool.abs();
            let edge = |drop: f64| k * drop.sqrt() + valve.null_leakage * drop;
            let leak = |drop: f64| valve.null_leakage * drop;
            let [a, b] = chambers;
            let (into_a, into_b, drawn) = if spool >= 0.0 {
                (
                    edge(supply - a) - leak(a),
                    leak(supply - b) - edge(b),
                    edge(supply - a) + leak(supply - b),
                )
            } else {
                (
                    leak(supply - a) - edge(a),
                    edge(supply - b) - leak(b),
                    edge(supply - b) + leak(supply - a),
                )
            };
            let scale = valve.flow_coefficient * supply.sqrt();
            for (got, expected) in [
                (flows.into_a, into_a),
                (flows.into_b, into_b),
                (flows.from_supply, drawn),
            ] {
                assert!(
                    (got - expected).abs() < 1e-5 * scale,
                    "{spool} V: {got} {expected}"
                );
            }
        }
    }
}

//! The rig as a linear system near the middle position.

use nalgebra::DMatrix;

use super::{STATES, SealFriction, ServoHydraulicInput, ServoHydraulicState, ServoHydraulicTable};
use crate::linear::StateSpace;

/// Typical magnitudes of the states, for differences: V, V/s, Pa, Pa, m, m/s, m, Pa.
const SCALE: [f64; STATES] = [1.0, 100.0, 1e6, 1e6, 0.01, 0.1, 1e-5, 1e6];

impl ServoHydraulicTable {
    /// The rig linearised at rest in the middle while its seals slide: dry friction, which has no
    /// linear model, is left out and viscous friction stays.
    ///
    /// Inputs valve command (V) and specimen force (N); states as [`ServoHydraulicState`] in
    /// order, less the seals' deflection; outputs displacement, velocity, acceleration and
    /// actuator force, SI. With overlap the valve passes nothing at null, so linearise a rig
    /// without it.
    pub fn linearised(&self) -> StateSpace {
        let sliding = Self {
            friction: SealFriction::viscous_only(self.friction.viscous),
            ..*self
        };
        let rest: [f64; STATES] = sliding.rest().into();
        let evaluate = |x: [f64; STATES], u: [f64; 2]| {
            let input = ServoHydraulicInput {
                valve_command: u[0] - sliding.valve.null_bias,
                specimen_force: u[1],
                supply_lost: false,
            };
            let state = ServoHydraulicState::from(x);
            let rates: [f64; STATES] = sliding.derivatives(&state, &input).into();
            let force = sliding.actuator_force(&state);
            (rates, [state.displacement, state.velocity, rates[5], force])
        };
        // Central differences; the equations are smooth near rest except for the kink of the flow
        // at zero opening, which is symmetrical and drops out.
        let difference = |high: f64, low: f64, step: f64| (high - low) / (2.0 * step);
        let kept = [0, 1, 2, 3, 4, 5, 7];
        let mut a = DMatrix::zeros(7, 7);
        let mut c = DMatrix::zeros(4, 7);
        for (j, &state) in kept.iter().enumerate() {
            let step = 1e-4 * SCALE[state];
            let (mut up, mut down) = (rest, rest);
            up[state] += step;
            down[state] -= step;
            let (high, low) = (evaluate(up, [0.0; 2]), evaluate(down, [0.0; 2]));
            for (i, &row) in kept.iter().enumerate() {
                a[(i, j)] = difference(high.0[row], low.0[row], step);
            }
            for i in 0..4 {
                c[(i, j)] = difference(high.1[i], low.1[i], step);
            }
        }
        let mut b = DMatrix::zeros(7, 2);
        let mut d = DMatrix::zeros(4, 2);
        for (j, step) in [1e-3, 1e-2].into_iter().enumerate() {
            let (mut up, mut down) = ([0.0; 2], [0.0; 2]);
            up[j] = step;
            down[j] = -step;
            let (high, low) = (evaluate(rest, up), evaluate(rest, down));
            for (i, &row) in kept.iter().enumerate() {
                b[(i, j)] = difference(high.0[row], low.0[row], step);
            }
            for i in 0..4 {
                d[(i, j)] = difference(high.1[i], low.1[i], step);
            }
        }
        StateSpace { a, b, c, d }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::Complex;

    use super::*;
    use crate::identified::shake_table::ShakeTable;
    use crate::linear::log_space;
    use units::constants::{INCH, LBF};

    #[test]
    fn linearised_rig_is_within_2_db_of_the_identified_plant() {
        let rig = ServoHydraulicTable::default().linearised();
        let identified = ShakeTable::default().state_space();
        let grid = log_space(TAU * 0.4, TAU * 30.0, 200);
        for (output, name) in [(0, "displacement"), (2, "acceleration"), (3, "force")] {
            let mut sum = 0.0;
            for &omega in &grid {
                let s = Complex::new(0.0, omega);
                let ratio = rig.evaluate(s).unwrap()[(output, 0)].norm()
                    / identified.evaluate(s).unwrap()[(output, 0)].norm();
                sum += (20.0 * ratio.log10()).powi(2);
            }
            let rms = (sum / grid.len() as f64).sqrt();
            println!("valve command to {name}: {rms:.2} dB rms");
            assert!(rms < 2.0, "{name}: {rms} dB");
        }
    }

    #[test]
    fn linearisation_is_the_textbook_load_pressure_model() {
        // Thesis units: y'' + 2 0.9 w y' + w² y = w² u; V_t/(4 β) P' = k_q y - A v - C P;
        // m v' = A P - (5 + c) v - k x, where k_q = k_v sqrt(P_s / 2).
        let rig = ServoHydraulicTable::default().linearised();
        let pressure = 3000.0 * 0.05 / (0.05 + 4e-5);
        let k_q = 0.0418 * (pressure / 2.0_f64).sqrt();
        let w = TAU * 60.0;
        let (mass, damping, stiffness) = (1.0 / 8.248, 2.034 / 8.248, 192.4 / 8.248);
        for f in [0.1, 1.0, 5.0, 20.0, 80.0] {
            let s = Complex::new(0.0, TAU * f);
            let y = w * w / (s * s + s * 1.8 * w + w * w);
            let mechanical = s * s * mass + s * (damping + 5.0) + stiffness;
            let compliance = s * 24.0 / (4.0 * 4e4) + 4e-4;
            let x = y * k_q * 0.4 / (mechanical * compliance + s * 0.16);
            let got = rig.evaluate(s).unwrap()[(0, 0)] / INCH;
            assert!((got - x).norm() < 1e-4 * x.norm(), "at {f} Hz: {got} {x}");
        }
        assert!((rig.d[(2, 1)] * LBF / INCH * mass - 1.0).abs() < 1e-6);
    }
}

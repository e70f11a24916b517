//! Gains of three-variable control from a model of the rig, by a stated rule.

use nalgebra::DMatrix;
use plant::identified::shake_table::ShakeTable;
use units::constants::INCH;

use crate::ModelError;
use crate::three_variable::ThreeVariableGains;

impl ThreeVariableGains {
    /// Tunes for `rig`, whose measurements are `delay` samples of `period` seconds late:
    ///
    /// 1. `Kp` is half the gain at which the sampled displacement loop becomes unstable (a gain
    ///    margin of 6 dB); velocity and acceleration are not fed back.
    /// 2. `Ki/Kp` is that of Table 3-2.
    /// 3. The feedforward gains are the inverse of the rig to second order,
    ///    `1/G(s) = c0 + c1 s + c2 s²`, brought forward by the hold's half sample, less what the
    ///    feedback of late measurements adds when the table follows perfectly.
    ///
    /// # Errors
    /// A rig that the displacement loop cannot hold, or that does not move.
    pub fn tuned(rig: &ShakeTable, delay: usize, period: f64) -> Result<Self, ModelError> {
        rig.validate()?;
        ModelError::require_positive("period", period)?;
        let ultimate = ultimate_gain(rig, delay, period)?;
        let proportional = 0.5 * ultimate;
        let printed = Self::TABLE_3_2_IN_THESIS_UNITS;
        let [c0, c1, c2] = inverse_series(rig)?;
        let (hold, late) = (0.5 * period, period * delay as f64);
        Ok(Self {
            proportional,
            integral: proportional * printed.integral / printed.proportional,
            velocity_feedback: 0.0,
            acceleration_feedback: 0.0,
            displacement_feedforward: c0,
            velocity_feedforward: c1 + c0 * hold - proportional * late,
            acceleration_feedforward: c2
                + c1 * hold
                + 0.5 * c0 * hold * hold
                + 0.5 * proportional * late * late,
        })
    }
}

/// Gain (V/m) at which the sampled displacement loop is about to oscillate.
fn ultimate_gain(rig: &ShakeTable, delay: usize, period: f64) -> Result<f64, ModelError> {
    let sampled = rig.state_space().sample(period);
    let (n, order) = (sampled.order(), sampled.order() + delay);
    let is_stable = |gain: f64| {
        // The states, then the displacements of the last `delay` samples.
        let mut a = DMatrix::zeros(order, order);
        a.view_mut((0, 0), (n, n)).copy_from(&sampled.a);
        let measured = |a: &mut DMatrix<f64>, row: usize, factor: f64| {
            if delay == 0 {
                for j in 0..n {
                    a[(row, j)] += factor * sampled.c[(0, j)];
                }
            } else {
                a[(row, order - 1)] += factor;
            }
        };
        for i in 0..n {
            measured(&mut a, i, -gain * sampled.b[(i, 0)]);
        }
        for i in 0..delay {
            if i == 0 {
                for j in 0..n {
                    a[(n, j)] = sampled.c[(0, j)];
                }
            } else {
                a[(n + i, n + i - 1)] = 1.0;
            }
        }
        a.complex_eigenvalues().iter().all(|pole| pole.norm() < 1.0)
    };
    // A rig that is unstable by itself needs some gain: begin where the loop is held.
    let mut low = [3.0, 1.0, 0.3]
        .into_iter()
        .map(|gain| gain / INCH)
        .find(|&gain| is_stable(gain))
        .ok_or(ModelError::NoSolution {
            equation: "the tuning of three-variable control",
            reason: "no displacement gain of 0.3 to 3 V/in holds the table".into(),
        })?;
    let mut high = low;
    while is_stable(high) {
        (low, high) = (high, 2.0 * high);
        if high > 1e3 / INCH {
            break;
        }
    }
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if is_stable(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(low)
}

/// `[c0, c1, c2]` of `u/x = c0 + c1 s + c2 s² + ...`, V/m, V s/m, V s²/m.
///
/// From `x (m s² + c s + k - s G2) = G1 u` with `G = N/D`:
/// `u/x = ((m s² + c s + k) D - s N2) / N1`, a quotient of power series.
fn inverse_series(rig: &ShakeTable) -> Result<[f64; 3], ModelError> {
    let actuator = &rig.actuator;
    let ascending = |p: &[f64; 3]| [p[2], p[1], p[0]];
    let (d, n1, n2) = (
        ascending(&actuator.denominator),
        ascending(&actuator.voltage_to_force),
        ascending(&actuator.velocity_to_force),
    );
    let t = [rig.table.stiffness, rig.table.damping, rig.table.mass];
    let above = [
        t[0] * d[0],
        t[0] * d[1] + t[1] * d[0] - n2[0],
        t[0] * d[2] + t[1] * d[1] + t[2] * d[0] - n2[1],
    ];
    if n1[0] == 0.0 {
        return Err(ModelError::NoSolution {
            equation: "the inverse of the rig",
            reason: "a constant valve command exerts no force".into(),
        });
    }
    let c0 = above[0] / n1[0];
    let c1 = (above[1] - c0 * n1[1]) / n1[0];
    let c2 = (above[2] - c0 * n1[2] - c1 * n1[1]) / n1[0];
    Ok([c0, c1, c2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;
    use plant::servo_hydraulic::ServoHydraulicTable;

    #[test]
    fn the_series_is_the_inverse_of_the_rig_at_low_frequency() {
        let rig = ServoHydraulicTable::default().fitted().unwrap();
        let [c0, c1, c2] = inverse_series(&rig).unwrap();
        let g = rig.state_space();
        let error = |omega: f64| {
            let s = Complex::new(0.0, omega);
            (1.0 - (c0 + s * c1 + s * s * c2) * g.evaluate(s).unwrap()[(0, 0)]).norm()
        };
        // What is left is of third order, beside a term of first order in u/x.
        assert!(error(5.0) < 0.01, "{}", error(5.0));
        let ratio = error(8.0) / error(4.0);
        assert!((3.0..5.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn twice_the_tuned_gain_is_the_margin_of_stability() {
        let rig = ServoHydraulicTable::default().fitted().unwrap();
        for delay in 0..3 {
            let gains = ThreeVariableGains::tuned(&rig, delay, 0.002).unwrap();
            // Independent of the eigenvalues: the loop's gain where its phase is -180 degrees.
            let sampled = rig.state_space().sample(0.002);
            let open = |omega: f64| {
                let z = Complex::new(0.0, 0.002 * omega).exp();
                sampled.evaluate(z).unwrap()[(0, 0)] * z.powi(-(delay as i32))
            };
            let (mut low, mut high) = (60.0, 160.0);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if open(middle).im < 0.0 {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let margin = 1.0 / (gains.proportional * open(low).norm());
            assert!((margin - 2.0).abs() < 1e-6, "delay {delay}: {margin}");
        }
    }
}

//! Gains of three-variable control from a model of the rig, by a stated rule.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, Matrix3, Vector3};
use plant::identified::shake_table::ShakeTable;
use plant::linear::log_space;
use plant::linear::margins::nyquist;
use units::constants::INCH;

use crate::ModelError;
use crate::robustness::LateRig;
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

/// Largest sensitivity that the rule allows: it leaves a gain margin of 8.5 dB and a phase margin
/// of 36 degrees at least. A stiffer loop follows no better.
const PEAK_SENSITIVITY: f64 = 1.6;
/// Displacement gains that are tried, V/m: 0.001 to 1000 V/in, whatever the valve's range and the stroke.
const GAINS: (f64, f64) = (1e-3 / INCH, 1e3 / INCH);

/// Gains to begin with, V/m: the `usual` ones (V/in), then all over [`GAINS`].
fn trial_gains(usual: impl IntoIterator<Item = f64>) -> impl Iterator<Item = f64> {
    let all = std::iter::successors(Some(GAINS.0), |gain| Some(1.25 * gain));
    let usual = usual.into_iter().map(|gain| gain / INCH);
    usual.chain(all.take_while(|gain| *gain < GAINS.1))
}

/// Band of the motions, Hz, in which the feedforward is fitted.
const BAND: (f64, f64) = (0.25, 10.0);

impl ThreeVariableGains {
    /// Tunes for `rig`, whose measurements are `late` s late, sampled every `period` s:
    ///
    /// 1. `Kba`, of a grid, is the acceleration feedback that allows the largest `Kp`, and `Kp` the
    ///    largest with which the sensitivity of the sampled loop stays below 1.6. Velocity is not fed
    ///    back.
    /// 2. `Ki/Kp` is that of Table 3-2.
    /// 3. The feedforward gains make the table's response to its reference one over the band of the
    ///    motions, in least squares over 0.25 to 10 Hz of the acceleration's error.
    ///
    /// # Errors
    /// A rig that no displacement gain holds.
    pub fn damped(rig: &ShakeTable, late: f64, period: f64) -> Result<Self, ModelError> {
        rig.validate()?;
        let space = rig.state_space();
        let late_rig = LateRig::new(&space, late, period)?;
        let grid: Vec<(f64, [Complex<f64>; 2])> = log_space(0.5, 0.999 * nyquist(period), 400)
            .into_iter()
            .map(|omega| {
                let all = late_rig.responses(omega);
                (omega, [all[0], all[2]])
            })
            .collect();
        let peak = |displacement: f64, acceleration: f64| {
            let distances = grid
                .iter()
                .map(|(_, [x, a])| (1.0 + x * displacement + a * acceleration).norm());
            1.0 / distances.fold(f64::INFINITY, f64::min)
        };
        // The acceleration that one volt makes where it makes the most.
        let most = grid.iter().map(|(_, [_, a])| a.norm()).fold(0.0, f64::max);
        let mut best: Option<[f64; 2]> = None;
        for step in 0..=20 {
            let acceleration = 0.1 * f64::from(step) / most;
            let holds = |gain: f64| peak(gain, acceleration) <= PEAK_SENSITIVITY;
            let first = trial_gains([0.1])
                .find(|gain| holds(*gain) && late_rig.is_held_by(&[*gain, 0.0, acceleration]));
            let Some(mut low) = first else { continue };
            while holds(1.05 * low) && low < GAINS.1 {
                low *= 1.05;
            }
            if best.is_none_or(|[gain, _]| low > gain)
                && late_rig.is_held_by(&[low, 0.0, acceleration])
            {
                best = Some([low, acceleration]);
            }
        }
        let [proportional, acceleration] = best.ok_or(ModelError::NoSolution {
            equation: "the tuning of three-variable control",
            reason: "no displacement gain from 0.001 to 1000 V/in stabilises the table with a \
                sensitivity of 1.6"
                .into(),
        })?;
        let printed = Self::TABLE_3_2_IN_THESIS_UNITS;
        let integral = proportional * printed.integral / printed.proportional;
        let prompt = LateRig::new(&space, 0.0, period)?;
        let wanted = reference_gains(&prompt, &late_rig, [proportional, acceleration, integral])?;
        Ok(Self {
            proportional,
            integral,
            velocity_feedback: 0.0,
            acceleration_feedback: acceleration,
            displacement_feedforward: wanted[0] - proportional,
            velocity_feedforward: wanted[1],
            acceleration_feedforward: wanted[2] - acceleration,
        })
    }
}

/// Gains of the reference and its derivatives with which the table follows best, where the table
/// moves as `prompt` and is measured as `late`.
fn reference_gains(
    prompt: &LateRig,
    late: &LateRig,
    [displacement, acceleration, integral]: [f64; 3],
) -> Result<[f64; 3], ModelError> {
    let (mut normal, mut right) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
    let period = prompt.period();
    for line in 0..200 {
        let hertz = BAND.0 + (BAND.1 - BAND.0) * f64::from(line) / 199.0;
        let s = Complex::new(0.0, TAU * hertz);
        let heard = late.responses(s.im);
        let sum = period * integral / (1.0 - (-s * period).exp());
        let open = heard[0] * (displacement + sum) + heard[2] * acceleration;
        let closed = prompt.responses(s.im)[0] / (1.0 + open);
        let row = [closed, closed * s, closed * s * s];
        let target = 1.0 - closed * sum;
        for part in [|c: Complex<f64>| c.re, |c: Complex<f64>| c.im] {
            let row = Vector3::from(row.map(part));
            normal += row * row.transpose();
            right += row * part(target);
        }
    }
    // Powers of s differ by orders of magnitude: scale before solving.
    let scale = Vector3::from_fn(|i, _| 1.0 / f64::sqrt(normal[(i, i)]));
    let scaled = Matrix3::from_diagonal(&scale) * normal * Matrix3::from_diagonal(&scale);
    let solution =
        scaled
            .lu()
            .solve(&scale.component_mul(&right))
            .ok_or(ModelError::NoSolution {
                equation: "the feedforward of three-variable control",
                reason: "the rig does not respond in the band of the motions".into(),
            })?;
    Ok(solution.component_mul(&scale).into())
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
    let mut low = trial_gains([3.0, 1.0, 0.3])
        .find(|&gain| is_stable(gain))
        .ok_or(ModelError::NoSolution {
            equation: "the tuning of three-variable control",
            reason: "no displacement gain from 0.001 to 1000 V/in stabilises the table".into(),
        })?;
    let mut high = low;
    while is_stable(high) {
        (low, high) = (high, 2.0 * high);
        if high > GAINS.1 {
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
    use super::super::known_rig::fitted;
    use super::*;
    use plant::servo_hydraulic::ServoHydraulicTable;

    #[test]
    fn the_series_is_the_inverse_of_the_rig_at_low_frequency() {
        let rig = fitted(&ServoHydraulicTable::default());
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
        let rig = fitted(&ServoHydraulicTable::default());
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

    #[test]
    fn the_damped_rule_keeps_its_sensitivity_and_follows_better() {
        let rig = fitted(&ServoHydraulicTable::default());
        let (late, period) = (0.002, 0.002);
        let gains = ThreeVariableGains::damped(&rig, late, period).unwrap();
        let plain = ThreeVariableGains::tuned(&rig, 1, period).unwrap();
        println!("{gains:?}\n{plain:?}");
        assert!(gains.proportional > 1.1 * plain.proportional);
        // Independent of the rule's own grid: the law itself, pushed.
        let late_rig = LateRig::new(&rig.state_space(), late, period).unwrap();
        let mut law = crate::three_variable::ThreeVariableControl {
            gains,
            ..crate::three_variable::ThreeVariableControl::table_3_2()
        };
        let mut command = |heard: &crate::robustness::Heard| {
            let input = crate::three_variable::ThreeVariableInput {
                measured: heard.motion,
                ..Default::default()
            };
            crate::Controller::step(&mut law, &input, period)
        };
        let run = crate::robustness::Pushed::new(&late_rig, &mut command, 10.0);
        assert!(run.is_stable());
        let peak = run.open_loop(1.0).peak_sensitivity();
        assert!((1.4..1.62).contains(&peak), "{peak}");
        // Sines in the middle of the band: error of the table over its reference, in the time domain.
        let error = |gains: &ThreeVariableGains, hertz: f64| {
            let mut law = crate::three_variable::ThreeVariableControl {
                gains: *gains,
                ..crate::three_variable::ThreeVariableControl::table_3_2()
            };
            let plant = rig.state_space().sample(period);
            let mut x = nalgebra::DVector::zeros(5);
            let mut before = crate::Motion::default();
            let (omega, size): (f64, f64) = (TAU * hertz, 1e-3);
            let mut sum = 0.0;
            for k in 0..4000 {
                let (s, c) = (omega * period * f64::from(k)).sin_cos();
                let y = &plant.c * &x;
                if k > 2000 {
                    sum += (y[0] - size * s).powi(2);
                }
                let input = crate::three_variable::ThreeVariableInput {
                    reference: crate::Motion {
                        displacement: size * s,
                        velocity: size * omega * c,
                        acceleration: -size * omega * omega * s,
                    },
                    measured: before,
                };
                before = crate::Motion {
                    displacement: y[0],
                    velocity: y[1],
                    acceleration: y[2],
                };
                let u = crate::Controller::step(&mut law, &input, period);
                x = &plant.a * x + plant.b.column(0) * u;
            }
            (sum / 2000.0).sqrt() / size
        };
        let sum = |gains: &ThreeVariableGains| -> f64 {
            [2.0, 5.0, 8.0]
                .iter()
                .map(|hertz| error(gains, *hertz))
                .sum()
        };
        assert!(
            sum(&gains) < 0.7 * sum(&plain),
            "{} {}",
            sum(&gains),
            sum(&plain)
        );
    }
}

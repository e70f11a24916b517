//! Acceleration trajectory tracking and the dual loop from a model of the rig, by stated rules; and
//! command shaping, the rig's inverse, for whoever needs it.

use std::f64::consts::TAU;

use nalgebra::{Complex, Matrix4, Vector4};
use plant::identified::shake_table::ShakeTable;
use plant::linear::log_space;
use plant::linear::margins::nyquist;
use units::constants::{INCH, STROKE};

use super::suite::Measurements;
use crate::acceleration_tracking::{
    AccelerationLoop, AccelerationTracking, AccelerationTrackingInput, DisplacementFilter,
    ForceLoop, SHAPING,
};
use crate::pid::VALVE_LIMIT;
use crate::robustness::{Heard, LateRig, Pushed};
use crate::{Controller, ModelError};

/// Largest sensitivity that the rules allow, as for three-variable control.
const PEAK_SENSITIVITY: f64 = 1.6;
/// Band of the motions, Hz, in which the shaping is fitted.
const BAND: (f64, f64) = (0.25, 15.0);
/// Most samples by which the shaped motion may be ahead.
const FARTHEST: usize = 15;
/// Frequency below which the force loop holds the table and not the acceleration loop, rad/s: just below the
/// band of the motions. Lower, the table wanders.
const HANDOVER: f64 = TAU * 0.16;
/// Most of the dual loop's gain on displacement, V/m: the valve's whole command at a third of the stroke. A
/// rig that leaves itself would be lost at the limit.
const MOST: f64 = 3.0 * VALVE_LIMIT / STROKE;
/// Lowest displacement gain that is tried, V/m.
const LOWEST: f64 = 0.1 / INCH;

/// Command shaping: a polynomial in `s` of the motion some samples ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shaping {
    /// V/m, V s/m, V s²/m, V s³/m.
    pub gains: [f64; SHAPING],
    /// Samples ahead.
    pub lead: usize,
    /// What is left of the motion's error, rms over 0.25 to 15 Hz, as a share of the motion.
    pub left: f64,
}

impl Shaping {
    /// The polynomial and lead with which `closed` (command to displacement, m/V, at rad/s) times them
    /// comes nearest to `target`, in least squares from 0.25 to 15 Hz.
    ///
    /// # Errors
    /// A rig that does not answer there.
    pub fn fitted(
        period: f64,
        answer: impl Fn(f64) -> (Complex<f64>, Complex<f64>),
    ) -> Result<Self, ModelError> {
        const LINES: usize = 240;
        let lines: Vec<(Complex<f64>, Complex<f64>, Complex<f64>)> = (0..LINES)
            .map(|line| {
                let part = line as f64 / (LINES - 1) as f64;
                let omega = TAU * (BAND.0 + (BAND.1 - BAND.0) * part);
                let (closed, target) = answer(omega);
                (Complex::new(0.0, omega), closed, target)
            })
            .collect();
        let fits = (0..=FARTHEST).filter_map(|lead| {
            let rows: Vec<([Complex<f64>; SHAPING], Complex<f64>)> = lines
                .iter()
                .map(|&(s, closed, target)| {
                    let ahead = closed * (s * (lead as f64 * period)).exp();
                    // The jerk is the difference of two samples.
                    let jerk = s * s * (1.0 - (-s * period).exp()) / period;
                    ([ahead, ahead * s, ahead * s * s, ahead * jerk], target)
                })
                .collect();
            let (mut normal, mut right) = (Matrix4::<f64>::zeros(), Vector4::<f64>::zeros());
            for (row, target) in &rows {
                for part in [|c: Complex<f64>| c.re, |c: Complex<f64>| c.im] {
                    let row = Vector4::from(row.map(part));
                    normal += row * row.transpose();
                    right += row * part(*target);
                }
            }
            // Powers of s differ by orders of magnitude: scale before solving.
            let scale = Vector4::from_fn(|i, _| 1.0 / f64::sqrt(normal[(i, i)]));
            let scaling = Matrix4::from_diagonal(&scale);
            let scaled = (scaling * normal * scaling).cholesky()?;
            let gains: [f64; SHAPING] = (scaling * scaled.solve(&(scaling * right))).into();
            let square: f64 = rows
                .iter()
                .map(|(row, target)| {
                    let sum: Complex<f64> = row.iter().zip(gains).map(|(r, g)| r * g).sum();
                    (target - sum).norm_sqr()
                })
                .sum();
            let left = (square / LINES as f64).sqrt();
            left.is_finite().then_some(Self { gains, lead, left })
        });
        fits.min_by(|a, b| a.left.total_cmp(&b.left))
            .ok_or(ModelError::NoSolution {
                equation: "command shaping",
                reason: "the rig does not respond in the band of the motions".into(),
            })
    }

    /// The inverse of `rig` alone, without feedback.
    ///
    /// # Errors
    /// As [`Self::fitted`]; a period that is not positive.
    pub fn inverse(rig: &ShakeTable, period: f64) -> Result<Self, ModelError> {
        let rig = LateRig::new(&rig.state_space(), 0.0, period)?;
        Self::fitted(period, |omega| {
            (rig.responses(omega)[0], Complex::new(1.0, 0.0))
        })
    }
}

/// A tuned law with what its references have to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccelerationTuning {
    /// The law.
    pub law: AccelerationTracking,
    /// Samples by which the shaped motion is ahead.
    pub lead: usize,
}

/// The rig on a grid of frequencies, late and prompt.
struct Grid {
    late: LateRig,
    lines: Vec<(Complex<f64>, [Complex<f64>; 3])>,
}

impl Grid {
    /// From `first` rad/s on.
    fn new(rig: &ShakeTable, measurements: &Measurements, first: f64) -> Result<Self, ModelError> {
        rig.validate()?;
        let period = measurements.period;
        let late = LateRig::new(&rig.state_space(), measurements.late, period)?;
        let lines = log_space(first, 0.999 * nyquist(period), 500)
            .into_iter()
            .map(|omega| {
                let all = late.responses(omega);
                let z = Complex::new(0.0, omega * period).exp();
                (z, [all[0], all[2], all[3]])
            })
            .collect();
        Ok(Self { late, lines })
    }

    fn peak(&self, open: impl Fn(Complex<f64>, &[Complex<f64>; 3]) -> Complex<f64>) -> f64 {
        let distances = self.lines.iter().map(|(z, g)| (1.0 + open(*z, g)).norm());
        1.0 / distances.fold(f64::INFINITY, f64::min)
    }

    /// Whether the law as it runs brings the rig to rest.
    fn is_held_by(&self, law: &AccelerationTracking) -> bool {
        let (mut law, period) = (*law, self.late.period());
        let mut command = |heard: &Heard| {
            let input = AccelerationTrackingInput {
                measured: heard.motion,
                force: heard.force,
                ..AccelerationTrackingInput::default()
            };
            law.step(&input, period)
        };
        Pushed::new(&self.late, &mut command, 60.0).is_stable()
    }
}

/// The largest of 0.1 V/in and what follows by steps of a twentieth, up to where it no longer `holds`. A rig
/// that is unstable by itself needs some gain: begun is where it first holds.
fn largest(holds: impl Fn(f64) -> bool) -> Option<f64> {
    let mut gains = (0..200).map(|step| LOWEST * 1.05_f64.powi(step));
    let first = gains.find(|gain| holds(*gain))?;
    let further = gains.take_while(|gain| holds(*gain)).last();
    Some(further.unwrap_or(first))
}

impl AccelerationTracking {
    /// Trajectory tracking (Fig 1-3) for a rig:
    ///
    /// 1. The filter has the noise of the measurements.
    /// 2. The displacement gain is half of the largest with which the sensitivity of the sampled loop
    ///    stays below 1.6: it holds the table, and shaping moves it.
    /// 3. Shaping and its lead make the table's response to its reference one
    ///    ([`Shaping::fitted`]).
    ///
    /// # Errors
    /// A rig that no gain holds or that does not answer.
    pub fn trajectory(
        rig: &ShakeTable,
        measurements: &Measurements,
    ) -> Result<AccelerationTuning, ModelError> {
        let grid = Grid::new(rig, measurements, 0.5)?;
        let Measurements { period, noise, .. } = *measurements;
        let filter = DisplacementFilter {
            displacement_noise: noise[0],
            acceleration_noise: noise[2],
        };
        let fed_back = |z: Complex<f64>, displacement: Complex<f64>, acceleration: Complex<f64>| {
            let [x, a] = filter.responses(z, period);
            x * displacement + a * acceleration
        };
        let gain = largest(|gain| {
            grid.peak(|z, [x, a, _]| fed_back(z, *x, *a) * gain) <= PEAK_SENSITIVITY
        });
        let unheld = || ModelError::NoSolution {
            equation: "the tuning of acceleration trajectory tracking",
            reason: "no displacement gain from 0.1 V/in upwards stabilises the table".into(),
        };
        let gain = 0.5 * gain.ok_or_else(unheld)?;
        let prompt = LateRig::new(&rig.state_space(), 0.0, period)?;
        let delay = measurements.delay() as f64 * period;
        let shaping = Shaping::fitted(period, |omega| {
            let s = Complex::new(0.0, omega);
            let heard = grid.late.responses(omega);
            let open = fed_back((s * period).exp(), heard[0], heard[2]) * gain;
            let closed = prompt.responses(omega)[0] / (1.0 + open);
            (closed, 1.0 - closed * gain * (-s * delay).exp())
        })?;
        let law = Self {
            shaping: shaping.gains,
            displacement_gain: gain,
            filter,
            ..Self::default()
        };
        law.validate()?;
        if !grid.is_held_by(&law) {
            return Err(unheld());
        }
        Ok(AccelerationTuning {
            law,
            lead: shaping.lead,
        })
    }

    /// The dual loop (Fig 1-4) for a rig:
    ///
    /// 1. The loops hand over at 0.16 Hz: there the integrals of the acceleration leak, and the force's lag
    ///    ends. A metre of slow displacement is worth as much to the force loop, through the table's
    ///    springs, as one of quick displacement to the acceleration loop.
    /// 2. Of a grid of ratios of the acceleration loop's three gains, that which leaves the least of
    ///    the acceleration's error over 0.25 to 10 Hz, each as high as a sensitivity of 1.6
    ///    allows and
    ///    at most the valve's whole command at a third of the stroke.
    ///
    /// # Errors
    /// A rig that no gains of the grid hold.
    pub fn dual_loop(
        rig: &ShakeTable,
        measurements: &Measurements,
    ) -> Result<AccelerationTuning, ModelError> {
        let grid = Grid::new(rig, measurements, 0.1 * HANDOVER)?;
        let Measurements { period, noise, .. } = *measurements;
        let table = &rig.table;
        let force = |gain: f64| ForceLoop {
            gain: gain / table.stiffness,
            corner: HANDOVER,
            mass: table.mass,
            damping: table.damping,
            stiffness: table.stiffness,
        };
        let mut best: Option<(f64, AccelerationLoop)> = None;
        for lead in [0.0, 0.005, 0.01, 0.02, 0.04, 0.08] {
            for curve in [0.0, 0.5, 1.0, 2.0, 4.0] {
                let own = |gain: f64| AccelerationLoop {
                    proportional: gain * curve * 1e-4,
                    integral: gain * lead,
                    double_integral: gain,
                    leak: HANDOVER,
                };
                let open = |gain: f64, z: Complex<f64>, g: &[Complex<f64>; 3]| {
                    own(gain).response(z, period) * g[1] + force(gain).response(z, period) * g[2]
                };
                let holds = |gain: f64| grid.peak(|z, g| open(gain, z, g)) <= PEAK_SENSITIVITY;
                let Some(gain) = largest(|gain| gain <= MOST && holds(gain)) else {
                    continue;
                };
                let band = grid.lines.iter().filter(|(z, _)| {
                    let hertz = z.arg() / period / TAU;
                    (0.25..10.0).contains(&hertz)
                });
                let left: f64 = band
                    .map(|(z, g)| 1.0 / (1.0 + open(gain, *z, g)).norm_sqr())
                    .sum();
                if best.is_none_or(|(least, _)| left < least) {
                    best = Some((left, own(gain)));
                }
            }
        }
        let unheld = || ModelError::NoSolution {
            equation: "the tuning of the dual loop",
            reason: "no gains of its grid stabilise the table".into(),
        };
        let (_, acceleration) = best.ok_or_else(unheld)?;
        let law = Self {
            shaping: [0.0; SHAPING],
            displacement_gain: 0.0,
            filter: DisplacementFilter {
                displacement_noise: noise[0],
                acceleration_noise: noise[2],
            },
            acceleration,
            force: force(acceleration.double_integral),
            ..Self::default()
        };
        law.validate()?;
        if !grid.is_held_by(&law) {
            return Err(unheld());
        }
        Ok(AccelerationTuning { law, lead: 0 })
    }
}

#[cfg(test)]
mod tests {
    use super::super::known_rig::fitted;
    use super::*;
    use crate::Motion;
    use crate::acceleration_tracking::AccelerationTrackingInput;
    use plant::servo_hydraulic::ServoHydraulicTable;
    use units::Parameters as _;

    fn measurements(late: f64) -> Measurements {
        Measurements {
            late,
            noise: [1.3e-5, 5e-3, 0.1],
            period: 0.002,
        }
    }

    /// Acceleration's error over the reference under a sine of `hertz`, and the displacement at the end,
    /// in the time domain, on the rig sampled, with `offset` V on the valve.
    fn play(rig: &ShakeTable, tuning: &AccelerationTuning, hertz: f64, offset: f64) -> (f64, f64) {
        let period = 0.002;
        let mut law = tuning.law;
        let plant = rig.state_space().sample(period);
        let mut x = nalgebra::DVector::zeros(5);
        let omega = TAU * hertz;
        let size = 0.5 / omega;
        let motion = |k: i32| {
            let (s, c) = (omega * period * f64::from(k)).sin_cos();
            Motion {
                displacement: size / omega * (1.0 - c),
                velocity: size * s,
                acceleration: size * omega * c,
            }
        };
        let mut heard = (Motion::default(), 0.0);
        let (mut sum, mut all) = (0.0, 0.0);
        let count = 20_000;
        for k in 0..count {
            let y = &plant.c * &x;
            if k > count - 5000 {
                sum += (y[2] - motion(k).acceleration).powi(2);
                all += motion(k).acceleration.powi(2);
            }
            let input = AccelerationTrackingInput {
                ahead: motion(k + tuning.lead as i32),
                reference: motion(k - 1),
                measured: heard.0,
                force: heard.1,
            };
            heard = (
                Motion {
                    displacement: y[0],
                    velocity: y[1],
                    acceleration: y[2],
                },
                y[3],
            );
            let u = law.step(&input, period) + offset;
            x = &plant.a * x + plant.b.column(0) * u;
        }
        ((sum / all).sqrt(), x[3])
    }

    #[test]
    fn the_trajectory_is_tracked_on_the_rig_of_the_rule() {
        let rig = fitted(&ServoHydraulicTable::default());
        let tuning = AccelerationTracking::trajectory(&rig, &measurements(0.002)).unwrap();
        let errors = [1.0, 3.0, 8.0].map(|hertz| play(&rig, &tuning, hertz, 0.0).0);
        println!("{tuning:?}\n{errors:?}");
        assert!(errors.iter().all(|error| *error < 0.02), "{errors:?}");
    }

    #[test]
    fn the_dual_loop_tracks_slow_motion_and_does_not_drift() {
        let rig = fitted(&ServoHydraulicTable::default());
        let tuning = AccelerationTracking::dual_loop(&rig, &measurements(0.002)).unwrap();
        let errors = [0.5, 1.0, 3.0, 8.0].map(|hertz| play(&rig, &tuning, hertz, 0.0).0);
        println!("{tuning:?}\n{errors:?}");
        assert!(errors[0] < 0.2 && errors[1] < 0.2, "{errors:?}");
        let printed = ShakeTable::default();
        let own = AccelerationTracking::dual_loop(&printed, &measurements(0.0)).unwrap();
        let errors = [0.5, 1.0, 3.0, 8.0].map(|hertz| play(&printed, &own, hertz, 0.0).0);
        println!("{own:?}\n{errors:?}");
        assert!(errors.iter().all(|error| *error < 0.2), "{errors:?}");
        // A valve off its null moves the table until its springs answer. In closed form, for nothing
        // accelerates: x = G (offset - K k x).
        let (_, still) = play(&rig, &tuning, 1.0, 0.0);
        let (_, pushed) = play(&rig, &tuning, 1.0, 0.05);
        let own = &tuning.law.force;
        let at_rest = rig.state_space().evaluate(Complex::new(0.0, 0.0)).unwrap()[(0, 0)].re;
        let expected = at_rest * 0.05 / (1.0 + at_rest * own.gain * own.stiffness);
        let moved = pushed - still;
        assert!((moved / expected - 1.0).abs() < 0.01, "{moved} {expected}");
    }

    #[test]
    fn the_default_is_the_rules_for_the_identified_rig() {
        let tuning = AccelerationTracking::trajectory(
            &ShakeTable::default(),
            &Measurements {
                noise: [1.27e-5, 5e-3, 0.0981],
                ..measurements(0.0)
            },
        )
        .unwrap();
        assert_eq!(tuning.lead, 2);
        let (mut rule, mut own) = (tuning.law, AccelerationTracking::default());
        for law in [&mut rule, &mut own] {
            law.filter = DisplacementFilter {
                displacement_noise: 1.0,
                acceleration_noise: 1.0,
            };
        }
        for ((name, rule), (_, own)) in rule.named().into_iter().zip(own.named()) {
            assert!(
                (rule - own).abs() <= 2e-3 * rule.abs(),
                "{name}: {rule} {own}"
            );
        }
    }
}

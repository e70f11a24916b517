//! Margins of laws as they run: the code of a law in the loop with a linear rig, pushed once at the
//! valve.
//!
//! The command that follows a unit push at the valve is the impulse response of the sensitivity
//! `S = 1/(1 + L)`, whatever the law remembers, predicts or optimises, as long as no limit is met; so
//! `L = 1/S - 1` at every frequency. No model of the law is needed: a margin found here is that of
//! what runs, delays by parts of a sample included.

use std::collections::VecDeque;

use nalgebra::{Complex, DMatrix, DVector};
use plant::linear::margins::{self, Margins};
use plant::linear::{DiscreteStateSpace, StateSpace, log_space};

use crate::{ModelError, Motion};

/// What a law hears of the rig.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Heard {
    /// Motion of the table.
    pub motion: Motion,
    /// Force of the actuator, N.
    pub force: f64,
}

/// A law with its references at zero: from what is heard at a sample to the valve command (V).
pub type ValveLaw<'a> = dyn FnMut(&Heard) -> f64 + 'a;

/// A linear rig whose measurements are late.
#[derive(Debug, Clone)]
pub struct LateRig {
    sampled: DiscreteStateSpace,
    /// From the command before to the state, for a delay by a part of a sample.
    before: DVector<f64>,
    /// From the present command to the state.
    now: DVector<f64>,
    /// Whole samples.
    delay: usize,
}

impl LateRig {
    /// `rig` (first input the valve command in V; outputs displacement, velocity, acceleration,
    /// actuator force, SI) sampled every `period` s, what is measured `late` s late. The lateness
    /// is one of the loop: where in it makes no difference to margins.
    ///
    /// # Errors
    /// A lateness that is negative, or a period that is not positive.
    pub fn new(rig: &StateSpace, late: f64, period: f64) -> Result<Self, ModelError> {
        ModelError::require_positive("period", period)?;
        ModelError::require_non_negative("late", late)?;
        let mut delay = (late / period).floor();
        let mut part = late - delay * period;
        // A whole number of samples up to rounding.
        if part > (1.0 - 1e-6) * period {
            (delay, part) = (delay + 1.0, 0.0);
        }
        let sampled = rig.sample(period);
        // Held over [0, part) is the command before, over [part, period) the present one.
        let rest = rig.sample(period - part);
        let now = rest.b.column(0).into_owned();
        let before = sampled.b.column(0) - &now;
        Ok(Self {
            sampled,
            before,
            now,
            delay: delay as usize,
        })
    }

    /// Sampling period, s.
    pub fn period(&self) -> f64 {
        self.sampled.period
    }

    /// Responses at `omega` (rad/s) from the valve command to the outputs, the delay included;
    /// infinite at a pole.
    pub fn responses(&self, omega: f64) -> DVector<Complex<f64>> {
        let z = Complex::new(0.0, omega * self.sampled.period).exp();
        let combined = DiscreteStateSpace {
            b: DMatrix::from_columns(&[self.now.clone(), self.before.clone()]),
            d: DMatrix::zeros(self.sampled.c.nrows(), 2),
            ..self.sampled.clone()
        };
        let Some(both) = combined.evaluate(z) else {
            let infinite = Complex::new(f64::INFINITY, 0.0);
            return DVector::from_element(self.sampled.c.nrows(), infinite);
        };
        (both.column(0) + both.column(1) / z) * z.powi(-(self.delay as i32))
    }

    /// Whether static feedback of the outputs, `u = -gains y`, holds the rig.
    pub fn is_held_by(&self, gains: &[f64]) -> bool {
        let (n, line) = (self.sampled.order(), self.delay + 1);
        // The states, then the last commands, the latest first.
        let mut a = DMatrix::zeros(n + line, n + line);
        a.view_mut((0, 0), (n, n)).copy_from(&self.sampled.a);
        let mut feedback = DMatrix::zeros(1, n);
        for (gain, row) in gains.iter().zip(self.sampled.c.row_iter()) {
            feedback -= row * *gain;
        }
        if self.delay == 0 {
            let mut direct = a.view_mut((0, 0), (n, n));
            direct += &self.now * &feedback;
        } else {
            a.view_mut((0, n + self.delay - 1), (n, 1))
                .copy_from(&self.now);
        }
        a.view_mut((0, n + self.delay), (n, 1))
            .copy_from(&self.before);
        a.view_mut((n, 0), (1, n)).copy_from(&feedback);
        for i in 1..line {
            a[(n + i, n + i - 1)] = 1.0;
        }
        a.complex_eigenvalues().iter().all(|pole| pole.norm() < 1.0)
    }
}

/// The command after a unit push at the valve.
#[derive(Debug, Clone)]
pub struct Pushed {
    commands: Vec<f64>,
    period: f64,
    stable: bool,
}

/// The push, V: far from every limit.
const PUSH: f64 = 1e-3;

impl Pushed {
    /// Pushes `rig` under `law`, which is at rest, and follows it for `seconds`.
    pub fn new(rig: &LateRig, law: &mut ValveLaw<'_>, seconds: f64) -> Self {
        let period = rig.sampled.period;
        let count = ((seconds / period) as usize).max(64);
        let outputs = &rig.sampled.c;
        let mut x = DVector::zeros(rig.sampled.order());
        let mut next = x.clone();
        let mut y = DVector::zeros(outputs.nrows());
        let mut line: VecDeque<f64> = vec![0.0; rig.delay + 2].into();
        let mut commands = Vec::with_capacity(count);
        let mut stable = true;
        for k in 0..count {
            y.gemv(1.0, outputs, &x, 0.0);
            let at = |i: usize| y.get(i).copied().unwrap_or(0.0);
            let heard = Heard {
                motion: Motion {
                    displacement: at(0),
                    velocity: at(1),
                    acceleration: at(2),
                },
                force: at(3),
            };
            let push = if k == 0 { PUSH } else { 0.0 };
            let u = law(&heard) + push;
            commands.push(u / PUSH);
            if !u.is_finite() || u.abs() > 1e3 * PUSH {
                stable = false;
                break;
            }
            line.push_front(u);
            line.truncate(rig.delay + 2);
            next.gemv(1.0, &rig.sampled.a, &x, 0.0);
            next.axpy(line[rig.delay], &rig.now, 1.0);
            next.axpy(line[rig.delay + 1], &rig.before, 1.0);
            std::mem::swap(&mut x, &mut next);
        }
        stable &= has_died_out(&commands, 1e-6);
        Self {
            commands,
            period,
            stable,
        }
    }

    /// The commands that followed a unit push, as they were measured every `period` s; what stays below
    /// a hundredth is taken for noise.
    pub fn measured(commands: Vec<f64>, period: f64) -> Self {
        let bounded = commands.iter().all(|u| u.abs() < 1e3);
        Self {
            stable: bounded && has_died_out(&commands, 1e-2),
            commands,
            period,
        }
    }

    /// Whether the push died out.
    pub fn is_stable(&self) -> bool {
        self.stable
    }

    /// `S` at `omega`, rad/s.
    pub fn sensitivity(&self, omega: f64) -> Complex<f64> {
        let turn = Complex::new(0.0, -omega * self.period).exp();
        let backwards = self.commands.iter().rev();
        backwards.fold(Complex::new(0.0, 0.0), |sum, u| sum * turn + *u)
    }

    /// `L` on a grid of angular frequencies from `first` (rad/s) to the Nyquist frequency.
    pub fn open_loop(&self, first: f64) -> OpenLoop {
        let last = margins::nyquist(self.period);
        let count = 1 + ((last / first).log10() * POINTS_PER_DECADE).ceil() as usize;
        let omega = log_space(first, last, count);
        let values = omega
            .iter()
            .map(|&omega| 1.0 / self.sensitivity(omega) - 1.0)
            .collect();
        OpenLoop { omega, values }
    }
}

/// Whether a push has died out: what grows slowly has grown from the second quarter to the last.
fn has_died_out(commands: &[f64], noise: f64) -> bool {
    let quarter = commands.len().div_ceil(4).max(1);
    let largest = |part: usize| {
        let own = commands.iter().skip(part * quarter).take(quarter);
        own.fold(0.0_f64, |most, u| most.max(u.abs()))
    };
    largest(3) < largest(1).max(noise)
}

const POINTS_PER_DECADE: f64 = 120.0;

/// The open loop on a logarithmic grid.
#[derive(Debug, Clone)]
pub struct OpenLoop {
    /// rad/s, ascending.
    pub omega: Vec<f64>,
    /// The loop's response, negative feedback.
    pub values: Vec<Complex<f64>>,
}

impl OpenLoop {
    /// The response at `omega`, straight between the points of the grid.
    pub fn at(&self, omega: f64) -> Complex<f64> {
        let above = self.omega.partition_point(|own| *own < omega);
        let high = above.clamp(1, self.omega.len() - 1);
        let (a, b) = (self.omega[high - 1], self.omega[high]);
        let part = ((omega - a) / (b - a)).clamp(0.0, 1.0);
        self.values[high - 1] * (1.0 - part) + self.values[high] * part
    }

    /// Margins on the grid.
    pub fn margins(&self) -> Margins {
        let (Some(&first), Some(&last)) = (self.omega.first(), self.omega.last()) else {
            return Margins::default();
        };
        margins::margins(|omega| self.at(omega), first, last)
    }

    /// The lowest angular frequency at which the gain falls below one, rad/s.
    pub fn first_crossover(&self) -> Option<f64> {
        let (&first, &last) = (self.omega.first()?, self.omega.last()?);
        margins::crossovers(|omega| self.at(omega), first, last)
            .first()
            .copied()
    }

    /// Largest magnitude of the sensitivity `1/(1 + L)`: the inverse of the distance from the loop to
    /// the critical point.
    pub fn peak_sensitivity(&self) -> f64 {
        let distances = self.values.iter().map(|own| (own + 1.0).norm());
        1.0 / distances.fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Controller;
    use crate::loops::{Controlled, LinearLaw, Loop, Time};
    use crate::pid::{Pid, PidInput};
    use plant::identified::coupled::Rig;
    use units::constants::SAMPLING_PERIOD;

    fn pushed(late: f64, gain: f64) -> Pushed {
        let rig = Rig::default().shake_table.state_space();
        let rig = LateRig::new(&rig, late, SAMPLING_PERIOD).unwrap();
        let mut law = Pid::equation_3_6();
        law.proportional *= gain;
        law.integral *= gain;
        Pushed::new(
            &rig,
            &mut |heard| {
                let input = PidInput {
                    reference: 0.0,
                    measured: heard.motion.displacement,
                };
                law.step(&input, SAMPLING_PERIOD)
            },
            20.0,
        )
    }

    #[test]
    fn the_margins_of_a_pid_are_those_of_its_difference_equation() {
        let law = LinearLaw::pid(
            &Pid::equation_3_6(),
            Controlled::Displacement,
            SAMPLING_PERIOD,
        )
        .unwrap();
        let expected = Loop::new(&Rig::default(), law).margins(Time::Sampled, 1.0);
        let run = pushed(0.0, 1.0);
        assert!(run.is_stable());
        let got = run.open_loop(1.0).margins();
        let close = |a: Option<f64>, b: Option<f64>, by: f64| {
            let (a, b) = (a.unwrap(), b.unwrap());
            assert!((a - b).abs() < by, "{a} {b}");
        };
        close(got.crossover, expected.crossover, 0.02);
        close(got.phase_margin_deg, expected.phase_margin_deg, 0.2);
        close(got.gain_margin_db, expected.gain_margin_db, 0.02);
        // The margin is the edge of stability of the code itself.
        let margin = 10f64.powf(got.gain_margin_db.unwrap() / 20.0);
        assert!(pushed(0.0, 0.97 * margin).is_stable());
        assert!(!pushed(0.0, 1.03 * margin).is_stable());
    }

    #[test]
    fn lateness_turns_the_loop_by_its_angle_even_by_parts_of_a_sample() {
        let prompt = pushed(0.0, 1.0);
        let on_time = prompt.open_loop(5.0);
        for late in [0.0005, 0.002, 0.0047] {
            let run = pushed(late, 1.0).open_loop(5.0);
            for omega in [8.0, 30.0, 90.0] {
                let turn = (run.at(omega) / on_time.at(omega)).arg();
                assert!((turn + omega * late).abs() < 3e-3, "{late} {omega} {turn}");
            }
        }
    }
}

//! Every loop of the thesis as a linear system around the rig, opened at the valve: continuous as
//! printed, and as sampled.
//!
//! The sampled loops hold the same difference equations as the laws that the FMUs run, with the
//! plant behind a zero-order hold, so that a margin given here is a margin of what runs.

use nalgebra::{Complex, DMatrix, DVector, RowSVector, dmatrix};
use plant::identified::coupled::Rig;
use plant::linear::margins::{self, Margins};
use plant::linear::{DiscreteStateSpace, StateSpace, TransferFunction};

use crate::ModelError;
use crate::allocation::ControlAllocation;
use crate::loop_shaping::{LoopShaping, LoopShapingCoefficients, Section};
use crate::pid::Pid;
use crate::sliding_mode::SlidingMode;
use crate::three_variable::ThreeVariableGains;

/// What a law may listen to, in this order: measured displacement, velocity, acceleration, actuator
/// force and specimen acceleration; reference displacement, velocity and acceleration, the first of
/// which is the reference force in the force loop.
type Signals = RowSVector<f64, 8>;

const MEASURED: usize = 5;
const SPECIMEN_ACCELERATION: usize = 4;

/// Which signal of the rig a loop makes follow its reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Controlled {
    /// The table's displacement in m; references come with their derivatives.
    Displacement = 0,
    /// The actuator's force in N.
    Force = 3,
}

/// A dynamic part of a law: one combination of signals through a transfer function.
#[derive(Debug, Clone)]
struct Channel {
    signals: Signals,
    continuous: StateSpace,
    sampled: DiscreteStateSpace,
}

/// A linear law in continuous time and as sampled.
#[derive(Debug, Clone)]
pub struct LinearLaw {
    controlled: Controlled,
    direct: Signals,
    channels: Vec<Channel>,
    period: f64,
}

/// Rig and law with the loop opened at the valve.
#[derive(Debug, Clone)]
pub struct Loop {
    plant: StateSpace,
    sampled_plant: DiscreteStateSpace,
    law: LinearLaw,
}

/// Continuous time, or sampled with the plant's input held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Time {
    /// The law runs continuously.
    Continuous,
    /// The law runs once a period.
    Sampled,
}

impl LinearLaw {
    /// Displacement or force PID without its derivative part (Eq 3-6, 3-7).
    ///
    /// # Errors
    /// A derivative gain, or a period that is not positive.
    pub fn pid(pid: &Pid, controlled: Controlled, period: f64) -> Result<Self, ModelError> {
        let mut error = Signals::zeros();
        error[MEASURED] = 1.0;
        error[controlled as usize] = -1.0;
        Ok(Self {
            controlled,
            direct: Signals::zeros(),
            channels: vec![proportional_integral(pid, error, 1.0, period)?],
            period,
        })
    }

    /// A controller of the form of Eq 3-10.
    ///
    /// # Errors
    /// Coefficients with which there is none.
    pub fn loop_shaping(
        coefficients: &LoopShapingCoefficients,
        period: f64,
    ) -> Result<Self, ModelError> {
        coefficients.validate()?;
        let LoopShapingCoefficients {
            gain,
            numerator_rate: n1,
            numerator_constant: n0,
            pole: p,
        } = *coefficients;
        let continuous = TransferFunction::new(&[gain, gain * n1, gain * n0], &[1.0, p, 0.0])?
            .to_state_space()?;
        // Memory (error, lag, integral) of the law as it runs.
        let (half, damping) = (0.5 * period, 1.0 / (1.0 + 0.5 * period * p));
        let lag = [half * damping, (1.0 - half * p) * damping, half * damping];
        let integral = gain * n0 * half;
        let a = dmatrix![
            0.0, 0.0, 0.0;
            lag[0], lag[1], 0.0;
            integral * lag[0], integral * (lag[1] + 1.0), 1.0
        ];
        let b = dmatrix![1.0; lag[2]; integral * lag[2]];
        let to_command = dmatrix![0.0, gain * (n1 - p), 1.0];
        let sampled = DiscreteStateSpace::new(
            a.clone(),
            b.clone(),
            &to_command * a,
            &to_command * b + dmatrix![gain],
            period,
        )?;
        let mut error = Signals::zeros();
        error[MEASURED] = 1.0;
        error[0] = -1.0;
        Ok(Self {
            controlled: Controlled::Displacement,
            direct: Signals::zeros(),
            channels: vec![Channel {
                signals: error,
                continuous,
                sampled,
            }],
            period,
        })
    }

    /// A controller of the form of Eq 3-10 with its further sections.
    ///
    /// # Errors
    /// Coefficients with which there is none.
    pub fn shaped(law: &LoopShaping, period: f64) -> Result<Self, ModelError> {
        let mut whole = Self::loop_shaping(&law.coefficients, period)?;
        for section in law.sections.iter().filter(|section| !section.is_one()) {
            section.validate()?;
            let Section { b2, b1, a2, a1 } = *section;
            let continuous =
                TransferFunction::new(&[b2, b1, 1.0], &[a2, a1, 1.0])?.to_state_space()?;
            let (b, a) = section.sampled(period);
            // The transposed second direct form, as the law runs.
            let sampled = DiscreteStateSpace::new(
                dmatrix![-a[0], 1.0; -a[1], 0.0],
                dmatrix![b[1] - a[0] * b[0]; b[2] - a[1] * b[0]],
                dmatrix![1.0, 0.0],
                dmatrix![b[0]],
                period,
            )?;
            for channel in &mut whole.channels {
                channel.continuous = in_series(&continuous, &channel.continuous);
                let first = as_continuous(&sampled);
                let both = in_series(&first, &as_continuous(&channel.sampled));
                channel.sampled = DiscreteStateSpace::new(both.a, both.b, both.c, both.d, period)?;
            }
        }
        Ok(whole)
    }

    /// Three-variable control (Fig 3-5).
    ///
    /// # Errors
    /// A period that is not positive.
    pub fn three_variable(gains: &ThreeVariableGains, period: f64) -> Result<Self, ModelError> {
        let (reference, feedback) = gains.reference_and_feedback();
        let mut direct = Signals::zeros();
        for i in 0..3 {
            direct[MEASURED + i] = reference[i];
            direct[i] = -feedback[i];
        }
        let mut error = Signals::zeros();
        error[MEASURED] = 1.0;
        error[0] = -1.0;
        let integral = Pid {
            proportional: 0.0,
            integral: gains.integral,
            ..Pid::equation_3_6()
        };
        Ok(Self {
            controlled: Controlled::Displacement,
            direct,
            channels: vec![proportional_integral(&integral, error, 1.0, period)?],
            period,
        })
    }

    /// The hierarchy of Fig 4-3: sliding mode over a displacement and a force loop.
    ///
    /// # Errors
    /// A derivative gain, or a period that is not positive.
    pub fn hierarchy(
        sliding: &SlidingMode,
        displacement: &Pid,
        force: &Pid,
        allocation: &ControlAllocation,
        period: f64,
    ) -> Result<Self, ModelError> {
        let stiffness = sliding.table.stiffness;
        let [restoring, velocity, acceleration] = sliding.error_gains();
        let printed = sliding.table.mass * sliding.surface_rate * sliding.reaching_rate;
        let mut displacement_error = Signals::zeros();
        displacement_error[MEASURED] = printed / stiffness;
        displacement_error[0] = -printed / stiffness;

        let mut force_error = Signals::zeros();
        force_error[MEASURED] = restoring;
        force_error[0] = stiffness - restoring;
        force_error[MEASURED + 1] = velocity;
        force_error[1] = sliding.table.damping - velocity;
        force_error[MEASURED + 2] = acceleration;
        force_error[SPECIMEN_ACCELERATION] = sliding.specimen_mass;
        force_error[Controlled::Force as usize] = -1.0;
        let (alpha, beta) = (allocation.displacement_share, allocation.force_share);
        Ok(Self {
            controlled: Controlled::Displacement,
            direct: Signals::zeros(),
            channels: vec![
                proportional_integral(displacement, displacement_error, alpha, period)?,
                proportional_integral(force, force_error, beta, period)?,
            ],
            period,
        })
    }
}

/// The matrices alone: joining systems does not ask what time is.
fn as_continuous(system: &DiscreteStateSpace) -> StateSpace {
    StateSpace {
        a: system.a.clone(),
        b: system.b.clone(),
        c: system.c.clone(),
        d: system.d.clone(),
    }
}

/// `second` behind `first`, one input and one output each.
fn in_series(first: &StateSpace, second: &StateSpace) -> StateSpace {
    let (n, m) = (first.order(), second.order());
    let mut a = DMatrix::zeros(n + m, n + m);
    a.view_mut((0, 0), (n, n)).copy_from(&first.a);
    a.view_mut((n, 0), (m, n))
        .copy_from(&(&second.b * &first.c));
    a.view_mut((n, n), (m, m)).copy_from(&second.a);
    let mut b = DMatrix::zeros(n + m, 1);
    b.rows_mut(0, n).copy_from(&first.b);
    b.rows_mut(n, m).copy_from(&(&second.b * &first.d));
    let mut c = DMatrix::zeros(1, n + m);
    c.columns_mut(0, n).copy_from(&(&second.d * &first.c));
    c.columns_mut(n, m).copy_from(&second.c);
    StateSpace {
        a,
        b,
        c,
        d: &second.d * &first.d,
    }
}

/// `share (P + I / (s + leak))` on the error `signals`.
fn proportional_integral(
    pid: &Pid,
    signals: Signals,
    share: f64,
    period: f64,
) -> Result<Channel, ModelError> {
    if pid.derivative != 0.0 {
        return Err(ModelError::Parameter {
            name: "derivative_gain",
            value: pid.derivative,
            expected: "zero in a loop that is analysed",
        });
    }
    ModelError::require_positive("period", period)?;
    let kept = (-pid.integral_leak * period).exp();
    let (p, i) = (share * pid.proportional, share * pid.integral);
    Ok(Channel {
        signals,
        continuous: StateSpace::new(
            dmatrix![-pid.integral_leak],
            dmatrix![i],
            dmatrix![1.0],
            dmatrix![p],
        )?,
        sampled: DiscreteStateSpace::new(
            dmatrix![kept],
            dmatrix![i * period],
            dmatrix![kept],
            dmatrix![p + i * period],
            period,
        )?,
    })
}

impl Loop {
    /// Joins a rig and a law.
    pub fn new(rig: &Rig, law: LinearLaw) -> Self {
        // Without a specimen the rig's last two states and its specimen signals are idle.
        let full = rig.state_space();
        let order = if rig.specimen.is_some() { 7 } else { 5 };
        let mut c = DMatrix::zeros(MEASURED, order);
        for (row, output) in [0, 1, 2, 3, 6].into_iter().enumerate() {
            c.row_mut(row)
                .copy_from(&full.c.view((output, 0), (1, order)));
        }
        let plant = StateSpace {
            a: full.a.view((0, 0), (order, order)).into_owned(),
            b: full.b.rows(0, order).into_owned(),
            c,
            d: DMatrix::zeros(MEASURED, 1),
        };
        Self {
            sampled_plant: plant.sample(law.period),
            plant,
            law,
        }
    }

    /// The open loop's response at `omega` (rad/s): minus the command that comes back for a valve
    /// command of one. Infinite where `omega` meets a pole.
    pub fn open(&self, time: Time, omega: f64) -> Complex<f64> {
        let Some((plant, law)) = self.responses(time, omega) else {
            return Complex::new(f64::INFINITY, 0.0);
        };
        let mut returned = Complex::new(0.0, 0.0);
        for i in 0..MEASURED {
            returned -= law[i] * plant[i];
        }
        returned
    }

    /// Response at `omega` (rad/s) of the controlled signal to its reference, with the reference's
    /// derivatives given to the laws that use them.
    pub fn closed(&self, time: Time, omega: f64) -> Complex<f64> {
        let Some((plant, law)) = self.responses(time, omega) else {
            return Complex::new(f64::NAN, f64::NAN);
        };
        let rate = Complex::new(0.0, omega);
        let command = match self.law.controlled {
            Controlled::Displacement => {
                law[MEASURED] + rate * (law[MEASURED + 1] + rate * law[MEASURED + 2])
            }
            Controlled::Force => law[MEASURED],
        };
        plant[self.law.controlled as usize] * command / (1.0 + self.open(time, omega))
    }

    /// Responses at `omega` from valve command to the measured signals, and from all signals to the
    /// valve command.
    fn responses(&self, time: Time, omega: f64) -> Option<Responses> {
        let s = Complex::new(0.0, omega);
        let z = (s * self.law.period).exp();
        let plant = match time {
            Time::Continuous => self.plant.evaluate(s)?,
            Time::Sampled => self.sampled_plant.evaluate(z)?,
        };
        let mut law = [Complex::new(0.0, 0.0); 8];
        for (value, &direct) in law.iter_mut().zip(self.law.direct.iter()) {
            *value += direct;
        }
        for channel in &self.law.channels {
            let response = match time {
                Time::Continuous => channel.continuous.evaluate(s)?,
                Time::Sampled => channel.sampled.evaluate(z)?,
            }[(0, 0)];
            for (value, &weight) in law.iter_mut().zip(channel.signals.iter()) {
                *value += response * weight;
            }
        }
        Some((plant, law))
    }

    /// Poles of the closed loop: 1/s in continuous time, in the z plane as sampled.
    pub fn closed_loop_poles(&self, time: Time) -> DVector<Complex<f64>> {
        let (a, b, c) = match time {
            Time::Continuous => (&self.plant.a, &self.plant.b, &self.plant.c),
            Time::Sampled => (
                &self.sampled_plant.a,
                &self.sampled_plant.b,
                &self.sampled_plant.c,
            ),
        };
        let n = a.nrows();
        let measured = |signals: &Signals| {
            DMatrix::from_row_slice(1, MEASURED, &signals.as_slice()[..MEASURED])
        };
        let memory: usize = self
            .law
            .channels
            .iter()
            .map(|channel| channel.continuous_or_sampled(time).0.nrows())
            .sum();
        let mut closed = DMatrix::zeros(n + memory, n + memory);
        let mut command = DMatrix::zeros(1, n + memory);
        command
            .view_mut((0, 0), (1, n))
            .copy_from(&(measured(&self.law.direct) * c));
        let mut at = n;
        for channel in &self.law.channels {
            let (ac, bc, cc, dc) = channel.continuous_or_sampled(time);
            let heard = measured(&channel.signals) * c;
            let order = ac.nrows();
            closed.view_mut((at, at), (order, order)).copy_from(ac);
            closed
                .view_mut((at, 0), (order, n))
                .copy_from(&(bc * &heard));
            command.view_mut((0, at), (1, order)).copy_from(cc);
            let mut direct = command.view_mut((0, 0), (1, n));
            direct += heard * dc[(0, 0)];
            at += order;
        }
        let mut plant_rows = closed.view_mut((0, 0), (n, n));
        plant_rows += a;
        let mut plant_rows = closed.rows_mut(0, n);
        plant_rows += b * command;
        closed.complex_eigenvalues()
    }

    /// True when every closed-loop pole decays.
    pub fn is_stable(&self, time: Time) -> bool {
        self.closed_loop_poles(time).iter().all(|pole| match time {
            Time::Continuous => pole.re < 0.0,
            Time::Sampled => pole.norm() < 1.0,
        })
    }

    /// Margins between `first` (rad/s) and the Nyquist frequency, in continuous time a hundred
    /// times beyond it.
    pub fn margins(&self, time: Time, first: f64) -> Margins {
        margins::margins(|omega| self.open(time, omega), first, self.last(time))
    }

    /// Every crossover from `first` (rad/s) upwards, ascending.
    pub fn crossovers(&self, time: Time, first: f64) -> Vec<f64> {
        margins::crossovers(|omega| self.open(time, omega), first, self.last(time))
    }

    /// Bandwidth of the closed loop in rad/s: see [`margins::bandwidth`].
    pub fn bandwidth(&self, time: Time, lowest: f64, first: f64) -> Option<f64> {
        let closed = |omega| self.closed(time, omega);
        margins::bandwidth(closed, lowest, first, self.last(time))
    }

    fn last(&self, time: Time) -> f64 {
        let nyquist = margins::nyquist(self.law.period);
        match time {
            Time::Continuous => 1e2 * nyquist,
            Time::Sampled => nyquist,
        }
    }
}

type Responses = (DMatrix<Complex<f64>>, [Complex<f64>; 8]);
type Matrices<'a> = (
    &'a DMatrix<f64>,
    &'a DMatrix<f64>,
    &'a DMatrix<f64>,
    &'a DMatrix<f64>,
);

impl Channel {
    fn continuous_or_sampled(&self, time: Time) -> Matrices<'_> {
        match time {
            Time::Continuous => {
                let s = &self.continuous;
                (&s.a, &s.b, &s.c, &s.d)
            }
            Time::Sampled => {
                let s = &self.sampled;
                (&s.a, &s.b, &s.c, &s.d)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loop_shaping::LoopShaping;
    use crate::pid::PidInput;
    use crate::three_variable::{ThreeVariableControl, ThreeVariableInput};
    use crate::{Controller, Motion};

    const PERIOD: f64 = 0.002;

    /// Signals without regularity, from -1 to 1.
    fn signals(samples: usize) -> Vec<Signals> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 23) - 1.0
        };
        let rows = (0..samples).map(|_| Signals::from_fn(|_, _| next()));
        rows.collect()
    }

    /// The commands of a linear law as sampled.
    fn commands(law: &LinearLaw, signals: &[Signals]) -> Vec<f64> {
        let of = |channel: &Channel| channel.sampled.order();
        let mut states: Vec<_> = law
            .channels
            .iter()
            .map(|own| DVector::zeros(of(own)))
            .collect();
        let step = |row: &Signals| {
            let mut command = row.dot(&law.direct);
            for (channel, state) in law.channels.iter().zip(&mut states) {
                let (own, input) = (&channel.sampled, row.dot(&channel.signals));
                command += (&own.c * &*state)[0] + own.d[0] * input;
                *state = &own.a * &*state + own.b.column(0) * input;
            }
            command
        };
        signals.iter().map(step).collect()
    }

    fn assert_same(law: &LinearLaw, runs: &mut dyn FnMut(&Signals) -> f64) {
        let signals = signals(200);
        for (k, (command, row)) in commands(law, &signals).iter().zip(&signals).enumerate() {
            let expected = runs(row);
            let size = expected.abs().max(1.0);
            assert!(
                (command - expected).abs() < 1e-9 * size,
                "sample {k}: {command} {expected}"
            );
        }
    }

    fn motion(row: &Signals, first: usize) -> Motion {
        Motion {
            displacement: row[first],
            velocity: row[first + 1],
            acceleration: row[first + 2],
        }
    }

    #[test]
    fn a_sampled_loop_is_the_law_that_runs() {
        let mut pid = Pid {
            integral: 300.0,
            integral_leak: 40.0,
            derivative: 0.0,
            limit: 1e12,
            ..Pid::equation_3_6()
        };
        for controlled in [Controlled::Displacement, Controlled::Force] {
            pid.reset();
            let law = LinearLaw::pid(&pid, controlled, PERIOD).unwrap();
            assert_same(&law, &mut |row| {
                let input = PidInput {
                    reference: row[MEASURED],
                    measured: row[controlled as usize],
                };
                pid.step(&input, PERIOD)
            });
        }
        let mut shaped = LoopShaping {
            limit: 1e12,
            ..LoopShaping::default()
        };
        shaped.sections[0] = Section {
            b2: 1e-4,
            b1: 3e-3,
            a2: 4e-4,
            a1: 1e-2,
        };
        let law = LinearLaw::shaped(&shaped, PERIOD).unwrap();
        assert_same(&law, &mut |row| {
            let input = PidInput {
                reference: row[MEASURED],
                measured: row[0],
            };
            shaped.step(&input, PERIOD)
        });
        let gains = ThreeVariableGains {
            integral: 50.0,
            ..ThreeVariableGains::table_3_2()
        };
        let law = LinearLaw::three_variable(&gains, PERIOD).unwrap();
        let mut runs = ThreeVariableControl {
            gains,
            limit: 1e12,
            integral: 0.0,
        };
        assert_same(&law, &mut |row| {
            let input = ThreeVariableInput {
                reference: motion(row, MEASURED),
                measured: motion(row, 0),
            };
            runs.step(&input, PERIOD)
        });
    }

    #[test]
    fn a_continuous_loop_is_the_printed_one() {
        let pid = Pid {
            integral: 300.0,
            integral_leak: 40.0,
            derivative: 0.0,
            ..Pid::equation_3_6()
        };
        let law = LinearLaw::pid(&pid, Controlled::Displacement, PERIOD).unwrap();
        for omega in [1.0, 40.0, 300.0] {
            let s = Complex::new(0.0, omega);
            let found = law.channels[0].continuous.evaluate(s).unwrap()[(0, 0)];
            let expected = pid.proportional + pid.integral / (s + pid.integral_leak);
            assert!((found / expected - 1.0).norm() < 1e-12, "{omega} rad/s");
        }
        let told = |pid: &Pid, period| {
            let law = LinearLaw::pid(pid, Controlled::Displacement, period);
            law.unwrap_err().to_string()
        };
        let derivative = Pid {
            derivative: 1.0,
            ..pid
        };
        assert!(told(&derivative, PERIOD).contains("derivative_gain"));
        assert!(told(&pid, 0.0).contains("period"));
    }
}

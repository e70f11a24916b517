//! Rates of sliding mode, and force loop and rates for a rig with late measurements, by stated rules.

use nalgebra::DVector;
use plant::identified::coupled::Rig;
use plant::identified::shake_table::ShakeTable;
use plant::linear::StateSpace;
use plant::linear::margins::{crossovers, nyquist};

use crate::allocation::{ControlAllocation, LoopCommands};
use crate::hierarchy::{SlidingModeInput, force_loop};
use crate::loops::{Controlled, LinearLaw, Loop, Time};
use crate::pid::{Pid, PidInput};
use crate::prediction_over_delay::PredictionOverDelay;
use crate::sliding_mode::SlidingMode;
use crate::{Controller, ModelError, Motion};

/// The hierarchy of Fig 4-3 around a linear rig: what a stability margin is asked of.
#[derive(Debug, Clone)]
pub struct Hierarchy<'a> {
    /// What is moved: input valve command (V); outputs displacement, velocity, acceleration and
    /// actuator force, SI.
    pub rig: &'a StateSpace,
    /// The model in the law's prediction.
    pub model: &'a ShakeTable,
    /// Displacement loop.
    pub displacement: Pid,
    /// Samples by which measurements are late.
    pub delay: usize,
    /// Sampling period, s.
    pub period: f64,
}

/// What the rule chooses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlidingModeTuning {
    /// Force loop.
    pub force: Pid,
    /// `lambda = K`, 1/s.
    pub rate: f64,
}

/// Displacement, velocity and actuator force, SI.
type Measured = [f64; 3];

/// Crossover of the force loop over the rates of the sliding mode.
const SEPARATION: f64 = 10.0;
/// The gain margin that the rule leaves, 6 dB.
const MARGIN: f64 = 2.0;
/// Rates over those of [`rate_by_rule`]: a fifth of the force loop's crossover, the lower end of what
/// is usual between the loops of a cascade. What the closeness costs is part of the margin.
const RATES: f64 = 2.0;
/// A gain that no loop of this size reaches, V: the margins are those of loops without limits.
const UNLIMITED: f64 = 1e12;

impl Hierarchy<'_> {
    /// The largest gain of the force loop, in its printed ratio of proportional to integral, with
    /// which the hierarchy keeps a gain margin of 6 dB at the valve, while `lambda = K` are a fifth
    /// of that force loop's crossover.
    ///
    /// # Errors
    /// A rig with which no force loop down to a hundredth of the printed gain keeps that margin.
    pub fn tuned(&self) -> Result<SlidingModeTuning, ModelError> {
        // Too weak a force loop has no margin either: search from above.
        let mut part = 2.0;
        while part > 0.01 {
            // One without crossover or prediction is no candidate.
            if let Ok(tuning) = self.with_part(part)
                && self.is_stable(&tuning, MARGIN)?
            {
                return Ok(tuning);
            }
            part *= 0.98;
        }
        Err(ModelError::NoSolution {
            equation: "the rule for the force loop under sliding mode",
            reason: "none of its gains gives the hierarchy a margin of 6 dB".into(),
        })
    }

    /// The force loop with `part` of its printed gain, and the rates that belong to it.
    fn with_part(&self, part: f64) -> Result<SlidingModeTuning, ModelError> {
        let allocation = ControlAllocation::default();
        let mut force = force_loop(&allocation);
        force.proportional *= part;
        force.integral *= part;
        let rig = Rig {
            shake_table: *self.model,
            specimen: None,
        };
        let rate = rate_by_rule(&rig, &force, allocation.force_share, self.period)?;
        Ok(SlidingModeTuning {
            force,
            rate: RATES * rate,
        })
    }

    /// Whether the laws as they run, the valve's command times `gain`, bring the rig to rest.
    ///
    /// # Errors
    /// Laws that cannot run.
    pub fn is_stable(&self, tuning: &SlidingModeTuning, gain: f64) -> Result<bool, ModelError> {
        let sampled = self.rig.sample(self.period);
        let mut x = DVector::zeros(sampled.order());
        self.comes_to_rest(tuning, gain, &mut |u| {
            x = &sampled.a * &x + sampled.b.column(0) * u;
            let y = &sampled.c * &x;
            [y[0], y[1], y[3]]
        })
    }

    /// As [`Self::is_stable`] on whatever `rig` is: it is given the command of a sample (V) and
    /// gives what is measured at the next one.
    fn comes_to_rest(
        &self,
        tuning: &SlidingModeTuning,
        gain: f64,
        rig: &mut dyn FnMut(f64) -> Measured,
    ) -> Result<bool, ModelError> {
        const SECONDS: f64 = 2.0;
        const PUSH: f64 = 0.1;
        let mut allocation = ControlAllocation {
            limit: UNLIMITED,
            ..ControlAllocation::default()
        };
        let (mut displacement, mut force) = (self.displacement, tuning.force);
        (displacement.limit, force.limit) = (UNLIMITED, UNLIMITED);
        let mut law = SlidingMode::new(self.model.table, 0.0, tuning.rate, tuning.rate);
        if self.delay > 0 {
            let mut prediction = PredictionOverDelay::new(self.model, self.period, self.delay, 0)?;
            prediction.reference_ahead = true;
            prediction.displacement_loop = displacement;
            prediction.force_loop = force;
            prediction.allocation = allocation;
            law.prediction = Some(prediction);
        }
        let mut late = vec![[0.0; 3]; self.delay + 1];
        let count = (SECONDS / self.period) as usize;
        // Largest command in each quarter of the time.
        let mut largest = [0.0_f64; 4];
        for k in 0..count {
            let [at, velocity, measured_force] = late[self.delay];
            let input = SlidingModeInput {
                measured: Motion {
                    displacement: at,
                    velocity,
                    acceleration: 0.0,
                },
                measured_force,
                ..SlidingModeInput::default()
            };
            let references = law.step(&input, self.period);
            let to_displacement = PidInput {
                reference: references.displacement,
                measured: at,
            };
            let to_force = PidInput {
                reference: references.force,
                measured: measured_force,
            };
            let commands = LoopCommands {
                displacement_loop: displacement.step(&to_displacement, self.period),
                force_loop: force.step(&to_force, self.period),
            };
            let push = if k == 0 { PUSH } else { 0.0 };
            let u = gain * allocation.step(&commands, self.period) + push;
            if !u.is_finite() || u.abs() > 1e3 {
                return Ok(false);
            }
            let quarter = &mut largest[4 * k / count];
            *quarter = quarter.max(u.abs());
            late.rotate_right(1);
            late[0] = rig(u);
        }
        Ok(largest[3] < largest[1])
    }
}

/// `lambda = K` in 1/s: a tenth of the highest crossover of the force loop that runs with
/// `force_share` of the valve, sampled with `period`.
///
/// # Errors
/// A loop that never has a gain of one.
pub fn rate_by_rule(
    rig: &Rig,
    force: &Pid,
    force_share: f64,
    period: f64,
) -> Result<f64, ModelError> {
    let shared = Pid {
        proportional: force.proportional * force_share,
        integral: force.integral * force_share,
        ..*force
    };
    let law = LinearLaw::pid(&shared, Controlled::Force, period)?;
    let force_loop = Loop::new(rig, law);
    crossovers(
        |omega| force_loop.open(Time::Sampled, omega),
        1.0,
        nyquist(period),
    )
    .last()
    .map(|crossover| crossover / SEPARATION)
    .ok_or(ModelError::NoSolution {
        equation: "the rule for surface_rate and reaching_rate",
        reason: "the force loop has no crossover".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::known_rig::fitted;
    use super::*;
    use crate::hierarchy::DISPLACEMENT_INTEGRAL_LEAK;
    use crate::three_variable::ThreeVariableGains;
    use plant::servo_hydraulic::{SealFriction, ServoHydraulicInput, ServoHydraulicTable};
    use units::constants::SAMPLING_PERIOD as PERIOD;

    #[test]
    fn the_margin_is_6_db_on_the_linear_and_on_the_whole_rig() {
        let table = ServoHydraulicTable::default();
        let (rig, model) = (table.linearised(), fitted(&table));
        let gains = ThreeVariableGains::tuned(&model, 1, PERIOD).unwrap();
        let printed = Pid::equation_3_6();
        let displacement = Pid {
            integral_leak: DISPLACEMENT_INTEGRAL_LEAK,
            proportional: gains.proportional,
            integral: printed.integral * gains.proportional / printed.proportional,
            ..printed
        };
        let hierarchy = Hierarchy {
            rig: &rig,
            model: &model,
            displacement,
            delay: 1,
            period: PERIOD,
        };
        let tuning = hierarchy.tuned().unwrap();
        println!(
            "force loop {:.3} of the printed one, lambda = K = {:.1} 1/s",
            tuning.force.proportional / Pid::equation_3_7().proportional,
            tuning.rate
        );
        // The linearised rig, then the nonlinear one with sliding seals, pushed a little.
        let sliding = ServoHydraulicTable {
            friction: SealFriction::viscous_only(table.friction.viscous),
            ..table
        };
        for (gain, holds) in [(1.0, true), (0.96 * MARGIN, true), (1.06 * MARGIN, false)] {
            assert_eq!(hierarchy.is_stable(&tuning, gain).unwrap(), holds, "{gain}");
            let mut state = sliding.rest();
            let mut whole = |valve_command: f64| {
                let input = ServoHydraulicInput {
                    valve_command,
                    ..ServoHydraulicInput::default()
                };
                state = sliding.advance(&state, &input, PERIOD);
                let force = sliding.actuator_force(&state);
                [state.displacement, state.velocity, force]
            };
            let rest = hierarchy.comes_to_rest(&tuning, gain, &mut whole).unwrap();
            assert_eq!(rest, holds, "{gain} on the whole rig");
        }
        // The printed force loop and rates, made for another plant without delay, do not hold it.
        let printed = SlidingModeTuning {
            force: force_loop(&ControlAllocation::default()),
            rate: crate::sliding_mode::IDENTIFIED_RATE,
        };
        assert!(!hierarchy.is_stable(&printed, 1.0).unwrap());
    }

    #[test]
    fn rates_are_a_tenth_of_the_crossover_of_the_force_loop_with_its_share_of_the_valve() {
        let rig = Rig::default();
        let force = Pid::equation_3_7();
        for share in [1.0, 0.5, 0.25] {
            let rate = rate_by_rule(&rig, &force, share, PERIOD).unwrap();
            let law = LinearLaw::pid(&force, Controlled::Force, PERIOD).unwrap();
            let open = Loop::new(&rig, law).open(Time::Sampled, SEPARATION * rate);
            assert!(
                (share * open.norm() - 1.0).abs() < 1e-3,
                "{share}: {rate} 1/s"
            );
        }
        let none = rate_by_rule(&rig, &force, 1e-9, PERIOD).unwrap_err();
        assert!(none.to_string().contains("the force loop has no crossover"));
    }
}

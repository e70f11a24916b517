//! Every controller of a rig from its model, each by its stated rule, and each as it runs.

use std::sync::OnceLock;
use units::vocabulary;

use plant::identified::coupled::Rig;
use plant::identified::shake_table::ShakeTable;
use units::Parameters as _;
use units::constants::{G, STROKE};

use super::sliding_mode::{Hierarchy, SlidingModeTuning};
use crate::allocation::{ControlAllocation, LoopCommands};
use crate::hierarchy::{DISPLACEMENT_INTEGRAL_LEAK, SlidingModeInput};
use crate::mpc::{
    ModelPredictiveControl, ModelPredictiveInput, Noise, Outlook, Parameters, Weights,
    prediction_plant,
};
use crate::pid::{Pid, PidInput};
use crate::prediction_over_delay::PredictionOverDelay;
use crate::robustness::{Heard, ValveLaw};
use crate::sliding_mode::SlidingMode;
use crate::synthesis::whole_plant::{Shaped, WholePlantDesign};
use crate::three_variable::{ThreeVariableControl, ThreeVariableGains, ThreeVariableInput};
use crate::{Controller, ModelError, Motion};

/// What is known of a rig's measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurements {
    /// Lateness behind the command's effect, s.
    pub late: f64,
    /// One standard deviation of the noise of displacement (m), velocity (m/s) and acceleration
    /// (m/s²).
    pub noise: [f64; 3],
    /// Sampling period, s.
    pub period: f64,
}

impl Measurements {
    /// The lateness in whole samples.
    pub fn delay(&self) -> usize {
        (self.late / self.period).round().max(0.0) as usize
    }
}

/// What a rule gave, once it was asked.
type Ruled<T> = OnceLock<Result<T, ModelError>>;

/// The controllers of a rig. Each is found when it is asked for, so that a rig for which one rule finds
/// none has the others.
#[derive(Debug, Clone)]
pub struct Suite {
    /// The model.
    pub rig: ShakeTable,
    /// Its measurements.
    pub measurements: Measurements,
    tuned: Ruled<ThreeVariableGains>,
    damped: Ruled<ThreeVariableGains>,
    shaped: Ruled<WholePlantDesign>,
    sliding: Ruled<SlidingModeTuning>,
}

/// A controller of a [`Suite`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Member {
    /// Displacement PID.
    DisplacementPid,
    /// Three-variable control.
    ThreeVariable,
    /// Loop shaping.
    LoopShaping,
    /// Sliding mode.
    SlidingMode,
    /// Model predictive control.
    ModelPredictive,
}

impl Member {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::DisplacementPid,
        Self::ThreeVariable,
        Self::LoopShaping,
        Self::SlidingMode,
        Self::ModelPredictive,
    ];

    /// The name of the built-in system that runs it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DisplacementPid => "displacement-pid",
            Self::ThreeVariable => "three-variable",
            Self::LoopShaping => "loop-shaping",
            Self::SlidingMode => "sliding-mode",
            Self::ModelPredictive => "mpc",
        }
    }
}

/// Velocity of one unit in the cost of model predictive control, m/s: 20 in/s.
const VELOCITY_UNIT: f64 = 0.508;

impl Suite {
    /// The controllers of `rig`.
    pub fn new(rig: &ShakeTable, measurements: &Measurements) -> Self {
        Self {
            rig: *rig,
            measurements: *measurements,
            tuned: OnceLock::new(),
            damped: OnceLock::new(),
            shaped: OnceLock::new(),
            sliding: OnceLock::new(),
        }
    }

    /// Gains of [`ThreeVariableGains::tuned`], from which other rules begin.
    fn tuned(&self) -> Result<ThreeVariableGains, ModelError> {
        let Measurements { period, .. } = self.measurements;
        let delay = self.measurements.delay();
        let find = || ThreeVariableGains::tuned(&self.rig, delay, period);
        self.tuned.get_or_init(find).clone()
    }

    /// Displacement PID: half the gain at which the sampled loop oscillates, the printed ratio of
    /// integral to proportional.
    ///
    /// # Errors
    /// A rig for which the rule finds none.
    pub fn displacement_pid(&self) -> Result<Pid, ModelError> {
        let printed = Pid::equation_3_6();
        let proportional = self.tuned()?.proportional;
        Ok(Pid {
            proportional,
            integral: printed.integral * proportional / printed.proportional,
            ..printed
        })
    }

    /// Three-variable control: [`ThreeVariableGains::damped`].
    ///
    /// # Errors
    /// A rig for which the rule finds none.
    pub fn three_variable(&self) -> Result<ThreeVariableGains, ModelError> {
        let Measurements { late, period, .. } = self.measurements;
        let find = || ThreeVariableGains::damped(&self.rig, late, period);
        self.damped.get_or_init(find).clone()
    }

    /// Loop shaping: [`Shaped::fastest`], unless another crossover was asked for.
    ///
    /// # Errors
    /// A rig for which the rule finds none.
    pub fn loop_shaping(&self) -> Result<WholePlantDesign, ModelError> {
        self.shaped.get_or_init(|| self.shaping().fastest()).clone()
    }

    fn shaping(&self) -> Shaped<'_> {
        let Measurements {
            late,
            noise,
            period,
        } = self.measurements;
        Shaped {
            rig: &self.rig,
            late,
            noise: noise[0],
            period,
        }
    }

    /// The same with another crossover of loop shaping, rad/s.
    ///
    /// # Errors
    /// A crossover that is not reached.
    pub fn with_crossover(mut self, crossover: f64) -> Result<Self, ModelError> {
        let design = self.shaping().design(crossover)?;
        self.shaped = OnceLock::from(Ok(design));
        Ok(self)
    }

    /// Displacement loop under sliding mode.
    fn displacement_loop(&self) -> Result<Pid, ModelError> {
        let allocation = ControlAllocation::default();
        Ok(Pid {
            integral_leak: DISPLACEMENT_INTEGRAL_LEAK,
            limit: allocation.limit / allocation.displacement_share,
            ..self.displacement_pid()?
        })
    }

    /// Force loop and rates of sliding mode: [`Hierarchy::tuned`].
    ///
    /// # Errors
    /// A rig for which the rule finds none.
    pub fn sliding_mode(&self) -> Result<SlidingModeTuning, ModelError> {
        let find = || {
            Hierarchy {
                rig: &self.rig.state_space(),
                model: &self.rig,
                displacement: self.displacement_loop()?,
                delay: self.measurements.delay(),
                period: self.measurements.period,
            }
            .tuned()
        };
        self.sliding.get_or_init(find).clone()
    }

    /// Model predictive control on the model, with its lateness and noise; outputs in units of the
    /// stroke, 20 in/s and 1 g.
    ///
    /// # Errors
    /// A rig for which the rule finds none.
    pub fn mpc(&self) -> Result<Parameters, ModelError> {
        let Measurements { noise, period, .. } = self.measurements;
        let mpc = Parameters {
            plant: prediction_plant(&Rig {
                shake_table: self.rig,
                specimen: None,
            }),
            low_level: ThreeVariableControl {
                gains: self.tuned()?,
                ..ThreeVariableControl::table_3_2()
            },
            period,
            weights: Weights {
                scale: [STROKE, VELOCITY_UNIT, G],
                ..Weights::TABLE_5_1
            },
            outlook: Outlook::Extrapolate,
            loop_delay_samples: self.measurements.delay(),
            noise: Noise {
                measurement: noise,
                ..Noise::default()
            },
            ..Parameters::default()
        };
        mpc.validate()?;
        Ok(mpc)
    }

    /// What a controller is set to, by the names of its component, SI; beside it the model.
    ///
    /// # Errors
    /// A rig for which its rule finds none.
    pub fn named(&self, member: Member) -> Result<Vec<(String, f64)>, ModelError> {
        let own = |all: &[(&str, f64)]| -> Vec<(String, f64)> {
            all.iter().map(|(n, v)| ((*n).to_string(), *v)).collect()
        };
        let pid = |pid: &Pid| {
            [
                (vocabulary::PROPORTIONAL_GAIN, pid.proportional),
                (vocabulary::INTEGRAL_GAIN, pid.integral),
            ]
        };
        Ok(match member {
            Member::DisplacementPid => own(&pid(&self.displacement_pid()?)),
            Member::ThreeVariable => own(&self.three_variable()?.named()),
            Member::LoopShaping => self.loop_shaping()?.law.named(),
            Member::SlidingMode => {
                let SlidingModeTuning { force, rate } = self.sliding_mode()?;
                let displacement = self.displacement_loop()?;
                own(&[
                    ("surface_rate", rate),
                    ("reaching_rate", rate),
                    (
                        "displacement_loop_proportional_gain",
                        displacement.proportional,
                    ),
                    ("displacement_loop_integral_gain", displacement.integral),
                    ("force_loop_proportional_gain", force.proportional),
                    ("force_loop_integral_gain", force.integral),
                ])
            }
            Member::ModelPredictive => {
                let mpc = self.mpc()?;
                let (noise, scale) = (mpc.noise.measurement, mpc.weights.scale);
                let mut all = own(&mpc.low_level.gains.named());
                // The sensors' noise, and outputs in units of the stroke, 20 in/s and 1 g: with the
                // printed weights on unscaled outputs displacement counts for nothing and drifts.
                all.extend(own(&[
                    (vocabulary::MEASUREMENT_NOISE[0], noise[0]),
                    (vocabulary::MEASUREMENT_NOISE[1], noise[1]),
                    (vocabulary::MEASUREMENT_NOISE[2], noise[2]),
                    (vocabulary::DISPLACEMENT_SCALE, scale[0]),
                    (vocabulary::VELOCITY_SCALE, scale[1]),
                    (vocabulary::ACCELERATION_SCALE, scale[2]),
                ]));
                all
            }
        })
    }

    /// A controller as it runs, at rest, its references at zero.
    ///
    /// # Errors
    /// A rig for which its rule finds none; parameters with which it cannot run.
    pub fn law(&self, member: Member) -> Result<Box<ValveLaw<'static>>, ModelError> {
        let period = self.measurements.period;
        let at_displacement = |heard: &Heard| PidInput {
            reference: 0.0,
            measured: heard.motion.displacement,
        };
        Ok(match member {
            Member::DisplacementPid => {
                let mut law = self.displacement_pid()?;
                law.validate()?;
                Box::new(move |heard| law.step(&at_displacement(heard), period))
            }
            Member::LoopShaping => {
                let mut law = self.loop_shaping()?.law;
                law.validate()?;
                Box::new(move |heard| law.step(&at_displacement(heard), period))
            }
            Member::ThreeVariable => {
                let mut law = ThreeVariableControl {
                    gains: self.three_variable()?,
                    ..ThreeVariableControl::table_3_2()
                };
                law.validate()?;
                Box::new(move |heard| {
                    let input = ThreeVariableInput {
                        reference: Motion::default(),
                        measured: heard.motion,
                    };
                    law.step(&input, period)
                })
            }
            Member::SlidingMode => self.hierarchy()?,
            Member::ModelPredictive => {
                let mpc = self.mpc()?;
                let mut below = mpc.low_level;
                let mut law = ModelPredictiveControl::new(mpc)?;
                Box::new(move |heard| {
                    let input = ModelPredictiveInput {
                        measured: heard.motion,
                        ..ModelPredictiveInput::default()
                    };
                    let input = ThreeVariableInput {
                        reference: law.step(&input, period),
                        measured: heard.motion,
                    };
                    below.step(&input, period)
                })
            }
        })
    }

    /// Sliding mode over its two loops.
    fn hierarchy(&self) -> Result<Box<ValveLaw<'static>>, ModelError> {
        let Measurements { period, .. } = self.measurements;
        let delay = self.measurements.delay();
        let SlidingModeTuning { mut force, rate } = self.sliding_mode()?;
        let mut allocation = ControlAllocation::default();
        let mut displacement = self.displacement_loop()?;
        let mut law = SlidingMode::new(self.rig.table, 0.0, rate, rate);
        if delay > 0 {
            let mut prediction = PredictionOverDelay::new(&self.rig, period, delay, 0)?;
            prediction.reference_ahead = true;
            prediction.displacement_loop = displacement;
            prediction.force_loop = force;
            prediction.allocation = allocation;
            law.prediction = Some(prediction);
        }
        law.validate()?;
        Ok(Box::new(move |heard| {
            let input = SlidingModeInput {
                measured: Motion {
                    acceleration: 0.0,
                    ..heard.motion
                },
                measured_force: heard.force,
                ..SlidingModeInput::default()
            };
            let references = law.step(&input, period);
            let to_displacement = PidInput {
                reference: references.displacement,
                measured: heard.motion.displacement,
            };
            let to_force = PidInput {
                reference: references.force,
                measured: heard.force,
            };
            let commands = LoopCommands {
                displacement_loop: displacement.step(&to_displacement, period),
                force_loop: force.step(&to_force, period),
            };
            allocation.step(&commands, period)
        }))
    }
}

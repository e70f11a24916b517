//! Parameters of model predictive control, with Table 5-1 as default.

use nalgebra::{DMatrix, Vector3};
use plant::identified::coupled::Rig;
use plant::linear::StateSpace;
use units::constants::{INCH, SAMPLING_PERIOD, STROKE};
use units::vocabulary;

use super::disturbance::OutputDisturbance;
use super::prediction::CHANNELS;
use crate::ModelError;
use crate::three_variable::ThreeVariableControl;

/// Longest horizon and furthest preview, samples.
pub const MAXIMUM_HORIZON: usize = 20;
/// Longest delay of either kind, samples.
pub const MAXIMUM_DELAY: usize = 4;

/// Highest order of the plant in the prediction.
pub const MAXIMUM_ORDER: usize = 10;

/// The rig as [`Parameters::plant`] wants it: inputs valve command (V) and force on the table (N).
pub fn prediction_plant(rig: &Rig) -> StateSpace {
    let rig_model = rig.state_space();
    let (_, table_input) = rig.shake_table.dynamics();
    // Without a specimen the last two states stand still.
    let n = if rig.specimen.is_some() { 7 } else { 5 };
    let per_mass = table_input[(4, 1)];
    let mut b = DMatrix::zeros(n, 2);
    b.column_mut(0).copy_from(&rig_model.b.rows(0, n));
    b[(4, 1)] = per_mass;
    let mut d = DMatrix::zeros(CHANNELS, 2);
    d[(2, 1)] = per_mass;
    if n == 7 {
        b[(6, 1)] = -per_mass;
    }
    StateSpace {
        a: rig_model.a.view((0, 0), (n, n)).into_owned(),
        b,
        c: rig_model.c.view((0, 0), (CHANNELS, n)).into_owned(),
        d,
    }
}

/// Everything the controller is built from.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    /// The plant of the prediction: inputs valve command (V) and a force on the table (N), first
    /// three outputs displacement, velocity and acceleration, which the valve command doesn't
    /// reach directly. [`prediction_plant`] makes it from a rig.
    pub plant: StateSpace,
    /// Three-variable control between this controller and the valve.
    pub low_level: ThreeVariableControl,
    /// Which loop predicts.
    pub law: LowLevelLaw,
    /// Sampling period, s.
    pub period: f64,
    /// Samples looked ahead, p.
    pub horizon: usize,
    /// Weights of the cost.
    pub weights: Weights,
    /// Soft limits of the outputs.
    pub limits: OutputLimits,
    /// What is known of the reference ahead.
    pub outlook: Outlook,
    /// Samples from the valve command to the valve.
    pub loop_delay_samples: usize,
    /// Samples from this controller's commands to three-variable control.
    pub command_delay_samples: usize,
    /// Disturbance model.
    pub disturbance: OutputDisturbance,
    /// Noise covariances of the Kalman filter.
    pub noise: Noise,
    /// Solver of the steps in which a limit is active.
    pub solver: SolverChoice,
    /// Iterations after which the solver gives up.
    pub iteration_limit: usize,
    /// Seconds after which the solver gives up; infinite for a run that can be repeated.
    pub time_limit: f64,
}

/// How three-variable control runs in the prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LowLevelLaw {
    /// Computed at the samples, as it is here.
    #[default]
    Sampled,
    /// Running continuously, as in Eq 5-5.
    Continuous,
}

/// What the controller assumes of the reference over the horizon.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Outlook {
    /// The samples ahead are given.
    #[default]
    Preview,
    /// The present sample is held.
    Hold,
    /// The acceleration goes on along its last difference, velocity and displacement follow it.
    Extrapolate,
}

/// Solver of the constrained problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SolverChoice {
    /// Dense dual active-set method, see [`super::solver::Kwik`].
    #[default]
    Kwik,
    /// Interior point method of the crate `clarabel`.
    Clarabel,
}

/// Weights of Eq 5-16 to 5-18 over displacement, velocity and acceleration.
///
/// Each error, rate and limit violation is divided by its `scale` before it is weighted. The
/// thesis's weights act on in, in/s and in/s² without scales; as one factor common to the three
/// changes nothing, they act the same on m, m/s and m/s² with scales of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Tracking, Eq 5-16.
    pub output: [f64; CHANNELS],
    /// Change of the commands from sample to sample, Eq 5-17.
    pub rate: [f64; CHANNELS],
    /// Violation of the limits, Eq 5-18.
    pub violation: f64,
    /// Unit of each channel: m, m/s, m/s².
    pub scale: [f64; CHANNELS],
}

impl Weights {
    /// Table 5-1.
    pub const TABLE_5_1: Self = Self {
        output: [5.0, 3.0, 1.0],
        rate: [0.1, 0.1, 0.1],
        violation: 5000.0,
        scale: [1.0, 1.0, 1.0],
    };

    pub(crate) fn tracking(&self) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.output[i] / self.scale[i].powi(2))
    }

    pub(crate) fn rate(&self) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.rate[i] / self.scale[i].powi(2))
    }
}

/// Soft limits on displacement (m), velocity (m/s) and acceleration (m/s²); infinite where there
/// is none. One slack softens all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputLimits {
    /// Lowest values.
    pub minimum: [f64; CHANNELS],
    /// Highest values.
    pub maximum: [f64; CHANNELS],
}

impl OutputLimits {
    /// Table 5-1: the stroke, ±1.5 in.
    pub const TABLE_5_1: Self = Self {
        minimum: [-STROKE, f64::NEG_INFINITY, f64::NEG_INFINITY],
        maximum: [STROKE, f64::INFINITY, f64::INFINITY],
    };
}

/// Standard deviations from which the Kalman filter is designed. The thesis gives none; what counts
/// is their size against the walks of Eq 5-6, beside which sensors of unit variance in in, in/s and
/// in/s² and the process are almost certain: whatever the model doesn't explain is taken for
/// disturbance within a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// White noise on the valve command, V.
    pub valve: f64,
    /// White force on the table, N.
    pub force: f64,
    /// Sensor noise: m, m/s, m/s².
    pub measurement: [f64; CHANNELS],
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            valve: 1e-3,
            force: 1.0,
            measurement: [INCH; CHANNELS],
        }
    }
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            plant: prediction_plant(&Rig::default()),
            low_level: ThreeVariableControl::table_3_2(),
            law: LowLevelLaw::Sampled,
            period: SAMPLING_PERIOD,
            horizon: 15,
            weights: Weights::TABLE_5_1,
            limits: OutputLimits::TABLE_5_1,
            outlook: Outlook::Preview,
            loop_delay_samples: 0,
            command_delay_samples: 0,
            disturbance: OutputDisturbance::equation_5_6(),
            noise: Noise::default(),
            solver: SolverChoice::Kwik,
            iteration_limit: 200,
            time_limit: f64::INFINITY,
        }
    }
}

/// The parameters' names by channel, as the FMU shows them.
const OUTPUT_WEIGHTS: [&str; CHANNELS] = [
    "displacement_weight",
    "velocity_weight",
    vocabulary::ACCELERATION_WEIGHT,
];
const RATE_WEIGHTS: [&str; CHANNELS] = [
    "displacement_rate_weight",
    "velocity_rate_weight",
    "acceleration_rate_weight",
];
const SCALES: [&str; CHANNELS] = [
    vocabulary::DISPLACEMENT_SCALE,
    vocabulary::VELOCITY_SCALE,
    vocabulary::ACCELERATION_SCALE,
];
const MINIMA: [&str; CHANNELS] = [
    "minimum_displacement",
    "minimum_velocity",
    "minimum_acceleration",
];

fn count_within(
    name: &'static str,
    value: usize,
    least: usize,
    most: usize,
    expected: &'static str,
) -> Result<(), ModelError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(ModelError::Parameter {
        name,
        value: value as f64,
        expected,
    })
}

impl Parameters {
    /// Checks the parameters.
    ///
    /// # Errors
    /// What no controller can be built from, by name.
    pub fn validate(&self) -> Result<(), ModelError> {
        crate::Controller::validate(&self.low_level)?;
        self.validate_plant()?;
        ModelError::require_positive("period", self.period)?;
        count_within(
            "prediction_horizon",
            self.horizon,
            1,
            MAXIMUM_HORIZON,
            "1 to 20 samples",
        )?;
        for (name, value) in [
            (vocabulary::LOOP_DELAY_SAMPLES, self.loop_delay_samples),
            (
                vocabulary::COMMAND_DELAY_SAMPLES,
                self.command_delay_samples,
            ),
        ] {
            count_within(name, value, 0, MAXIMUM_DELAY, "0 to 4 samples")?;
        }
        self.validate_weights()?;
        for channel in 0..CHANNELS {
            let (low, high) = (self.limits.minimum[channel], self.limits.maximum[channel]);
            if low.is_nan() || high.is_nan() || low >= high {
                return Err(ModelError::Parameter {
                    name: MINIMA[channel],
                    value: low,
                    expected: "less than the maximum of the same output",
                });
            }
        }
        self.disturbance.validate()?;
        ModelError::require_non_negative(vocabulary::VALVE_NOISE, self.noise.valve)?;
        ModelError::require_non_negative(vocabulary::FORCE_NOISE, self.noise.force)?;
        for channel in 0..CHANNELS {
            ModelError::require_positive(
                vocabulary::MEASUREMENT_NOISE[channel],
                self.noise.measurement[channel],
            )?;
        }
        if self.time_limit.is_nan() || self.time_limit <= 0.0 {
            return Err(ModelError::Parameter {
                name: vocabulary::TIME_LIMIT,
                value: self.time_limit,
                expected: "a positive number of seconds, or infinity",
            });
        }
        if self.law == LowLevelLaw::Continuous && self.loop_delay_samples > 0 {
            return Err(ModelError::Parameter {
                name: vocabulary::LOOP_DELAY_SAMPLES,
                value: self.loop_delay_samples as f64,
                expected: "0 with `continuous_law`, because Eq 5-5 has no delay",
            });
        }
        Ok(())
    }

    /// The valve's limit as the problem knows it.
    pub(crate) fn valve_limit(&self) -> Option<f64> {
        (self.law == LowLevelLaw::Sampled && self.low_level.limit.is_finite())
            .then_some(self.low_level.limit)
    }

    fn validate_plant(&self) -> Result<(), ModelError> {
        let plant = StateSpace::new(
            self.plant.a.clone(),
            self.plant.b.clone(),
            self.plant.c.clone(),
            self.plant.d.clone(),
        )?;
        let (n, inputs, outputs) = (plant.order(), plant.b.ncols(), plant.c.nrows());
        if !(2..=MAXIMUM_ORDER).contains(&n) || inputs != 2 || outputs < CHANNELS {
            return Err(ModelError::Shape {
                what: "parameter `plant`",
                expected: format!(
                    "order 2 to {MAXIMUM_ORDER}, 2 inputs, at least {CHANNELS} outputs"
                ),
                got: format!("order {n}, {inputs} inputs, {outputs} outputs"),
            });
        }
        for matrix in [&plant.a, &plant.b, &plant.c, &plant.d] {
            for &value in matrix {
                ModelError::require_finite("plant", value)?;
            }
        }
        match plant
            .d
            .view((0, 0), (CHANNELS, 1))
            .iter()
            .find(|d| **d != 0.0)
        {
            Some(&value) => Err(ModelError::Parameter {
                name: "plant",
                value,
                expected: "no direct path from the valve command to the motion",
            }),
            None => Ok(()),
        }
    }

    fn validate_weights(&self) -> Result<(), ModelError> {
        let weights = &self.weights;
        for channel in 0..CHANNELS {
            ModelError::require_positive(OUTPUT_WEIGHTS[channel], weights.output[channel])?;
            ModelError::require_positive(RATE_WEIGHTS[channel], weights.rate[channel])?;
            ModelError::require_positive(SCALES[channel], weights.scale[channel])?;
        }
        ModelError::require_positive("violation_weight", weights.violation)
    }
}

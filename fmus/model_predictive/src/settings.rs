//! The parameters of the FMU and what the controller is built from.

use controllers::mpc::disturbance::OutputDisturbance;
use controllers::mpc::{
    LowLevelLaw, Noise, Outlook, OutputLimits, Parameters, SolverChoice, Weights, prediction_plant,
};
use controllers::three_variable::ThreeVariableControl;
use fmu_kit::{Enumeration, Item, Variable};
use plant::ModelError;
use plant::identified::coupled::Rig;
use plant::identified::shake_table::ShakeTable;
use plant::specimens::linear::LinearSpecimen;
use serde::{Deserialize, Serialize};
use units::vocabulary;
use units::vocabulary::{
    COMMAND_DELAY_SAMPLES, LOOP_DELAY_SAMPLES, MEASUREMENT_NOISE, SPECIMEN_DAMPING, SPECIMEN_MASS,
    SPECIMEN_STIFFNESS,
};

use crate::ModelPredictive;

/// Limits of this size, in m, m/s and m/s², are none.
const NO_LIMIT: [f64; 3] = [1e3, 1e3, 1e5];

/// The choices of `solver`.
pub const SOLVERS: Enumeration = Enumeration {
    name: "Solver",
    items: &[
        Item {
            name: "kwik",
            value: 1,
            description: "Dense dual active-set method",
        },
        Item {
            name: "clarabel",
            value: 2,
            description: "Interior point method; allocates",
        },
    ],
};

/// All parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    shake_table: ShakeTable,
    specimen: LinearSpecimen,
    specimen_in_model: bool,
    low_level: ThreeVariableControl,
    continuous_law: bool,
    prediction_horizon: i32,
    output_weights: [f64; 3],
    rate_weights: [f64; 3],
    violation_weight: f64,
    scales: [f64; 3],
    minimum: [f64; 3],
    maximum: [f64; 3],
    preview: bool,
    extrapolate: bool,
    loop_delay_samples: i32,
    command_delay_samples: i32,
    disturbance: OutputDisturbance,
    valve_noise: f64,
    force_noise: f64,
    measurement_noise: [f64; 3],
    pub(crate) solver: i32,
    iteration_limit: i32,
    time_limit: f64,
}

impl Default for Settings {
    fn default() -> Self {
        let p = Parameters::default();
        let limit =
            |bounds: [f64; 3]| std::array::from_fn(|i| bounds[i].clamp(-NO_LIMIT[i], NO_LIMIT[i]));
        Self {
            shake_table: ShakeTable::default(),
            specimen: LinearSpecimen::default(),
            specimen_in_model: false,
            low_level: p.low_level,
            continuous_law: false,
            prediction_horizon: 15,
            output_weights: p.weights.output,
            rate_weights: p.weights.rate,
            violation_weight: p.weights.violation,
            scales: p.weights.scale,
            minimum: limit(p.limits.minimum),
            maximum: limit(p.limits.maximum),
            preview: false,
            extrapolate: true,
            loop_delay_samples: 0,
            command_delay_samples: 0,
            disturbance: p.disturbance,
            valve_noise: p.noise.valve,
            force_noise: p.noise.force,
            measurement_noise: p.noise.measurement,
            solver: 1,
            iteration_limit: 200,
            time_limit: 0.0,
        }
    }
}

impl Settings {
    /// What the controller is built from; refuses negative counts by name.
    pub fn parameters(&self, period: f64) -> Result<Parameters, ModelError> {
        self.shake_table.validate()?;
        if self.specimen_in_model {
            self.specimen.validate()?;
        }
        let specimen = self.specimen_in_model.then_some(self.specimen);
        let limit = |bounds: [f64; 3]| {
            std::array::from_fn(|i| match bounds[i] {
                bound if bound.abs() >= NO_LIMIT[i] => bound.signum() * f64::INFINITY,
                bound => bound,
            })
        };
        Ok(Parameters {
            plant: prediction_plant(&Rig {
                shake_table: self.shake_table,
                specimen,
            }),
            low_level: ThreeVariableControl {
                integral: 0.0,
                ..self.low_level
            },
            law: if self.continuous_law {
                LowLevelLaw::Continuous
            } else {
                LowLevelLaw::Sampled
            },
            period,
            horizon: ModelError::count("prediction_horizon", self.prediction_horizon)?,
            weights: Weights {
                output: self.output_weights,
                rate: self.rate_weights,
                violation: self.violation_weight,
                scale: self.scales,
            },
            limits: OutputLimits {
                minimum: limit(self.minimum),
                maximum: limit(self.maximum),
            },
            outlook: match (self.preview, self.extrapolate) {
                (true, _) => Outlook::Preview,
                (false, true) => Outlook::Extrapolate,
                (false, false) => Outlook::Hold,
            },
            loop_delay_samples: ModelError::count(LOOP_DELAY_SAMPLES, self.loop_delay_samples)?,
            command_delay_samples: ModelError::count(
                COMMAND_DELAY_SAMPLES,
                self.command_delay_samples,
            )?,
            disturbance: self.disturbance,
            noise: Noise {
                valve: self.valve_noise,
                force: self.force_noise,
                measurement: self.measurement_noise,
            },
            solver: if self.solver == 2 {
                SolverChoice::Clarabel
            } else {
                SolverChoice::Kwik
            },
            iteration_limit: ModelError::count("iteration_limit", self.iteration_limit)?,
            time_limit: if self.time_limit == 0.0 {
                f64::INFINITY
            } else {
                self.time_limit
            },
        })
    }
}

/// The table's rows of the parameters.
pub fn variables() -> Vec<Variable<ModelPredictive>> {
    fmu_kit::table! { ModelPredictive, s:
        parameter("preview", s.settings.preview, "Whether the reference ahead is connected");
        parameter("extrapolate", s.settings.extrapolate, "Without preview: extrapolate the reference instead of holding it");
        parameter("prediction_horizon", s.settings.prediction_horizon, "Samples looked ahead, Table 5-1").min(1.0).max(20.0);
        parameter(LOOP_DELAY_SAMPLES, s.settings.loop_delay_samples, "Samples from three-variable control to the valve").min(0.0).max(4.0);
        parameter(COMMAND_DELAY_SAMPLES, s.settings.command_delay_samples, "Samples from here to three-variable control").min(0.0).max(4.0);
        parameter("continuous_law", s.settings.continuous_law, "Predict with three-variable control running continuously, Eq 5-5");
        parameter("displacement_weight", s.settings.output_weights[0], "w_disp of Eq 5-16, Table 5-1");
        parameter("velocity_weight", s.settings.output_weights[1], "w_vel of Eq 5-16, Table 5-1");
        parameter(vocabulary::ACCELERATION_WEIGHT, s.settings.output_weights[2], "w_acc of Eq 5-16, Table 5-1");
        parameter("displacement_rate_weight", s.settings.rate_weights[0], "w_delta_disp of Eq 5-17, Table 5-1");
        parameter("velocity_rate_weight", s.settings.rate_weights[1], "w_delta_vel of Eq 5-17, Table 5-1");
        parameter("acceleration_rate_weight", s.settings.rate_weights[2], "w_delta_acc of Eq 5-17, Table 5-1");
        parameter("violation_weight", s.settings.violation_weight, "rho of Eq 5-18, Table 5-1");
        parameter(vocabulary::DISPLACEMENT_SCALE, s.settings.scales[0], "Unit of displacement in the cost", "m" => "in");
        parameter(vocabulary::VELOCITY_SCALE, s.settings.scales[1], "Unit of velocity in the cost", "m/s" => "in/s");
        parameter(vocabulary::ACCELERATION_SCALE, s.settings.scales[2], "Unit of acceleration in the cost", "m/s2" => "g");
        parameter("minimum_displacement", s.settings.minimum[0], "Soft limit, Table 5-1", "m" => "in");
        parameter("maximum_displacement", s.settings.maximum[0], "Soft limit, Table 5-1", "m" => "in");
        parameter("minimum_velocity", s.settings.minimum[1], "Soft limit", "m/s" => "in/s");
        parameter("maximum_velocity", s.settings.maximum[1], "Soft limit", "m/s" => "in/s");
        parameter("minimum_acceleration", s.settings.minimum[2], "Soft limit", "m/s2" => "g");
        parameter("maximum_acceleration", s.settings.maximum[2], "Soft limit", "m/s2" => "g");
        parameter("iteration_limit", s.settings.iteration_limit, "Iterations after which the solver gives up").min(0.0);
        parameter(vocabulary::TIME_LIMIT, s.settings.time_limit, "Time after which the solver gives up; 0: none", "s");
        parameter(vocabulary::VALVE_NOISE, s.settings.valve_noise, "Standard deviation of the noise on the valve command", "V");
        parameter(vocabulary::FORCE_NOISE, s.settings.force_noise, "Standard deviation of the force on the table", "N" => "lbf");
        parameter(MEASUREMENT_NOISE[0], s.settings.measurement_noise[0], "Standard deviation of the sensor", "m" => "in");
        parameter(MEASUREMENT_NOISE[1], s.settings.measurement_noise[1], "Standard deviation of the sensor", "m/s" => "in/s");
        parameter(MEASUREMENT_NOISE[2], s.settings.measurement_noise[2], "Standard deviation of the sensor", "m/s2" => "g");
        parameter("disturbance_input_gain[1]", s.settings.disturbance.input[0], "B_d of Eq 5-6, displacement");
        parameter("disturbance_input_gain[2]", s.settings.disturbance.input[1], "B_d of Eq 5-6, velocity");
        parameter("disturbance_input_gain[3]", s.settings.disturbance.input[2], "B_d of Eq 5-6, acceleration");
        parameter("disturbance_output_gain[1]", s.settings.disturbance.output[0], "C_d of Eq 5-6, displacement", "m" => "in");
        parameter("disturbance_output_gain[2]", s.settings.disturbance.output[1], "C_d of Eq 5-6, velocity", "m/s" => "in/s");
        parameter("disturbance_output_gain[3]", s.settings.disturbance.output[2], "C_d of Eq 5-6, acceleration", "m/s2" => "g");
        group(s.settings.low_level);
        parameter("specimen_in_model", s.settings.specimen_in_model, "Whether the prediction knows the specimen");
        parameter(SPECIMEN_MASS, s.settings.specimen.mass, "Mass of the specimen", "kg" => "lbf.s2/in");
        parameter(SPECIMEN_DAMPING, s.settings.specimen.damping, "Viscous damping of the specimen", "N.s/m" => "lbf.s/in");
        parameter(SPECIMEN_STIFFNESS, s.settings.specimen.stiffness, "Stiffness of the specimen", "N/m" => "lbf/in");
        group(s.settings.shake_table.table);
        group(s.settings.shake_table.actuator);
    }
}

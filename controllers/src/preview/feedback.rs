//! Linear quadratic Gaussian feedback on what is left (Eq 5-1 to 5-4): states by a Kalman filter from
//! late measurements, with a force on the table and an offset of the valve as disturbances.

use nalgebra::{DMatrix, DVector, RowSVector, SMatrix, SVector};
use plant::linear::{DiscreteStateSpace, discrete_riccati};
use units::{Parameters, vocabulary};

use super::model::{OUTPUTS, STATES, SampledRig};
use crate::ModelError;
use crate::mpc::kalman::SteadyStateKalmanFilter;

/// Most samples by which measurements may be late.
pub const MAXIMUM_DELAY: usize = 4;
/// Disturbances: force on the table (N), offset of the valve (V).
pub const DISTURBANCES: usize = 2;
/// What is estimated.
pub const ALL: usize = STATES + DISTURBANCES;
/// Part of the unknown force that is left after a sample: what lasts for seconds is the valve's, from
/// which a constant force cannot be told.
const FORCE_LEFT: f64 = 0.999;

/// What the noise of a sensor is.
const NOISE: &str = "Standard deviation of the sensor";

/// What the filter takes to be uncertain: one standard deviation each.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct Uncertainty {
    /// Displacement (m), velocity (m/s) and acceleration (m/s²) as measured.
    #[parameter(0, name = vocabulary::MEASUREMENT_NOISE[0], about = NOISE, "m" => "in", positive)]
    #[parameter(1, name = vocabulary::MEASUREMENT_NOISE[1], about = NOISE, "m/s" => "in/s", positive)]
    #[parameter(2, name = vocabulary::MEASUREMENT_NOISE[2], about = NOISE, "m/s2" => "g", positive)]
    pub measurement: [f64; OUTPUTS],
    /// Standard deviation of white noise on the valve command, V.
    #[parameter("V", name = vocabulary::VALVE_NOISE, non_negative)]
    pub valve: f64,
    /// Standard deviation of white noise of the force on the table, N.
    #[parameter("N" => "lbf", name = vocabulary::FORCE_NOISE, non_negative)]
    pub force: f64,
    /// Standard deviation of the unknown force's step a sample, N.
    #[parameter("N" => "lbf", positive)]
    pub force_step: f64,
    /// Standard deviation of the step of the valve's offset a sample, V.
    #[parameter("V", positive)]
    pub offset_step: f64,
}

impl Uncertainty {
    /// Checks the deviations.
    ///
    /// # Errors
    /// Names the first that no filter is built from.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }
}

/// Feedback of the states' distance from where they should be, and the filter that gives them.
#[derive(Debug, Clone, PartialEq)]
pub struct Feedback {
    gain: RowSVector<f64, STATES>,
    /// States and command with which a disturbance leaves the displacement where it is.
    target: SMatrix<f64, STATES, DISTURBANCES>,
    target_command: RowSVector<f64, DISTURBANCES>,
    transition: SMatrix<f64, ALL, ALL>,
    output: SMatrix<f64, OUTPUTS, ALL>,
    correction: SMatrix<f64, ALL, OUTPUTS>,
    delay: usize,
}

/// What the feedback remembers.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct FeedbackState {
    /// States and disturbances at the sample that is measured now, before it is.
    prediction: [f64; ALL],
    /// Commands since then, the oldest first, V.
    commands: [f64; MAXIMUM_DELAY],
    /// Known forces from then to now, N.
    forces: [f64; MAXIMUM_DELAY + 1],
}

impl Feedback {
    /// Minimises the sum of `|W y|²` and `(w u)²` for measurements `delay` samples late.
    ///
    /// # Errors
    /// A Riccati equation without a stabilising solution; a rig whose displacement no command holds.
    pub fn new(
        rig: &SampledRig,
        weights: &SVector<f64, OUTPUTS>,
        command_weight: f64,
        uncertainty: &Uncertainty,
        delay: usize,
    ) -> Result<Self, ModelError> {
        let a = DMatrix::from_fn(STATES, STATES, |i, j| rig.a[(i, j)]);
        let b = DMatrix::from_fn(STATES, 1, |i, _| rig.b[i]);
        let c = SMatrix::<f64, OUTPUTS, OUTPUTS>::from_diagonal(weights) * rig.c;
        let square = c.transpose() * c;
        let q = DMatrix::from_fn(STATES, STATES, |i, j| square[(i, j)]);
        let r = DMatrix::from_element(1, 1, command_weight * command_weight);
        let p = discrete_riccati(&a, &b, &q, &r)?;
        let weighted = b.transpose() * &p;
        let gain = &weighted * &a / (r[(0, 0)] + (&weighted * &b)[(0, 0)]);

        let force = rig.from + rig.to;
        let mut transition = SMatrix::<f64, ALL, ALL>::identity();
        transition
            .fixed_view_mut::<STATES, STATES>(0, 0)
            .copy_from(&rig.a);
        transition
            .fixed_view_mut::<STATES, 1>(0, STATES)
            .copy_from(&force);
        transition
            .fixed_view_mut::<STATES, 1>(0, STATES + 1)
            .copy_from(&rig.b);
        transition[(STATES, STATES)] = FORCE_LEFT;
        let mut output = SMatrix::<f64, OUTPUTS, ALL>::zeros();
        output
            .fixed_view_mut::<OUTPUTS, STATES>(0, 0)
            .copy_from(&rig.c);
        output
            .fixed_view_mut::<OUTPUTS, 1>(0, STATES)
            .copy_from(&rig.d);

        let mut noise = rig.b * rig.b.transpose() * uncertainty.valve.powi(2);
        noise += force * force.transpose() * uncertainty.force.powi(2);
        let mut q = DMatrix::zeros(ALL, ALL);
        q.view_mut((0, 0), (STATES, STATES)).copy_from(&noise);
        q[(STATES, STATES)] = uncertainty.force_step.powi(2);
        q[(STATES + 1, STATES + 1)] = uncertainty.offset_step.powi(2);
        let r = DMatrix::from_diagonal(&DVector::from_fn(OUTPUTS, |i, _| {
            uncertainty.measurement[i].powi(2)
        }));
        let filter = SteadyStateKalmanFilter::new(
            &DMatrix::from_fn(ALL, ALL, |i, j| transition[(i, j)]),
            &DMatrix::from_fn(OUTPUTS, ALL, |i, j| output[(i, j)]),
            &q,
            &r,
        )?;
        let (target, target_command) = targets(rig)?;
        Ok(Self {
            gain: RowSVector::from_fn(|_, j| gain[(0, j)]),
            target,
            target_command,
            transition,
            output,
            correction: SMatrix::from_fn(|i, j| filter.gain[(i, j)]),
            delay: delay.min(MAXIMUM_DELAY),
        })
    }

    /// States and disturbances now, from what is `measured` now; `force` is the known one now (N).
    pub fn estimate(
        &self,
        state: &mut FeedbackState,
        rig: &SampledRig,
        measured: &SVector<f64, OUTPUTS>,
        force: f64,
    ) -> SVector<f64, ALL> {
        state.forces[self.delay] = force;
        let mut estimate = SVector::<f64, ALL>::from(state.prediction);
        let innovation = measured - self.output * estimate - rig.d * state.forces[0];
        estimate += self.correction * innovation;
        state.prediction = estimate.into();
        for (i, sent) in state.commands[..self.delay].iter().enumerate() {
            estimate = self.advance(
                rig,
                &estimate,
                *sent,
                [state.forces[i], state.forces[i + 1]],
            );
        }
        estimate
    }

    /// Command (V) that brings the rig to the model's state `x` under the model's `command`, from
    /// what is `measured` now; `force` is the known one now (N).
    pub fn command(
        &self,
        state: &mut FeedbackState,
        rig: &SampledRig,
        x: &SVector<f64, STATES>,
        command: f64,
        measured: &SVector<f64, OUTPUTS>,
        force: f64,
    ) -> f64 {
        let estimate = self.estimate(state, rig, measured, force);
        let own = estimate.fixed_rows::<STATES>(0);
        let disturbances = estimate.fixed_rows::<DISTURBANCES>(STATES);
        let wanted = x + self.target * disturbances;
        command + (self.target_command * disturbances)[0] + (self.gain * (wanted - own))[0]
    }

    /// Takes note of the command (V) that was sent and of the known force at the next sample (N).
    pub fn sent(&self, state: &mut FeedbackState, rig: &SampledRig, command: f64, force: f64) {
        let second = if self.delay == 0 {
            force
        } else {
            state.forces[1]
        };
        let oldest = if self.delay == 0 {
            command
        } else {
            state.commands[0]
        };
        let estimate = SVector::from(state.prediction);
        state.prediction = self
            .advance(rig, &estimate, oldest, [state.forces[0], second])
            .into();
        if self.delay > 0 {
            state.commands.rotate_left(1);
            state.commands[self.delay - 1] = command;
            state.forces.rotate_left(1);
        }
        state.forces[self.delay] = force;
    }

    /// States and disturbances a sample later under `command` (V) and known forces (N) at both ends.
    pub fn advance(
        &self,
        rig: &SampledRig,
        estimate: &SVector<f64, ALL>,
        command: f64,
        [from, to]: [f64; 2],
    ) -> SVector<f64, ALL> {
        let mut next = self.transition * estimate;
        let mut own = next.fixed_rows_mut::<STATES>(0);
        own += rig.b * command + rig.from * from + rig.to * to;
        next
    }

    /// Largest magnitude of the poles of `plant` (valve command to what is measured) under this
    /// feedback, which takes it for `rig`, with its commands times `gain` and the measurements `late`
    /// samples late: below one the plant comes to rest.
    pub fn slowest_pole(
        &self,
        rig: &SampledRig,
        plant: &DiscreteStateSpace,
        gain: f64,
        late: usize,
    ) -> f64 {
        // The loop is linear: its transition, one basis vector after the other.
        let states = plant.order();
        let late = late.min(MAXIMUM_DELAY + 1);
        let order = states * (late + 1) + ALL + self.delay;
        let rest = SVector::zeros();
        let columns: Vec<DVector<f64>> = (0..order)
            .map(|basis| {
                let mut unit = DVector::zeros(order);
                unit[basis] = 1.0;
                let line = |age: usize| unit.rows(age * states, states).into_owned();
                let filter = states * (late + 1);
                let mut state = FeedbackState {
                    prediction: std::array::from_fn(|i| unit[filter + i]),
                    ..FeedbackState::default()
                };
                for i in 0..self.delay {
                    state.commands[i] = unit[filter + ALL + i];
                }
                let measured = &plant.c * line(late);
                let measured = SVector::from_fn(|i, _| measured[i]);
                let u = self.command(&mut state, rig, &rest, 0.0, &measured, 0.0);
                self.sent(&mut state, rig, u, 0.0);
                let mut next = DVector::zeros(order);
                next.rows_mut(0, states)
                    .copy_from(&(&plant.a * line(0) + plant.b.column(0) * (gain * u)));
                for age in 0..late {
                    next.rows_mut((age + 1) * states, states)
                        .copy_from(&line(age));
                }
                for i in 0..ALL {
                    next[filter + i] = state.prediction[i];
                }
                for i in 0..self.delay {
                    next[filter + ALL + i] = state.commands[i];
                }
                next
            })
            .collect();
        let mut transition = DMatrix::from_columns(&columns);
        // The states differ by orders of magnitude, and the slowest poles lie next to one.
        nalgebra::linalg::balancing::balance_parlett_reinsch(&mut transition);
        let poles = transition.complex_eigenvalues();
        poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max)
    }

    /// Whether `plant` keeps a gain margin (a factor) up and down under this feedback, and bears
    /// measurements that are one sample later than it knows.
    pub fn is_robust(&self, rig: &SampledRig, plant: &DiscreteStateSpace, margin: f64) -> bool {
        let holds = |gain, late| self.slowest_pole(rig, plant, gain, late) < 1.0;
        [1.0 / margin, 1.0, margin]
            .iter()
            .all(|gain| holds(*gain, self.delay))
            && holds(1.0, self.delay + 1)
    }
}

/// States and command at which the displacement stays zero while a disturbance lasts or fades (the
/// regulator equation `X S = A X + B U + E`, `C X = 0`), per disturbance.
fn targets(
    rig: &SampledRig,
) -> Result<
    (
        SMatrix<f64, STATES, DISTURBANCES>,
        RowSVector<f64, DISTURBANCES>,
    ),
    ModelError,
> {
    let mut m = SMatrix::<f64, { STATES + 1 }, { STATES + 1 }>::zeros();
    m.fixed_view_mut::<STATES, STATES>(0, 0)
        .copy_from(&(SMatrix::<f64, STATES, STATES>::identity() * FORCE_LEFT - rig.a));
    m.fixed_view_mut::<STATES, 1>(0, STATES).copy_from(&-rig.b);
    m.fixed_view_mut::<1, STATES>(STATES, 0)
        .copy_from(&rig.c.row(0));
    let mut right = SMatrix::<f64, { STATES + 1 }, 1>::zeros();
    right
        .fixed_rows_mut::<STATES>(0)
        .copy_from(&(rig.from + rig.to));
    let solution = m.lu().solve(&right).ok_or(ModelError::NoSolution {
        equation: "the rig at rest under a force",
        reason: "no valve command holds the displacement".into(),
    })?;
    let mut states = SMatrix::<f64, STATES, DISTURBANCES>::zeros();
    states
        .fixed_view_mut::<STATES, 1>(0, 0)
        .copy_from(&solution.fixed_rows::<STATES>(0));
    // An offset of the valve is taken off the command.
    Ok((states, RowSVector::from([[solution[STATES]], [-1.0]])))
}

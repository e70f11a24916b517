//! Prediction model: the plant under three-variable control, as it is sampled here or as in
//! Eq 5-5, and what its outputs do over the horizon (Eq 5-12, 5-13).

use nalgebra::{DMatrix, DVector, RowDVector, RowVector3, SymmetricEigen, Vector3};
use plant::linear::StateSpace;

use crate::ModelError;
use crate::three_variable::ThreeVariableGains;

/// Most rotations of the search for the prediction's singular directions.
const MOST_ROTATIONS: usize = 100_000;

/// Inputs of the loop and outputs of the plant: displacement, velocity, acceleration.
pub const CHANNELS: usize = 3;

/// The loop from the commands `[rd, rv, ra]` to the measured motion, sampled; the output
/// disturbances are its last three states.
///
/// `s[k+1] = A s[k] + B r[k]`, `y[k] = C s[k]`; SI.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopModel {
    /// Transition, n x n.
    pub a: DMatrix<f64>,
    /// Commands, n x 3.
    pub b: DMatrix<f64>,
    /// Measured motion, 3 x n.
    pub c: DMatrix<f64>,
    /// What enters beside the commands, n x 2: an error of the valve command (V) and a force on
    /// the table (N), each held over the sample.
    pub aside: DMatrix<f64>,
    /// Index of three-variable control's integral among the states.
    pub integral_state: usize,
    /// Samples by which the valve is late.
    pub delay: usize,
    valve: Option<ValvePath>,
}

/// How commands reach the plant through its one valve.
#[derive(Debug, Clone, PartialEq)]
struct ValvePath {
    /// Motion that three-variable control sees, 3 x n.
    motion: DMatrix<f64>,
    /// Transition with the valve command as input instead of three-variable control.
    open_a: DMatrix<f64>,
    /// The valve command, n x 1.
    open_b: DMatrix<f64>,
    /// Feedback of the measured motion, the sample's integral included.
    feedback: RowVector3<f64>,
    /// Gains of the commands, the sample's integral included.
    command: RowVector3<f64>,
    /// Integral gain times period.
    integral: f64,
}

impl LoopModel {
    /// The loop as it is sampled: the plant's inputs held over each period, and the law as
    /// [`crate::three_variable::ThreeVariableControl`] computes it from the motion at the sample.
    /// The valve moves `delay` samples after its command.
    ///
    /// `plant` has inputs valve command (V) and force on the table (N), and first three outputs
    /// displacement, velocity, acceleration. States: the plant's, the `delay` commands on their
    /// way (oldest first), the integral, the three output disturbances. As in Eq 5-7 the
    /// disturbances act behind the loop.
    pub fn sampled(
        plant: &StateSpace,
        gains: &ThreeVariableGains,
        delay: usize,
        period: f64,
    ) -> Self {
        let plant = plant.sample(period);
        let n = plant.order();
        let (integral_state, disturbance) = (n + delay, n + delay + 1);
        let size = disturbance + CHANNELS;
        let integral = gains.integral * period;

        let mut motion = DMatrix::zeros(CHANNELS, size);
        motion
            .columns_mut(0, n)
            .copy_from(&plant.c.rows(0, CHANNELS));
        let mut open_a = DMatrix::identity(size, size);
        let mut open_b = DMatrix::zeros(size, 1);
        open_a.view_mut((0, 0), (n, n)).copy_from(&plant.a);
        if delay == 0 {
            open_b.rows_mut(0, n).copy_from(&plant.b.columns(0, 1));
        } else {
            open_a
                .view_mut((0, n), (n, 1))
                .copy_from(&plant.b.columns(0, 1));
            let mut line = open_a.view_mut((n, n), (delay, delay));
            line.fill(0.0);
            for i in 1..delay {
                line[(i - 1, i)] = 1.0;
            }
            open_b[(n + delay - 1, 0)] = 1.0;
        }

        let (k, l) = gains.reference_and_feedback();
        let (mut command, mut feedback) = (RowVector3::from(k), RowVector3::from(l));
        command[0] += integral;
        feedback[0] += integral;
        let mut law: RowDVector<f64> = -feedback * &motion;
        law[integral_state] += 1.0;
        let mut a = &open_a + &open_b * &law;
        let mut b = DMatrix::zeros(size, CHANNELS);
        b.copy_from(&(&open_b * command));
        let mut integral_row = a.row_mut(integral_state);
        integral_row -= motion.row(0) * integral;
        b[(integral_state, 0)] += integral;

        let mut aside = DMatrix::zeros(size, 2);
        aside.column_mut(0).copy_from(&open_b);
        aside
            .view_mut((0, 1), (n, 1))
            .copy_from(&plant.b.columns(1, 1));
        let mut c = motion.clone();
        c.columns_mut(disturbance, CHANNELS).fill_with_identity();
        Self {
            a,
            b,
            c,
            aside,
            integral_state,
            delay,
            valve: Some(ValvePath {
                motion,
                open_a,
                open_b,
                feedback,
                command,
                integral,
            }),
        }
    }

    /// Eq 5-5 and 5-7: the law runs continuously between the samples of its commands.
    ///
    /// `plant` as in [`Self::sampled`]. States: the plant's, the integral, the three output
    /// disturbances.
    pub fn continuous(plant: &StateSpace, gains: &ThreeVariableGains, period: f64) -> Self {
        let sampled = continuous_loop(plant, gains).sample(period);
        let n = sampled.order();
        let mut a = DMatrix::identity(n + CHANNELS, n + CHANNELS);
        a.view_mut((0, 0), (n, n)).copy_from(&sampled.a);
        let mut inputs = DMatrix::zeros(n + CHANNELS, CHANNELS + 2);
        inputs.rows_mut(0, n).copy_from(&sampled.b);
        let mut c = DMatrix::zeros(CHANNELS, n + CHANNELS);
        c.columns_mut(0, n).copy_from(&sampled.c);
        c.columns_mut(n, CHANNELS).fill_with_identity();
        Self {
            a,
            b: inputs.columns(0, CHANNELS).into_owned(),
            c,
            aside: inputs.columns(CHANNELS, 2).into_owned(),
            integral_state: n - 1,
            delay: 0,
            valve: None,
        }
    }

    /// What three-variable control adds to its command for a measured motion that is off by the
    /// disturbance, V; `None` where the law runs continuously and there is no one valve command.
    pub fn valve_feedback(&self) -> Option<RowVector3<f64>> {
        self.valve.as_ref().map(|valve| -valve.feedback)
    }

    /// Number of states.
    pub fn order(&self) -> usize {
        self.a.nrows()
    }

    /// What the horizon of `p` samples makes of the state and of the effective valve sequence.
    ///
    /// `importance` are the weights of the three outputs in the cost; only [`Self::continuous`]
    /// needs them.
    ///
    /// # Errors
    /// A continuous law whose leading directions cannot be told.
    pub fn respond(
        &self,
        p: usize,
        importance: &Vector3<f64>,
    ) -> Result<HorizonResponse, ModelError> {
        match &self.valve {
            Some(valve) => Ok(self.respond_through_the_valve(valve, p)),
            None => self.respond_through_leading_directions(p, importance),
        }
    }

    /// Outputs `1 + delay ..= p + delay` depend on the commands only through the p valve commands
    /// `w_i = kappa r_i + xi_i - l y_i`, so in terms of `w` they are the open plant's. Written
    /// out with the integrator's path, `kappa r_i + Ki h sum_{j<i} rd_j = w_i + l y_i +
    /// Ki h sum_{j<i} x_j - xi_0`: the left side is `M z`, the right side `N w + S s`.
    fn respond_through_the_valve(&self, valve: &ValvePath, p: usize) -> HorizonResponse {
        let n = self.order();
        let last = p + self.delay;
        // Motion at samples 0 ..= last to the state and to a valve command at sample 0.
        let mut to_state = vec![valve.motion.clone()];
        let mut pulse = vec![DMatrix::zeros(CHANNELS, 1)];
        for _ in 0..last {
            let row: &DMatrix<f64> = &to_state[to_state.len() - 1];
            pulse.push(row * &valve.open_b);
            to_state.push(row * &valve.open_a);
        }
        let mut free = DMatrix::zeros(CHANNELS * p, n);
        let mut forced = DMatrix::zeros(CHANNELS * p, p);
        for i in 0..p {
            let output = i + 1 + self.delay;
            let mut rows = free.rows_mut(CHANNELS * i, CHANNELS);
            rows.copy_from(&to_state[output]);
            rows.columns_mut(n - CHANNELS, CHANNELS)
                .fill_with_identity();
            for j in 0..p.min(output) {
                forced
                    .view_mut((CHANNELS * i, j), (CHANNELS, 1))
                    .copy_from(&pulse[output - j]);
            }
        }

        let mut commands = DMatrix::zeros(p, CHANNELS * p);
        let mut sequence = DMatrix::identity(p, p);
        let mut offset = DMatrix::zeros(p, n);
        for i in 0..p {
            commands
                .view_mut((i, CHANNELS * i), (1, CHANNELS))
                .copy_from(&valve.command);
            let mut from_state = valve.feedback * &to_state[i];
            for j in 0..i {
                commands[(i, CHANNELS * j)] += valve.integral;
                sequence[(i, j)] += (valve.feedback * &pulse[i - j])[0];
                from_state += to_state[j].row(0) * valve.integral;
                for earlier in 0..j {
                    sequence[(i, earlier)] += valve.integral * pulse[j - earlier][(0, 0)];
                }
            }
            from_state[self.integral_state] -= 1.0;
            offset.row_mut(i).copy_from(&from_state);
        }
        HorizonResponse {
            free,
            forced,
            commands,
            sequence,
            offset,
        }
    }

    /// With the law running continuously the valve moves between samples too, and nothing is
    /// exactly redundant; the p leading singular directions of the tracking cost carry all but
    /// 1e-9 of it.
    fn respond_through_leading_directions(
        &self,
        p: usize,
        importance: &Vector3<f64>,
    ) -> Result<HorizonResponse, ModelError> {
        let (free, full) = self.large_response(p);
        let weight = DVector::from_fn(CHANNELS * p, |i, _| importance[i % CHANNELS].sqrt());
        let weighted = DMatrix::from_diagonal(&weight) * &full;
        // By eigenvectors: the singular value decomposition's last rotations take `hypot`, whose last bit
        // differs between versions of the system's library.
        let cost = weighted.tr_mul(&weighted);
        let Some(found) = SymmetricEigen::try_new(cost, f64::EPSILON, MOST_ROTATIONS) else {
            return Err(ModelError::NoSolution {
                equation: "the prediction's singular directions",
                reason: "they do not converge".into(),
            });
        };
        let mut order: Vec<usize> = (0..CHANNELS * p).collect();
        order.sort_by(|&i, &j| found.eigenvalues[j].total_cmp(&found.eigenvalues[i]));
        let commands = DMatrix::from_fn(p, CHANNELS * p, |i, j| found.eigenvectors[(j, order[i])]);
        Ok(HorizonResponse {
            free,
            forced: full * commands.transpose(),
            commands,
            sequence: DMatrix::identity(p, p),
            offset: DMatrix::zeros(p, self.order()),
        })
    }

    /// Outputs `1 + delay ..= p + delay` stacked: to the state (3p x n) and to all 3p commands
    /// (3p x 3p), from the closed loop step by step.
    pub fn large_response(&self, p: usize) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = self.order();
        let mut to_state = vec![self.c.clone()];
        for i in 0..p + self.delay {
            to_state.push(&to_state[i] * &self.a);
        }
        let mut free = DMatrix::zeros(CHANNELS * p, n);
        let mut forced = DMatrix::zeros(CHANNELS * p, CHANNELS * p);
        for i in 0..p {
            let output = i + 1 + self.delay;
            free.rows_mut(CHANNELS * i, CHANNELS)
                .copy_from(&to_state[output]);
            for j in 0..p.min(output) {
                forced
                    .view_mut((CHANNELS * i, CHANNELS * j), (CHANNELS, CHANNELS))
                    .copy_from(&(&to_state[output - 1 - j] * &self.b));
            }
        }
        (free, forced)
    }
}

/// `plant` (inputs valve command and force on the table, first three outputs displacement, velocity,
/// acceleration) under three-variable control running continuously: states the plant's and the
/// integral, inputs `[rd, rv, ra]`, an error of the valve command and the force.
pub fn continuous_loop(plant: &StateSpace, gains: &ThreeVariableGains) -> StateSpace {
    let n = plant.order();
    let (k, l) = gains.reference_and_feedback();
    let mut c = DMatrix::zeros(CHANNELS, n + 1);
    c.columns_mut(0, n).copy_from(&plant.c.rows(0, CHANNELS));
    let mut valve = DMatrix::zeros(n + 1, 1);
    valve.rows_mut(0, n).copy_from(&plant.b.columns(0, 1));
    let mut law: RowDVector<f64> = -RowVector3::from(l) * &c;
    law[n] += 1.0;
    let mut a = DMatrix::zeros(n + 1, n + 1);
    a.view_mut((0, 0), (n, n)).copy_from(&plant.a);
    a += &valve * law;
    a.row_mut(n).copy_from(&(c.row(0) * -gains.integral));
    let mut b = DMatrix::zeros(n + 1, CHANNELS + 2);
    b.columns_mut(0, CHANNELS)
        .copy_from(&(&valve * RowVector3::from(k)));
    b[(n, 0)] += gains.integral;
    b.view_mut((0, CHANNELS), (n, 2))
        .copy_from(&plant.b.columns(0, 2));
    StateSpace {
        a,
        b,
        c,
        d: DMatrix::zeros(CHANNELS, CHANNELS + 2),
    }
}

/// Stacked outputs `Y = free s + forced w` (3p) over the horizon and the relation of the effective
/// valve sequence `w` (p) to the stacked commands `z` (3p): `commands z = sequence w + offset s`.
#[derive(Debug, Clone, PartialEq)]
pub struct HorizonResponse {
    /// 3p x n.
    pub free: DMatrix<f64>,
    /// 3p x p.
    pub forced: DMatrix<f64>,
    /// p x 3p, of full rank.
    pub commands: DMatrix<f64>,
    /// p x p.
    pub sequence: DMatrix<f64>,
    /// p x n.
    pub offset: DMatrix<f64>,
}

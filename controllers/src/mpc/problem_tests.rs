//! The reduced problem against the 45-variable one of the thesis.

use nalgebra::{Cholesky, DMatrix, DVector, dvector};
use plant::identified::coupled::Rig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use units::constants::INCH;

use super::*;
use crate::mpc::solver::{Outcome, Solver};
use plant::linear::zero_order_hold;

/// Eq 5-14 to 5-18 over all 3p commands and the slack, written out from the closed loop.
struct LargeProblem {
    hessian: DMatrix<f64>,
    constraints: DMatrix<f64>,
    free: DMatrix<f64>,
    forced: DMatrix<f64>,
    tracking: DMatrix<f64>,
    rate: DMatrix<f64>,
    difference: DMatrix<f64>,
    violation: f64,
    limit: f64,
}

impl LargeProblem {
    /// Only displacement is limited, to both sides alike.
    fn new(control: &ModelPredictiveControl) -> Self {
        let p = control.parameters();
        let size = 3 * p.horizon;
        let (free, forced) = control.model().large_response(p.horizon);
        let diagonal = |weights: [f64; 3]| {
            DMatrix::from_diagonal(&DVector::from_fn(size, |i, _| {
                weights[i % 3] / p.weights.scale[i % 3].powi(2)
            }))
        };
        let (tracking, rate) = (diagonal(p.weights.output), diagonal(p.weights.rate));
        let mut difference = DMatrix::identity(size, size);
        for i in 3..size {
            difference[(i, i - 3)] = -1.0;
        }
        let mut hessian = DMatrix::zeros(size + 1, size + 1);
        hessian.view_mut((0, 0), (size, size)).copy_from(
            &(forced.transpose() * &tracking * &forced
                + difference.transpose() * &rate * &difference),
        );
        hessian[(size, size)] = p.weights.violation;
        let mut constraints = DMatrix::zeros(2 * p.horizon, size + 1);
        for i in 0..p.horizon {
            for (row, sign) in [(2 * i, 1.0), (2 * i + 1, -1.0)] {
                constraints
                    .view_mut((row, 0), (1, size))
                    .copy_from(&(forced.row(3 * i) * sign));
                constraints[(row, size)] = p.weights.scale[0];
            }
        }
        Self {
            hessian,
            constraints,
            free,
            forced,
            tracking,
            rate,
            difference,
            violation: p.weights.violation,
            limit: p.limits.maximum[0],
        }
    }

    fn parts<'a>(&self, given: &'a DVector<f64>) -> [nalgebra::DVectorView<'a, f64>; 3] {
        let (size, n) = (self.forced.nrows(), self.free.ncols());
        [
            given.rows(0, size),
            given.rows(size, n),
            given.rows(size + n, 3),
        ]
    }

    fn cost(&self, given: &DVector<f64>, x: &DVector<f64>) -> f64 {
        let [reference, state, previous] = self.parts(given);
        let size = self.forced.nrows();
        let z = x.rows(0, size);
        let error = reference - &self.free * state - &self.forced * z;
        let mut change = &self.difference * z;
        let mut first = change.rows_mut(0, 3);
        first -= previous;
        error.dot(&(&self.tracking * &error))
            + change.dot(&(&self.rate * &change))
            + self.violation * x[size].powi(2)
    }

    /// Optimum by `solver`-independent means where no limit is active, else by clarabel.
    fn optimum(&self, given: &DVector<f64>) -> DVector<f64> {
        let [reference, state, previous] = self.parts(given);
        let size = self.forced.nrows();
        let start = &self.free * state;
        let mut linear = DVector::zeros(size + 1);
        let mut commands = linear.rows_mut(0, size);
        commands += self.forced.transpose() * &self.tracking * (reference - &start);
        let mut before = DVector::zeros(size);
        before.rows_mut(0, 3).copy_from(&previous);
        commands += self.difference.transpose() * &self.rate * before;
        let target = Cholesky::new(self.hessian.clone()).unwrap().solve(&linear);
        let bound = DVector::from_fn(self.constraints.nrows(), |row, _| {
            let sign = if row % 2 == 0 { 1.0 } else { -1.0 };
            -self.limit - sign * start[3 * (row / 2)]
        });
        if (&self.constraints * &target - &bound).min() >= 0.0 {
            return target;
        }
        let mut x = target.clone();
        let mut solver =
            solver::Kwik::new(&self.hessian, &self.constraints, 500, f64::INFINITY).unwrap();
        let outcome = solver.nearest(&target, &bound, &mut x);
        assert!(matches!(outcome, Outcome::Solved { .. }), "{outcome:?}");
        x
    }
}

fn small_optimum(control: &mut ModelPredictiveControl, given: &DVector<f64>) -> DVector<f64> {
    control.work.given.copy_from(given);
    let found = control
        .problem
        .optimise(&mut control.work, &mut *control.solver);
    assert_ne!(found, Found::No);
    let p = control.parameters.horizon;
    DVector::from_fn(3 * p + 1, |i, _| {
        if i < 3 * p {
            control.problem.command(&control.work, i / 3)[i % 3]
        } else {
            control.work.solution[p]
        }
    })
}

#[test]
fn small_problem_has_the_optimum_of_the_large_one() {
    let seed = 5;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let unlimited = ThreeVariableControl {
        limit: 100.0,
        ..ThreeVariableControl::table_3_2()
    };
    let limit = 0.4 * INCH;
    let parameters = |scale, loop_delay_samples, solver| Parameters {
        low_level: unlimited,
        loop_delay_samples,
        solver,
        weights: Weights {
            scale,
            ..Weights::TABLE_5_1
        },
        limits: OutputLimits {
            minimum: [-limit, f64::NEG_INFINITY, f64::NEG_INFINITY],
            maximum: [limit, f64::INFINITY, f64::INFINITY],
        },
        ..Parameters::default()
    };
    let scaled = [1.5 * INCH, 20.0 * INCH, 386.4 * INCH];
    for (scale, delay, solver) in [
        ([1.0; 3], 0, SolverChoice::Kwik),
        ([1.0; 3], 2, SolverChoice::Clarabel),
        (scaled, 0, SolverChoice::Kwik),
        (scaled, 0, SolverChoice::Clarabel),
    ] {
        let mut control = ModelPredictiveControl::new(parameters(scale, delay, solver)).unwrap();
        let large = LargeProblem::new(&control);
        let (kappa, _) = control.parameters.low_level.gains.reference_and_feedback();
        let (mut worst, mut largest, mut active) = (0.0f64, 0.0f64, 0);
        for _ in 0..100 {
            // A motion about the limit, and a state and previous command near it.
            let omega = random.random_range(3.0..60.0);
            let phase: f64 = random.random_range(0.0..6.3);
            let peak = random.random_range(0.0..0.6) * INCH;
            let n = control.model.order();
            let mut given = control.work.given.clone();
            let at = |i: usize| phase + omega * H * i as f64;
            for i in 0..15 {
                given[3 * i] = peak * at(i + 1).sin();
                given[3 * i + 1] = peak * omega * at(i + 1).cos();
                given[3 * i + 2] = -peak * omega * omega * at(i + 1).sin();
            }
            let mut noise = || random.random_range(0.9..1.1);
            for j in 0..n {
                given[45 + j] = 0.0;
            }
            given[45] = 20.0 * noise();
            given[45 + 3] = peak * at(0).sin() * noise();
            given[45 + 4] = peak * omega * at(0).cos() * noise();
            given[45 + n - 1] = 0.1 * noise();
            given[45 + n] = peak * at(0).sin() * noise();
            given[45 + n + 1] = peak * omega * at(0).cos() * noise();
            given[45 + n + 2] = noise();
            let by_large = large.optimum(&given);
            let by_small = small_optimum(&mut control, &given);
            let valve = |z: &DVector<f64>| (0..3).map(|j| kappa[j] * z[j]).sum::<f64>();
            worst = worst.max((valve(&by_small) - valve(&by_large)).abs());
            largest = largest.max(valve(&by_large).abs());
            active += usize::from(by_small[45] > 1e-9);
            let (small, best) = (large.cost(&given, &by_small), large.cost(&given, &by_large));
            let gap = match solver {
                SolverChoice::Kwik => 1e-10,
                SolverChoice::Clarabel => 1e-7,
            };
            assert!(small <= best * (1.0 + gap) + 1e-15, "{small:e} {best:e}");
        }
        println!(
            "seed {seed}: {worst:e} V of {largest:.2} at most, {active} of 100 with active limits"
        );
        assert!(worst < 1e-6, "seed {seed}: {worst:e} V");
        assert!((10..90).contains(&active), "{active} active");
    }
}

#[test]
fn reduction_makes_a_well_conditioned_problem_of_rank_fifteen() {
    let control = ModelPredictiveControl::new(Parameters::default()).unwrap();
    let large = LargeProblem::new(&control);
    let values = large
        .hessian
        .view((0, 0), (45, 45))
        .into_owned()
        .symmetric_eigenvalues();
    let condition = values.max() / values.min();
    assert!((1e9..4e9).contains(&condition), "{condition:e}");
    let singular = (&large.tracking * &large.forced).singular_values();
    let rank = singular
        .iter()
        .filter(|s| **s > 1e-10 * singular.max())
        .count();
    assert_eq!(rank, 15);
    assert!(
        control.problem().condition() < 75.0,
        "{}",
        control.problem().condition()
    );

    let continuous = ModelPredictiveControl::new(Parameters {
        law: LowLevelLaw::Continuous,
        ..Parameters::default()
    })
    .unwrap();
    let condition = continuous.problem().condition();
    assert!((condition - 69.0).abs() < 1.0, "{condition}");
}

#[test]
fn sampled_prediction_is_what_plant_and_law_do() {
    let seed = 9;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for delay in [0, 1, 3] {
        let control = ModelPredictiveControl::new(Parameters {
            loop_delay_samples: delay,
            ..Parameters::default()
        })
        .unwrap();
        let model = control.model();
        let mut s = DVector::zeros(model.order());
        let (a, b) = Rig::default().shake_table.dynamics();
        let (a, b) = zero_order_hold(&a, &b, H);
        let mut x = nalgebra::SVector::<f64, 5>::zeros();
        let mut law = ThreeVariableControl::table_3_2();
        let mut line = vec![0.0; delay];
        let system = Rig::default().shake_table.state_space();
        for _ in 0..300 {
            let y = &system.c * DVector::from_column_slice(x.as_slice());
            let predicted = &model.c * &s;
            for j in 0..3 {
                let error = (predicted[j] - y[j]).abs();
                assert!(
                    error < 1e-11 * (1.0 + y[j].abs()),
                    "seed {seed}, output {j}: {error:e}"
                );
            }
            let mut draw = |size: f64| random.random_range(-size..size);
            let r = [draw(0.005), draw(0.05), draw(1.0)];
            let input = ThreeVariableInput {
                reference: Motion {
                    displacement: r[0],
                    velocity: r[1],
                    acceleration: r[2],
                },
                measured: Motion {
                    displacement: y[0],
                    velocity: y[1],
                    acceleration: y[2],
                },
            };
            let valve = push(&mut line, law.step(&input, H));
            x = a * x + b.column(0) * valve;
            s = &model.a * s + &model.b * dvector![r[0], r[1], r[2]];
        }
        assert!(law.integral != 0.0);
    }
}

const H: f64 = 0.002;

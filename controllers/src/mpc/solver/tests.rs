use nalgebra::{Cholesky, DMatrix, DVector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

struct Problem {
    hessian: DMatrix<f64>,
    constraints: DMatrix<f64>,
    target: DVector<f64>,
    bound: DVector<f64>,
}

/// Random strictly convex problem with a feasible point; the smaller `room`, the more constraints
/// are active at the optimum.
fn random_problem(random: &mut ChaCha8Rng, n: usize, m: usize, room: f64) -> Problem {
    let mut draw = |rows: usize, columns: usize| {
        DMatrix::from_fn(rows, columns, |_, _| random.random_range(-1.0..1.0))
    };
    let root = draw(n, n);
    let hessian = &root * root.transpose() + DMatrix::identity(n, n) * 0.05;
    let constraints = draw(m, n);
    let target = draw(n, 1).column(0) * 3.0;
    let feasible = draw(n, 1).column(0).into_owned();
    let gap = draw(m, 1).column(0).abs() * room;
    let bound = &constraints * feasible - gap;
    Problem {
        hessian,
        constraints,
        target,
        bound,
    }
}

fn solve(solver: &mut dyn Solver, problem: &Problem) -> (Outcome, DVector<f64>) {
    let mut x = DVector::zeros(problem.target.len());
    let outcome = solver.nearest(&problem.target, &problem.bound, &mut x);
    (outcome, x)
}

fn both(problem: &Problem) -> (Kwik, Clarabel) {
    let (h, a) = (&problem.hessian, &problem.constraints);
    (
        Kwik::new(h, a, 500, f64::INFINITY).unwrap(),
        Clarabel::new(h, a, 500, f64::INFINITY).unwrap(),
    )
}

/// The best of the minimisers over all sets of constraints held as equations that is feasible.
fn by_enumeration(problem: &Problem) -> DVector<f64> {
    let Problem {
        hessian,
        constraints,
        target,
        bound,
    } = problem;
    let (m, n) = constraints.shape();
    let inverse = Cholesky::new(hessian.clone()).unwrap().inverse();
    if (constraints * target - bound).min() >= 0.0 {
        return target.clone();
    }
    let mut best = (f64::INFINITY, target.clone());
    for set in 0..1usize << m {
        let rows: Vec<usize> = (0..m).filter(|i| set >> i & 1 == 1).collect();
        if rows.len() > n || rows.is_empty() {
            continue;
        }
        let a = constraints.select_rows(&rows);
        let missing = bound.select_rows(&rows) - &a * target;
        let Some(multipliers) = (&a * &inverse * a.transpose()).lu().solve(&missing) else {
            continue;
        };
        let step = &inverse * a.transpose() * multipliers;
        let cost = step.dot(&(hessian * &step));
        let margin = constraints * (target + &step) - bound;
        if cost < best.0 && margin.iter().all(|margin| *margin > -1e-9) {
            best = (cost, target + step);
        }
    }
    best.1
}

#[test]
fn small_problems_agree_with_all_active_sets_tried() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for case in 0..200 {
        let problem = random_problem(&mut random, 3, 7, 0.3);
        let (mut kwik, mut clarabel) = both(&problem);
        let wanted = by_enumeration(&problem);
        for solver in [&mut kwik as &mut dyn Solver, &mut clarabel] {
            let (outcome, x) = solve(solver, &problem);
            assert!(
                matches!(outcome, Outcome::Solved { .. }),
                "{case}: {outcome:?}"
            );
            let error = (&x - &wanted).amax();
            assert!(error < 1e-6, "case {case} of seed 7: {error:e}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn kwik_and_clarabel_find_the_same_optimum(
        seed in 0u64..1 << 32,
        n in 2usize..17,
        m in 1usize..61,
        room in 0.0..2.0f64,
    ) {
        let problem = random_problem(&mut ChaCha8Rng::seed_from_u64(seed), n, m, room);
        let (mut kwik, mut clarabel) = both(&problem);
        let (kwik_outcome, by_kwik) = solve(&mut kwik, &problem);
        let (clarabel_outcome, by_clarabel) = solve(&mut clarabel, &problem);
        let solved = matches!(kwik_outcome, Outcome::Solved { .. });
        prop_assert!(solved, "{:?}", kwik_outcome);
        let solved = matches!(clarabel_outcome, Outcome::Solved { .. });
        prop_assert!(solved, "{:?}", clarabel_outcome);
        // The interior point stops by its gap, 1e-8, of which a distance is the root.
        let error = (&by_kwik - &by_clarabel).amax() / (1.0 + by_kwik.amax());
        prop_assert!(error < 1e-5, "{:e}", error);
        let cost = |x: &DVector<f64>| {
            let off = x - &problem.target;
            0.5 * off.dot(&(&problem.hessian * &off))
        };
        let (ours, theirs) = (cost(&by_kwik), cost(&by_clarabel));
        prop_assert!((ours - theirs).abs() < 1e-7 * (1.0 + ours), "{:e} {:e}", ours, theirs);
        // The dual method ends on its constraints to rounding.
        let margin = &problem.constraints * &by_kwik - &problem.bound;
        prop_assert!(margin.min() > -1e-9, "{:e}", margin.min());
    }
}

#[test]
fn constraints_given_twice_do_no_harm() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    for _ in 0..50 {
        let mut problem = random_problem(&mut random, 6, 20, 0.1);
        let (mut once, _) = both(&problem);
        let (_, wanted) = solve(&mut once, &problem);
        let (a, b) = (&problem.constraints, &problem.bound);
        problem.constraints = DMatrix::from_fn(40, 6, |i, j| {
            a[(i / 2, j)] * if i % 2 == 0 { 1.0 } else { 3.0 }
        });
        problem.bound = DVector::from_fn(40, |i, _| b[i / 2] * if i % 2 == 0 { 1.0 } else { 3.0 });
        let (mut twice, _) = both(&problem);
        let (outcome, x) = solve(&mut twice, &problem);
        assert!(matches!(outcome, Outcome::Solved { .. }), "{outcome:?}");
        assert!((x - wanted).amax() < 1e-9);
    }
}

#[test]
fn what_cannot_be_met_and_what_takes_too_long_is_said() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut problem = random_problem(&mut random, 4, 2, 0.0);
    let first = problem.constraints.row(0).into_owned();
    problem.constraints.row_mut(1).copy_from(&-first);
    problem.bound = nalgebra::dvector![1.0, 1.0];
    let (mut kwik, mut clarabel) = both(&problem);
    assert_eq!(solve(&mut kwik, &problem).0, Outcome::Failed);
    assert_eq!(solve(&mut clarabel, &problem).0, Outcome::Failed);

    let problem = random_problem(&mut random, 10, 40, 0.0);
    let (h, a) = (&problem.hessian, &problem.constraints);
    let mut hurried = Kwik::new(h, a, 1, f64::INFINITY).unwrap();
    assert_eq!(solve(&mut hurried, &problem).0, Outcome::OutOfTime);
    let mut hurried = Clarabel::new(h, a, 1, f64::INFINITY).unwrap();
    assert_eq!(solve(&mut hurried, &problem).0, Outcome::OutOfTime);
    let mut hurried = Kwik::new(h, a, 1000, 1e-12).unwrap();
    assert_eq!(solve(&mut hurried, &problem).0, Outcome::OutOfTime);

    let mut broken = random_problem(&mut random, 3, 5, 0.5);
    let (mut kwik, _) = both(&broken);
    broken.target[1] = f64::NAN;
    assert_eq!(solve(&mut kwik, &broken).0, Outcome::Failed);
}

//! Runs of components that are computed here, against recurrences in closed form.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod compiled;
mod coupling;
mod kinds;
#[allow(dead_code, reason = "other tests need more")]
#[path = "../../../fmi/tests/compiled/made.rs"]
mod made;
mod moments;
mod parts;

use fmi_master::{Algorithm, Column, Ended, Ending, Plan, Samples, VariableStep};
use parts::{LOOP, RATE, RING, STEP, parts, run};

#[test]
fn a_controlled_body_decays_as_the_recurrence_of_its_order_of_calls() {
    for algorithm in [Algorithm::GaussSeidel, Algorithm::Jacobi] {
        let plan = Plan {
            algorithm,
            ..Plan::fixed(STEP, 2.0)
        };
        let outcome = run(LOOP, &mut parts(10.0), &Samples::none(STEP), &plan, 20);
        assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
        assert_eq!(outcome.record.len(), 20);
        let body = outcome.record.column("body.y").unwrap();
        assert_eq!(body[0], 1.0);
        for n in 2..19 {
            let (now, before) = (body[n], body[n - 1]);
            // In the order of dependencies the law sees this sample; all at once, the one before.
            let seen = match algorithm {
                Algorithm::Jacobi => before,
                _ => now,
            };
            let expected = now - STEP * RATE * seen;
            assert!(
                (body[n + 1] - expected).abs() < 1e-12,
                "{algorithm} {n}: {body:?}"
            );
        }
        let time = outcome.record.column("time").unwrap();
        assert!((time[19] - 1.9).abs() < 1e-12);
    }
}

#[test]
fn a_motion_is_followed_ahead_of_time_and_rests_after_its_end() {
    let text = "connections = [\"reference.displacement[1] -> body.u\"]\n[components.body]\nfmu = \"Rest\"\n";
    let values = vec![0.001, 0.004, -0.002];
    let column = |values: &[f64], after| Column {
        values: values.to_vec(),
        after,
    };
    let samples = Samples {
        period: STEP,
        columns: vec![
            column(&values, 0.003),
            column(&[0.0; 3], 0.0),
            column(&[0.0; 3], 0.0),
        ],
    };
    let outcome = run(text, &mut parts(10.0), &samples, &Plan::fixed(STEP, 0.6), 6);
    let body = outcome.record.column("body.y").unwrap();
    // A sample ahead, m as mm, and a body that takes them for m per s: the sum of the reference from its second
    // sample on.
    let mut sum = 0.0;
    for (n, value) in [0.004, -0.002, 0.003, 0.003, 0.003].into_iter().enumerate() {
        sum += STEP * value;
        assert!((body[n + 1] - sum).abs() < 1e-15, "{n}: {body:?}");
    }
}

#[test]
fn a_run_ends_with_the_component_that_fails() {
    // y = 1 + 0.1 n 0.4: above 1.1 at the third step.
    let text = "[components.body]\nfmu = \"Body\"\n[components.body.inputs]\nu = \"0.4 m\"\n";
    let outcome = run(
        text,
        &mut parts(1.1),
        &Samples::none(STEP),
        &Plan::fixed(STEP, 1.0),
        10,
    );
    assert_eq!(outcome.ended.kind(), Ending::Failed);
    assert!(matches!(outcome.ended, Ended::Failed(_)));
    let said = outcome.ended.message();
    assert!(
        said.contains("`body`") && said.contains("leaves its limit of 1.1 m"),
        "{said}"
    );
    let body = outcome.record.column("body.y").unwrap();
    let expected = [1.0, 1.04, 1.08];
    assert_eq!(body.len(), 3);
    for (value, expected) in body.iter().zip(expected) {
        assert!((value - expected).abs() < 1e-12, "{body:?}");
    }
}

#[test]
fn a_variable_step_keeps_its_tolerance_and_a_smaller_one_costs_more_steps() {
    let omega = RATE.sqrt();
    let with = |tolerance: f64| {
        let plan = Plan {
            algorithm: Algorithm::GaussSeidel,
            step: STEP,
            stop: 4.0,
            variable: Some(VariableStep {
                tolerance,
                least: Some(STEP / 1024.0),
            }),
        };
        let outcome = run(RING, &mut parts(10.0), &Samples::none(STEP), &plan, 40);
        assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
        let x = outcome.record.column("x.y").unwrap();
        let errors = x
            .iter()
            .enumerate()
            .map(|(n, x)| (x - (omega * STEP * n as f64).cos()).abs());
        (
            outcome.steps,
            errors.fold(0.0, f64::max),
            outcome.variable.unwrap(),
        )
    };
    let (coarse, coarse_error, _) = with(0.05);
    let (fine, fine_error, taken) = with(0.0005);
    assert!(fine > 2 * coarse, "{fine} {coarse}");
    assert!(fine_error < coarse_error, "{fine_error} {coarse_error}");
    assert!((taken.tolerance_percent - 0.05).abs() < 1e-12);
    assert!(taken.shortest_s >= taken.least_s && taken.longest_s <= taken.greatest_s);
    assert!(taken.worst_percent <= 0.05 || taken.over > 0, "{taken:?}");
}

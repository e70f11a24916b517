//! Table and specimen coupled as FMUs against the same rig as one model, both under the same
//! controller sampled at 2 ms; only the coupling step varies.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::path::Path;

use acceptance::monolithic::{table_acceleration, table_acceleration_under, worst_error};
use acceptance::shared;
use fmi_master::{Algorithm, Ended};
use laboratory::run::experiment::{Prepared, Request, prepare};
use laboratory::run::refinement::refine;
use plant::identified::shake_table::ShakeTable;
use plant::specimens::linear::LinearSpecimen;

fn request(record: Option<&Path>, specimen: &str, step: f64) -> Prepared {
    let request = Request {
        specimen: specimen.to_string(),
        record: record.map(Path::to_path_buf),
        step_s: Some(step),
        ..Request::built_in("three-variable")
    };
    prepare(&request).unwrap()
}

fn coupled(prepared: &Prepared, algorithm: Algorithm) -> Vec<f64> {
    let outcome = prepared.run(algorithm).unwrap();
    assert!(
        matches!(outcome.ended, Ended::Complete),
        "{}",
        outcome.ended.message()
    );
    outcome.record.column("table.acceleration").unwrap()
}

/// Errors for coupling steps of 2, 1, 0.5 and 0.25 ms and the orders between them.
fn convergence(algorithm: Algorithm) -> (Vec<f64>, Vec<f64>) {
    let steps = [0.002, 0.001, 0.0005, 0.00025];
    let errors: Vec<f64> = steps
        .iter()
        .map(|&step| {
            let prepared = request(None, "linear", step);
            let truth = table_acceleration(&prepared.motion, true);
            worst_error(&truth, &coupled(&prepared, algorithm))
        })
        .collect();
    let orders = errors
        .windows(2)
        .map(|pair| (pair[0] / pair[1]).log2())
        .collect();
    println!("{algorithm}: errors {errors:?}, orders {orders:?}");
    (errors, orders)
}

#[needs::shared("records")]
#[test]
fn coupling_at_2_ms_errs_by_less_than_2_percent_of_the_peak_for_every_record() {
    let mut errors = Vec::new();
    for record in shared::records() {
        let prepared = request(Some(&record), "linear", 0.002);
        let truth = table_acceleration(&prepared.motion, true);
        let error = worst_error(&truth, &coupled(&prepared, Algorithm::GaussSeidel));
        println!("{}: {:.2} %", prepared.motion.name, 100.0 * error);
        errors.push((prepared.motion.name.clone(), error));
    }
    for (name, error) in errors {
        // Without any error it would not be a coupling.
        assert!(error < 0.02 && error > 1e-6, "{name}: {error}");
    }
}

#[test]
fn without_a_specimen_there_is_nothing_to_couple() {
    let prepared = request(None, "none", 0.002);
    let truth = table_acceleration(&prepared.motion, false);
    let error = worst_error(&truth, &coupled(&prepared, Algorithm::GaussSeidel));
    assert!(error < 1e-9, "{error:e}");
}

#[test]
fn the_coupling_is_of_second_order() {
    for algorithm in [Algorithm::GaussSeidel, Algorithm::Iterative] {
        let (errors, orders) = convergence(algorithm);
        assert!(errors[0] < 0.005, "{algorithm}: {errors:?}");
        for order in orders {
            assert!((order - 2.0).abs() < 0.1, "{algorithm}: {order}");
        }
    }
}

#[test]
fn a_jacobi_master_couples_with_first_order() {
    let (errors, orders) = convergence(Algorithm::Jacobi);
    println!("{errors:?}");
    for order in orders {
        assert!((order - 1.0).abs() < 0.3, "{order}");
    }
}

/// Specimens of a tenth of the table's mass to ten times it, with the period and damping of Appendix A.
#[test]
fn the_step_is_halved_until_the_coupling_errs_by_less_than_asked_for() {
    let table = ShakeTable::default().table.mass;
    for ratio in [0.1, 1.0, 10.0] {
        let specimen = LinearSpecimen::from_period(ratio * table, 1.0, 0.05);
        let set = [
            ("mass", specimen.mass),
            ("damping", specimen.damping),
            ("stiffness", specimen.stiffness),
        ];
        let units = ["kg", "N s/m", "N/m"];
        let set = set.iter().zip(units);
        let set = set.map(|((name, value), unit)| format!("specimen.{name}={value} {unit}"));
        let request = Request {
            set: set.collect(),
            ..Request::built_in("three-variable")
        };
        // Under the heaviest, the loop is close to its limit, and 2 ms make it unstable.
        for algorithm in [Algorithm::GaussSeidel, Algorithm::Iterative] {
            let mut prepared = prepare(&request).unwrap();
            prepared.algorithm = algorithm;
            let truth = table_acceleration_under(&prepared.motion, Some(specimen));
            let before = worst_error(&truth, &coupled(&prepared, algorithm));
            let estimated = refine(&mut prepared, 0.05).unwrap();
            let after = worst_error(&truth, &coupled(&prepared, algorithm));
            println!(
                "mass {ratio} of the table's, {algorithm}: {:.4} % at 2 ms, {:.4} % at {} ms, estimated \
                 {:.4} % of `{}`",
                100.0 * before,
                100.0 * after,
                1e3 * prepared.step,
                estimated.percent,
                estimated.signal
            );
            assert!(estimated.is_reached(), "{estimated:?}");
            assert!(after < 5e-4, "{after}");
            // The estimate is of the signal that is most in error, so it is no smaller.
            assert!(100.0 * after < 1.2 * estimated.percent + 1e-6, "{after}");
        }
    }
}

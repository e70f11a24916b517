//! The examples on the Reference FMUs, against closed forms.

use std::path::{Path, PathBuf};

#[path = "../examples/one_fmu.rs"]
mod one_fmu;
#[path = "../examples/two_in_a_loop.rs"]
mod two_in_a_loop;

fn reference_fmu(name: &str) -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let shared = std::env::var_os("SHAKEBENCH_SHARED");
    let shared = shared.map_or(here.join("../../../shared"), |folder| here.join(folder));
    shared.join("foreign-fmus").join(name)
}

#[needs::shared("foreign-fmus")]
#[test]
fn one_fmu_decays_as_its_equation_says() {
    for version in ["fmi2", "fmi3"] {
        let fmu = reference_fmu(&format!("{version}/Dahlquist.fmu"));
        let outcome = one_fmu::run(&fmu, 2.0).unwrap();
        assert!(outcome.ended.is_regular());
        let column = outcome
            .record
            .columns
            .iter()
            .find(|name| name.ends_with(".x"));
        let x = outcome.record.column(column.unwrap()).unwrap();
        // x' = -x, integrated with the explicit Euler method in steps of 0.1 s.
        let (at, exact) = (x[100], 0.9_f64.powi(10));
        assert!((at - exact).abs() < 1e-12, "{at} is not {exact}");
    }
}

#[needs::shared("foreign-fmus")]
#[test]
fn two_integrators_in_a_loop_oscillate() {
    let fmu = reference_fmu("fmi3/StateSpace.fmu");
    let error = |step: f64| {
        let record = two_in_a_loop::run(Path::new(&fmu), step, 3.0).unwrap();
        let x = record.column("first.y[1]").unwrap();
        let errors = x.iter().enumerate();
        let errors = errors.map(|(n, x)| (-x - (step * n as f64).sin()).abs());
        errors.fold(0.0, f64::max)
    };
    let [coarse, fine] = [0.1, 0.05].map(error);
    assert!(coarse < 5e-3, "the largest error is {coarse}");
    // One integrator steps on what the other has reached, as in the leapfrog method: second order in the coupling step.
    let ratio = coarse / fine;
    assert!(
        (3.6..4.4).contains(&ratio),
        "half the step divides the error by {ratio}"
    );
}

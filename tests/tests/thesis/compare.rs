//! `shakebench compare` over the eight records: the order of the controllers, and medians well below
//! those of the thesis.

use std::path::Path;

use acceptance::shared;
use laboratory::run::experiment::{Request, prepare};
use motion::metrics::tracking;

fn request(system: &str, specimen: &str, record: &Path) -> Request {
    Request {
        specimen: specimen.into(),
        record: Some(record.into()),
        ..Request::built_in(system)
    }
}

fn time_domain_percent(request: &Request) -> f64 {
    let prepared = prepare(request).unwrap();
    let outcome = prepared.run(prepared.algorithm).unwrap();
    assert_eq!(outcome.ended.kind().word(), "complete");
    let column = |name| outcome.record.column(name).unwrap();
    let displacement = column("table.displacement");
    let acceleration = column("table.acceleration");
    tracking(&prepared.motion, &displacement, &acceleration)
        .unwrap()
        .time_domain_percent
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    0.5 * (values[3] + values[4])
}

#[needs::shared("records")]
#[test]
fn sliding_mode_before_three_variable_before_loop_shaping_in_the_median() {
    let records = shared::records();
    for specimen in ["none", "linear"] {
        let [sliding, three, shaping] =
            ["sliding-mode", "three-variable", "loop-shaping"].map(|system| {
                let errors = records
                    .iter()
                    .map(|record| time_domain_percent(&request(system, specimen, record)));
                median(errors.collect())
            });
        println!(
            "specimen {specimen}: sliding mode {sliding:.3}, three-variable {three:.2}, \
             loop shaping {shaping:.2}"
        );
        assert!(sliding < 0.1 * three && three < shaping);
        // Table 4-1: 10.70 and 13.19.
        assert!(sliding < 0.1 * 10.70 && shaping < 0.75 * 13.19);
    }
}

#[needs::shared("records")]
#[test]
fn with_the_jacobi_algorithm_sliding_mode_is_told_its_delays_and_keeps_its_advantage() {
    let records = shared::records();
    let jacobi = |system: &str, settings: &[&str]| {
        let mut request = request(system, "linear", &records[3]);
        request.algorithm = serde_json::from_str("\"jacobi\"").unwrap();
        request.set = settings.iter().map(|text| text.to_string()).collect();
        time_domain_percent(&request)
    };
    let without = time_domain_percent(&request("sliding-mode", "linear", &records[3]));
    let three = jacobi("three-variable", &[]);
    let told = [
        "control.loop_delay_samples=3",
        "control.command_delay_samples=1",
    ];
    // The same as what is counted along the connections.
    let predicted = jacobi("sliding-mode", &[]);
    assert_eq!(predicted, jacobi("sliding-mode", &told));
    println!("three-variable {three:.2}, predicted {predicted:.3}, without delay {without:.3}");
    assert!(three - predicted > 2.0 / 3.0 * (three - without));
    let untold = told.map(|setting| setting.replace(['1', '3'], "0"));
    assert!(jacobi("sliding-mode", &untold.each_ref().map(String::as_str)) > 100.0);
}

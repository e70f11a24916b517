//! The walk-through of the book prints the figures that its commands give.

use std::path::Path;

use hidden_effects::case::{Case, Kind, Settings};
use identification::diagnosis::Evidence;
use identification::diagnosis::engine::Observer;
use laboratory::diagnosis::diagnose;
use laboratory::results::Out;

/// `value` with three significant digits, as the report shows ratios.
fn three(value: f64) -> String {
    let decimals = (2 - value.abs().log10().floor() as i32).max(0) as usize;
    format!("{value:.decimals$}")
}

#[test]
fn figures_of_the_walkthrough_are_those_of_its_command() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/diagnosis-walkthrough.md");
    let page = std::fs::read_to_string(page).unwrap();
    let command = "generate -- hidden 1 7 valve_dead_band";
    assert!(page.contains(command), "another case: {command} is gone");
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("case-00007");
    Case::draw(7, &Settings::new(Kind::This("valve_dead_band")))
        .write(&place)
        .unwrap();
    let report = diagnose(
        &place,
        &[],
        None,
        &Out::new(folder.path().join("out")),
        Observer::none(),
    )
    .unwrap();

    let quoted: Vec<&str> = page
        .lines()
        .filter_map(|line| line.strip_prefix("> "))
        .collect();
    assert_eq!(quoted.join(" "), report.sentence);
    let Evidence::ShakeTable(evidence) = &report.evidence else {
        panic!("a case is of the shake table")
    };
    let gain = evidence.co_simulation.as_ref().unwrap();
    let noise = gain.against_noise.as_ref().unwrap();
    let words = format!(
        "from {} to {} noise floors",
        three(noise.before_ratio),
        three(noise.after_ratio)
    );
    let page: Vec<&str> = page.split_whitespace().collect();
    assert!(
        page.join(" ").contains(&words),
        "the page does not say `{words}`"
    );
}

//! `shakebench design` against the same figures computed with SciPy from the printed equations.

use acceptance::python::python;
use shakebench::cli::design::{NAMES, design};

fn scipy(script: &str, json: &serde_json::Value) -> (bool, String) {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), json.to_string()).unwrap();
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("thesis")
        .join(script);
    let output = python().arg(script).arg(file.path()).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    (
        output.status.success(),
        text + &String::from_utf8_lossy(&output.stderr),
    )
}

#[test]
fn margins_crossovers_bandwidths_and_gamma_agree_with_scipy() {
    let json = design(None, None, None).unwrap().json();
    let (agrees, report) = scipy("design_margins.py", &json);
    println!("{report}");
    assert!(agrees, "{report}");
    // The check notices a figure that is off by little more than its tolerance.
    let mut wrong = json;
    let crossover = &mut wrong["loops"][2]["crossover_rad_s"];
    *crossover = serde_json::json!(crossover.as_f64().unwrap() * 1.002);
    assert!(!scipy("design_margins.py", &wrong).0);
}

#[test]
fn the_force_loop_is_reported_as_stable_in_continuous_time_only() {
    let json = design(Some("force-pid"), None, None).unwrap().json();
    let row = &json["loops"][0];
    assert_eq!(row["name"], "force-pid");
    assert_eq!(row["stable"], true);
    assert_eq!(row["sampled"]["stable"], false);
    let note = row["note"].as_str().unwrap();
    assert!(note.contains("stable in continuous time only"), "{note}");
}

#[test]
fn under_the_specimen_the_force_loop_alone_is_unstable() {
    let json = design(None, None, Some("linear")).unwrap().json();
    for (row, name) in json["loops"].as_array().unwrap().iter().zip(NAMES) {
        assert_eq!(row["name"], name);
        // The specimen's resonance turns the force loop's phase where its gain is one; in the
        // hierarchy the displacement loop holds it.
        assert_eq!(row["stable"], name != "force-pid", "{row}");
        assert_eq!(row["sampled"]["stable"], name != "force-pid", "{row}");
    }
}

#[test]
fn what_cannot_be_designed_is_refused_with_its_option() {
    for (refused, words) in [
        (design(Some("pid"), None, None), "--loop: `pid` is no loop"),
        (
            design(None, Some(-1.0), None),
            "--crossover: parameter `crossover` is -1",
        ),
        (design(None, Some(1e4), None), "does not stabilise"),
        (
            design(None, None, Some("yielding")),
            "--specimen: `yielding`",
        ),
    ] {
        let error = refused.err().unwrap().to_string();
        assert!(error.contains(words), "{error}");
    }
}

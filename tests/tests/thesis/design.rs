//! `shakebench design` against the same figures computed with SciPy from the printed equations.

use acceptance::python::python;
use laboratory::design::{Design, LoopName, Options, Specimen, design};

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

fn json(design: &Design) -> serde_json::Value {
    serde_json::json!(design)
}

#[test]
fn margins_crossovers_bandwidths_and_gamma_agree_with_scipy() {
    let json = json(&design(&Options::default()).unwrap());
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
    let only = Some(LoopName::ForcePid);
    let options = Options {
        only,
        ..Options::default()
    };
    let json = json(&design(&options).unwrap());
    let row = &json["loops"][0];
    assert_eq!(row["name"], "force-pid");
    assert_eq!(row["stable"], true);
    assert_eq!(row["sampled"]["stable"], false);
    let note = row["note"].as_str().unwrap();
    assert!(note.contains("stable in continuous time only"), "{note}");
}

#[test]
fn under_the_specimen_the_force_loop_alone_is_unstable() {
    let options = Options {
        specimen: Specimen::Linear,
        ..Options::default()
    };
    let json = json(&design(&options).unwrap());
    for (row, name) in json["loops"].as_array().unwrap().iter().zip(LoopName::ALL) {
        assert_eq!(row["name"], name.name());
        // The specimen's resonance turns the force loop's phase where its gain is one; in the
        // hierarchy the displacement loop holds it.
        assert_eq!(row["stable"], name != LoopName::ForcePid, "{row}");
        assert_eq!(
            row["sampled"]["stable"],
            name != LoopName::ForcePid,
            "{row}"
        );
    }
}

#[test]
fn what_cannot_be_designed_is_refused() {
    let refused = "pid".parse::<LoopName>().unwrap_err();
    assert!(
        refused
            .to_string()
            .starts_with("`pid` is not a loop; expected one of"),
        "{refused}"
    );
    let refused = "yielding".parse::<Specimen>().unwrap_err();
    assert!(
        refused
            .to_string()
            .starts_with("`yielding` has no linear model"),
        "{refused}"
    );
    for (crossover, words) in [
        (-1.0, "parameter `crossover` is -1"),
        (1e4, "no controller crosses at 10000"),
    ] {
        let options = Options {
            crossover: Some(crossover),
            ..Options::default()
        };
        let error = design(&options).err().unwrap().to_string();
        assert!(error.contains(words), "{error}");
    }
}

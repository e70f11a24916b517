//! The fifteen practice cases beside the repository: every verdict right.

use std::path::PathBuf;

use diagnosis::{Observer, Verdict};
use rigs::case::Case;
use rigs::kinds::shake_table::diagnose;

fn shared() -> PathBuf {
    std::env::var_os("SHAKEBENCH_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    )
}

/// Effects of a truth file with their first parameter, thesis units.
fn truth(text: &str) -> Vec<(String, Option<f64>)> {
    let value = |rest: &str| {
        let (_, after) = rest.split_once("\"value\":")?;
        let number = after.split([',', '}']).next()?.trim();
        number.parse().ok()
    };
    text.split("\"effect\":")
        .skip(1)
        .filter_map(|rest| {
            let name = rest.split('"').nth(1)?;
            Some((name.to_string(), value(rest)))
        })
        .collect()
}

fn to_si(effect: &str, value: f64) -> f64 {
    use units::constants::{INCH, LBF};
    value
        * match effect {
            "coulomb_friction" | "valve_flow_saturation" => LBF,
            "added_payload" => LBF / INCH,
            "specimen_yielding" => INCH,
            "accelerometer_tilt" => 1.0 / INCH,
            "internal_leakage" => 1.0 / LBF,
            _ => 1.0,
        }
}

#[needs::shared("hidden-effects")]
#[test]
fn every_practice_case_is_right() {
    let folder = shared().join("hidden-effects");
    let mut seen = 0;
    for number in 1..=15 {
        let name = format!("dev-{number:02}");
        let text = std::fs::read_to_string(folder.join(format!("truth/{name}.json"))).unwrap();
        let hidden = truth(&text);
        let case = Case::read(&folder.join("cases").join(&name)).unwrap();
        let diagnosis = diagnose(&case, Observer::none()).unwrap();
        println!("{name}: {}", diagnosis.sentence);
        for (name, relation) in &diagnosis.relations {
            println!("    {name}: {:.2} times its noise", relation.nominal);
        }
        let mut found: Vec<&str> = diagnosis.effects.iter().map(|e| e.effect).collect();
        found.sort_unstable();
        let mut wanted: Vec<&str> = hidden.iter().map(|(name, _)| name.as_str()).collect();
        wanted.sort_unstable();
        if wanted == ["outside_catalogue"] {
            assert_eq!(diagnosis.verdict, Verdict::Unexplained, "{name}");
        } else if wanted.is_empty() {
            assert_eq!(diagnosis.verdict, Verdict::Adequate, "{name}");
        } else {
            assert_eq!(diagnosis.verdict, Verdict::Named, "{name}");
            assert_eq!(found, wanted, "{name}");
            for effect in &diagnosis.effects {
                let value = hidden.iter().find(|(name, _)| name == effect.effect);
                let value = to_si(effect.effect, value.unwrap().1.unwrap());
                let estimate = &effect.parameters[0];
                let error = (estimate.value - value).abs();
                assert!(
                    error < 4.0 * estimate.standard_error + 0.01 * value.abs(),
                    "{name}: {estimate:?}, truth {value}"
                );
            }
            assert!(
                diagnosis.gain.after_ratio < 1.03,
                "{name}: {:?}",
                diagnosis.gain
            );
        }
        seen += 1;
    }
    assert_eq!(seen, 15);
}

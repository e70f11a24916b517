//! The measured frame with its damper: either motion predicted from the other, by the descriptions of its page.

use std::path::Path;

use acceptance::shared;
use identification::diagnosis::engine::{Observer, Verdict};
use identification::diagnosis::rigs::{Description, RigDiagnosis, diagnose};

const PAGE: &str = include_str!("../../../docs/rigs/frame_with_damper.md");
const FILES: [(&str, u32); 4] = [
    ("ElCentro_V0.csv", 0),
    ("ElCentro_V5.csv", 5),
    ("Kobe_V0.csv", 0),
    ("Kobe_V5.csv", 5),
];

/// The diagnosis by the page's description of this kind, of the files with a column of their voltage.
fn found(kind: &str) -> RigDiagnosis {
    let folder = tempfile::tempdir().unwrap();
    let from = shared::folder().join("measured/frame_with_damper");
    for (name, voltage) in FILES {
        let text = std::fs::read_to_string(from.join(name)).unwrap();
        let rows = text.lines().filter(|row| !row.trim().is_empty());
        let with_voltage: String = rows
            .enumerate()
            .map(|(k, row)| match k {
                0 => format!("{},voltage [V]\n", row.trim()),
                _ => format!("{},{voltage}\n", row.trim()),
            })
            .collect();
        std::fs::write(folder.path().join(name), with_voltage).unwrap();
    }
    let is_own = |block: &&str| block.contains(&format!("kind = \"{kind}\""));
    let block = PAGE.split("```toml\n").find(is_own).unwrap();
    let text = block.split("```").next().unwrap();
    let path: &Path = &folder.path().join("rig.toml");
    std::fs::write(path, text).unwrap();
    let description = Description::read(path).unwrap();
    let measurement = description.measurement(&[]).unwrap();
    diagnose(&description, &measurement, Observer::none()).unwrap()
}

/// Per cent on the held-out data, and with the parts swapped.
fn errors(found: &RigDiagnosis, output: &str) -> [f64; 2] {
    let start = format!("error of {output} on the held-out data: ");
    let own = found
        .findings
        .iter()
        .find_map(|own| own.strip_prefix(&start));
    let mut numbers = own.unwrap().split(' ').filter_map(|word| word.parse().ok());
    [numbers.next().unwrap(), numbers.next().unwrap()]
}

#[needs::shared("measured")]
#[test]
#[ignore = "minutes"]
fn the_motion_of_the_table_and_the_voltage_predict_drifts_and_force() {
    let found = found("frame");
    assert_eq!(found.verdict, Verdict::Named, "{:?}", found.named);
    assert!(found.named.iter().any(|own| own == "device_creep"));
    for (output, most) in [("drift", 20.0), ("upper_drift", 25.0), ("force", 25.0)] {
        let own = errors(&found, output);
        assert!(
            own.into_iter().all(|percent| percent < most),
            "{output}: {own:?}"
        );
    }
}

#[needs::shared("measured")]
#[test]
#[ignore = "half a minute"]
fn the_friction_of_the_damper_creeps_and_its_force_does_not_lag() {
    let found = found("controlled_damper");
    assert_eq!(found.verdict, Verdict::Named, "{:?}", found.named);
    assert!(found.named.iter().any(|own| own == "friction_creep"));
    assert!(
        found.named.iter().all(|own| !own.starts_with("force_")),
        "{:?}",
        found.named
    );
    let own = [found.confirmed.error, found.confirmed.swapped_error];
    assert!(own.into_iter().all(|error| error < 0.215), "{own:?}");
}

#[needs::shared("measured")]
#[test]
#[ignore = "minutes; 16.7 and 18.7 % of the drift, 23.7 and 21.7 % of the force"]
fn open_the_frame_is_predicted_within_ten_and_fifteen_per_cent() {
    let found = found("frame");
    assert!(
        errors(&found, "drift")
            .into_iter()
            .all(|percent| percent < 10.0)
    );
    assert!(
        errors(&found, "force")
            .into_iter()
            .all(|percent| percent < 15.0)
    );
}

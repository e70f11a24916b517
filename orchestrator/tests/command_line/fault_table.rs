//! What an operator sees when something breaks: the table of `docs/physical-rig.md`.

use serde_json::Value;

use crate::physical_rig::Results;
use crate::{shakebench, stderr, stdout};

const G: f64 = 9.80665;
const STROKE: f64 = 1.5 * 0.0254;
const CONTROLLERS: [&str; 3] = ["preview", "mpc", "three-variable"];

/// What is done to the rig; faults of sensors begin at 8 s.
const FAULTS: [(&str, &[&str]); 13] = [
    ("none", &[]),
    (
        "accelerometer frozen",
        &["fault=frozen", "fault_channel=acceleration"],
    ),
    (
        "displacement frozen",
        &["fault=frozen", "fault_channel=displacement"],
    ),
    (
        "accelerometer NaN",
        &["fault=not_a_number", "fault_channel=acceleration"],
    ),
    (
        "one displacement NaN",
        &[
            "fault=not_a_number",
            "fault_channel=displacement",
            "fault_duration=2 ms",
        ],
    ),
    (
        "one displacement off by 0.5 in",
        &[
            "fault=offset",
            "fault_channel=displacement",
            "fault_duration=2 ms",
            "fault_size=0.0127",
        ],
    ),
    (
        "one acceleration off by 3 g",
        &[
            "fault=offset",
            "fault_channel=acceleration",
            "fault_duration=2 ms",
            "fault_size=29.4",
        ],
    ),
    (
        "accelerometer reversed",
        &["fault=reversed", "fault_channel=acceleration"],
    ),
    (
        "accelerometer off by 0.05 g",
        &[
            "fault=offset",
            "fault_channel=acceleration",
            "fault_size=0.49",
        ],
    ),
    (
        "a fifth of the samples dropped",
        &["fault=dropped", "fault_size=0.2"],
    ),
    (
        "supply at 60 % from the start",
        &["table.pump_pressure=1800 psi"],
    ),
    ("specimen breaks off", &["specimen.break_off_time=8 s"]),
    (
        "three times the table's mass",
        &["table.table_mass=63.7 kg"],
    ),
];

#[test]
fn faults_are_bridged_or_stop_the_table_as_the_book_says() {
    let folder = tempfile::tempdir().unwrap();
    let book = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/physical-rig.md");
    let book = std::fs::read_to_string(book).unwrap();
    let mut missing = Vec::new();
    let mut harder = Vec::new();
    for controller in CONTROLLERS {
        for (name, settings) in FAULTS {
            let mut all: Vec<String> = ["run", controller, "--plant", "servohydraulic"]
                .into_iter()
                .chain([
                    "--specimen",
                    "yielding",
                    "--out",
                    "out",
                    "--force",
                    "--json",
                ])
                .map(String::from)
                .collect();
            for setting in settings {
                let own = match setting.contains('.') && !setting.starts_with("fault") {
                    true => (*setting).to_string(),
                    false => format!("sensors.{setting}"),
                };
                all.extend(["--set".to_string(), own]);
            }
            if settings.iter().any(|setting| setting.starts_with("fault")) {
                all.extend(["--set".to_string(), "sensors.fault_time=8 s".to_string()]);
            }
            let all: Vec<&str> = all.iter().map(String::as_str).collect();
            let output = shakebench(folder.path(), &all);
            let json: Value = serde_json::from_str(&stdout(&output))
                .unwrap_or_else(|error| panic!("{name}: {error}: {}", stderr(&output)));
            let results = Results::read(&folder.path().join("out"));
            let peak = |column: &str, from: f64| {
                let pairs = results
                    .column("time")
                    .into_iter()
                    .zip(results.column(column));
                pairs
                    .filter(|(t, _)| *t >= from)
                    .fold(0.0, |m: f64, (_, a)| m.max(a.abs()))
            };
            let from = if name.contains("start") || name.contains("mass") {
                0.0
            } else {
                8.0
            };
            let largest = peak("table.acceleration", from) / G;
            let motion = json["motion"]["pga_g"].as_f64().unwrap();
            assert!(
                peak("table.displacement", 0.0) < STROKE,
                "{name} hit the stop"
            );
            let ended = match json["trip"]["time_s"].as_f64() {
                Some(time) => format!("stopped at {time:.3} s"),
                None => format!(
                    "completed, error {:.2} %",
                    json["tracking"]["time_domain_percent"].as_f64().unwrap()
                ),
            };
            let mut said: Vec<String> = Vec::new();
            said.extend(json["trip"]["cause"].as_str().map(String::from));
            let warnings = json["warnings"].as_array().into_iter().flatten();
            said.extend(
                warnings
                    .filter_map(|warning| warning.as_str()?.split_once(" warned at "))
                    .map(|(_, words)| format!("warning at {words}")),
            );
            let said = if said.is_empty() {
                "-".to_string()
            } else {
                said.join("; ")
            };
            let row = format!("| `{controller}` | {name} | {ended} | {largest:.3} | {said} |");
            println!("{row}");
            if !book.contains(&row) {
                missing.push(row);
            }
            // Feedback of a reversed accelerometer acts until it is noticed.
            let bound = if name.contains("reversed") { 4.0 } else { 1.5 };
            if largest > bound * motion {
                harder.push(format!("{controller}, {name}: {largest:.3} g"));
            }
        }
    }
    assert!(harder.is_empty(), "beyond the motion: {harder:#?}");
    assert!(
        missing.is_empty(),
        "docs/physical-rig.md lacks\n{}",
        missing.join("\n")
    );
}

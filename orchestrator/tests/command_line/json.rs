//! `--json` of every command: one object alone on standard output, whatever else is asked for; nothing there if
//! the input is at fault.

use std::fs;

use crate::{shakebench, stderr, stdout};

const STUDY: &str = r#"[study]
design = "sobol"
runs = 2
[fixed]
duration = "1 s"
[factors]
"specimen.stiffness" = { uniform = ["80 lbf/in", "120 lbf/in"] }
"#;

const TUNING: &str = r#"[study]
design = "full"
[fixed]
controller = "three-variable"
specimen = "none"
duration = "2 s"
[factors]
seed = [1, 2]
[tune]
objective = "time_domain_percent"
quantile = 0.95
gain_margin = "8 dB"
phase_margin = "40 deg"
evaluations = 3
hold_out = 0.5
[tune.parameters]
"control.proportional_gain" = ["2 V/in", "20 V/in"]
"#;

/// Commands in their order (`~` for a blank within a word), the status, and keys of the object, `a/b` for `b` in
/// `a` and `*` for the first of a list. Without keys, nothing is printed.
const PRINTED: &[(&str, i32, &[&str])] = &[
    (
        "run mpc --duration 1~s --out a",
        0,
        &[
            "folder",
            "step_s",
            "wall_s",
            "tracking/delay_s",
            "motion/duration_s",
        ],
    ),
    (
        "run three-variable --duration 1~s --quiet --out b",
        0,
        &["folder", "tracking/peak_displacement_m"],
    ),
    ("run mpc --duration 1~s --verbose --out c", 0, &["folder"]),
    // Too short for errors, and stopped by the interlock: `ended` says so, and there are no errors.
    (
        "run mpc --duration 0.01~s --out d",
        0,
        &["ended", "warnings/*"],
    ),
    (
        "run three-variable --plant servohydraulic --set control.proportional_gain=90~V/in --duration 2~s --out e",
        1,
        &["folder", "ended_because", "trip/time_s"],
    ),
    ("run nothing.toml", 2, &[]),
    ("run mpc --duration x", 2, &[]),
    (
        "compare a b --out f",
        0,
        &[
            "folder",
            "runs/*/tracking/time_domain_percent",
            "differences/*/what",
        ],
    ),
    (
        "compare mpc three-variable --duration 1~s --seed 1 --out g",
        0,
        &[
            "folder",
            "rows/*/ended_s",
            "medians/mpc/time_domain_percent",
        ],
    ),
    ("compare mpc mpc", 2, &[]),
    (
        "compare --figures 3-7 --out h",
        0,
        &["figures/*/number", "files/*"],
    ),
    (
        "design --out i",
        0,
        &[
            "folder",
            "report",
            "loops/*/crossover_rad_s",
            "loops/*/gain_margin_db",
        ],
    ),
    ("design --loop zzz", 2, &[]),
    (
        "iterate three-variable --iterations 1 --out j",
        0,
        &["folder", "runs/*/time_domain_percent", "stop"],
    ),
    (
        "qualify ac156 --set s_ds=0.2 --motion-only --out k",
        0,
        &[
            "folder",
            "motion/peak_velocity_m_s",
            "rule/points/*/frequency_hz",
            "rule/points/*/level_g",
        ],
    ),
    (
        "trs k/motion.csv --rrs ac156 --set s_ds=0.2",
        0,
        &["points/*/frequency_hz", "points/*/rrs_g", "verdict"],
    ),
    ("trs nothing.csv --rrs ac156", 2, &[]),
    (
        "info mpc",
        0,
        &[
            "components/*/name",
            "connections/*/from",
            "order_of_calls/*",
        ],
    ),
    (
        "info ShakeTable",
        0,
        &[
            "variables/*/unit",
            "terminals",
            "preferred_step_s",
            "sha256",
        ],
    ),
    (
        "info k/motion.csv",
        0,
        &["duration_s", "peak_acceleration_m_s2"],
    ),
    ("info nothing", 2, &[]),
    ("export mpc --ssp l.ssp", 0, &["file", "notes"]),
    ("validate l.ssp", 0, &["errors", "findings", "checked"]),
    ("validate empty.ssp", 2, &["errors", "findings/*/message"]),
    ("validate nothing.ssp", 2, &[]),
    ("report a", 0, &["of", "report"]),
    ("report nothing", 2, &[]),
    ("campaign study.toml --plan", 0, &["runs", "columns/*/name"]),
    (
        "campaign study.toml --out m --quiet",
        0,
        &["folder", "complete", "wall_s"],
    ),
    ("campaign study.toml --rows 0-1", 2, &[]),
    ("campaign nothing.toml", 2, &[]),
    (
        "tune tuning.toml --out n",
        0,
        &["folder", "trials/*", "wall_s"],
    ),
    ("identify nothing.csv --out o.toml", 2, &[]),
    ("diagnose --template table", 0, &["kind", "template"]),
    ("diagnose nothing", 2, &[]),
    ("commission --level 0 --out p", 2, &[]),
    ("serve zzz --openfresco --units m,N", 2, &[]),
    ("doctor --quiet", 0, &["ready", "findings/*/state"]),
];

#[test]
fn every_command_prints_one_object_alone() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, text) in [
        ("study.toml", STUDY),
        ("tuning.toml", TUNING),
        ("empty.ssp", ""),
    ] {
        fs::write(folder.join(name), text).unwrap();
    }
    let mut faults = Vec::new();
    for (command, status, keys) in PRINTED {
        let words: Vec<String> = command
            .split(' ')
            .map(|word| word.replace('~', " "))
            .collect();
        let mut arguments: Vec<&str> = words.iter().map(String::as_str).collect();
        arguments.push("--json");
        let output = shakebench(folder, &arguments);
        let mut wrong = Vec::new();
        if output.status.code() != Some(*status) {
            wrong.push(format!("status {:?}", output.status.code()));
        }
        let printed = stdout(&output);
        match serde_json::from_str::<serde_json::Value>(&printed) {
            Ok(found) if found.is_object() => {
                let missing = keys
                    .iter()
                    .filter(|key| found.pointer(&pointer(key)).is_none());
                wrong.extend(missing.map(|key| format!("without `{key}`")));
                if keys.is_empty() {
                    wrong.push("printed an object".to_string());
                }
            }
            _ if keys.is_empty() && printed.is_empty() => {}
            _ => wrong.push(format!("printed `{printed}`")),
        }
        if !wrong.is_empty() {
            faults.push(format!(
                "{command}\n  {}\n  {}",
                wrong.join(", "),
                stderr(&output)
            ));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// A key as a JSON pointer.
fn pointer(key: &str) -> String {
    format!("/{}", key.replace('*', "0"))
}

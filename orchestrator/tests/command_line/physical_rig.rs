//! The physical rig: controllers compared on it, and what happens when something breaks.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::{shakebench, stderr, stdout};

/// Stroke of the rig, m.
const STROKE: f64 = 1.5 * 0.0254;
/// When faults occur, s.
const AT: f64 = 8.0;
/// Sampling period, s.
const PERIOD: f64 = 0.002;
/// Longest duration of a stop, s.
const STOP: f64 = 0.3;

/// The columns of a `results.csv`.
pub(crate) struct Results {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
    lines: Vec<String>,
}

impl Results {
    pub(crate) fn read(folder: &Path) -> Self {
        let text = fs::read_to_string(folder.join("results.csv")).unwrap();
        let lines: Vec<String> = text.lines().map(String::from).collect();
        let cells = |line: &String| line.split(',').map(String::from).collect::<Vec<_>>();
        // Columns of text are no numbers.
        let number = |cell: &String| cell.parse().unwrap_or(f64::NAN);
        let numbers = |line: &String| cells(line).iter().map(number).collect();
        Self {
            names: cells(&lines[0]),
            rows: lines[1..].iter().map(numbers).collect(),
            lines,
        }
    }

    pub(crate) fn column(&self, name: &str) -> Vec<f64> {
        let place = self.names.iter().position(|n| n == name).unwrap();
        self.rows.iter().map(|row| row[place]).collect()
    }
}

/// Compares on the physical rig; gives the exit status, the JSON object and what was said.
fn compare(arguments: &[&str]) -> (i32, Value, String) {
    let folder = tempfile::tempdir().unwrap();
    let fixed = [
        "compare",
        "--plant",
        "servohydraulic",
        "--json",
        "--out",
        "out",
    ];
    let output = shakebench(folder.path(), &[&fixed[..], arguments].concat());
    let json = serde_json::from_str(&stdout(&output)).unwrap_or_else(|error| {
        panic!("{error}: {}", stderr(&output));
    });
    let page = fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("Displacement error on"), "a plot");
    (output.status.code().unwrap(), json, stderr(&output))
}

fn median(json: &Value, controller: &str) -> f64 {
    json["medians"][controller]["time_domain_percent"]
        .as_f64()
        .unwrap()
}

/// The controllers of the thesis.
const THESIS: &str = "displacement-pid,three-variable,loop-shaping,sliding-mode,mpc";

/// No run of `controllers` ends early or leaves the stroke; displacement PID is the worst, model
/// predictive control far from it and preview control far from that.
#[track_caller]
fn holds_its_order(json: &Value, status: i32, said: &str, controllers: usize) {
    assert_eq!(status, 0, "{said}");
    let rows = json["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 8 * controllers);
    for row in rows {
        assert_eq!(row["ended"], "complete", "{row}");
        assert!(
            row["peak_displacement_m"].as_f64().unwrap() < STROKE,
            "{row}"
        );
    }
    let all = ["mpc", "sliding-mode", "three-variable", "loop-shaping"];
    let medians = all.map(|controller| median(json, controller));
    let worst = median(json, "displacement-pid");
    let best = median(json, "preview");
    println!(
        "{}: {all:?} {medians:.2?} %, PID {worst:.2} %, preview {best:.2} %",
        json["specimen"]
    );
    assert!(medians.iter().all(|own| *own < worst), "{medians:?}");
    assert!(medians[0] < 0.6 * worst, "{medians:?}");
    assert!(best < 0.5 * medians[0], "{best}, {medians:?}");
}

#[test]
fn with_every_specimen_no_run_ends_early_and_the_order_of_controllers_holds() {
    let controllers = format!("{THESIS},preview");
    for specimen in ["none", "linear", "yielding"] {
        let (status, json, said) =
            compare(&["--specimen", specimen, "--controllers", &controllers]);
        holds_its_order(&json, status, &said, 6);
        assert_eq!(json["specimen"], specimen);
    }
}

/// The folder of the eight records.
fn records() -> PathBuf {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let shared = std::env::var_os("SHAKEBENCH_SHARED").map_or(beside, PathBuf::from);
    shared.join("records")
}

#[needs::shared("records")]
#[test]
fn the_eight_records_with_the_yielding_specimen_keep_the_order() {
    let records = records().display().to_string();
    let (status, json, said) = compare(&["--specimen", "yielding", "--records", &records]);
    holds_its_order(&json, status, &said, 19);
    // Stated in docs/physical-rig.md, docs/preview-control.md and docs/published-methods.md.
    for (controller, largest) in [
        ("preview", 1.5),
        ("mpc", 5.5),
        ("three-variable", 6.5),
        ("sliding-mode", 7.5),
        ("loop-shaping", 10.5),
        ("multi-metric", 4.5),
        ("acceleration-tracking", 5.5),
        ("minimal-control-synthesis", 9.0),
        ("dual-loop", 9.5),
        ("receding-horizon", 4.0),
        ("multiple-surface", 5.0),
        ("dynamic-surface", 6.5),
        ("adaptive-inverse", 6.0),
        ("adaptive-preview", 0.85),
        ("adaptive-mpc", 1.8),
    ] {
        assert!(median(&json, controller) < largest, "{controller}");
    }
    // Who learns never loses to who does not.
    let rows = json["rows"].as_array().unwrap();
    let error = |controller: &str, row: &Value| {
        let own = |r: &&Value| r["controller"] == controller && r["record"] == row["record"];
        rows.iter().find(own).unwrap()["time_domain_percent"]
            .as_f64()
            .unwrap()
    };
    for row in rows.iter().filter(|row| row["controller"] == "preview") {
        let (learns, does_not) = (error("adaptive-preview", row), error("preview", row));
        assert!(learns < does_not, "{}: {learns} {does_not}", row["record"]);
    }
}

#[test]
fn printed_tunings_that_are_unstable_on_this_rig_are_stopped_and_shown_as_stopped() {
    let arguments = ["--specimen", "yielding", "--tuning", "printed"];
    let controllers = ["--controllers", THESIS];
    let (status, json, said) = compare(&[&arguments[..], &controllers].concat());
    assert_eq!(status, 1);
    for controller in ["mpc", "sliding-mode"] {
        assert!(json["medians"][controller]["time_domain_percent"].is_null());
        assert_eq!(json["medians"][controller]["ended_early"], 8);
    }
    let rows = json["rows"].as_array().unwrap();
    for row in rows {
        let unstable = row["controller"] == "mpc" || row["controller"] == "sliding-mode";
        assert_eq!(row["ended"] == "interlock", unstable, "{row}");
        assert!(
            row["peak_displacement_m"].as_f64().unwrap() < STROKE,
            "{row}"
        );
        if unstable {
            let because = row["ended_because"].as_str().unwrap();
            assert!(
                because.contains("chatters or the loop oscillates"),
                "{because}"
            );
            assert!(row["ended_s"].as_f64().unwrap() < 1.0);
        }
    }
    assert!(said.contains("sliding-mode on synthetic-1 ended early (interlock)"));
    assert!(median(&json, "three-variable") > 0.0);
}

#[test]
fn a_motion_that_leaves_the_safe_stroke_is_stopped_before_the_stop_is_hit() {
    for (frequency, controller) in [
        (0.5, "three-variable"),
        (2.0, "three-variable"),
        (1.0, "mpc"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let mut text =
            "time [s],displacement [in],velocity [in/s],acceleration [in/s2]\n".to_string();
        let (amplitude, w) = (1.49, std::f64::consts::TAU * frequency);
        for k in 0..3000 {
            // It grows over the first two seconds: b(t) sin(w t) with a cubic b.
            let t = PERIOD * f64::from(k);
            let s = (t / 2.0).min(1.0);
            let (b, b1, b2) = if s < 1.0 {
                (
                    s * s * (3.0 - 2.0 * s),
                    3.0 * s * (1.0 - s),
                    1.5 * (1.0 - 2.0 * s),
                )
            } else {
                (1.0, 0.0, 0.0)
            };
            let (sin, cos) = (w * t).sin_cos();
            text += &format!(
                "{t},{},{},{}\n",
                amplitude * b * sin,
                amplitude * (b1 * sin + b * w * cos),
                amplitude * (b2 * sin + 2.0 * b1 * w * cos - b * w * w * sin)
            );
        }
        fs::write(folder.path().join("beyond.csv"), text).unwrap();
        let arguments = [
            "run",
            controller,
            "--plant",
            "servohydraulic",
            "--specimen",
            "yielding",
            "--reference",
            "beyond.csv",
            "--out",
            "out",
        ];
        let output = shakebench(folder.path(), &arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        let reached = Results::read(&folder.path().join("out")).column("table.displacement");
        let farthest = reached.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        println!(
            "{frequency} Hz, {controller}: {:.3} in, {said}",
            farthest / 0.0254
        );
        assert!((0.8 * STROKE..STROKE).contains(&farthest), "{farthest}");
        assert!(said.contains("displacement"), "{said}");
    }
}

/// What a fault has to lead to.
struct Expected<'a> {
    name: &'a str,
    ended: &'a str,
    words: &'a [&'a str],
    /// Longest time from the fault to the trip, s.
    within: f64,
}

/// Runs with `arguments` in `folder` and checks that the valve is brought to null in time, that
/// everything up to then is saved and equal to the `healthy` run's, and what is said.
#[track_caller]
fn check(folder: &Path, arguments: &[&str], healthy: &Results, expected: &Expected) {
    let Expected {
        name,
        ended,
        words,
        within,
    } = *expected;
    let all = [arguments, &["--out", "out", "--force", "--json"]].concat();
    let output = shakebench(folder, &all);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{name}: {said}");
    for word in words.iter().chain(&["the run ended early", "saved"]) {
        assert!(said.contains(word), "{name}: `{word}` is not in: {said}");
    }
    let summary: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(summary["ended"], ended, "{name}");
    let results = Results::read(&folder.join("out"));
    let valve = results.column("interlock.valve_command");
    let last = valve.iter().rposition(|&u| u != 0.0).unwrap();
    let null = PERIOD * (last + 1) as f64 - AT;
    let tripped = results.column("interlock.tripped");
    let trip = tripped.iter().position(|&t| t != 0.0).unwrap() as f64 * PERIOD - AT;
    let farthest = results.column("table.displacement");
    let farthest = farthest.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    println!(
        "{name:30} trips {trip:.3} s after the fault, valve at null after {null:.3} s, farthest \
         {:.2} in",
        farthest / 0.0254
    );
    assert!((0.0..=within).contains(&trip), "{name}: {trip} s");
    // Within the stop's time of the trip, and the run goes on to show it.
    assert!(null <= trip + STOP + PERIOD + 1e-9, "{name}");
    // The table is stopped no harder than the motion shook it.
    let largest = |results: &Results, from: usize| {
        let all = results.column("table.acceleration");
        all[from..].iter().fold(0.0, |m: f64, a| m.max(a.abs()))
    };
    let (stop, motion) = (
        largest(&results, (AT / PERIOD) as usize),
        largest(healthy, 0),
    );
    assert!(stop <= motion, "{name}: {stop} beyond {motion} m/s2");
    assert!(valve.len() > last + 200, "{name}: {} rows", valve.len());
    assert!(farthest < STROKE, "{name} hit the stop");
    let jump = valve.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    assert!(jump.fold(0.0, f64::max) < 2.0, "{name}: the valve jumps");
    let before = (AT / PERIOD) as usize;
    assert_eq!(results.lines[..before], healthy.lines[..before], "{name}");
}

const RUN: [&str; 6] = [
    "run",
    "three-variable",
    "--plant",
    "servohydraulic",
    "--specimen",
    "yielding",
];

fn healthy(folder: &Path) -> Results {
    let output = shakebench(folder, &[&RUN[..], &["--out", "healthy"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stdout(&output).contains("seed of the noise of `sensors`: 1"));
    Results::read(&folder.join("healthy"))
}

#[test]
fn a_broken_rig_is_stopped_softly_in_the_time_that_the_docs_state() {
    let folder = tempfile::tempdir().unwrap();
    let healthy = healthy(folder.path());
    let at = format!("={AT} s");
    let fault = |kind: &str, channel: &str| {
        vec![
            format!("sensors.fault={kind}"),
            format!("sensors.fault_channel={channel}"),
            format!("sensors.fault_time{at}"),
        ]
    };
    let stale: &[&str] = &["interlock.tripped", "a measurement repeats itself"];
    let no_number: &[&str] = &["interlock.tripped", "not a finite number"];
    let mut cases = Vec::new();
    for channel in ["displacement", "acceleration", "actuator_force"] {
        cases.push((
            format!("{channel} frozen"),
            fault("frozen", channel),
            stale,
            0.1,
        ));
        cases.push((
            format!("{channel} no number"),
            fault("not_a_number", channel),
            no_number,
            0.024,
        ));
    }
    let lost: &[&str] = &[
        "interlock.tripped",
        "the supply's pressure is below its limit",
    ];
    cases.push((
        "supply lost".into(),
        vec![format!("table.supply_loss_time{at}")],
        lost,
        1.0,
    ));
    let off: &[&str] = &["interlock.tripped", "the specimen does not answer"];
    cases.push((
        "specimen off".into(),
        vec![format!("specimen.break_off_time{at}")],
        off,
        0.6,
    ));
    for (name, settings, words, within) in &cases {
        let mut arguments = RUN.to_vec();
        for setting in settings {
            arguments.extend(["--set", setting]);
        }
        let expected = Expected {
            name,
            ended: "interlock",
            words,
            within: *within,
        };
        check(folder.path(), &arguments, &healthy, &expected);
    }
}

#[test]
fn a_worn_valve_that_keeps_the_pump_busy_trips_by_its_flow_at_a_sound_pressure() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("worn");
    // A hundred times the leakage: 11.1 in³/s at 2,778 psi.
    let worn = "table.null_leakage=0.004 in3/(s.psi)";
    let output = shakebench(
        folder.path(),
        &[
            "run",
            "three-variable",
            "--plant",
            "servohydraulic",
            "--specimen",
            "none",
            "--duration",
            "5s",
            "--set",
            worn,
            "--out",
            out.to_str().unwrap(),
        ],
    );
    let said = String::from_utf8_lossy(&output.stdout).to_string()
        + &String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("the flow out of the supply is beyond its limit"),
        "{said}"
    );
}

/// Three-variable control whose last part fails, on the physical rig with the yielding specimen.
fn failing_controller(fmu: &str, fault: &str) -> String {
    let connections = [
        "connections = [",
        "\"reference.displacement -> control.reference_displacement\",",
        "\"reference.velocity -> control.reference_velocity\",",
        "\"reference.acceleration -> control.reference_acceleration\",",
        "\"sensors.measured_displacement -> control.measured_displacement\",",
        "\"sensors.measured_velocity -> control.measured_velocity\",",
        "\"sensors.measured_acceleration -> control.measured_acceleration\",",
        "\"control.valve_command -> output.level\",",
        "\"output.value -> interlock.controller_command\",",
        "\"table.acceleration -> specimen.table_acceleration\",",
        "\"specimen.force -> table.specimen_force\",",
    ];
    let rig = include_str!("../../laboratory/systems/plant/servohydraulic.toml");
    let rig = rig.replace("connections = [", &connections.join("\n"));
    format!(
        r#"{rig}
        [components.specimen]
        fmu = "YieldingSpecimen"
        [components.control]
        fmu = "ThreeVariableControl"
        period = "2 ms"
        [components.output]
        fmu = "{fmu}"
        period = "2 ms"
        inputs = {{ enabled = true, offset = 0, label = "", "tap[1]" = 0, "tap[2]" = 0, "tap[3]" = 0 }}
        parameters = {{ gain = 1, fault = "{fault}", fault_after = {} }}
        "#,
        (AT / PERIOD) as u32
    )
}

#[test]
fn a_failing_controller_lets_the_interlock_bring_the_valve_to_null() {
    let folder = tempfile::tempdir().unwrap();
    let write = |text: String| fs::write(folder.path().join("rig.toml"), text).unwrap();
    for version in pack::FmiVersion::ALL {
        let out = folder.path().join("fmus");
        let packed = pack::build_component("tests/importers/faulty", &out, &[version]).unwrap();
        let fmu = packed[0].path.display().to_string();
        write(failing_controller(&fmu, "none"));
        let output = shakebench(
            folder.path(),
            &["run", "rig.toml", "--force", "--out", "healthy"],
        );
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let healthy = Results::read(&folder.path().join("healthy"));
        for (fault, words) in [
            ("error_in_step", "refused on demand"),
            ("panic_in_step", "on demand"),
            ("nan", "NaN"),
        ] {
            write(failing_controller(&fmu, fault));
            let expected = Expected {
                name: &format!("controller, {fault}"),
                ended: "failed",
                words: &["`output`", "Faulty.fmu", words, "brought the valve to null"],
                within: 0.026,
            };
            check(folder.path(), &["run", "rig.toml"], &healthy, &expected);
        }
    }
}

#[test]
fn the_sensors_noise_belongs_to_its_seed_and_repeats_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let run = |seed: &str, out: &str| {
        let setting = format!("sensors.seed={seed}");
        let more = [
            "--duration",
            "2 s",
            "--set",
            &setting,
            "--out",
            out,
            "--json",
        ];
        let output = shakebench(folder.path(), &[&RUN[..], &more].concat());
        let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
        assert_eq!(json["seeds"]["sensors"].as_f64(), seed.parse().ok());
        fs::read(folder.path().join(out).join("results.csv")).unwrap()
    };
    let first = run("5", "first");
    assert_eq!(first, run("5", "again"));
    assert_ne!(first, run("6", "other"));
}

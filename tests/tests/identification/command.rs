//! `shakebench identify` as scripts use it: JSON, files, exit status, and bad data refused by name.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use acceptance::recordings::{Test, csv};
use identification::data::{Channel, Recording};
use serde_json::Value;

/// The program, built once.
fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let arguments = [
            "build",
            "--release",
            "-p",
            "shakebench",
            "--bin",
            "shakebench",
            "--message-format",
            "json-render-diagnostics",
        ];
        let built = Command::new(env!("CARGO"))
            .args(arguments)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&built.stdout).into_owned();
        let executable = said
            .lines()
            .filter_map(|line| serde_json::from_str::<Value>(line).ok())
            .find_map(|message| message["executable"].as_str().map(PathBuf::from));
        executable.unwrap_or_else(|| panic!("{}", String::from_utf8_lossy(&built.stderr)))
    })
}

fn shakebench(folder: &Path, arguments: &[&str]) -> Output {
    let output = Command::new(program())
        .args(arguments)
        .current_dir(folder)
        .output();
    output.unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Done with status 0; the one JSON object that was printed.
#[track_caller]
fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = shakebench(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Names in a folder, sorted.
fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Refused with status 2 and a message with all the `words`; nothing written.
#[track_caller]
fn refused(folder: &Path, arguments: &[&str], words: &[&str]) {
    let before = files(folder);
    let output = shakebench(folder, arguments);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert_eq!(text(&output.stdout), "");
    assert!(said.starts_with("error: "), "{said}");
    for word in words {
        assert!(said.contains(word), "`{word}` is not in: {said}");
    }
    assert_eq!(files(folder), before, "something was written");
}

fn specimen_test() -> Test {
    Test {
        duration: 30.0,
        ..Test::default()
    }
}

/// The rows of a file with each cell of a column through `change`.
fn with_column(text: &str, column: usize, change: impl Fn(usize, &str) -> String) -> String {
    let mut out = String::new();
    for (row, line) in text.lines().enumerate() {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        if row > 0 {
            cells[column] = change(row, &cells[column]);
        }
        out += &cells.join(",");
        out.push('\n');
    }
    out
}

#[test]
fn data_to_json_to_model_to_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("data.csv"), csv(&specimen_test().record())).unwrap();
    let said = json(
        folder,
        &["identify", "data.csv", "--out", "rig.toml", "--json"],
    );
    let mut keys: Vec<&str> = said
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    keys.sort_unstable();
    assert_eq!(
        keys,
        [
            "actuator_poles_rad_s",
            "fit_percent",
            "identifiable",
            "model",
            "table_poles_rad_s",
            "wall_s",
            "warnings"
        ]
    );
    assert_eq!(said["model"], "rig.toml");
    assert_eq!(said["identifiable"], true);
    assert_eq!(said["actuator_poles_rad_s"].as_array().unwrap().len(), 3);
    // Eq 2-28: s^2 + 2.034 s + 192.4.
    let poles = said["table_poles_rad_s"].as_array().unwrap();
    for pole in poles {
        let size = pole[0].as_f64().unwrap().hypot(pole[1].as_f64().unwrap());
        assert!((size / 192.4f64.sqrt() - 1.0).abs() < 0.005, "{size}");
    }
    for channel in [
        "displacement",
        "acceleration",
        "actuator_force",
        "specimen_acceleration",
    ] {
        let fit = said["fit_percent"][channel].as_f64().unwrap();
        assert!((95.0..100.0).contains(&fit), "{channel}: {fit}");
    }
    assert_eq!(files(folder), ["data.csv", "rig.html", "rig.toml"]);
    let page = std::fs::read_to_string(folder.join("rig.html")).unwrap();
    for words in [
        "Coherence",
        "Singular values",
        "valve_command to actuator_force",
    ] {
        assert!(page.contains(words), "{words}");
    }

    // The identified rig moves as the rig that the data come from.
    let tracking = |more: &[&str], out: &str| {
        let mut arguments = vec!["run", "three-variable", "--duration", "8 s", "--json"];
        arguments.extend(["--out", out]);
        arguments.extend(more);
        let said = json(folder, &arguments);
        assert_eq!(said["ended"], "complete");
        said["tracking"]["time_domain_percent"].as_f64().unwrap()
    };
    let truth = tracking(&[], "truth");
    let own = tracking(
        &[
            "--set",
            "table.model=rig.toml",
            "--set",
            "specimen.model=rig.toml",
        ],
        "own",
    );
    assert!(
        own != truth && (own / truth - 1.0).abs() < 0.02,
        "{own} {truth}"
    );
}

#[test]
fn a_known_specimen_is_printed_as_given() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("data.csv"), csv(&specimen_test().record())).unwrap();
    let known = "units = \"metre, newton, second, volt\"\n[specimen]\nmass = 45.36\n\
                 damping = 28.5\nstiffness = 1790.0\n";
    std::fs::write(folder.join("known.toml"), known).unwrap();
    let arguments = ["identify", "data.csv", "--specimen", "known.toml", "--out"];
    let output = shakebench(folder, &[&arguments[..], &["rig.toml"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    let given = said
        .lines()
        .filter(|line| line.starts_with("specimen") && line.contains(" given "));
    assert_eq!(given.count(), 3, "{said}");
    // The same file for both would lose the specimen.
    refused(
        folder,
        &[&arguments[..], &["known.toml"]].concat(),
        &["--out: known.toml is an input"],
    );
}

#[test]
fn a_bare_table_gives_the_table_and_no_actuator() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let bare = Test {
        specimen: None,
        ..specimen_test()
    };
    std::fs::write(folder.join("bare.csv"), csv(&bare.record())).unwrap();
    let said = json(
        folder,
        &["identify", "bare.csv", "--out", "bare.toml", "--json"],
    );
    assert_eq!(said["identifiable"], false);
    assert_eq!(said["actuator_poles_rad_s"], serde_json::json!([]));
    assert_eq!(said["table_poles_rad_s"].as_array().unwrap().len(), 2);
    let warnings = said["warnings"].to_string();
    assert!(warnings.contains("with two payloads"), "{warnings}");
    refused(
        folder,
        &[
            "run",
            "three-variable",
            "--set",
            "table.model=bare.toml",
            "--out",
            "run",
        ],
        &["no [actuator]", "two payloads"],
    );
}

#[test]
fn a_gap_is_told_and_the_rest_is_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let whole = csv(&specimen_test().record());
    let holed: Vec<&str> = whole
        .lines()
        .enumerate()
        .filter(|(row, _)| !(7000..7200).contains(row))
        .map(|(_, line)| line)
        .collect();
    std::fs::write(folder.join("holed.csv"), holed.join("\n")).unwrap();
    let said = json(
        folder,
        &["identify", "holed.csv", "--out", "rig.toml", "--json"],
    );
    let warnings = said["warnings"].to_string();
    assert!(warnings.contains("gap of 0.402 s"), "{warnings}");
    assert_eq!(said["identifiable"], true);
}

#[test]
fn bad_data_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let good = csv(&Test {
        duration: 20.0,
        ..Test::default()
    }
    .record());
    let with = |text: String, words: &[&str]| {
        std::fs::write(folder.join("data.csv"), text).unwrap();
        refused(
            folder,
            &["identify", "data.csv", "--out", "rig.toml", "--json"],
            words,
        );
    };
    let command = 1;
    with(
        with_column(&good, command, |_, _| "0.1".into()),
        &["no excitation", "valve_command is constant at 0.1000 V"],
    );
    let short: Vec<&str> = good.lines().take(900).collect();
    with(short.join("\n"), &["too short to fit", "record at least"]);
    // One line in the spectrum of every channel; the command is not quite one, since a sampled sine
    // obeys its own recursion and would be taken for pure feedback.
    let sine = |gain: f64, phase: f64, noise: f64| {
        move |row: usize, _: &str| {
            let value = (std::f64::consts::TAU * 0.004 * row as f64 + phase).sin();
            let draw = (row * 7919 % 1009) as f64 / 1009.0 - 0.5;
            (gain * value + noise * draw).to_string()
        }
    };
    let mut pure = good.clone();
    for (column, gain, phase) in [
        (1, 1.0, 0.0),
        (2, 0.01, 1.0),
        (3, -1.5, 1.0),
        (4, 40.0, 2.0),
        (5, 1.0, 2.5),
    ] {
        let noise = if column == command { 1e-3 } else { 0.0 };
        pure = with_column(&pure, column, sine(gain, phase, noise));
    }
    with(pure, &["rank deficiency"]);
    with(
        good.replacen("displacement [m]", "displacement", 1),
        &[
            "data.csv, line 1: column `displacement` has no unit",
            "displacement [m]",
        ],
    );
    with(
        good.replacen("displacement [m]", "displacement [kg]", 1),
        &["data.csv, line 1, column 3 (`displacement`)"],
    );
    with(
        with_column(
            &good,
            4,
            |row, cell| {
                if row == 99 { "n/a".into() } else { cell.into() }
            },
        ),
        &[
            "data.csv, line 100, column 5 (`actuator_force`): \"n/a\"",
            "expected a number",
        ],
    );
    with(
        with_column(&good, 4, |_, cell| {
            let sign = if cell.starts_with('-') { "" } else { "-" };
            format!("{sign}{}", cell.trim_start_matches('-'))
        }),
        &["unstable result", "signs of actuator_force"],
    );
    std::fs::write(folder.join("data.csv"), good).unwrap();
    for (out, words) in [
        ("none/rig.toml", "the folder does not exist"),
        ("rig.html", "expected a file name that ends in .toml"),
    ] {
        refused(
            folder,
            &["identify", "data.csv", "--out", out],
            &["--out", words],
        );
    }
}

#[test]
fn command_and_displacement_alone_make_a_transfer_function() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let all = Test {
        duration: 30.0,
        specimen: None,
        ..Test::default()
    }
    .record();
    let two = [
        Channel::Acceleration,
        Channel::ActuatorForce,
        Channel::Velocity,
    ]
    .into_iter()
    .fold(all, Recording::without);
    std::fs::write(folder.join("two.csv"), csv(&two)).unwrap();
    let said = json(
        folder,
        &["identify", "two.csv", "--out", "two.toml", "--json"],
    );
    assert!(
        said["fit_percent"]["displacement"].as_f64().unwrap() > 80.0,
        "{said}"
    );
    assert_eq!(files(folder), ["two.csv", "two.html", "two.toml"]);
    let model = std::fs::read_to_string(folder.join("two.toml")).unwrap();
    for line in [
        "[transfer_function]",
        "input = \"valve_command\"",
        "denominator = [1.0, ",
    ] {
        assert!(model.contains(line), "{line}: {model}");
    }

    // Columns of other names, with a map; and a map that is wrong.
    let german = csv(&two)
        .replace("reference [m]", "Sollweg")
        .replace("displacement [m]", "Weg")
        .replace("time [s]", "Zeit");
    std::fs::write(folder.join("german.csv"), german).unwrap();
    let map = "time = { column = \"Zeit\", unit = \"s\" }\n\
               reference = { column = \"Sollweg\", unit = \"m\" }\n\
               displacement = { column = \"Weg\", unit = \"m\" }\n";
    std::fs::write(folder.join("map.toml"), map).unwrap();
    let arguments = ["identify", "german.csv", "--columns", "map.toml", "--out"];
    json(folder, &[&arguments[..], &["own.toml", "--json"]].concat());
    std::fs::write(
        folder.join("map.toml"),
        map.replace("displacement", "displacemnt"),
    )
    .unwrap();
    refused(
        folder,
        &[&arguments[..], &["wrong.toml"]].concat(),
        &["map.toml", "`displacemnt` is not a channel", "displacement"],
    );
}

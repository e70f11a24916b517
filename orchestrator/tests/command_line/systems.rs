//! Systems at fault.

use std::fs;

use crate::{refused, shakebench, stderr};

/// The bare table under displacement control, as a file.
const SYSTEM: &str = r#"
connections = [
    "reference.displacement -> control.reference_displacement",
    "table.displacement -> control.measured_displacement",
    "control.valve_command -> table.valve_command",
]

[components.control]
fmu = "DisplacementPid"
period = "2 ms"
[components.control.parameters]
proportional_gain = "3 V/in"

[components.table]
fmu = "ShakeTable"
model = "equation-2-13"
[components.table.inputs]
specimen_force = "0 lbf"
"#;

/// The system with `this` replaced by `that` is refused with all the `words`.
#[track_caller]
fn changed(this: &str, that: &str, words: &[&str]) {
    assert!(SYSTEM.contains(this), "{this}");
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("rig.toml"), SYSTEM.replace(this, that)).unwrap();
    let words = [&["rig.toml"], words].concat();
    refused(folder.path(), &["run", "rig.toml"], &words);
}

#[test]
fn the_system_as_it_stands_runs() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("rig.toml"), SYSTEM).unwrap();
    let output = shakebench(folder.path(), &["run", "rig.toml", "--duration", "2 s"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(
        folder
            .path()
            .join("shakebench-results/rig-synthetic-1/results.csv")
            .is_file()
    );
}

#[test]
fn a_table_that_runs_away_is_a_failed_run_whatever_it_is_called() {
    for name in ["table", "platform"] {
        let folder = tempfile::tempdir().unwrap();
        let wrong_way = SYSTEM
            .replace("\"3 V/in\"", "\"-3 V/in\"")
            .replace("table", name);
        fs::write(folder.path().join("rig.toml"), wrong_way).unwrap();
        let output = shakebench(folder.path(), &["run", "rig.toml", "--duration", "4 s"]);
        assert_eq!(output.status.code(), Some(1), "{name}: {}", stderr(&output));
        assert!(stderr(&output).contains("the run diverged"), "{name}");
    }
}

#[test]
fn no_toml() {
    changed("connections = [", "connections = ", &["line 3"]);
    changed("period", "perriod", &["perriod", "line"]);
}

#[test]
fn names_that_are_unknown_come_with_the_nearest_one() {
    changed(
        "table.displacement ->",
        "table.displacment ->",
        &[
            "line 4",
            "ShakeTable",
            "no output `displacment`",
            "did you mean `displacement`",
        ],
    );
    changed(
        "control.valve_command ->",
        "controll.valve_command ->",
        &["did you mean `control`"],
    );
    changed(
        "reference.displacement",
        "reference.displacements",
        &["did you mean `displacement`"],
    );
    changed(
        "proportional_gain",
        "proportional_gane",
        &[
            "components.control.parameters.proportional_gane",
            "did you mean `proportional_gain`",
        ],
    );
    changed(
        "\"ShakeTable\"",
        "\"ShakeTabel\"",
        &["components.table", "did you mean `ShakeTable`"],
    );
    let folder = tempfile::tempdir().unwrap();
    refused(
        folder.path(),
        &["run", "three-varable"],
        &["did you mean `three-variable`"],
    );
    let setting = ["run", "--set", "control.valve_limits=5"];
    refused(
        folder.path(),
        &setting,
        &["--set", "did you mean `valve_limit`"],
    );
}

#[test]
fn units_that_do_not_fit() {
    changed(
        "table.displacement ->",
        "table.velocity ->",
        &[
            "line 4",
            "`table.velocity` does not fit `control.measured_displacement`",
            "m/s",
        ],
    );
    changed(
        "3 V/in",
        "3 V/lbf",
        &["proportional_gain", "V/lbf", "does not fit"],
    );
    changed("0 lbf", "0 in", &["specimen_force", "does not fit"]);
}

#[test]
fn a_value_of_another_type() {
    changed(
        "\"3 V/in\"",
        "true",
        &["proportional_gain", "`true` is not a value for a Float64"],
    );
    changed("\"3 V/in\"", "\"much\"", &["proportional_gain", "much"]);
    changed(
        "\"2 ms\"",
        "\"2 mm\"",
        &["components.control.period", "does not fit"],
    );
}

#[test]
fn an_input_left_open_keeps_its_start_value_and_a_line_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let open = SYSTEM.replace("specimen_force = \"0 lbf\"", "");
    fs::write(folder.path().join("rig.toml"), open).unwrap();
    let output = shakebench(folder.path(), &["run", "rig.toml", "--duration", "1 s"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(
        said.contains("`table`: the open input `specimen_force` (0 N) keeps its start value"),
        "{said}"
    );
}

#[test]
fn an_input_driven_twice() {
    let twice = "\"table.displacement -> control.reference_displacement\",\n    \"table";
    changed(
        "\"table",
        twice,
        &[
            "line 4",
            "`control.reference_displacement` is already driven by `reference.displacement`",
        ],
    );
}

#[test]
fn an_output_where_an_input_belongs() {
    changed(
        "-> table.valve_command",
        "-> table.velocity",
        &["`velocity` is an output"],
    );
    changed(
        "\"control.valve_command ->",
        "\"control.valve_limit ->",
        &["is a parameter"],
    );
}

#[test]
fn models_that_must_not_be_simulated_or_do_not_exist() {
    changed(
        "equation-2-13",
        "equation-2-11",
        &[
            "components.table.model",
            "must not be simulated",
            "four digits are too few",
        ],
    );
    changed(
        "equation-2-13",
        "equation-2-31",
        &["did you mean `equation-2-13`"],
    );
    changed("equation-2-13", "none.toml", &["none.toml"]);
}

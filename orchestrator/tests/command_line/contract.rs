//! What scripts rely on.

use std::fs;

use crate::{shakebench, stderr, stdout};

#[test]
fn without_arguments_the_built_in_system_runs_and_says_where_everything_lies() {
    let folder = tempfile::tempdir().unwrap();
    let output = shakebench(folder.path(), &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(
        stderr(&output),
        "",
        "nothing but results where nobody watches"
    );
    let said = stdout(&output);
    for file in [
        "results.csv",
        "summary.json",
        "report.html",
        "manifest.json",
    ] {
        let path = folder
            .path()
            .join("shakebench-results/three-variable-synthetic-1")
            .join(file);
        assert!(path.is_file(), "{}", path.display());
        assert!(said.contains(file), "{said}");
    }
    assert!(said.contains("normalised RMS acceleration error"), "{said}");
    let page = folder
        .path()
        .join("shakebench-results/three-variable-synthetic-1/report.html");
    let page = fs::read_to_string(page).unwrap();
    assert!(page.contains("three-variable on synthetic-1"));
    let fetched = page.contains("src=\"http") || page.contains("href=\"http");
    assert!(!fetched, "the page needs a network");
}

#[test]
fn json_is_one_object_with_the_fields_of_the_contract() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "run",
        "displacement-pid",
        "--specimen",
        "none",
        "--fmi",
        "2",
        "--duration",
    ];
    let arguments = [&arguments[..], &["5 s", "--out", "out", "--json"]].concat();
    let output = shakebench(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let mut run: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(run["system"], "displacement-pid");
    assert_eq!(run["motion"]["name"], "synthetic-1");
    for field in ["duration_s", "pga_g", "peak_displacement_m"] {
        assert!(run["motion"][field].as_f64().unwrap() > 0.0, "{field}");
    }
    assert_eq!(run["steps"], 2500);
    assert_eq!(run["step_s"], 0.002);
    assert_eq!(run["fmi"], "2.0");
    assert_eq!(run["algorithm"], "gauss-seidel");
    assert_eq!(run["ended"], "complete");
    for field in ["wall_s", "real_time_factor"] {
        assert!(run[field].as_f64().unwrap() > 0.0, "{field}");
    }
    for field in [
        "time_domain_percent",
        "frequency_domain_percent",
        "peak_displacement_m",
    ] {
        assert!(run["tracking"][field].as_f64().unwrap() > 0.0, "{field}");
    }
    // Where the files are is not a figure of the run.
    assert_eq!(
        run.as_object_mut().unwrap().remove("folder").unwrap(),
        "out"
    );
    let summary = fs::read_to_string(folder.path().join("out/summary.json")).unwrap();
    assert_eq!(
        serde_json::from_str::<serde_json::Value>(&summary).unwrap(),
        run
    );
    let results = fs::read_to_string(folder.path().join("out/results.csv")).unwrap();
    let mut lines = results.lines();
    assert!(
        lines
            .next()
            .unwrap()
            .starts_with("time,reference.displacement,")
    );
    assert_eq!(lines.clone().count(), 2500);
    assert!(lines.all(|line| line.split(',').all(|cell| cell.parse::<f64>().is_ok())));
}

#[test]
fn a_manifest_repeats_a_run_to_the_bit_and_notices_a_difference() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "run",
        "--set",
        "control.integral_gain=\"0.5 V/(in s)\"",
        "--pga",
        "0.1",
    ];
    let arguments: Vec<String> = arguments.map(|a| a.replace('"', "")).to_vec();
    let mut arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    arguments.extend(["--step", "1 ms", "--duration", "4 s", "--out", "first"]);
    let output = shakebench(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));

    let again = ["run", "--manifest", "first/manifest.json", "--out", "again"];
    let output = shakebench(folder.path(), &again);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains("repeated to the bit"));
    let read = |file| fs::read(folder.path().join(file)).unwrap();
    assert_eq!(read("first/results.csv"), read("again/results.csv"));

    let manifest = String::from_utf8(read("first/manifest.json")).unwrap();
    let given = "control.integral_gain=0.5 V/(in s)";
    assert!(manifest.contains(given), "{manifest}");
    let other = manifest.replace(given, "control.integral_gain=0.6 V/(in s)");
    fs::write(folder.path().join("first/manifest.json"), other).unwrap();
    let elsewhere = ["run", "--manifest", "first/manifest.json", "--out", "other"];
    let output = shakebench(folder.path(), &elsewhere);
    assert_eq!(output.status.code(), Some(1));
    let said = stderr(&output);
    assert!(
        said.contains("not repeated") && said.contains("control.integral_gain"),
        "{said}"
    );
}

#[test]
fn every_command_has_help_with_an_example() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["build", "info", "report", "run"] {
        let output = shakebench(folder.path(), &[command, "--help"]);
        assert_eq!(output.status.code(), Some(0));
        let said = stdout(&output);
        assert!(said.contains("Example") && said.contains(&format!("shakebench {command}")));
    }
}

#[test]
fn an_fmu_that_refuses_a_parameter_is_named_with_the_parameter() {
    let folder = tempfile::tempdir().unwrap();
    let setting = ["run", "--set", "control.valve_limit=-3 V"];
    let words = [
        "`control`",
        "ThreeVariableControl.fmu",
        "`valve_limit` is -3",
    ];
    crate::refused(folder.path(), &setting, &words);
}

#[test]
fn a_number_for_a_variable_with_a_unit_asks_for_the_unit() {
    let folder = tempfile::tempdir().unwrap();
    let setting = ["run", "--set", "control.proportional_gain=5"];
    let words = [
        "`5` has no unit",
        "`proportional_gain` is in V/m",
        "proportional_gain=\"5 V/m\"",
        "\"5 V/in\"",
    ];
    crate::refused(folder.path(), &setting, &words);
    // Whole numbers without a unit, truth values and zero need none.
    let done = [
        "run",
        "--duration",
        "1 s",
        "--set",
        "control.integral_gain=0",
    ];
    let output = shakebench(folder.path(), &done);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn nothing_is_overwritten_that_differs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = |pga: &str, rest: &[&str]| {
        let all = ["run", "displacement-pid", "--duration", "1 s", "--pga", pga];
        shakebench(folder, &[&all[..], rest].concat())
    };
    let code = |pga: &str, rest: &[&str]| run(pga, rest).status.code();
    let place = |name: &str| folder.join("shakebench-results").join(name);
    // Without a name: the same command into the same folder, another into a new one.
    assert_eq!(code("0.1", &[]), Some(0));
    assert_eq!(code("0.1", &[]), Some(0));
    assert!(!place("displacement-pid-synthetic-1-2").exists());
    assert_eq!(code("0.12", &[]), Some(0));
    assert!(place("displacement-pid-synthetic-1-2/results.csv").is_file());
    // With a name: the same again is done, another is refused unless it is forced.
    assert_eq!(code("0.1", &["--out", "own"]), Some(0));
    assert_eq!(code("0.1", &["--out", "own"]), Some(0));
    let before = fs::read(folder.join("own/results.csv")).unwrap();
    let refused = run("0.12", &["--out", "own"]);
    assert_eq!(refused.status.code(), Some(2));
    let said = stderr(&refused);
    assert!(
        said.contains("results.csv") && said.contains("--force"),
        "{said}"
    );
    assert_eq!(fs::read(folder.join("own/results.csv")).unwrap(), before);
    assert_eq!(code("0.12", &["--out", "own", "--force"]), Some(0));
    assert_ne!(fs::read(folder.join("own/results.csv")).unwrap(), before);
}

#[test]
fn results_that_cannot_be_written_are_noticed_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("taken"), "").unwrap();
    let output = shakebench(folder.path(), &["run", "--out", "taken"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("taken: results cannot be written here: it is a file"));
    let output = shakebench(folder.path(), &["run", "--out", "taken/below"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}

/// Parquet holds the columns of `results.csv`, to the bit.
#[test]
fn signals_are_written_as_parquet_too_where_that_is_asked_for() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    let folder = tempfile::tempdir().unwrap();
    let arguments = ["run", "--duration", "1 s", "--parquet", "--out", "out"];
    let output = shakebench(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let file = fs::File::open(folder.path().join("out/results.parquet")).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let mut csv = csv::Reader::from_path(folder.path().join("out/results.csv")).unwrap();
    let names = csv.headers().unwrap().clone();
    let mut rows = csv.records();
    let mut count = 0;
    for row in reader.get_row_iter(None).unwrap() {
        let expected = rows.next().unwrap().unwrap();
        for ((name, field), (head, cell)) in row
            .unwrap()
            .get_column_iter()
            .zip(names.iter().zip(&expected))
        {
            assert_eq!(name, head);
            assert_eq!(*field, Field::Double(cell.parse().unwrap()), "{name}");
        }
        count += 1;
    }
    assert_eq!(count, 500);
    assert!(rows.next().is_none());
}

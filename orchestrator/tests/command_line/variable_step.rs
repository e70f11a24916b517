//! Coupling steps chosen as the run goes on, on two masses coupled by a spring, whose motion is known in
//! closed form.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use zip::{ZipWriter, write::SimpleFileOptions};

use crate::{refused, shakebench, stderr};

/// Of each mass: damping coefficient, N s/m, of 1 kg, and stiffnesses to the ground and between, N/m.
const DAMPING: f64 = 0.6;
const GROUND: f64 = 9.0;
const BETWEEN: f64 = 20.0;

/// Packs `tests/importers/oscillator/oscillator.c` as two FMUs with these attributes.
fn pack(folder: &Path, attributes: [&str; 2]) {
    let source =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/importers/oscillator/oscillator.c");
    let library = folder.join("oscillator.so");
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-o"]);
    let done = compiler.arg(&library).arg(source).arg("-lm").output();
    let done = done.expect("a C compiler");
    assert!(done.status.success(), "{}", stderr(&done));
    let variable = |(reference, name): (usize, &&str)| {
        let (role, start) = match reference {
            0 | 1 => (
                r#"causality="output" variability="continuous" initial="calculated""#,
                "",
            ),
            2 | 3 => (
                r#"causality="input" variability="continuous""#,
                r#" start="0""#,
            ),
            4 | 6 | 7 => (
                r#"causality="parameter" variability="fixed""#,
                r#" start="1""#,
            ),
            _ => (
                r#"causality="parameter" variability="fixed""#,
                r#" start="0""#,
            ),
        };
        format!(
            r#"<ScalarVariable name="{name}" valueReference="{reference}" {role}><Real{start}/></ScalarVariable>"#
        )
    };
    let names = [
        "x", "v", "other", "force", "m", "c", "k", "coupling", "x0", "longest",
    ];
    let variables: String = names.iter().enumerate().map(variable).collect();
    for (name, attributes) in ["a", "b"].iter().zip(attributes) {
        let description = format!(
            r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="oscillator" guid="{{1}}">
<CoSimulation modelIdentifier="oscillator" {attributes}/>
<ModelVariables>{variables}</ModelVariables>
<ModelStructure><Outputs><Unknown index="1" dependencies=""/><Unknown index="2" dependencies=""/></Outputs>
<InitialUnknowns><Unknown index="1" dependencies="9"/><Unknown index="2" dependencies=""/></InitialUnknowns>
</ModelStructure></fmiModelDescription>"#
        );
        let mut archive = ZipWriter::new(File::create(folder.join(format!("{name}.fmu"))).unwrap());
        for (entry, content) in [
            ("modelDescription.xml", description.into_bytes()),
            (
                "binaries/linux64/oscillator.so",
                fs::read(&library).unwrap(),
            ),
        ] {
            let options = SimpleFileOptions::default();
            archive.start_file(entry, options).unwrap();
            archive.write_all(&content).unwrap();
        }
        archive.finish().unwrap();
    }
    let both = format!("c = {DAMPING}, k = {GROUND}, coupling = {BETWEEN}");
    let system = format!(
        "connections = [\"a.x -> b.other\", \"b.x -> a.other\"]\n\
         [components.a]\nfmu = \"a.fmu\"\nparameters = {{ {both}, x0 = 1.0 }}\n\
         [components.b]\nfmu = \"b.fmu\"\nparameters = {{ {both} }}\n\
         [experiment]\nsampling = \"0.1 s\"\nduration = \"40 s\"\n"
    );
    fs::write(folder.join("masses.toml"), system).unwrap();
}

const ANY: &str = r#"canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true""#;
const WITHOUT_STATE: &str = r#"canHandleVariableCommunicationStepSize="true""#;
const ONE_LENGTH: &str = r#"canGetAndSetFMUstate="true""#;

/// Displacements of both masses at a time, s, the first let go at 1 m: the sum and the difference are
/// damped oscillators of their own.
fn exact(time: f64) -> [f64; 2] {
    let mode = |stiffness: f64| {
        let decay = DAMPING / 2.0;
        let frequency = (stiffness - decay * decay).sqrt();
        let (sine, cosine) = (frequency * time).sin_cos();
        0.5 * (-decay * time).exp() * (cosine + decay / frequency * sine)
    };
    let (sum, difference) = (mode(GROUND), mode(GROUND + 2.0 * BETWEEN));
    [sum + difference, sum - difference]
}

struct Run {
    summary: Value,
    /// Rows of `time`, `a.x`, `b.x`.
    rows: Vec<[f64; 3]>,
    said: String,
}

impl Run {
    /// Largest error of both displacements, m.
    fn error(&self) -> f64 {
        let errors = self.rows.iter().flat_map(|&[time, a, b]| {
            let exact = exact(time);
            [(a - exact[0]).abs(), (b - exact[1]).abs()]
        });
        errors.fold(0.0, f64::max)
    }

    fn steps(&self) -> u64 {
        self.summary["steps"].as_u64().unwrap()
    }

    fn of_steps(&self, key: &str) -> f64 {
        self.summary["variable_step"][key].as_f64().unwrap()
    }
}

fn run(folder: &Path, more: &[&str]) -> Run {
    let out = tempfile::tempdir_in(folder).unwrap();
    let out = out.path().join("out").display().to_string();
    let mut arguments = vec![
        "run",
        "masses.toml",
        "--json",
        "--isolate",
        "none",
        "--out",
        &out,
    ];
    arguments.extend(more);
    let output = shakebench(folder, &arguments);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let results = fs::read_to_string(Path::new(&out).join("results.csv")).unwrap();
    let mut lines = results
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let place = |name: &str| names.iter().position(|known| *known == name).unwrap();
    let places = ["time", "a.x", "b.x"].map(place);
    let rows = lines.map(|row| places.map(|place| row[place].parse().unwrap()));
    Run {
        summary: serde_json::from_slice(&output.stdout).unwrap(),
        rows: rows.collect(),
        said,
    }
}

#[test]
fn the_error_follows_the_tolerance_with_fewer_steps_than_equal_ones_need() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, [ANY, ANY]);
    for algorithm in ["gauss-seidel", "iterative"] {
        let mut before = f64::INFINITY;
        for tolerance in ["0.1 %", "0.01 %"] {
            let chosen = run(
                folder,
                &["--variable-step", tolerance, "--algorithm", algorithm],
            );
            let (error, steps) = (chosen.error(), chosen.steps());
            // As many equal steps, and a few more.
            let each = (steps as f64 / 400.0).ceil();
            let step = format!("{} s", 0.1 / each);
            let arguments = ["--step", &step, "--algorithm", algorithm];
            let equal = run(folder, &arguments);
            println!(
                "{algorithm} {tolerance}: {steps} steps of {} to {} s, {} repeated, error {error:.2e}; \
                 {} equal steps: {:.2e}",
                chosen.of_steps("shortest_s"),
                chosen.of_steps("longest_s"),
                chosen.of_steps("repeated"),
                equal.steps(),
                equal.error()
            );
            assert_eq!(chosen.rows.len(), 401);
            assert!(error < 0.25 * before, "{algorithm} {tolerance}: {error}");
            assert!(equal.steps() >= steps);
            assert!(
                error < 0.8 * equal.error(),
                "{algorithm} {tolerance}: {error}"
            );
            before = error;
        }
    }
}

#[test]
fn what_cannot_go_back_is_stepped_by_the_error_of_the_step_before() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, [ANY, WITHOUT_STATE]);
    let chosen = run(folder, &["--variable-step", "0.1 %"]);
    assert!(chosen.error() < 4e-3, "{}", chosen.error());
    assert_eq!(chosen.of_steps("repeated"), 0.0);
    assert!(
        chosen.said.contains("`b` cannot save its state"),
        "{}",
        chosen.said
    );
    assert!(chosen.of_steps("longest_s") > 10.0 * chosen.of_steps("shortest_s"));
}

#[test]
fn a_step_that_an_fmu_discards_or_loses_its_way_in_is_made_again_with_a_shorter_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, [ANY, ANY]);
    let limit = ["--set", "a.longest=-0.004"];
    let chosen = run(folder, &[&limit[..], &["--variable-step", "1 %"]].concat());
    assert!(chosen.of_steps("longest_s") <= 0.004 * (1.0 + 1e-9));
    let equal = shakebench(folder, &[&["run", "masses.toml"][..], &limit].concat());
    assert_eq!(equal.status.code(), Some(1));
    let limit = ["--set", "a.longest=0.004"];
    let chosen = run(folder, &[&limit[..], &["--variable-step", "1 %"]].concat());
    assert!(chosen.of_steps("longest_s") <= 0.004 * (1.0 + 1e-9));
    assert!(chosen.of_steps("repeated") > 0.0);
    let equal = shakebench(folder, &[&["run", "masses.toml"][..], &limit].concat());
    assert_eq!(equal.status.code(), Some(1));
    assert!(
        stderr(&equal).contains("returned discard"),
        "{}",
        stderr(&equal)
    );
}

#[test]
fn sampled_components_are_called_at_their_times_and_a_manifest_repeats_the_steps() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, [ANY, ONE_LENGTH]);
    let system = fs::read_to_string(folder.join("masses.toml")).unwrap();
    // Two masses and a third that is called every 0.2 s.
    let third = system
        .replace(
            "\"b.x -> a.other\"]",
            "\"b.x -> a.other\", \"a.x -> c.other\"]",
        )
        .replace(
            "[components.b]\nfmu = \"b.fmu\"",
            "[components.b]\nfmu = \"a.fmu\"",
        )
        .replace("40 s", "2 s");
    let third = format!("{third}[components.c]\nfmu = \"b.fmu\"\nperiod = \"0.2 s\"\n");
    fs::write(folder.join("masses.toml"), third).unwrap();
    let out = ["--least-step", "1 ms", "--out", "out", "--trace", "trace"];
    let chosen = [
        "run",
        "masses.toml",
        "--isolate",
        "none",
        "--variable-step",
        "0.1 %",
    ];
    let output = shakebench(folder, &[&chosen[..], &out].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let trace = fs::read_to_string(folder.join("trace")).unwrap();
    let calls: Vec<&str> = trace
        .lines()
        .filter(|line| line.starts_with("c fmi2DoStep("))
        .collect();
    assert_eq!(calls.len(), 11, "{trace}");
    for (call, line) in calls.iter().enumerate() {
        let numbers = line.trim_start_matches("c fmi2DoStep(").split([',', ')']);
        let numbers: Vec<f64> = numbers
            .filter_map(|cell| cell.trim().parse().ok())
            .collect();
        assert!((numbers[0] - 0.2 * call as f64).abs() < 1e-12, "{line}");
        assert!((numbers[1] - 0.2).abs() < 1e-12, "{line}");
    }
    let again = shakebench(
        folder,
        &["run", "--manifest", "out/manifest.json", "--out", "again"],
    );
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
    assert!(
        stderr(&again).contains("repeated to the bit"),
        "{}",
        stderr(&again)
    );
}

#[test]
fn the_jump_of_an_input_table_is_met_and_its_ramp_followed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, [ANY, ANY]);
    // A mass alone on its spring, k = 1 N/m and no coupling: x = t - sin t under a ramp of 1 N/s from 0 on,
    // until the force falls to 0 at 3 s.
    fs::write(
        folder.join("force.csv"),
        "time,a.force\n0,0\n3,3\n3,0\n6,0\n",
    )
    .unwrap();
    let system = "[components.a]\nfmu = \"a.fmu\"\nparameters = { k = 1.0, coupling = 0.0 }\n\
                  [experiment]\nsampling = \"0.1 s\"\n";
    fs::write(folder.join("ramp.toml"), system).unwrap();
    let arguments = [
        "run",
        "ramp.toml",
        "--input",
        "force.csv",
        "--out",
        "out",
        "--json",
    ];
    let output = shakebench(
        folder,
        &[&arguments[..], &["--variable-step", "0.1 %"]].concat(),
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let results = fs::read_to_string(folder.join("out/results.csv")).unwrap();
    let mut lines = results.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = names.iter().position(|name| *name == "a.x").unwrap();
    let mut worst: f64 = 0.0;
    for line in lines {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let (time, x) = (cells[0], cells[place]);
        let after = time - 3.0;
        let exact = match time <= 3.0 {
            true => time - time.sin(),
            false => (3.0 - 3_f64.sin()) * after.cos() + (1.0 - 3_f64.cos()) * after.sin(),
        };
        worst = worst.max((x - exact).abs());
    }
    assert!(worst < 3e-3, "{worst}");
}

#[test]
fn steps_of_different_lengths_are_refused_where_they_cannot_be() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, [ANY, ONE_LENGTH]);
    let of = |more: &[&'static str]| [&["run", "masses.toml"][..], more].concat();
    let chosen = ["--variable-step", "0.1 %"];
    refused(folder, &of(&chosen), &["--variable-step", "`b`", "period"]);
    pack(folder, [ANY, ANY]);
    let with = |more: &[&'static str]| of(&[&chosen[..], more].concat());
    refused(
        folder,
        &with(&["--algorithm", "jacobi"]),
        &["jacobi", "gauss-seidel"],
    );
    refused(
        folder,
        &with(&["--least-step", "30 ms"]),
        &["0.03 s", "divide"],
    );
    refused(folder, &with(&["--least-step", "1 s"]), &["divide"]);
    refused(folder, &of(&["--least-step", "1 ms"]), &["--variable-step"]);
    refused(folder, &of(&["--variable-step=-1"]), &["not a share"]);
    let system = fs::read_to_string(folder.join("masses.toml")).unwrap();
    let wrong = system + "variable_step = \"often\"\n";
    fs::write(folder.join("masses.toml"), wrong).unwrap();
    refused(
        folder,
        &of(&[]),
        &["masses.toml", "experiment.variable_step", "often"],
    );
}

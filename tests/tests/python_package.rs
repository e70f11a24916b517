//! The Python package, on the program of this build; `dist/try` runs the same from a wheel.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use acceptance::python::{dask, importers, python};
use pack::{self, FmiVersion};

fn root() -> PathBuf {
    pack::workspace_root().unwrap()
}

/// The program that cargo has built beside this test.
fn program() -> PathBuf {
    let own = std::env::current_exe().unwrap();
    let folder = own.ancestors().nth(2).unwrap();
    let program = folder.join(format!("shakebench{}", std::env::consts::EXE_SUFFIX));
    assert!(program.is_file(), "{} is not built", program.display());
    program
}

/// Runs a module of the package's tests.
fn unittest(mut python: Command, module: &str) {
    pack::all_fmus().unwrap();
    python
        .args(["-m", "unittest", "-v", module])
        .env("PYTHONPATH", root().join("python/src"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("SHAKEBENCH_PROGRAM", program())
        .env("SHAKEBENCH_FMUS", pack::default_folder().unwrap())
        .current_dir(root().join("python/tests"));
    let output = python.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("\nOK"), "{said}");
}

#[test]
fn package_runs_the_program_and_returns_what_it_computed() {
    unittest(python(), "test_package");
}

/// Nothing depends on the library that the package steps simulations with, so it is built here.
#[test]
fn simulations_are_stepped_inside_of_python() {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["build", "--offline", "-p", "shakebench-native"]);
    if !cfg!(debug_assertions) {
        cargo.arg("--release");
    }
    let built = cargo.current_dir(root()).output().unwrap();
    assert!(
        built.status.success(),
        "{}",
        String::from_utf8_lossy(&built.stderr)
    );
    unittest(python(), "test_simulation");
}

#[test]
fn a_study_on_dask_is_that_of_the_program_though_a_worker_is_killed() {
    unittest(dask(), "test_campaign");
}

/// A loop of the importers' pages; what it printed.
fn example(script: &str, version: FmiVersion) -> String {
    let file = |name: &str| {
        let mut all = pack::all_fmus().unwrap().into_iter();
        let found = all.find(|fmu| fmu.version == version && fmu.name == name);
        found.unwrap().path
    };
    let mut command = python();
    command.arg(importers().join("../../docs/importing").join(script));
    command.args([file("ShakeTable"), file("ThreeVariableControl")]);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let wrong = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{script}: {said}{wrong}");
    said
}

/// Peak (mm) and largest error (%) in the line that the examples end with.
fn figures(said: &str) -> [f64; 2] {
    let line = said.lines().find(|line| line.starts_with("peak ")).unwrap();
    let mut numbers = line.split(' ').filter_map(|word| word.parse().ok());
    [numbers.next().unwrap(), numbers.next().unwrap()]
}

#[test]
fn examples_of_the_importers_pages_give_what_the_program_gives() {
    let [peak, error] = figures(&example("fmpy_loop.py", FmiVersion::V3));
    let [own_peak, own_error] = played_by_the_program();
    assert!(
        (peak - own_peak).abs() < 1e-3 && (error - own_error).abs() < 0.01,
        "fmpy {peak} mm, {error} %; the program {own_peak} mm, {own_error} %"
    );
    // These masters delay every connection by a step of 0.5 ms and call the controller as often.
    for (script, version) in [
        ("ecos_loop.py", FmiVersion::V3),
        ("libcosim_loop.py", FmiVersion::V2),
    ] {
        let [other, error] = figures(&example(script, version));
        assert!(
            (other / peak - 1.0).abs() < 0.01 && (error - own_error).abs() < 1.0,
            "{script}: {other} mm, {error} %"
        );
    }
}

/// The same motion in `shakebench run`.
fn played_by_the_program() -> [f64; 2] {
    let folder = tempfile::tempdir().unwrap();
    let script = "import sys; sys.path.insert(0, sys.argv[1]); from motion import *\n\
        print('time [s],displacement [m],velocity [m/s],acceleration [m/s2]')\n\
        for k in range(round(DURATION / STEP) + 1):\n    \
            print(','.join(map(repr, (k * STEP, *reference(k * STEP)))))";
    let written = python()
        .args(["-c", script])
        .arg(root().join("docs/importing"))
        .output()
        .unwrap();
    assert!(written.status.success());
    let reference = folder.path().join("reference.csv");
    fs::write(&reference, &written.stdout).unwrap();
    let out = folder.path().join("out");
    let run = Command::new(program())
        .args(["run", "three-variable", "--specimen", "none", "--reference"])
        .arg(&reference)
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    let column = |path: &Path, name: &str| -> Vec<f64> {
        let text = fs::read_to_string(path).unwrap();
        let mut lines = text.lines();
        let mut names = lines.next().unwrap().split(',');
        let at = names.position(|own| own.trim_matches('"') == name).unwrap();
        let cells = lines.map(|line| line.split(',').nth(at).unwrap().parse().unwrap());
        cells.collect()
    };
    let wanted = column(&reference, "displacement [m]");
    let reached = column(&out.join("results.csv"), "table.displacement");
    let peak = reached.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let error = wanted
        .iter()
        .zip(&reached)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    [1e3 * peak, 100.0 * error / (0.5 * 0.0254)]
}

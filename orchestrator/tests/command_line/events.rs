//! Event mode, early return, updates within steps, clocks, binaries and sized arrays of FMI 3.0, on a component
//! made from the project's own kit (`tests/importers/eventful`).

use std::fs;
use std::path::Path;

use crate::{shakebench, stderr};

const RATE: f64 = 0.7;

fn pack(folder: &Path, system: &str) {
    let version = [pack::FmiVersion::V3];
    pack::build_component("tests/importers/eventful", &folder.join("fmus"), &version).unwrap();
    fs::write(folder.join("rig.toml"), system).unwrap();
}

/// The columns of a run by name, and what it said.
fn run(folder: &Path, more: &[&str]) -> (Vec<String>, Vec<Vec<String>>, String) {
    let arguments = ["run", "rig.toml", "--out", "out", "--force"];
    let output = shakebench(folder, &[&arguments[..], more].concat());
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{more:?}: {said}");
    let results = fs::read_to_string(folder.join("out/results.csv")).unwrap();
    let mut lines = results
        .lines()
        .map(|line| line.split(',').map(str::to_string).collect());
    let names: Vec<String> = lines.next().unwrap();
    (names, lines.collect(), said)
}

fn value(names: &[String], row: &[String], name: &str) -> f64 {
    let place = names.iter().position(|one| one == name);
    row[place.unwrap_or_else(|| panic!("no {name} in {names:?}"))]
        .parse()
        .unwrap()
}

#[test]
fn events_within_steps_are_handled_to_their_end_wherever_the_fmu_runs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let system =
        "[components.it]\nfmu = \"fmus/fmi3/Eventful.fmu\"\n[experiment]\nduration = \"4.9 s\"\n";
    pack(folder, system);
    let ways: [&[&str]; 4] = [
        &["--isolate", "none"],
        &["--isolate", "foreign"],
        &["--isolate", "foreign", "--trace", "trace"],
        &["--isolate", "none", "--algorithm", "jacobi"],
    ];
    let mut first = None;
    for way in ways {
        let (names, rows, said) = run(folder, &[&["--step", "50 ms"], way].concat());
        assert!(said.contains("`wrapped` ticked at 1.42857"), "{said}");
        assert_eq!(rows.len(), 99);
        let mut before = 0.0;
        for (at, row) in rows.iter().enumerate() {
            let (time, it) = (0.05 * at as f64, |name: &str| value(&names, row, name));
            let risen = RATE * time;
            let wraps = (risen + 1e-9).floor();
            assert!(
                (it("it.level") - (risen - wraps)).abs() < 1e-9,
                "{way:?}, {time} s"
            );
            // Both passes of each event, and the time events, which no step passes.
            assert_eq!(it("it.wraps"), wraps, "{time}");
            assert_eq!(it("it.settled"), wraps, "{time}");
            assert_eq!(it("it.beats"), (time / 0.37 + 1e-9).floor(), "{time}");
            // A tick within a step is seen at its end, once.
            assert_eq!(it("it.wrapped"), wraps - before, "{time}");
            before = wraps;
            // The input clock, within steps as well: every 0.15 s.
            let samples = (time / 0.15 + 1e-9).floor() + 1.0;
            assert_eq!(it("it.samples"), samples, "{time}");
            let sampled = RATE * 0.15 * (samples - 1.0);
            assert!((it("it.sampled") - sampled.fract()).abs() < 1e-9, "{time}");
        }
        // Each whole step and each part of one.
        let parts = value(&names, &rows[98], "it.updates");
        assert_eq!(parts, 98.0 + 3.0 + 13.0 - 2.0, "{way:?}");
        match &first {
            None => first = Some(rows),
            Some(first) if way.contains(&"jacobi") => assert_eq!(rows.len(), first.len()),
            Some(first) => assert_eq!(&rows, first, "{way:?}"),
        }
    }
    // Every call of the events is in the trace, in the order of the standard.
    let trace = fs::read_to_string(folder.join("trace")).unwrap();
    let calls: Vec<&str> = trace
        .lines()
        .filter_map(|line| line.split_once(" fmi3")?.1.split('(').next())
        .filter(|call| call.contains("Mode") || call.contains("DoStep") || call.starts_with("Upd"))
        .collect();
    let early = calls.iter().position(|call| *call == "DoStep").unwrap();
    assert_eq!(
        calls[..early],
        [
            "EnterInitializationMode",
            "ExitInitializationMode",
            "UpdateDiscreteStates",
            "EnterStepMode"
        ]
    );
    let wrap = [
        "DoStep",
        "EnterEventMode",
        "UpdateDiscreteStates",
        "UpdateDiscreteStates",
        "EnterStepMode",
        "DoStep",
    ];
    let found = calls.windows(wrap.len()).filter(|seen| *seen == wrap);
    assert_eq!(found.count(), 3);
}

#[test]
fn binaries_and_arrays_of_any_size_travel_between_fmus() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let system = r#"
        connections = ["a.echo -> b.packet", "a.scaled -> b.v", "a.wrapped -> b.take", "a.wraps -> b.offer"]
        [components.a]
        fmu = "fmus/fmi3/Eventful.fmu"
        parameters = { n = 3, gains = [1, 2, 3] }
        inputs = { packet = "0102ff", v = [1, 10, 100] }
        [components.b]
        fmu = "fmus/fmi3/Eventful.fmu"
        parameters = { n = 3, gains = [5, 6, 7] }
        [experiment]
        duration = "4.9 s"
    "#;
    pack(folder, system);
    for isolate in ["none", "foreign"] {
        let (names, rows, _) = run(folder, &["--step", "50 ms", "--isolate", isolate]);
        for (at, row) in rows.iter().enumerate() {
            let it = |name: &str| value(&names, row, name);
            let bytes = |name: &str| &row[names.iter().position(|one| one == name).unwrap()];
            assert_eq!(bytes("a.echo"), "ff0201");
            assert_eq!(bytes("b.echo"), "0102ff");
            for (element, (a, b)) in [(1.0, 5.0), (20.0, 120.0), (300.0, 2100.0)]
                .iter()
                .enumerate()
            {
                let element = element + 1;
                assert_eq!(it(&format!("a.scaled[{element}]")), *a);
                assert_eq!(it(&format!("b.scaled[{element}]")), *b);
            }
            // What ticks within a step of `a` triggers `b` at the end of the step, with what `a` gives there.
            let wraps = (RATE * 0.05 * at as f64 + 1e-9).floor();
            assert_eq!(it("b.takes"), wraps, "row {at}");
            assert_eq!(it("b.taken"), wraps, "row {at}");
        }
    }
}

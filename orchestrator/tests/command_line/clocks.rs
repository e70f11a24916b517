//! Input clocks of FMI 3.0: each ticks when its time has come, or the FMU is refused by name.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::process::Command;

use zip::{ZipWriter, write::SimpleFileOptions};

use crate::{shakebench, stderr};

/// Compiles `tests/importers/clocks/clocks.c` and packs it.
fn pack(folder: &Path, attributes: &str) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/importers/clocks/clocks.c");
    let library = folder.join("clocks.so");
    let done = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .args([&library, &source])
        .output()
        .expect("a C compiler");
    assert!(done.status.success(), "{}", stderr(&done));
    let description = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="clocks" instantiationToken="1" generationTool="by hand">
<CoSimulation modelIdentifier="clocks" {attributes}/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Clock name="periodic" valueReference="1" causality="input" intervalVariability="constant" intervalDecimal="0.2"/>
<Clock name="later" valueReference="2" causality="input" intervalVariability="constant" resolution="10" intervalCounter="3" shiftCounter="1"/>
<Clock name="countdown" valueReference="3" causality="input" intervalVariability="countdown"/>
<Clock name="changing" valueReference="4" causality="input" intervalVariability="changing"/>
<Clock name="triggered" valueReference="5" causality="input" intervalVariability="triggered"/>
<Clock name="ticks" valueReference="6" causality="output" intervalVariability="triggered"/>
<Clock name="relay" valueReference="7" causality="output" intervalVariability="triggered"/>
<Clock name="early" valueReference="8" causality="output" intervalVariability="triggered"/>
<Int32 name="n_periodic" valueReference="11" causality="output"/>
<Int32 name="n_later" valueReference="12" causality="output"/>
<Int32 name="n_countdown" valueReference="13" causality="output"/>
<Int32 name="n_changing" valueReference="14" causality="output"/>
<Float64 name="sampled" valueReference="15" causality="output" variability="discrete" clocks="1"/>
<Float64 name="at" valueReference="16" causality="output" variability="discrete" clocks="1"/>
<Int32 name="n_triggered" valueReference="17" causality="output" variability="discrete" clocks="5"/>
<Int32 name="held" valueReference="18" causality="output" variability="discrete" clocks="5"/>
<Float64 name="triggered_at" valueReference="19" causality="output" variability="discrete" clocks="5"/>
<Int32 name="v" valueReference="21" causality="input" variability="discrete" clocks="5" start="0"/>
<Float64 name="u" valueReference="20" causality="input" variability="discrete" clocks="1" start="0"/>
</ModelVariables>
<ModelStructure>
<Output valueReference="11" dependencies="1"/><Output valueReference="12" dependencies="2"/>
<Output valueReference="13" dependencies="3"/><Output valueReference="14" dependencies="4"/>
<Output valueReference="15" dependencies="1 20"/><Output valueReference="16" dependencies="1"/>
<Output valueReference="6" dependencies="1"/><Output valueReference="7" dependencies="5"/>
<Output valueReference="8" dependencies=""/><Output valueReference="17" dependencies="5"/>
<Output valueReference="18" dependencies="5 21"/><Output valueReference="19" dependencies="5"/>
</ModelStructure>
</fmiModelDescription>"#
    );
    let mut archive = ZipWriter::new(File::create(folder.join("clocks.fmu")).unwrap());
    for (name, content) in [
        ("modelDescription.xml", description.into_bytes()),
        (
            "binaries/x86_64-linux/clocks.so",
            fs::read(library).unwrap(),
        ),
    ] {
        archive
            .start_file(name, SimpleFileOptions::default())
            .unwrap();
        archive.write_all(&content).unwrap();
    }
    archive.finish().unwrap();
    let mut input = String::from("time [s],u\n");
    (0..=110).for_each(|k| input += &format!("{},{k}\n", 0.01 * f64::from(k)));
    fs::write(folder.join("input.csv"), input).unwrap();
    let system = r#"
        connections = ["input.u -> it.u"]
        [components.it]
        fmu = "clocks.fmu"
        [tables.input]
        file = "input.csv"
        [experiment]
        duration = "1.1 s"
    "#;
    fs::write(folder.join("rig.toml"), system).unwrap();
}

#[test]
fn input_clocks_tick_at_their_times() {
    let folder = tempfile::tempdir().unwrap();
    pack(
        folder.path(),
        r#"hasEventMode="true" canHandleVariableCommunicationStepSize="true""#,
    );
    for isolate in ["none", "foreign"] {
        for algorithm in ["gauss-seidel", "jacobi"] {
            let arguments = [
                "run", "rig.toml", "--out", "out", "--force", "--step", "50 ms",
            ];
            let more = ["--isolate", isolate, "--algorithm", algorithm];
            let output = shakebench(folder.path(), &[&arguments[..], &more].concat());
            let said = stderr(&output);
            assert_eq!(output.status.code(), Some(0), "{said}");
            assert!(said.contains("input clock `triggered`"), "{said}");
            let results = fs::read_to_string(folder.path().join("out/results.csv")).unwrap();
            let mut lines = results.lines();
            let names: Vec<&str> = lines.next().unwrap().split(',').collect();
            let column = |name: &str| names.iter().position(|one| *one == name).unwrap();
            let mut count = 0;
            for line in lines {
                let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
                let value = |name: &str| cells[column(name)];
                let time = cells[0];
                let ticks =
                    |shift: f64, period: f64| ((time - shift) / period + 1e-6).floor() + 1.0;
                assert_eq!(value("it.n_periodic"), ticks(0.0, 0.2), "{time}");
                assert_eq!(value("it.n_later"), ticks(0.1, 0.3).max(0.0), "{time}");
                assert_eq!(value("it.n_countdown"), ticks(0.05, 0.2).max(0.0), "{time}");
                // At 0.1, 0.3, 0.6 and 1 s.
                let changing = [0.1, 0.3, 0.6, 1.0].iter().filter(|at| **at < time + 1e-9);
                assert_eq!(value("it.n_changing"), changing.count() as f64, "{time}");
                let tick = 0.2 * (value("it.n_periodic") - 1.0);
                assert!((value("it.at") - tick).abs() < 1e-9, "{time}");
                if algorithm == "gauss-seidel" {
                    // The input of the tick, not of the step before.
                    assert!(
                        (value("it.sampled") - 100.0 * tick).abs() < 1e-6,
                        "{time}: {line}"
                    );
                }
                count += 1;
            }
            // From the start to the end.
            assert_eq!(count, 23);
        }
    }
}

#[test]
fn clocks_that_cannot_be_ticked_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    pack(
        folder.path(),
        r#"canHandleVariableCommunicationStepSize="true""#,
    );
    crate::refused(
        folder.path(),
        &["run", "rig.toml"],
        &["clocks.fmu", "input clock `periodic`", "event mode"],
    );
    // A tick between communication points of an FMU whose steps cannot differ.
    pack(folder.path(), r#"hasEventMode="true""#);
    let arguments = ["run", "rig.toml", "--out", "out", "--step", "110 ms"];
    let output = shakebench(folder.path(), &arguments);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("clock `") && said.contains("--step"),
        "{said}"
    );
}

#[test]
fn clocks_trigger_clocks_along_connections() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let attributes = r#"hasEventMode="true" mightReturnEarlyFromDoStep="true" canHandleVariableCommunicationStepSize="true""#;
    pack(folder, attributes);
    let system = |connections: &str| {
        format!(
            "connections = [{connections}]\n[components.a]\nfmu = \"clocks.fmu\"\n[components.b]\n\
             fmu = \"clocks.fmu\"\n[components.c]\nfmu = \"clocks.fmu\"\n[experiment]\nduration = \"1.1 s\"\n"
        )
    };
    let chain = r#""a.ticks -> b.triggered", "a.n_periodic -> b.v", "b.relay -> c.triggered", "b.held -> c.v""#;
    fs::write(folder.join("chain.toml"), system(chain)).unwrap();
    for isolate in ["none", "foreign"] {
        let arguments = [
            "run",
            "chain.toml",
            "--out",
            "out",
            "--force",
            "--step",
            "50 ms",
            "--isolate",
            isolate,
        ];
        let output = shakebench(folder, &arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(0), "{said}");
        // `early` ticks within a step, and `a.triggered` is not connected.
        assert!(said.contains("`early` ticked at 0.33 s"), "{said}");
        assert!(said.contains("`a`: nothing triggers") && !said.contains("`b`: nothing triggers"));
        let results = fs::read_to_string(folder.join("out/results.csv")).unwrap();
        let mut lines = results.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let column = |name: &str| names.iter().position(|one| *one == name).unwrap();
        for line in lines {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            let value = |name: &str| cells[column(name)];
            let time = cells[0];
            let ticks = (time / 0.2 + 1e-6).floor() + 1.0;
            let is_now = (time / 0.2 - (ticks - 1.0)).abs() < 1e-6;
            assert_eq!(value("a.ticks"), f64::from(u8::from(is_now)), "{time}");
            assert_eq!(value("b.relay"), value("a.ticks"), "{time}");
            for part in ["b", "c"] {
                // At the same moments, with what was given then.
                assert_eq!(
                    value(&format!("{part}.n_triggered")),
                    ticks,
                    "{time}: {line}"
                );
                assert_eq!(value(&format!("{part}.held")), ticks, "{time}: {line}");
                let at = value(&format!("{part}.triggered_at"));
                assert!((at - 0.2 * (ticks - 1.0)).abs() < 1e-9, "{time}: {line}");
            }
            // A tick at 0.33 s is seen at 0.35 s.
            let early = (time - 0.35).abs() < 1e-9;
            assert_eq!(value("a.early"), f64::from(u8::from(early)), "{time}");
        }
    }
    for (connection, words) in [
        (r#""a.ticks -> b.periodic""#, "ticks at its own times"),
        (r#""a.ticks -> b.v""#, "is a Clock and cannot drive"),
        (r#""a.n_periodic -> b.triggered""#, "cannot drive the Clock"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        pack(folder.path(), attributes);
        fs::write(folder.path().join("wrong.toml"), system(connection)).unwrap();
        crate::refused(folder.path(), &["run", "wrong.toml"], &[words]);
    }
}

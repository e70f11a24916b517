//! SSP archives: read with all that the standard lets a description say, written so that the published
//! schemas and other importers take them.

use std::f64::consts::TAU;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use acceptance::python::{run_script, run_script_in};
use fmi_import::FmiVersion;
use fmi_master::{Algorithm, Outcome};
use laboratory::export::{Experiment, write};
use laboratory::run::experiment::{Request, prepare};
use laboratory::run::signals::write_csv;
use pack::all_fmus;
use zip::{ZipWriter, write::SimpleFileOptions};

const HEAD: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription version="1.0" name="nested"
 xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping">"#;

/// A component that plays a sine, times an input.
fn sine(name: &str, bindings: &str) -> String {
    format!(
        r#"<ssd:Component name="{name}" source="resources/Sine%20wave.fmu">
<ssd:Connectors>
<ssd:Connector name="scale" kind="input"/>
<ssd:Connector name="displacement" kind="output"/>
<ssd:Connector name="sine_frequency" kind="parameter"/>
</ssd:Connectors>{bindings}</ssd:Component>"#
    )
}

fn values(parameters: &str) -> String {
    format!(
        r#"<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
<ssv:ParameterSet version="1.0" name="set"><ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet>
</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"#
    )
}

fn real(name: &str, value: &str) -> String {
    format!(r#"<ssv:Parameter name="{name}"><ssv:Real value="{value}"/></ssv:Parameter>"#)
}

/// Writes an archive with a description, further files, and the component above.
fn archive(folder: &Path, description: &str, files: &[(&str, &str)]) -> PathBuf {
    let path = folder.join("nested.ssp");
    let mut archive = ZipWriter::new(File::create(&path).unwrap());
    let options = SimpleFileOptions::default();
    let motion = all_fmus()
        .unwrap()
        .into_iter()
        .find(|fmu| fmu.name == "ReferenceMotion" && fmu.version == FmiVersion::V2);
    let fmu = fs::read(&motion.unwrap().path).unwrap();
    let mut add = |name: &str, content: &[u8]| {
        archive.start_file(name, options).unwrap();
        archive.write_all(content).unwrap();
    };
    add("SystemStructure.ssd", description.as_bytes());
    add("resources/Sine wave.fmu", &fmu);
    for (name, content) in files {
        add(name, content.as_bytes());
    }
    archive.finish().unwrap();
    path
}

fn run(path: &Path) -> Outcome {
    let request = Request {
        step_s: Some(0.01),
        ..Request::built_in(&path.display().to_string())
    };
    let prepared = prepare(&request).unwrap_or_else(|error| panic!("{error}"));
    prepared.run(prepared.algorithm).unwrap()
}

#[test]
fn nested_systems_units_transformations_and_parameters_mean_what_the_standard_says() {
    let folder = tempfile::tempdir().unwrap();
    let inner = format!(
        r#"<ssd:System name="sub">
<ssd:Connectors>
<ssd:Connector name="x" kind="input"><ssc:Real unit="mm"/></ssd:Connector>
<ssd:Connector name="y" kind="output"/>
<ssd:Connector name="rate" kind="parameter"/>
</ssd:Connectors>
{}
<ssd:Elements>{}</ssd:Elements>
<ssd:Connections>
<ssd:Connection startConnector="x" endElement="b" endConnector="scale">
<ssc:LinearTransformation factor="2" offset="1"/></ssd:Connection>
<ssd:Connection startElement="b" startConnector="displacement" endConnector="y"/>
<ssd:Connection startConnector="rate" endElement="b" endConnector="sine_frequency"/>
</ssd:Connections>
</ssd:System>"#,
        values(&real("rate", "2")),
        sine("b", &values(&real("sine_amplitude", "0.25"))),
    );
    // Written against the direction of the value; a file with mapping and units; a binding of the whole
    // system goes before that of the component.
    let description = format!(
        r#"{HEAD}<ssd:System name="top">
<ssd:ParameterBindings>
<ssd:ParameterBinding source="resources/a.ssv" prefix="a."><ssd:ParameterMapping source="resources/a.ssm"/></ssd:ParameterBinding>
<ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="over"><ssv:Parameters>
{}{}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>
</ssd:ParameterBindings>
<ssd:Elements>{}{inner}{}</ssd:Elements>
<ssd:Connections>
<ssd:Connection startElement="sub" startConnector="x" endElement="a" endConnector="displacement"/>
<ssd:Connection startElement="sub" startConnector="y" endElement="c" endConnector="scale" suppressUnitConversion="true">
<ssc:LinearTransformation factor="10"/></ssd:Connection>
</ssd:Connections></ssd:System>
<ssd:Units><ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssd:Units>
<ssd:DefaultExperiment startTime="0" stopTime="0.5"/>
</ssd:SystemStructureDescription>"#,
        real("sub.b.sine_amplitude", "0.5"),
        real("nobody.is_here", "1"),
        sine("a", ""),
        sine("c", ""),
    );
    let set = r#"<ssv:ParameterSet version="1.0" name="a" xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
<ssv:Parameters>
<ssv:Parameter name="height"><ssv:Real value="2" unit="in"/></ssv:Parameter>
<ssv:Parameter name="not_mapped"><ssv:Real value="7"/></ssv:Parameter>
<ssv:Parameter name="period"><ssv:Real value="4"/></ssv:Parameter>
</ssv:Parameters><ssv:Units><ssc:Unit name="in"><ssc:BaseUnit m="1" factor="0.0254"/></ssc:Unit></ssv:Units></ssv:ParameterSet>"#;
    let mapping = r#"<ssm:ParameterMapping version="1.0" xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
<ssm:MappingEntry source="a.height" target="a.sine_amplitude"/>
<ssm:MappingEntry source="a.period" target="a.sine_frequency" suppressUnitConversion="true"><ssc:LinearTransformation factor="0.5" offset="1"/></ssm:MappingEntry>
</ssm:ParameterMapping>"#;
    let files = [("resources/a.ssv", set), ("resources/a.ssm", mapping)];
    let path = archive(folder.path(), &description, &files);
    let outcome = run(&path);
    assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
    let column = |name: &str| outcome.record.column(name).unwrap();
    let times = column("time");
    assert_eq!(times.len(), 51);
    let wave = |amplitude: f64, rate: f64, t: f64| 0.5 * amplitude * (1.0 - (TAU * rate * t).cos());
    let (a, b, c) = (
        column("a.displacement"),
        column("sub.b.displacement"),
        column("c.displacement"),
    );
    for (row, &t) in times.iter().enumerate() {
        let first = wave(2.0 * 0.0254, 3.0, t);
        let second = (2.0 * 1000.0 * first + 1.0) * wave(0.5, 2.0, t);
        let third = 10.0 * second * wave(0.0254, 1.0, t);
        for (got, wanted) in [(a[row], first), (b[row], second), (c[row], third)] {
            assert!(
                (got - wanted).abs() < 1e-12 * (1.0 + wanted.abs()),
                "{t}: {got} {wanted}"
            );
        }
    }
    let notes = prepare(&Request::built_in(&path.display().to_string()))
        .unwrap()
        .system
        .notes;
    assert!(
        notes.iter().any(|note| note.contains("nobody.is_here")),
        "{notes:?}"
    );
}

#[test]
fn faults_of_an_archive_are_named_with_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let with = |connections: &str, more: &str| {
        format!(
            "{HEAD}\n<ssd:System name=\"top\">\n<ssd:Elements>{}{}{more}</ssd:Elements>\n\
             <ssd:Connections>{connections}</ssd:Connections></ssd:System>\n\
             </ssd:SystemStructureDescription>",
            sine("a", ""),
            sine("b", "")
        )
    };
    let link = |from: &str, to: &str| {
        let end = |which: &str, at: &str| {
            let (element, connector) = at.split_once('.').unwrap();
            format!("{which}Element=\"{element}\" {which}Connector=\"{connector}\"")
        };
        format!(
            "<ssd:Connection {} {}/>",
            end("start", from),
            end("end", to)
        )
    };
    let there = link("a.displacement", "b.scale");
    for (description, words) in [
        (
            with(&link("a.displacment", "b.scale"), ""),
            "did you mean `displacement`",
        ),
        (
            with(&link("a.displacement", "d.scale"), ""),
            "no element `d`",
        ),
        (
            with(&link("a.displacement", "b.displacement"), ""),
            "both give values",
        ),
        (with(&link("a.scale", "b.scale"), ""), "both take values"),
        (
            with(&format!("{there}{there}"), ""),
            "already driven by `a.displacement`",
        ),
        (
            with("", "<ssd:Component name=\"a\" source=\"x\"/>"),
            "two elements are called `a`",
        ),
        (
            with("", "<ssd:Component name=\"d\" source=\"../x.fmu\"/>"),
            "points outside the archive",
        ),
        (
            with("", "<ssd:Component name=\"d\" source=\"file:///x.fmu\"/>"),
            "not relative",
        ),
        (
            with(
                "",
                "<ssd:Component name=\"d\" source=\"resources/no.fmu\"/>",
            ),
            "resources/no.fmu",
        ),
        (with("", "<ssd:Component name=\"d\"/>"), "no source"),
        (
            with(
                "",
                "<ssd:Component name=\"d\" type=\"text/x-modelica\" source=\"M\"/>",
            ),
            "text/x-modelica",
        ),
        (
            with(
                "",
                "<ssd:Component name=\"d\" type=\"application/x-ssp-definition\" source=\"SystemStructure.ssd\"/>",
            ),
            "loop",
        ),
        (
            with("<ssd:Connection startConnector=\"x\"/>", ""),
            "`endConnector`",
        ),
        (HEAD.to_string(), "not well-formed"),
        (
            format!("{HEAD}</ssd:SystemStructureDescription>"),
            "no <System>",
        ),
        (format!("{HEAD}{}", "<a>".repeat(100_000)), "deeper than"),
    ] {
        let path = archive(folder.path(), &description, &[]);
        let problem = prepare(&Request::built_in(&path.display().to_string())).err();
        let problem = problem
            .unwrap_or_else(|| panic!("{words}: accepted"))
            .to_string();
        assert!(problem.contains(words), "{words}: {problem}");
        assert!(problem.contains("nested.ssp"), "{problem}");
    }
}

/// A built-in system as an archive, and its results with the Jacobi algorithm.
fn exported(
    folder: &Path,
    plant: &str,
    (system, specimen): (&str, &str),
    fmi: FmiVersion,
) -> (PathBuf, PathBuf) {
    let request = Request {
        plant: plant.to_string(),
        specimen: specimen.to_string(),
        fmi,
        algorithm: Some(Algorithm::Jacobi),
        duration_s: Some(1.0),
        ..Request::built_in(system)
    };
    let prepared = prepare(&request).unwrap();
    let outcome = prepared.run(Algorithm::Jacobi).unwrap();
    let stem = format!("{plant}-{system}-{specimen}-{}", fmi.folder());
    let (archive, csv) = (
        folder.join(format!("{stem}.ssp")),
        folder.join(format!("{stem}.csv")),
    );
    let experiment = Experiment {
        motion: Some(&prepared.motion),
        step: prepared.step,
        duration: 1.0,
        algorithm: Algorithm::Jacobi.to_string(),
        fmi,
        installation: pack::Installation::default(),
    };
    write(&prepared.system, &experiment, &archive).unwrap();
    write_csv(&outcome.record, File::create(&csv).unwrap()).unwrap();

    // Read again, it gives the same to the bit.
    let again = prepare(&Request::built_in(&archive.display().to_string())).unwrap();
    assert_eq!(again.algorithm, Algorithm::Jacobi);
    let repeated = again.run(again.algorithm).unwrap();
    for name in &outcome.record.columns {
        let (first, second) = (outcome.record.column(name), repeated.record.column(name));
        let length = outcome.record.len().min(repeated.record.len());
        assert_eq!(
            first.map(|values| values[..length].to_vec()),
            second.map(|values| values[..length].to_vec()),
            "{stem}: {name}"
        );
    }
    (archive, csv)
}

#[test]
fn built_in_systems_are_valid_archives_and_give_in_ecos_and_libcosim_what_jacobi_gives_here() {
    let folder = tempfile::tempdir().unwrap();
    let of = |specimen: &str| -> Vec<(PathBuf, PathBuf)> {
        laboratory::systems::built_in::names()
            .map(|system| {
                exported(
                    folder.path(),
                    "identified",
                    (system, specimen),
                    FmiVersion::V2,
                )
            })
            .collect()
    };
    let (bare, loaded) = (of("none"), of("linear"));
    let third = [exported(
        folder.path(),
        "identified",
        ("three-variable", "none"),
        FmiVersion::V3,
    )];
    compared_with_schemas(&[("1.0", &bare), ("1.0", &loaded), ("2.0", &third)]);
    // ecos reads an output after inputs were set that it depends on directly: with a specimen, whose force
    // and the table's acceleration follow each other without a step, it is no Jacobi master.
    // It takes no SSP 2.0 either.
    compared(&[("ecos", &bare), ("libcosim", &bare), ("libcosim", &loaded)]);
}

#[test]
fn the_physical_rig_is_a_valid_archive_and_gives_in_ecos_and_libcosim_what_jacobi_gives_here() {
    let folder = tempfile::tempdir().unwrap();
    let of = |specimen: &str| -> Vec<(PathBuf, PathBuf)> {
        [
            "displacement-pid",
            "three-variable",
            "sliding-mode",
            "mpc",
            "dual-loop",
        ]
        .map(|system| {
            exported(
                folder.path(),
                "servohydraulic",
                (system, specimen),
                FmiVersion::V2,
            )
        })
        .to_vec()
    };
    let (bare, loaded) = (of("none"), of("linear"));
    compared_with_schemas(&[("1.0", &bare), ("1.0", &loaded)]);
    compared(&[("ecos", &bare), ("libcosim", &bare), ("libcosim", &loaded)]);
}

/// Archives of a version of SSP against its schemas.
fn compared_with_schemas(all: &[(&str, &[(PathBuf, PathBuf)])]) {
    for (version, pairs) in all {
        let mut arguments = vec![PathBuf::from(version)];
        arguments.extend(pairs.iter().map(|(archive, _)| archive.clone()));
        let report = match *version {
            "1.0" => run_script("ssp_schema.py", &arguments),
            _ => run_script_in("ssp", "requirements-ssp.txt", "ssp_schema.py", &arguments),
        };
        println!("{report}");
        assert_eq!(report.matches("ok ").count(), pairs.len(), "{report}");
    }
}

/// Archives in another program against the results here.
fn compared(all: &[(&str, &[(PathBuf, PathBuf)])]) {
    for (program, pairs) in all {
        let mut arguments = vec![PathBuf::from(program), PathBuf::from("0.002")];
        let files = pairs.iter();
        arguments.extend(files.flat_map(|(archive, csv)| [archive.clone(), csv.clone()]));
        let report = run_script("ssp_gate.py", &arguments);
        println!("{report}");
        assert_eq!(report.matches("ok ").count(), pairs.len(), "{report}");
    }
}

//! Systems written as an archive and read again, and connections of archives that do not hold.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::cell::RefCell;
use std::error::Error;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use fmi_import::FmiVersion;
use fmi_ssp::export::{Contents, Experiment, Player, Start, Supply, contents};
use fmi_system::{
    Files, Hop, Passage, Setting, System, SystemFile, Transformation, Value, assemble,
};
use zip::{ZipWriter, write::SimpleFileOptions};

fn zipped(path: &Path, files: &[(&str, &[u8])]) {
    let mut archive = ZipWriter::new(File::create(path).unwrap());
    for (name, content) in files {
        archive
            .start_file(*name, SimpleFileOptions::default())
            .unwrap();
        archive.write_all(content).unwrap();
    }
    archive.finish().unwrap();
}

/// A component of FMI 3.0 without a library: numbers in inches and millimetres, truth values, a choice.
fn part(folder: &Path) {
    let description = r#"<fmiModelDescription fmiVersion="3.0" modelName="Part" instantiationToken="1">
        <CoSimulation modelIdentifier="Part"/>
        <UnitDefinitions><Unit name="in"><BaseUnit m="1" factor="0.0254"/></Unit>
        <Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit></UnitDefinitions>
        <TypeDefinitions><EnumerationType name="Mode"><Item name="Slow" value="1"/><Item name="Fast" value="4"/>
        </EnumerationType></TypeDefinitions>
        <ModelVariables>
        <Float64 name="in" valueReference="1" causality="input" unit="in" start="0"/>
        <Float64 name="out" valueReference="2" causality="output" unit="mm" initial="calculated"/>
        <Boolean name="stop" valueReference="3" causality="input" variability="discrete" start="false"/>
        <Boolean name="done" valueReference="4" causality="output" variability="discrete" initial="calculated"/>
        <Float64 name="gap" valueReference="5" causality="parameter" variability="fixed" unit="mm" start="1"/>
        <Enumeration name="mode" declaredType="Mode" valueReference="6" causality="parameter" variability="fixed"
            start="1"/>
        <Int32 name="count" valueReference="7" causality="parameter" variability="fixed" start="3"/>
        </ModelVariables>
        <ModelStructure><Output valueReference="2" dependencies=""/><Output valueReference="4" dependencies=""/>
        </ModelStructure></fmiModelDescription>"#;
    zipped(
        &folder.join("Part.fmu"),
        &[("modelDescription.xml", description.as_bytes())],
    );
}

/// Keeps what it is asked to start with; the FMU stays as it is.
#[derive(Default)]
struct Kept {
    starts: RefCell<Vec<Start>>,
}

impl Supply for Kept {
    fn player(&self) -> Result<Option<Player>, Box<dyn Error + Send + Sync>> {
        Ok(None)
    }

    fn starting_with(
        &self,
        file: &Path,
        starts: &[Start],
    ) -> Result<Vec<u8>, Box<dyn Error + Send + Sync>> {
        self.starts.borrow_mut().extend_from_slice(starts);
        Ok(std::fs::read(file)?)
    }
}

fn assembled(file: &SystemFile) -> System {
    assemble(file, &[], &mut Files::of(file)).unwrap()
}

/// Connections by their ends, with what is done on the way, in the order of their names.
fn connections(system: &System) -> Vec<(String, Passage)> {
    let mut all: Vec<_> = system
        .connections
        .iter()
        .map(|own| {
            let part = &system.components[own.component];
            let input = &part.fmu.description.variables[own.input].name;
            let from = system.origin(own.source);
            let ends = format!("{from} -> {}.{input}", part.name);
            (ends, own.passage.clone())
        })
        .collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}

#[test]
fn a_system_is_the_same_after_it_was_an_archive() {
    let folder = tempfile::tempdir().unwrap();
    part(folder.path());
    let text = "connections = [\n\"a.out -> b.in\",\n\"a.done -> b.stop\",\n\
                { connect = \"b.out -> a.in\", factor = 3.0, offset = 0.5 },\n]\n\
                [components.a]\nfmu = \"Part.fmu\"\n[components.a.parameters]\ngap = \"0.5 in\"\ncount = 9\n\
                [components.b]\nfmu = \"Part.fmu\"\n";
    let path = folder.path().join("pair.toml");
    std::fs::write(&path, text).unwrap();
    let mut file = SystemFile::read(&path).unwrap();
    // A truth value, turned round.
    let turned = vec![(0.0, 1.0), (1.0, 0.0)];
    file.connections[1].way.hops = vec![Hop {
        transformation: Transformation::Numbers(turned.clone()),
        ..Hop::default()
    }];
    let before = assembled(&file);
    let supply = Kept::default();
    let experiment = Experiment {
        supply: &supply,
        sampling: None,
        step: 0.002,
        duration: 3.0,
        algorithm: "in-order".to_string(),
        fmi: FmiVersion::V3,
    };
    let out = folder.path().join("pair.ssp");
    let written = contents(&before, &experiment, &out).unwrap();
    // Two components of one FMU: it is in the archive once.
    let names: Vec<&str> = written.files.keys().map(String::as_str).collect();
    assert_eq!(names, ["SystemStructure.ssd", "resources/Part.fmu"]);
    assert_eq!(
        written.files["resources/Part.fmu"],
        std::fs::read(folder.path().join("Part.fmu")).unwrap()
    );
    let files: Vec<(&str, &[u8])> = written
        .files
        .iter()
        .map(|(name, content)| (name.as_str(), content.as_slice()))
        .collect();
    zipped(&out, &files);

    let read = fmi_ssp::read(&out.to_string_lossy()).unwrap();
    assert_eq!(read.step().unwrap(), Some(0.002));
    assert_eq!(read.duration().unwrap(), Some(3.0));
    let after = assembled(&read);
    let (before_all, after_all) = (connections(&before), connections(&after));
    assert_eq!(before_all.len(), 3);
    for ((ends, one), (others, other)) in before_all.iter().zip(&after_all) {
        assert_eq!(ends, others);
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * a.abs();
        assert!(
            near(one.factor, other.factor) && near(one.offset, other.offset),
            "{ends}"
        );
        assert_eq!(one.map, other.map, "{ends}");
    }
    // In the file: mm to in, then as it says.
    let back = &before_all[2].1;
    assert!((back.factor - 3.0 / 25.4).abs() < 1e-12, "{back:?}");
    assert_eq!((back.offset, &before_all[0].1.map), (0.5, &turned));
    for (one, other) in before.components.iter().zip(&after.components) {
        let values = |system: &fmi_system::Component| -> Vec<(usize, Value)> {
            let mut all = system.parameters.clone();
            all.sort_by_key(|(position, _)| *position);
            all
        };
        assert_eq!((&one.name, one.period), (&other.name, other.period));
        assert_eq!(values(one), values(other), "{}", one.name);
    }
}

#[test]
fn files_of_other_start_values_have_names_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    part(folder.path());
    let text = "[components.a]\nfmu = \"Part.fmu\"\n[components.a.parameters]\nmode = \"Fast\"\n\
                [components.b]\nfmu = \"Part.fmu\"\n";
    let path = folder.path().join("pair.toml");
    std::fs::write(&path, text).unwrap();
    let system = assembled(&SystemFile::read(&path).unwrap());
    let supply = Kept::default();
    let experiment = Experiment {
        supply: &supply,
        sampling: None,
        step: 0.002,
        duration: 1.0,
        algorithm: "in-order".to_string(),
        fmi: FmiVersion::V3,
    };
    let out = folder.path().join("pair.ssp");
    let structure = |written: &Contents| {
        let text = written.files["SystemStructure.ssd"].clone();
        String::from_utf8(text).unwrap()
    };
    // An FMU of others stays as it is, and its choice is in the archive's values.
    let written = contents(&system, &experiment, &out).unwrap();
    let names: Vec<&str> = written.files.keys().map(String::as_str).collect();
    assert_eq!(names, ["SystemStructure.ssd", "resources/Part.fmu"]);
    assert_eq!(*supply.starts.borrow(), []);
    let value = r#"<ssv:Parameter name="mode"><ssv:Integer value="4"/></ssv:Parameter>"#;
    assert!(structure(&written).contains(value));
    // One of the project starts with its choice.
    let mut system = system;
    for part in &mut system.components {
        Arc::make_mut(&mut part.fmu).is_own = true;
    }
    let experiment = Experiment {
        supply: &supply,
        ..experiment
    };
    let written = contents(&system, &experiment, &out).unwrap();
    let chosen = Start {
        name: "mode".to_string(),
        value: 4.0,
    };
    assert_eq!(*supply.starts.borrow(), [chosen]);
    let names: Vec<&str> = written.files.keys().map(String::as_str).collect();
    let expected = [
        "SystemStructure.ssd",
        "resources/Part-2.fmu",
        "resources/Part.fmu",
    ];
    assert_eq!(names, expected);
    assert!(!structure(&written).contains("\"mode\""));
}

/// A description with two components and a system within, whose connections are `inner` and `outer`.
fn description(inner: &str, outer: &str) -> String {
    let component = |name: &str| {
        format!(
            r#"<ssd:Component name="{name}" type="application/x-fmu-sharedlibrary" source="{name}.fmu"><ssd:Connectors>
            <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
            <ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors></ssd:Component>"#
        )
    };
    format!(
        r#"<ssd:SystemStructureDescription version="1.0" name="pair"
        xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
        xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"><ssd:System name="root"><ssd:Elements>
        {}{}<ssd:System name="s"><ssd:Connectors>
        <ssd:Connector name="i" kind="input"><ssc:Real/></ssd:Connector>
        <ssd:Connector name="o" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>
        <ssd:Connections>{inner}</ssd:Connections></ssd:System>
        </ssd:Elements><ssd:Connections>{outer}</ssd:Connections></ssd:System></ssd:SystemStructureDescription>"#,
        component("a"),
        component("b")
    )
}

fn read(folder: &Path, inner: &str, outer: &[[&str; 4]]) -> Result<SystemFile, String> {
    let outer: String = outer
        .iter()
        .map(|[element, connector, other, to]| {
            format!(
                r#"<ssd:Connection startElement="{element}" startConnector="{connector}" endElement="{other}" endConnector="{to}"/>"#
            )
        })
        .collect();
    let path = folder.join("SystemStructure.ssd");
    std::fs::write(&path, description(inner, &outer)).unwrap();
    fmi_ssp::read(&path.to_string_lossy()).map_err(|error| error.to_string())
}

#[test]
fn values_go_through_systems_within_in_either_direction() {
    let folder = tempfile::tempdir().unwrap();
    let through = r#"<ssd:Connection startConnector="i" endConnector="o"/>"#;
    for outer in [
        [["a", "y", "s", "i"], ["s", "o", "b", "u"]],
        // Kinds, not the order of the ends, give the direction.
        [["s", "i", "a", "y"], ["b", "u", "s", "o"]],
    ] {
        let file = read(folder.path(), through, &outer).unwrap();
        let links: Vec<String> = file.connections.iter().map(ToString::to_string).collect();
        assert_eq!(links, ["a.y -> b.u"]);
    }
}

#[test]
fn a_component_without_connectors_has_those_of_its_fmu_and_a_system_has_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("SystemStructure.ssd");
    let links = |end: &str| {
        let text = format!(
            r#"<ssd:SystemStructureDescription version="1.0" name="pair"
            xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"><ssd:System name="root"><ssd:Elements>
            <ssd:Component name="a" source="a.fmu"/><ssd:Component name="b" source="b.fmu"/>
            <ssd:System name="s"/></ssd:Elements><ssd:Connections>
            <ssd:Connection startElement="a" startConnector="y" {end}/>
            </ssd:Connections></ssd:System></ssd:SystemStructureDescription>"#
        );
        std::fs::write(&path, text).unwrap();
        let read = fmi_ssp::read(&path.to_string_lossy());
        read.map(|file| file.connections[0].to_string())
            .map_err(|error| error.to_string())
    };
    let found = links(r#"endElement="b" endConnector="u""#).unwrap();
    assert_eq!(found, "a.y -> b.u");
    let told = links(r#"endElement="s" endConnector="u""#).unwrap_err();
    assert!(told.contains("`s` has no connector `u`"), "{told}");
}

#[test]
fn connections_that_do_not_hold_are_refused_with_their_ends() {
    let folder = tempfile::tempdir().unwrap();
    let through = r#"<ssd:Connection startConnector="i" endConnector="o"/>"#;
    let cases: [(&str, &[[&str; 4]], &str); 7] = [
        (
            "",
            &[["a", "y", "b", "y"]],
            "`a.y` and `b.y` both give values",
        ),
        (
            "",
            &[["a", "u", "b", "u"]],
            "`a.u` and `b.u` both take values",
        ),
        (
            "",
            &[["a", "y", "b", "u"], ["b", "y", "b", "u"]],
            "`b.u` is already driven by `a.y`",
        ),
        ("", &[["a", "z", "b", "u"]], "`a` has no connector `z`"),
        (
            "",
            &[["c", "y", "b", "u"]],
            "the system `root` has no element `c`",
        ),
        (
            "",
            &[["", "q", "b", "u"]],
            "the system `root` has no connector `q`",
        ),
        (
            through,
            &[["s", "o", "s", "i"], ["s", "o", "b", "u"]],
            "`b.u` drives itself through connectors",
        ),
    ];
    for (inner, outer, expected) in cases {
        let said = read(folder.path(), inner, outer).unwrap_err();
        let (_, reason) = said.split_once(": ").unwrap();
        assert!(reason.contains(expected), "{said}");
    }
}

/// An archive whose element `reference` plays a motion: its FMU is of this model and has this motion.
fn played(folder: &Path, model: &str, motion: Option<&str>) -> SystemFile {
    let inner = folder.join("inner.fmu");
    let description = format!(r#"<fmiModelDescription modelName="{model}"/>"#);
    let mut files = vec![("modelDescription.xml", description.as_bytes())];
    files.extend(motion.map(|text| ("resources/motion.csv", text.as_bytes())));
    zipped(&inner, &files);
    let structure = r#"<ssd:SystemStructureDescription version="1.0" name="pair"
        xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"><ssd:System name="root"><ssd:Elements>
        <ssd:Component name="reference" source="resources/R.fmu"/><ssd:Component name="a" source="resources/A.fmu"/>
        </ssd:Elements><ssd:Connections>
        <ssd:Connection startElement="reference" startConnector="displacement" endElement="a" endConnector="x"/>
        <ssd:Connection startElement="reference" startConnector="velocity_before" endElement="a" endConnector="v"/>
        </ssd:Connections></ssd:System></ssd:SystemStructureDescription>"#;
    let path = folder.join("pair.ssp");
    let fmu = std::fs::read(&inner).unwrap();
    zipped(
        &path,
        &[
            ("SystemStructure.ssd", structure.as_bytes()),
            ("resources/R.fmu", &fmu),
            ("resources/A.fmu", &fmu),
        ],
    );
    fmi_ssp::read(&path.to_string_lossy()).unwrap()
}

#[test]
fn the_motion_of_an_own_archive_becomes_the_reference_and_another_component_gives_its_name_up() {
    let folder = tempfile::tempdir().unwrap();
    let names = |file: &SystemFile| -> Vec<String> { file.components.keys().cloned().collect() };
    let links = |file: &SystemFile| -> Vec<String> {
        let mut all: Vec<String> = file.connections.iter().map(ToString::to_string).collect();
        all.sort();
        all
    };
    let motion = "time,displacement,velocity,acceleration\n0,1,2,3\n0.01,4,5,6\n";
    let own = played(folder.path(), "ReferenceMotion", Some(motion));
    assert_eq!(names(&own), ["a"]);
    assert_eq!(
        links(&own),
        [
            "reference.displacement -> a.x",
            "reference.velocity[-1] -> a.v"
        ]
    );
    // The samples stay, under names with units.
    let table = own.experiment.reference.clone().unwrap();
    let table = own.directory.as_ref().unwrap().join(table);
    assert_eq!(
        std::fs::read_to_string(table).unwrap(),
        "time [s],displacement [m],velocity [m/s],acceleration [m/s2]\n0,1,2,3\n0.01,4,5,6\n"
    );
    assert!(own.notes.is_empty(), "{:?}", own.notes);
    for (model, motion) in [("Other", Some(motion)), ("ReferenceMotion", None)] {
        let other = played(folder.path(), model, motion);
        assert_eq!(names(&other), ["a", "reference_"]);
        assert_eq!(
            links(&other),
            [
                "reference_.displacement -> a.x",
                "reference_.velocity_before -> a.v"
            ]
        );
        assert_eq!(other.experiment.reference, None);
        assert_eq!(
            other.notes,
            [
                "the component `reference` is renamed `reference_`, because `reference` is the motion"
            ]
        );
    }
}

#[test]
fn an_experiment_is_the_same_after_it_was_an_archive() {
    let folder = tempfile::tempdir().unwrap();
    part(folder.path());
    let guard = r#"<fmiModelDescription fmiVersion="3.0" modelName="Guard" instantiationToken="1">
        <CoSimulation modelIdentifier="Guard"/><TypeDefinitions><EnumerationType name="Cause">
        <Item name="none" value="0"/><Item name="far" value="1"/></EnumerationType></TypeDefinitions><ModelVariables>
        <Boolean name="stop" valueReference="1" causality="input" variability="discrete" start="false"/>
        <Boolean name="tripped" valueReference="2" causality="output" variability="discrete" initial="calculated"/>
        <Enumeration name="why" declaredType="Cause" valueReference="3" causality="output" variability="discrete"
        initial="calculated"/></ModelVariables>
        <ModelStructure><Output valueReference="2"/><Output valueReference="3"/></ModelStructure>
        </fmiModelDescription>"#;
    zipped(
        &folder.path().join("Guard.fmu"),
        &[("modelDescription.xml", guard.as_bytes())],
    );
    let text = r#"connections = ["a.done -> guard.stop"]
        [components.a]
        fmu = "Part.fmu"
        [components.guard]
        fmu = "Guard.fmu"
        period = "2 ms"
        [experiment]
        start = 1.5
        end_when = "guard.tripped"
        end_cause = "guard.why"
        end_after = "0.5 s"
        stop = "guard.stop"
        "#;
    let path = folder.path().join("pair.toml");
    for (text, sampling) in [
        (text.to_string(), Some(0.004)),
        (text.split("[experiment]").next().unwrap().to_string(), None),
    ] {
        std::fs::write(&path, text).unwrap();
        let before = assembled(&SystemFile::read(&path).unwrap());
        let supply = Kept::default();
        let experiment = Experiment {
            supply: &supply,
            sampling,
            step: 0.002,
            duration: 3.0,
            algorithm: "gauss-seidel".to_string(),
            fmi: FmiVersion::V3,
        };
        let out = folder.path().join("pair.ssp");
        let written = contents(&before, &experiment, &out).unwrap();
        let files = written.files.iter();
        let files: Vec<(&str, &[u8])> = files.map(|(name, own)| (&**name, &**own)).collect();
        zipped(&out, &files);
        let read = fmi_ssp::read(&out.to_string_lossy()).unwrap();
        let after = assembled(&read);
        assert_eq!((after.end, after.stop), (before.end, before.stop));
        assert_eq!(after.start, before.start);
        let own = &read.experiment;
        assert_eq!(own.algorithm.as_deref(), Some("gauss-seidel"));
        assert_eq!(read.step().unwrap(), Some(0.002));
        assert_eq!(read.duration().unwrap(), Some(3.0));
        assert_eq!(own.sampling.is_some(), sampling.is_some());
        let periods: Vec<_> = after.components.iter().map(|part| part.period).collect();
        assert_eq!(periods, [None, Some(0.002)]);
    }
}

/// A description with an experiment and a system `inner` within so many others.
fn nested(depth: usize, experiment: &str, inner: &str) -> String {
    let begins = (0..depth).map(|n| format!(r#"<ssd:System name="s{n}"><ssd:Elements>"#));
    let ends = "</ssd:Elements></ssd:System>".repeat(depth);
    format!(
        r#"<ssd:SystemStructureDescription version="1.0" name="deep"
        xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription">{}{inner}{ends}{experiment}
        </ssd:SystemStructureDescription>"#,
        begins.collect::<String>()
    )
}

const ALONE: &str =
    r#"<ssd:Component name="a" source="a.fmu" type="application/x-fmu-sharedlibrary"/>"#;

fn of_text(text: &str) -> Result<SystemFile, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("SystemStructure.ssd");
    std::fs::write(&path, text).unwrap();
    fmi_ssp::read(&path.to_string_lossy()).map_err(|error| error.to_string())
}

#[test]
fn systems_are_followed_to_a_depth_and_components_bear_their_names() {
    let file = of_text(&nested(4, "", ALONE)).unwrap();
    let names: Vec<&String> = file.components.keys().collect();
    assert_eq!(names, ["s1.s2.s3.a"]);
    // The outermost is at no depth.
    assert!(of_text(&nested(33, "", ALONE)).is_ok());
    let refused = of_text(&nested(34, "", ALONE)).unwrap_err();
    assert!(refused.contains("nested deeper than 32"), "{refused}");
}

#[test]
fn an_experiment_begins_and_is_as_long_as_from_its_start_to_its_stop() {
    let of = |attributes: &str| {
        let experiment = format!("<ssd:DefaultExperiment {attributes}/>");
        let file = of_text(&nested(1, &experiment, ALONE))?;
        Ok::<_, String>((file.experiment.start, file.duration().unwrap()))
    };
    assert_eq!(
        of(r#"startTime="1.5" stopTime="4""#),
        Ok((Some(1.5), Some(2.5)))
    );
    assert_eq!(of(r#"stopTime="4""#), Ok((None, Some(4.0))));
    assert_eq!(of(r#"startTime="1.5""#), Ok((Some(1.5), None)));
    let refused = of(r#"startTime="4" stopTime="4""#).unwrap_err();
    let said = "the default experiment stops at 4 s, not after its start at 4 s";
    assert!(refused.contains(said), "{refused}");
}

#[test]
fn components_that_cannot_be_run_are_refused_with_their_reasons() {
    let of = |attributes: &str| {
        let component = format!(r#"<ssd:Component name="a" {attributes}/>"#);
        of_text(&nested(1, "", &component)).map(|_| ())
    };
    let fmu = r#"type="application/x-fmu-sharedlibrary""#;
    for (attributes, reason) in [
        (
            fmu.to_string(),
            "`a`: it has no source, so there is nothing to run",
        ),
        (
            r##"source="#other""##.to_string(),
            "`a`: there is no system with the id `other`",
        ),
        (
            r#"source="a.ssp" type="application/x-ssp-package""#.to_string(),
            "`a.ssp` is an archive within the archive, which is not supported",
        ),
        (
            r#"source="a.mo" type="text/x-modelica""#.to_string(),
            "its type is `text/x-modelica`",
        ),
        (
            format!(r#"source="a.fmu" {fmu} implementation="ScheduledExecution""#),
            "scheduled execution is not supported",
        ),
    ] {
        let refused = of(&attributes).unwrap_err();
        assert!(refused.contains(reason), "{refused}");
    }
    assert_eq!(of(&format!(r#"source="a.fmu" {fmu}"#)), Ok(()));
    assert_eq!(of(r#"source="a.fmu""#), Ok(()));
    let other = r#"<ssd:SignalDictionaryReference name="bus" dictionary="wires"/>"#;
    let refused = of_text(&nested(1, "", other)).unwrap_err();
    assert!(
        refused.contains("there is no signal dictionary `wires`"),
        "{refused}"
    );
    let twice = of_text(&nested(1, "", &ALONE.repeat(2))).unwrap_err();
    assert!(twice.contains("two elements are called `a`"), "{twice}");
}

#[test]
fn a_description_of_any_name_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.ssd");
    std::fs::write(&path, nested(1, "", ALONE)).unwrap();
    let other = folder.path().join("SystemStructure.ssd");
    std::fs::write(other, nested(1, "", &ALONE.replace("\"a\"", "\"b\""))).unwrap();
    let file = fmi_ssp::read(&path.to_string_lossy()).unwrap();
    assert!(file.components.contains_key("a") && file.components.len() == 1);
}

#[test]
fn values_of_a_system_reach_its_components_by_their_names() {
    let set = |parameters: &[(&str, f64)]| -> String {
        let all = parameters.iter().map(|(name, value)| {
            format!(r#"<ssv:Parameter name="{name}"><ssv:Real value="{value}"/></ssv:Parameter>"#)
        });
        format!(
            r#"<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0"
            name="set"><ssv:Parameters>{}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues>
            </ssd:ParameterBinding></ssd:ParameterBindings>"#,
            all.collect::<String>()
        )
    };
    let component = |name: &str, bindings: &str| {
        format!(
            r#"<ssd:Component name="{name}" source="a.fmu" type="application/x-fmu-sharedlibrary">{bindings}
            </ssd:Component>"#
        )
    };
    let inner = format!(
        r#"<ssd:System name="inner">{}<ssd:Elements>{}{}</ssd:Elements></ssd:System>{}"#,
        set(&[("a.k", 1.0), ("b.k", 2.0)]),
        component("a", &set(&[("k", 3.0), ("c", 4.0)])),
        component("b", ""),
        component("a", ""),
    );
    let text = nested(1, "", &inner)
        .replacen(
            r#"<ssd:System name="s0">"#,
            &format!(
                r#"<ssd:System name="s0">{}"#,
                set(&[("inner.b.k", 5.0), ("a.k", 6.0), ("inner.b.m", 7.0)])
            ),
            1,
        )
        .replace(
            "<ssd:SystemStructureDescription ",
            r#"<ssd:SystemStructureDescription xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" "#,
        );
    let file = of_text(&text).unwrap();
    let given = |component: &str| -> Vec<(String, f64)> {
        let all = file.components[component].parameters.iter();
        let number = |setting: &Setting| match setting {
            Setting::Number(value) => *value,
            Setting::Declared(own) => match own.value {
                Setting::Number(value) => value,
                _ => f64::NAN,
            },
            _ => f64::NAN,
        };
        all.map(|(name, own)| (name.clone(), number(own))).collect()
    };
    let named = |all: &[(&str, f64)]| -> Vec<(String, f64)> {
        all.iter()
            .map(|(name, value)| ((*name).to_string(), *value))
            .collect()
    };
    // Values of a higher system go before those of a lower one.
    assert_eq!(given("inner.a"), named(&[("c", 4.0), ("k", 1.0)]));
    assert_eq!(given("inner.b"), named(&[("k", 5.0), ("m", 7.0)]));
    assert_eq!(given("a"), named(&[("k", 6.0)]));
}

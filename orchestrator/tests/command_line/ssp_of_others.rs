//! SSP archives as other tools write them: each is made anew after what such a tool wrote, runs, and gives the
//! values that its description means.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use zip::{ZipWriter, write::SimpleFileOptions};

use crate::loops::{Offer, pack};
use crate::{shakebench, stderr};

const SPACES: &str = r#"xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon""#;

/// A description of a root system with this content.
fn described(content: &str, behind: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription version="1.0" name="others" {SPACES}>
<ssd:System name="root">{content}</ssd:System>{behind}
</ssd:SystemStructureDescription>"#
    )
}

const HALF_A_SECOND: &str = r#"<ssd:DefaultExperiment startTime="0.0" stopTime="0.5"/>"#;

/// `y = offset + gain u`, of FMI 2.0.
fn line(name: &str, more: &str) -> String {
    part(name, "line.fmu", r#"<ssc:Real/>"#, more)
}

fn part(name: &str, fmu: &str, kind: &str, more: &str) -> String {
    format!(
        r#"<ssd:Component name="{name}" type="application/x-fmu-sharedlibrary" source="resources/{fmu}">
<ssd:Connectors><ssd:Connector name="u" kind="input">{kind}</ssd:Connector>
<ssd:Connector name="y" kind="output">{kind}</ssd:Connector></ssd:Connectors>{more}</ssd:Component>"#
    )
}

/// Parameters in a set of their own.
fn set(parameters: &[(&str, &str)]) -> String {
    let parameters = parameters.iter().map(|(name, value)| {
        let value = match value.contains('<') {
            true => (*value).to_string(),
            false => format!(r#"<ssv:Real value="{value}"/>"#),
        };
        format!(r#"<ssv:Parameter name="{name}">{value}</ssv:Parameter>"#)
    });
    let parameters: String = parameters.collect();
    format!(
        r#"<ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="set">
<ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>"#
    )
}

fn bound(bindings: &[String]) -> String {
    format!(
        "<ssd:ParameterBindings>{}</ssd:ParameterBindings>",
        bindings.concat()
    )
}

fn link(from: (&str, &str), to: (&str, &str)) -> String {
    format!(
        r#"<ssd:Connection startElement="{}" startConnector="{}" endElement="{}" endConnector="{}"/>"#,
        from.0, from.1, to.0, to.1
    )
}

fn system(elements: &[String], connections: &[String]) -> String {
    format!(
        "<ssd:Elements>{}</ssd:Elements><ssd:Connections>{}</ssd:Connections>",
        elements.concat(),
        connections.concat()
    )
}

/// A component of the Reference-FMU with an input and an output of every type.
fn through(name: &str, connectors: &[(&str, &str, &str)], more: &str) -> String {
    let connectors = connectors.iter().map(|(name, kind, typed)| {
        format!(r#"<ssd:Connector name="{name}" kind="{kind}">{typed}</ssd:Connector>"#)
    });
    let connectors: String = connectors.collect();
    format!(
        r#"<ssd:Component name="{name}" source="resources/Feedthrough.fmu"><ssd:Connectors>{connectors}</ssd:Connectors>{more}</ssd:Component>"#
    )
}

struct Archives {
    folder: tempfile::TempDir,
}

impl Archives {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, is_fmi3) in [("line", false), ("line3", true)] {
            let derivatives = 0;
            pack(
                folder.path(),
                name,
                Offer {
                    is_fmi3,
                    derivatives,
                },
            );
        }
        Self { folder }
    }

    fn fmu(&self, name: &str) -> Vec<u8> {
        let own = self.folder.path().join(name);
        let others = shared().join("foreign-fmus/fmi2").join(name);
        fs::read(if own.is_file() { own } else { others }).unwrap()
    }

    fn write(&self, description: &str, files: &[(&str, &str)]) {
        let path = self.folder.path().join("system.ssp");
        let mut archive = ZipWriter::new(File::create(path).unwrap());
        let mut add = |name: &str, content: &[u8]| {
            archive
                .start_file(name, SimpleFileOptions::default())
                .unwrap();
            archive.write_all(content).unwrap();
        };
        add("SystemStructure.ssd", description.as_bytes());
        for name in ["line.fmu", "line3.fmu", "Feedthrough.fmu", "Dahlquist.fmu"] {
            add(&format!("resources/{name}"), &self.fmu(name));
        }
        for (name, content) in files {
            add(name, content.as_bytes());
        }
        archive.finish().unwrap();
    }

    /// Runs it; gives what was said, and the last value of each of these columns.
    #[track_caller]
    fn run(&self, file: &str, more: &[&str], columns: &[&str]) -> (String, Vec<f64>) {
        let mut arguments = vec!["run", file, "--out", "out", "--force"];
        if !more.contains(&"--step") {
            arguments.extend(["--step", "10 ms"]);
        }
        arguments.extend(more);
        let output = shakebench(self.folder.path(), &arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(0), "{said}");
        let results = fs::read_to_string(self.folder.path().join("out/results.csv")).unwrap();
        let names: Vec<&str> = results.lines().next().unwrap().split(',').collect();
        let last: Vec<&str> = results.lines().last().unwrap().split(',').collect();
        let value = |column: &&str| {
            let place = names.iter().position(|name| name == column);
            let place = place.unwrap_or_else(|| panic!("no `{column}` in {names:?}"));
            last[place].parse().unwrap()
        };
        (said, columns.iter().map(value).collect())
    }

    /// An archive of this root system gives these values at its end.
    #[track_caller]
    fn gives(&self, content: &str, wanted: &[(&str, f64)]) -> String {
        self.write(&described(content, HALF_A_SECOND), &[]);
        self.found("system.ssp", &[], wanted)
    }

    #[track_caller]
    fn found(&self, file: &str, more: &[&str], wanted: &[(&str, f64)]) -> String {
        let columns: Vec<&str> = wanted.iter().map(|(name, _)| *name).collect();
        let (said, values) = self.run(file, more, &columns);
        for ((name, wanted), value) in wanted.iter().zip(values) {
            let off = (value - wanted).abs();
            assert!(
                off < 1e-9 * (1.0 + wanted.abs()),
                "{name}: {value}, {wanted}"
            );
        }
        said
    }
}

pub(super) fn shared() -> PathBuf {
    let folder = std::env::var_os("SHAKEBENCH_SHARED").map(PathBuf::from);
    folder.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared"))
}

#[needs::shared("foreign-fmus")]
#[test]
fn ends_units_and_types_of_connections_are_what_others_write() {
    let archives = Archives::new();
    // 1: an empty name is the system itself, on both sides; an input of the whole from a table.
    let whole = r#"<ssd:Connectors><ssd:Connector name="in" kind="input"><ssc:Real/></ssd:Connector>
<ssd:Connector name="out" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>"#;
    let inner = system(
        &[line("a", &bound(&[set(&[("gain", "3")])])), line("b", "")],
        &[
            link(("", "in"), ("a", "u")),
            link(("a", "y"), ("b", "u")),
            link(("b", "y"), ("", "out")),
        ],
    );
    archives.write(&described(&format!("{whole}{inner}"), HALF_A_SECOND), &[]);
    fs::write(
        archives.folder.path().join("in.csv"),
        "time [s],in\n0,2\n1,2\n",
    )
    .unwrap();
    archives.found(
        "system.ssp",
        &["--input", "in.csv"],
        &[("a.y", 6.0), ("b.y", 6.0)],
    );

    // 2: no attribute of the element at all.
    let bare = inner
        .replace("startElement=\"\" ", "")
        .replace("endElement=\"\" ", "");
    archives.write(&described(&format!("{whole}{bare}"), HALF_A_SECOND), &[]);
    archives.found("system.ssp", &["--input", "in.csv"], &[("b.y", 6.0)]);

    // 3: an empty unit states none, beside one that is stated.
    let parts = [
        part(
            "a",
            "line.fmu",
            r#"<ssc:Real unit=""/>"#,
            &bound(&[set(&[("offset", "7")])]),
        ),
        part("b", "line.fmu", r#"<ssc:Real unit="mm"/>"#, ""),
    ];
    archives.gives(
        &system(&parts, &[link(("a", "y"), ("b", "u"))]),
        &[("b.y", 7.0)],
    );

    // 4: whole numbers drive choices, and choices whole numbers.
    let number = r#"<ssc:Integer/>"#;
    let choice = r#"<ssc:Enumeration name="Option"/>"#;
    let two = bound(&[set(&[("Int32_input", r#"<ssv:Integer value="2"/>"#)])]);
    let parts = [
        through(
            "p",
            &[
                ("Int32_input", "input", number),
                ("Int32_output", "output", number),
            ],
            &two,
        ),
        through(
            "q",
            &[
                ("Enumeration_input", "input", choice),
                ("Enumeration_output", "output", choice),
            ],
            "",
        ),
        through(
            "r",
            &[
                ("Int32_input", "input", number),
                ("Int32_output", "output", number),
            ],
            "",
        ),
    ];
    let links = [
        link(("p", "Int32_output"), ("q", "Enumeration_input")),
        link(("q", "Enumeration_output"), ("r", "Int32_input")),
    ];
    let wanted = [("q.Enumeration_output", 2.0), ("r.Int32_output", 2.0)];
    archives.gives(&system(&parts, &links), &wanted);

    // 5: components without connectors, as where nothing but the names is stored.
    let bare = |name: &str, more: &str| {
        format!(
            r#"<ssd:Component name="{name}" source="resources/line.fmu">{more}</ssd:Component>"#
        )
    };
    let parts = [bare("a", &bound(&[set(&[("offset", "4")])])), bare("b", "")];
    archives.gives(
        &system(&parts, &[link(("a", "y"), ("b", "u"))]),
        &[("b.y", 4.0)],
    );
}

#[needs::shared("foreign-fmus")]
#[test]
fn parameters_follow_the_precedence_of_the_standard() {
    let archives = Archives::new();
    // 6: the same name twice in a set.
    let twice = bound(&[set(&[("offset", "1"), ("offset", "2")])]);
    archives.gives(&system(&[line("a", &twice)], &[]), &[("a.y", 2.0)]);
    // 7: a later binding, and one of the system before that of the component.
    let later = bound(&[set(&[("offset", "1")]), set(&[("offset", "3")])]);
    archives.gives(&system(&[line("a", &later)], &[]), &[("a.y", 3.0)]);
    let outer = bound(&[set(&[("a.offset", "5"), ("a.nothing", "1")])]);
    let content = format!("{outer}{}", system(&[line("a", &later)], &[]));
    let said = archives.gives(&content, &[("a.y", 5.0)]);
    assert!(said.contains("nothing"), "{said}");
    // 8: a file of values with a mapping beside it.
    let values = format!(
        r#"<?xml version="1.0"?><ssv:ParameterSet {SPACES} version="1.0" name="x"><ssv:Parameters>
<ssv:Parameter name="level"><ssv:Real value="2"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"#
    );
    let mapping = format!(
        r#"<?xml version="1.0"?><ssm:ParameterMapping {SPACES} version="1.0">
<ssm:MappingEntry source="level" target="a.offset"><ssc:LinearTransformation factor="10.0" offset="0.5"/></ssm:MappingEntry>
</ssm:ParameterMapping>"#
    );
    let binding = r#"<ssd:ParameterBindings><ssd:ParameterBinding type="application/x-ssp-parameter-set" source="resources/x.ssv">
<ssd:ParameterMapping type="application/x-ssp-parameter-mapping" source="resources/x.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings>"#;
    let content = format!("{binding}{}", system(&[line("a", "")], &[]));
    let files = [
        ("resources/x.ssv", &values[..]),
        ("resources/x.ssm", &mapping),
    ];
    archives.write(&described(&content, HALF_A_SECOND), &files);
    archives.found("system.ssp", &[], &[("a.y", 20.5)]);
}

#[needs::shared("foreign-fmus")]
#[test]
fn systems_in_systems_and_folders_are_followed() {
    let archives = Archives::new();
    let ports = r#"<ssd:Connectors><ssd:Connector name="x" kind="input"/><ssd:Connector name="z" kind="output"/></ssd:Connectors>"#;
    let nested = |name: &str, inner: &str, element: &str, (input, output): (&str, &str)| {
        // One connection written against the direction of the value.
        format!(
            r#"<ssd:System name="{name}">{ports}<ssd:Elements>{inner}</ssd:Elements><ssd:Connections>
<ssd:Connection startElement="{element}" startConnector="{input}" endConnector="x"/>
<ssd:Connection startElement="{element}" startConnector="{output}" endConnector="z"/></ssd:Connections></ssd:System>"#
        )
    };
    // 9: three levels; 10: directions of their own.
    let deep = line("a", &bound(&[set(&[("gain", "2"), ("offset", "1")])]));
    let middle = nested("middle", &deep, "a", ("u", "y"));
    let outer = nested("outer", &middle, "middle", ("x", "z"));
    let first = line("first", &bound(&[set(&[("offset", "3")])]));
    let content = system(
        &[first, outer, line("last", "")],
        &[
            link(("outer", "x"), ("first", "y")),
            link(("outer", "z"), ("last", "u")),
        ],
    );
    archives.gives(&content, &[("outer.middle.a.y", 7.0), ("last.y", 7.0)]);

    // 11: an unpacked description with files in a folder beside its own.
    let folder = archives.folder.path().join("unpacked/description");
    fs::create_dir_all(&folder).unwrap();
    fs::create_dir_all(folder.join("../models")).unwrap();
    fs::write(folder.join("../models/line.fmu"), archives.fmu("line.fmu")).unwrap();
    let content = system(&[line("a", &bound(&[set(&[("offset", "9")])]))], &[]);
    let content = content.replace("resources/line.fmu", "../models/line.fmu");
    let file = folder.join("SystemStructure.ssd");
    fs::write(&file, described(&content, HALF_A_SECOND)).unwrap();
    archives.found(&file.display().to_string(), &[], &[("a.y", 9.0)]);

    // 12: what only drawings need, another version, and no experiment: the FMU's own stop time.
    let drawn =
        r#"<ssd:ElementGeometry x1="-10" y1="-10" x2="10" y2="10" iconSource="resources/a.svg"/>"#;
    let content = format!(
        r#"<ssd:SystemGeometry x1="-100" y1="-100" x2="100" y2="100"/>
<ssd:Elements><ssd:Component name="d" source="resources/Dahlquist.fmu" implementation="CoSimulation">{drawn}
<ssd:Connectors><ssd:Connector name="x" kind="output"><ssc:Real/><ssd:ConnectorGeometry x="1" y="0.5"/></ssd:Connector></ssd:Connectors>
</ssd:Component></ssd:Elements>
<ssd:Annotations><ssc:Annotation type="com.example.tool"><other xmlns="urn:example" a="1"/></ssc:Annotation></ssd:Annotations>"#
    );
    archives.write(&described(&content, ""), &[]);
    let (_, values) = archives.run("system.ssp", &["--step", "100 ms"], &["time", "d.x"]);
    assert!((values[0] - 9.9).abs() < 0.11, "{values:?}");
    assert!(values[1] > 0.0 && values[1] < 1e-4, "{values:?}");
}

#[needs::shared("foreign-fmus")]
#[test]
fn loops_are_iterated_by_themselves_and_locals_travel() {
    let archives = Archives::new();
    // 13: loops of two and of three, FMI 2.0 and 3.0, which do not settle by repetition.
    let two = system(
        &[
            line("a", &bound(&[set(&[("gain", "-3"), ("offset", "8")])])),
            line("b", ""),
        ],
        &[link(("a", "y"), ("b", "u")), link(("b", "y"), ("a", "u"))],
    );
    let said = archives.gives(&two, &[("a.y", 2.0), ("b.y", 2.0)]);
    assert!(said.contains("--algorithm iterative"), "{said}");
    let three = system(
        &[
            line("a", &bound(&[set(&[("gain", "2")])])),
            part(
                "b",
                "line3.fmu",
                "<ssc:Real/>",
                &bound(&[set(&[("gain", "-2")])]),
            ),
            line("c", &bound(&[set(&[("offset", "5")])])),
        ],
        &[
            link(("a", "y"), ("b", "u")),
            link(("b", "y"), ("c", "u")),
            link(("c", "y"), ("a", "u")),
        ],
    );
    // c = 5 - 4 c.
    archives.gives(&three, &[("c.y", 1.0), ("a.y", 2.0), ("b.y", -4.0)]);

    // 14: a local variable that drives an input, der(x) = -k x.
    let dahlquist = r#"<ssd:Component name="d" source="resources/Dahlquist.fmu"><ssd:Connectors>
<ssd:Connector name="x" kind="output"/><ssd:Connector name="der(x)" kind="output"/></ssd:Connectors></ssd:Component>"#;
    let content = system(
        &[dahlquist.to_string(), line("a", "")],
        &[link(("d", "der(x)"), ("a", "u"))],
    );
    archives.write(&described(&content, HALF_A_SECOND), &[]);
    let columns = ["d.x", "d.der(x)", "a.y"];
    let (_, values) = archives.run("system.ssp", &["--step", "100 ms"], &columns);
    assert_eq!(values[1], values[2]);
    assert!((values[0] + values[1]).abs() < 1e-12, "{values:?}");
}

//! A sound description, and the same with one fault at a time: each is found at its line.

use super::*;

const SECOND: &str = r#"<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="m" needsExecutionTool="false"/>
  <UnitDefinitions>
    <Unit name="m"><BaseUnit m="1"/></Unit>
    <Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="Mode"><Enumeration><Item name="a" value="1"/><Item name="b" value="2"/></Enumeration></SimpleType>
  </TypeDefinitions>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.1" tolerance="1e-6"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real unit="m" min="-1" max="1" nominal="0.5" start="0"/></ScalarVariable>
    <ScalarVariable name="p" valueReference="1" causality="parameter" variability="fixed"><Enumeration declaredType="Mode" start="1"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="2" causality="output" initial="calculated"><Real unit="mm"/></ScalarVariable>
    <ScalarVariable name="k" valueReference="3" causality="output" variability="discrete"><Integer/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="3"/><Unknown index="4"/></Outputs>
    <InitialUnknowns><Unknown index="3" dependencies="1"/><Unknown index="4" dependencies=""/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"#;

const THIRD: &str = r#"<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
  <CoSimulation modelIdentifier="m" fixedInternalStepSize="0.1"/>
  <DefaultExperiment startTime="0" stopTime="1"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent"/>
    <Float64 name="u" valueReference="1" causality="input" initial="exact" start="0"/>
    <Int32 name="n" valueReference="2" causality="parameter" start="3" min="1" max="5"/>
    <String name="s" valueReference="3" causality="parameter"><Start value="x"/></String>
    <Float64 name="y" valueReference="4" causality="output"/>
  </ModelVariables>
  <ModelStructure><Output valueReference="4"/><InitialUnknown valueReference="4" dependencies="1"/></ModelStructure>
</fmiModelDescription>
"#;

/// What is found, the severities before it.
fn found(text: &str) -> Vec<String> {
    let mut findings = Findings::default();
    findings.count_lines(text);
    schema::check(&mut findings, text);
    rules::check(&mut findings, text);
    let all = findings.findings.iter();
    all.map(|f| format!("{} {}: {}", f.severity, f.place, f.message))
        .collect()
}

/// Each change of a description (what is replaced, by what), and all that the one finding must say.
type Fault = (&'static str, &'static str, &'static [&'static str]);

fn every_fault_is_found(sound: &str, faults: &[Fault]) {
    for (old, new, expected) in faults {
        assert_eq!(sound.matches(old).count(), 1, "`{old}` is not there once");
        let row = sound[..sound.find(old).unwrap()].lines().count();
        let said = found(&sound.replacen(old, new, 1));
        let place = format!("{DESCRIPTION}:{row}: ");
        let is_meant = |line: &String| {
            line.contains(&place) && expected.iter().all(|part| line.contains(part))
        };
        assert_eq!(
            said.iter().filter(|line| is_meant(line)).count(),
            1,
            "`{new}`: {said:#?} lacks {place} {expected:?}"
        );
    }
}

#[test]
fn sound_descriptions_pass() {
    assert_eq!(found(SECOND), [""; 0]);
    assert_eq!(found(THIRD), [""; 0]);
}

#[test]
fn the_shape_of_fmi_2_is_checked() {
    every_fault_is_found(
        SECOND,
        &[
            (" guid=\"g\"", "", &["error", "guid"]),
            (
                "modelName=\"m\"",
                "modelName=\"m\" colour=\"x\"",
                &["error", "colour"],
            ),
            (
                "needsExecutionTool=\"false\"",
                "needsExecutionTool=\"no\"",
                &["error", "true or false"],
            ),
            (
                "stepSize=\"0.1\"",
                "stepSize=\"a\"",
                &["error", "stepSize", "a number"],
            ),
            (
                "valueReference=\"2\"",
                "valueReference=\"2.5\"",
                &["error", "a whole number"],
            ),
            (
                "<Unit name=\"m\"><BaseUnit m=\"1\"/></Unit>",
                "<Unit name=\"m\"><BaseUnit m=\"x\"/></Unit>",
                &["error", "a whole number"],
            ),
            (
                "<Integer/>",
                "<Float64/>",
                &["error", "Float64", "ScalarVariable"],
            ),
            (
                "<Enumeration declaredType=\"Mode\" start=\"1\"/>",
                "<Enumeration start=\"1\"/>",
                &["error", "declaredType"],
            ),
            (
                "<Item name=\"a\" value=\"1\"/>",
                "<Item name=\"a\" value=\"one\"/>",
                &["error", "value", "a whole number"],
            ),
        ],
    );
}

#[test]
fn what_must_be_held_is_missed() {
    let bare = SECOND
        .split("  <ModelStructure>")
        .next()
        .unwrap()
        .to_string();
    let bare = bare + "</fmiModelDescription>";
    let said = found(&bare);
    assert!(
        said.iter().any(|line| line.contains("ModelStructure")),
        "{said:?}"
    );
    let spaced = SECOND.replace(
        "<fmiModelDescription ",
        "<fmiModelDescription xmlns=\"urn:x\" ",
    );
    assert!(found(&spaced).iter().any(|line| line.contains("namespace")));
    assert!(found("<a").iter().any(|line| line.contains("well-formed")));
    let note = SECOND.replace(
        "<DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"0.1\" tolerance=\"1e-6\"/>",
        "",
    );
    let said = found(&note);
    assert!(said.len() == 1 && said[0].starts_with("note"), "{said:?}");
}

#[test]
fn the_rules_of_fmi_2_are_checked() {
    every_fault_is_found(
        SECOND,
        &[
            ("stopTime=\"1\"", "stopTime=\"0\"", &["error", "0 s"]),
            ("stepSize=\"0.1\"", "stepSize=\"0\"", &["error", "stepSize"]),
            (
                "tolerance=\"1e-6\"",
                "tolerance=\"-1\"",
                &["error", "tolerance"],
            ),
            (
                "<Unit name=\"mm\">",
                "<Unit name=\"m\">",
                &["error", "`m`", "twice"],
            ),
            (
                "<BaseUnit m=\"1\" factor=\"0.001\"/>",
                "<BaseUnit m=\"1\" factor=\"0\"/>",
                &["error", "factor", "`mm`"],
            ),
            ("<BaseUnit m=\"1\"/>", "", &["note", "`m`", "base units"]),
            (
                "<Item name=\"b\" value=\"2\"/>",
                "<Item name=\"b\" value=\"1\"/>",
                &["error", "`Mode`"],
            ),
            (
                "declaredType=\"Mode\"",
                "declaredType=\"Mood\"",
                &["error", "`Mood`"],
            ),
            (
                "name=\"y\" valueReference=\"2\"",
                "name=\"u\" valueReference=\"2\"",
                &["error", "`u`", ":13"],
            ),
            ("name=\"y\"", "name=\"\"", &["error", "empty"]),
            (
                "valueReference=\"2\"",
                "valueReference=\"0\"",
                &["error", "`u`", "`y`", "units"],
            ),
            (
                "causality=\"input\"",
                "causality=\"entry\"",
                &["error", "entry"],
            ),
            (
                "causality=\"input\"",
                "causality=\"input\" variability=\"fixed\"",
                &["error", "`u`", "input", "fixed"],
            ),
            (
                "variability=\"discrete\"",
                "variability=\"continuous\"",
                &["error", "`k`", "Integer", "continuous"],
            ),
            (
                "initial=\"calculated\"",
                "initial=\"maybe\"",
                &["error", "maybe"],
            ),
            (
                "causality=\"input\"",
                "causality=\"input\" initial=\"exact\"",
                &["error", "`u`", "input", "exact"],
            ),
            (" start=\"0\"", "", &["error", "`u`", "must have a start"]),
            (
                "<Real unit=\"mm\"/>",
                "<Real unit=\"mm\" start=\"1\"/>",
                &["error", "`y`", "must not have a start"],
            ),
            ("min=\"-1\"", "min=\"2\"", &["error", "min 2", "max 1"]),
            (" start=\"0\"", " start=\"1.5\"", &["warning", "`u`", "1.5"]),
            (
                " start=\"0\"",
                " start=\"-1.5\"",
                &["warning", "`u`", "-1.5"],
            ),
            ("nominal=\"0.5\"", "nominal=\"0\"", &["error", "nominal 0"]),
            (
                "unit=\"mm\"/>",
                "unit=\"furlong\"/>",
                &["warning", "`furlong`"],
            ),
        ],
    );
    // The limits themselves are within.
    for start in ["1", "-1"] {
        let text = SECOND.replacen(" start=\"0\"", &format!(" start=\"{start}\""), 1);
        assert_eq!(found(&text), [""; 0]);
    }
}

#[test]
fn the_rules_of_fmi_3_are_checked() {
    every_fault_is_found(
        THIRD,
        &[
            (
                "valueReference=\"2\"",
                "valueReference=\"1\"",
                &["error", "`n`", "`u`"],
            ),
            (
                "initial=\"exact\" start=\"0\"",
                "initial=\"calculated\" start=\"0\"",
                &["error", "`u`", "input", "calculated"],
            ),
            (
                "causality=\"independent\"",
                "causality=\"independent\" start=\"0\"",
                &["error", "`time`", "must not have a start"],
            ),
            (
                "<String name=\"s\" valueReference=\"3\" causality=\"parameter\"><Start value=\"x\"/></String>",
                "<String name=\"s\" valueReference=\"3\" causality=\"parameter\"/>",
                &["error", "`s`", "must have a start"],
            ),
            (
                "causality=\"parameter\" start=\"3\"",
                "causality=\"parameter\" variability=\"continuous\" start=\"3\"",
                &["error", "`n`", "parameter", "continuous"],
            ),
            ("start=\"3\"", "start=\"3 9\"", &["warning", "`n`", "9"]),
            (
                "causality=\"parameter\" start=\"3\"",
                "causality=\"parameter\" initial=\"approx\" start=\"3\"",
                &["error", "`n`", "causality parameter with initial approx"],
            ),
            (
                "name=\"y\" valueReference=\"4\" causality=\"output\"",
                "name=\"y\" valueReference=\"4\" causality=\"output\" priority=\"1\"",
                &["error", "priority"],
            ),
        ],
    );
}

#[test]
fn references_and_numbers_of_fmi_2_are_checked() {
    every_fault_is_found(
        SECOND,
        &[
            (
                "<Unknown index=\"4\"/>",
                "<Unknown index=\"3\"/>",
                &["error", "index 3", "twice"],
            ),
            (
                "<Unknown index=\"4\"/>",
                "<Unknown index=\"9\"/>",
                &["error", "index 9", "not a variable"],
            ),
            (
                "<Unknown index=\"4\"/>",
                "<Unknown index=\"4\"/><Unknown index=\"1\"/>",
                &["error", "`u`", "input", "expected output"],
            ),
            (
                "<Unknown index=\"4\"/>",
                "<Unknown index=\"4\" dependencies=\"1 2\" dependenciesKind=\"dependent\"/>",
                &["error", "2 dependencies", "1 kind"],
            ),
            (
                "<Unknown index=\"4\"/>",
                "<Unknown index=\"4\" dependencies=\"7\"/>",
                &["error", "dependency `7`"],
            ),
            (
                "start=\"0\"",
                "start=\"0,5\"",
                &["error", "`u`", "`0,5`", "Real"],
            ),
            (
                "start=\"0\"",
                "start=\"0 1\"",
                &["error", "`u`", "2 start values"],
            ),
            (
                "<Real unit=\"mm\"/>",
                "<Real unit=\"mm\" derivative=\"3\"/>",
                &["error", "`y`", "its own derivative"],
            ),
            (
                "<Real unit=\"mm\"/>",
                "<Real unit=\"mm\" derivative=\"30\"/>",
                &["error", "`y`", "`30`"],
            ),
        ],
    );
    // Its line is that of the variable.
    let without = SECOND.replace("<Unknown index=\"4\"/>", "");
    let said = found(&without);
    assert!(
        said[0].starts_with("error") && said[0].contains("`k`"),
        "{said:?}"
    );
    let twice = SECOND.replace(
        "<Integer/></ScalarVariable>",
        "<Integer/></ScalarVariable>
<ScalarVariable name=\"a\" valueReference=\"8\" initial=\"exact\"><Real start=\"1\"/></ScalarVariable>
<ScalarVariable name=\"b\" valueReference=\"8\" initial=\"exact\"><Real start=\"1\"/></ScalarVariable>",
    );
    let said = found(&twice);
    assert!(
        said.len() == 1 && said[0].contains("both have a start"),
        "{said:?}"
    );
}

#[test]
fn references_and_numbers_of_fmi_3_are_checked() {
    every_fault_is_found(
        THIRD,
        &[
            (
                "fixedInternalStepSize=\"0.1\"",
                "fixedInternalStepSize=\"-0.1\"",
                &["error", "fixedInternalStepSize", "-0.1"],
            ),
            (
                "start=\"3\"",
                "start=\"3000000000\"",
                &["error", "`n`", "Int32"],
            ),
            (
                "initial=\"exact\" start=\"0\"/>",
                "initial=\"exact\" start=\"0 1\"><Dimension start=\"3\"/></Float64>",
                &["error", "`u`", "2 start values for 3"],
            ),
            (
                "<Start value=\"x\"/>",
                "<Start value=\"x\"/><Start value=\"y\"/>",
                &["error", "`s`", "2 start values for 1 elements"],
            ),
            (
                "<Start value=\"x\"/>",
                "<Start value=\"x\"/><Start value=\"y\"/><Dimension start=\"3\"/>",
                &["error", "`s`", "2 start values for 3 elements"],
            ),
            (
                "name=\"y\" valueReference=\"4\"",
                "name=\"y\" valueReference=\"4\" clocks=\"1\"",
                &["error", "`y`", "clock `1`"],
            ),
            (
                "name=\"y\" valueReference=\"4\"",
                "name=\"y\" valueReference=\"4\" derivative=\"4\"",
                &["error", "`y`", "its own derivative"],
            ),
            (
                "<Output valueReference=\"4\"/>",
                "<Output valueReference=\"4\"/><InitialUnknown valueReference=\"40\"/>",
                &["error", "valueReference 40"],
            ),
        ],
    );
}

/// The lists are those that fmpy's `_validate_model_structure` accepts and refuses.
#[test]
fn initial_unknowns_are_those_that_the_standards_name() {
    let one = |text: &str, expected: &[&str]| {
        let said = found(text);
        let is_meant = said.len() == 1 && expected.iter().all(|part| said[0].contains(part));
        assert!(is_meant, "{said:#?} is not one of {expected:?}");
    };
    let missing = "is computed initially, but is not in <InitialUnknown";
    one(
        &SECOND.replace("<Unknown index=\"3\" dependencies=\"1\"/>", ""),
        &["error", ":15: ", "`y`", missing],
    );
    one(
        &THIRD.replace(
            "<InitialUnknown valueReference=\"4\" dependencies=\"1\"/>",
            "",
        ),
        &["error", ":10: ", "`y`", missing],
    );
    // An exact output, a parameter and what a clock governs are none.
    let exact = SECOND.replace(
        "initial=\"calculated\"><Real unit=\"mm\"/>",
        "initial=\"exact\"><Real unit=\"mm\" start=\"0\"/>",
    );
    one(
        &exact,
        &["error", "`y` is in <InitialUnknowns>", "expected"],
    );
    let parameter = THIRD.replace(
        "</ModelStructure>",
        "<InitialUnknown valueReference=\"2\"/></ModelStructure>",
    );
    one(&parameter, &["error", "`n` is in <InitialUnknown>"]);
    let clock = "<Clock name=\"c\" valueReference=\"5\" causality=\"input\" intervalVariability=\"triggered\"/>";
    let clocked = THIRD
        .replace(
            "causality=\"output\"/>",
            "causality=\"output\" variability=\"discrete\" clocks=\"5\"/>",
        )
        .replace(
            "  </ModelVariables>",
            &format!("  {clock}\n  </ModelVariables>"),
        );
    one(&clocked, &["error", "`y` is in <InitialUnknown>"]);
    // States and derivatives where they are computed, and calculated parameters.
    let state = "<Float64 name=\"x\" valueReference=\"5\" initial=\"exact\" start=\"1\"/>
    <Float64 name=\"der\" valueReference=\"6\" derivative=\"5\"/>
    <Float64 name=\"q\" valueReference=\"7\" causality=\"calculatedParameter\"/>
  </ModelVariables>";
    let moving = THIRD.replace("</ModelVariables>", state).replace(
        "<InitialUnknown",
        "<ContinuousStateDerivative valueReference=\"6\"/><InitialUnknown",
    );
    let said = found(&moving);
    assert!(said.len() == 2, "{said:?}");
    assert!(
        said[0].contains("`der`") && said[1].contains("`q`"),
        "{said:?}"
    );
    let known = moving.replace(
        "</ModelStructure>",
        "<InitialUnknown valueReference=\"6\"/><InitialUnknown valueReference=\"7\"/></ModelStructure>",
    );
    assert_eq!(found(&known), [""; 0]);
}

#[test]
fn very_many_findings_are_counted_and_found_in_time() {
    let mut text = SECOND.split("<ScalarVariable").next().unwrap().to_string();
    for k in 0..200_000 {
        text += &format!(
            "\n<ScalarVariable name=\"v{k}\" valueReference=\"1\" causality=\"parameter\"><Real/></ScalarVariable>"
        );
    }
    text += "\n</ModelVariables><ModelStructure/></fmiModelDescription>";
    let mut findings = Findings::default();
    findings.count_lines(&text);
    rules::check(&mut findings, &text);
    assert_eq!(findings.findings.len(), 1000);
    assert!(findings.count(Severity::Error) > 400_000);
}

#[test]
fn a_file_is_checked_by_its_name_and_its_findings_are_sorted() {
    use std::io::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let archive = |name: &str, description: &str| {
        let mut archive = zip::ZipWriter::new(std::fs::File::create(place(name)).unwrap());
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(DESCRIPTION, options).unwrap();
        archive.write_all(description.as_bytes()).unwrap();
        archive.finish().unwrap();
        validate(&place(name), None).unwrap()
    };
    // Upper case is an FMU too. There is nothing in it but its description.
    let sound = archive("Sound.FMU", SECOND);
    assert_eq!((sound.kind, sound.version.as_deref()), ("fmu", Some("2.0")));
    let told = |found: &Findings| -> Vec<String> {
        let folder = format!("{}/", folder.path().display());
        let all = found.findings.iter();
        all.map(|own| format!("{} {}: {}", own.severity, own.place, own.message))
            .map(|line| line.replace(&folder, ""))
            .collect()
    };
    let lacks = [
        "error archive: there are neither binaries nor sources",
        "error library: Sound.FMU: `validated` could not be instantiated: it needs a process of its own, and \
         no program is named that can be one (`Options::guest`)",
        "note archive: there is no documentation",
        "note archive: documentation/licenses contains no licence",
        "note archive: there is no reference result for comparison",
    ];
    assert_eq!(told(&sound), lacks);
    let is_rest = |finding: &Finding| finding.message.contains("are not listed");

    // What is too much to list is counted, and the worst comes first.
    let mut text = SECOND.split("<ScalarVariable").next().unwrap().to_string();
    for _ in 0..Findings::MOST + 10 {
        text += "\n<ScalarVariable name=\"v\" valueReference=\"1\" causality=\"parameter\"><Real start=\"0\"/>\
                 </ScalarVariable>";
    }
    text += "\n</ModelVariables><ModelStructure/></fmiModelDescription>";
    let many = archive("many.fmu", &text);
    let rest: Vec<&Finding> = many.findings.iter().filter(|own| is_rest(own)).collect();
    assert_eq!(rest.len(), 1, "{rest:#?}");
    assert_eq!(rest[0].severity, Severity::Error);
    assert!(rest[0].place.ends_with("many.fmu"), "{rest:#?}");
    let severities: Vec<Severity> = many.findings.iter().map(|own| own.severity).collect();
    assert!(severities.is_sorted());

    std::fs::write(place("notes.txt"), "").unwrap();
    let told = validate(&place("notes.txt"), None).unwrap_err();
    let told = told.to_string();
    assert!(told.ends_with("notes.txt: expected an .fmu or an .ssp file"));
    let told = validate(&place("none.fmu"), None).unwrap_err().to_string();
    assert!(told.contains("none.fmu: No such file"), "{told}");
}

#[test]
fn an_array_has_as_many_start_values_as_its_structural_parameter_says() {
    let sized = |name: &str, start: &str| {
        let array = format!(
            r#"<Float64 name="y" valueReference="4" causality="output"/>
            <UInt64 name="size" valueReference="5" causality="structuralParameter" start="3"/>
            <UInt64 name="other" valueReference="6" causality="{name}" start="2"/>
            <Float64 name="a" valueReference="7" causality="input" start="{start}"><Dimension valueReference="5"/>
            </Float64>"#
        );
        let plain = r#"<Float64 name="y" valueReference="4" causality="output"/>"#;
        found(&THIRD.replace(plain, &array))
    };
    for causality in ["parameter", "structuralParameter"] {
        assert_eq!(sized(causality, "1 2 3"), [""; 0]);
        assert_eq!(sized(causality, "1"), [""; 0]);
        let wrong = sized(causality, "1 2");
        assert!(
            wrong.len() == 1 && wrong[0].contains("2 start values for 3 elements"),
            "{wrong:?}"
        );
    }
}

#[test]
fn folders_and_licences_are_those_of_the_standard() {
    let of = |names: &[&str]| -> Vec<String> {
        let mut findings = Findings::default();
        let names: Vec<String> = names.iter().map(|name| (*name).to_string()).collect();
        archive::folders(&mut findings, &names);
        archive::licences(&mut findings, &names);
        let all = findings.findings.iter();
        all.map(|own| format!("{} {}", own.severity, own.message))
            .collect()
    };
    let sound = [
        "modelDescription.xml",
        "binaries/x/y.so",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "extra/own/a.csv",
    ];
    assert_eq!(of(&sound), [""; 0]);
    let without = |names: &[&str]| -> Vec<&str> {
        let all = sound.iter().filter(|name| !names.contains(name));
        all.copied().collect()
    };
    let library = "binaries/x/y.so";
    let page = "documentation/index.html";
    let licence = "documentation/licenses/license.txt";
    let with = |mut names: Vec<&'static str>, more: &[&'static str]| {
        names.extend(more);
        of(&names)
    };
    // A folder that is empty is none.
    let none = with(without(&[library]), &["binaries/"]);
    assert_eq!(none, ["error there are neither binaries nor sources"]);
    let sources = with(without(&[library]), &["sources/y.c"]);
    assert_eq!(
        sources,
        ["warning there are only sources: importers must compile them"]
    );
    let start = with(without(&[page]), &["documentation/about.html"]);
    assert_eq!(
        start,
        ["warning documentation/index.html, the start page, is missing"]
    );
    assert_eq!(
        with(without(&[page]), &["documentation/_main.html"]),
        [""; 0]
    );
    let both = of(&without(&[page, licence]));
    assert_eq!(
        both,
        [
            "note there is no documentation",
            "note documentation/licenses contains no licence"
        ]
    );
    let other = with(without(&[licence]), &["documentation/licenses/mit.md"]);
    assert_eq!(
        other,
        ["note documentation/licenses has no license.txt, .html or .spdx"]
    );
    let empty = with(without(&[licence]), &["documentation/licenses/"]);
    let lacks = "note documentation/licenses contains no licence".to_string();
    assert_eq!(empty, [lacks, other[0].clone()]);
    assert_eq!(with(without(&[licence]), &["licenses/mit.md"]), [""; 0]);
    let strange = with(without(&[]), &["src/a.c", "src/b.c", "README"]);
    assert_eq!(
        strange,
        [
            "note `README` at the top is not part of the standard",
            "note `src` at the top is not part of the standard"
        ]
    );
}

#[test]
fn a_system_with_a_faulty_component_is_not_run() {
    use std::io::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let mut inner = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    inner.start_file(DESCRIPTION, options).unwrap();
    inner.write_all(SECOND.as_bytes()).unwrap();
    let fmu = inner.finish().unwrap().into_inner();
    let system = r#"<ssd:SystemStructureDescription version="1.0" name="s"
        xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"><ssd:System name="s"><ssd:Elements>
        <ssd:Component name="a" type="application/x-fmu-sharedlibrary" source="resources/A.fmu"/>
        </ssd:Elements></ssd:System></ssd:SystemStructureDescription>"#;
    let path = folder.path().join("s.ssp");
    let mut outer = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    for (name, bytes) in [
        ("SystemStructure.ssd", system.as_bytes()),
        ("resources/A.fmu", &fmu),
    ] {
        outer.start_file(name, options).unwrap();
        outer.write_all(bytes).unwrap();
    }
    outer.finish().unwrap();
    let found = validate(&path, None).unwrap();
    assert_eq!((found.kind, found.file.ends_with("s.ssp")), ("ssp", true));
    let own = |finding: &&Finding| finding.message.contains("so the system was not run");
    assert_eq!(
        found.findings.iter().filter(own).count(),
        1,
        "{:?}",
        found.findings
    );
    let place = "resources/A.fmu: archive";
    assert!(
        found.findings.iter().any(|own| own.place == place),
        "{:?}",
        found.findings
    );
}

#[test]
fn what_a_variable_is_and_how_it_begins_go_together() {
    let of = |attributes: &str| {
        let plain = r#"<Float64 name="y" valueReference="4" causality="output"/>"#;
        let more = format!(r#"{plain}<Float64 name="q" valueReference="7" {attributes}/>"#);
        found(&THIRD.replace(plain, &more))
    };
    for (attributes, is_sound) in [
        (
            r#"causality="calculatedParameter" variability="fixed" initial="exact" start="1""#,
            false,
        ),
        (
            r#"causality="parameter" variability="fixed" initial="exact" start="1""#,
            true,
        ),
        (
            r#"causality="parameter" variability="fixed" initial="calculated""#,
            false,
        ),
        (
            r#"causality="local" variability="constant" initial="exact" start="1""#,
            true,
        ),
        (
            r#"causality="local" variability="constant" initial="approx" start="1""#,
            false,
        ),
        (r#"causality="input" initial="approx" start="1""#, false),
    ] {
        let all = of(attributes);
        let refused = all
            .iter()
            .any(|line| line.contains("`q`: causality") && line.contains(" with initial "));
        assert_eq!(!refused, is_sound, "{attributes}: {all:?}");
    }
}

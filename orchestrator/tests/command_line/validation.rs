//! `validate`: each violation of the standard is an error, and the exit status shows it.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

use crate::loops::{Offer, pack};
use crate::{shakebench, stderr, stdout};

/// What is wrong; what of the description is replaced by what; files that are added; a word of the finding.
type Violation<'a> = (&'a str, [&'a str; 2], &'a [(&'a str, &'a str)], &'a str);

const OUTPUTS: &str = r#"<Outputs><Unknown index="1" dependencies="2"/></Outputs>"#;
const INPUT: &str = r#"causality="input" variability="continuous"><Real start="0"/>"#;

const SECOND: &[Violation] = &[
    (
        "an output that is none",
        [
            OUTPUTS,
            r#"<Outputs><Unknown index="1" dependencies="2"/><Unknown index="2"/></Outputs>"#,
        ],
        &[],
        "expected output",
    ),
    (
        "a wrong count of kinds",
        [
            r#"dependencies="2"/></Outputs>"#,
            r#"dependencies="2" dependenciesKind="dependent dependent"/></Outputs>"#,
        ],
        &[],
        "1 dependencies",
    ),
    ("an output that is missing", [OUTPUTS, ""], &[], "`y`"),
    (
        "an output that is there twice",
        [
            OUTPUTS,
            r#"<Outputs><Unknown index="1"/><Unknown index="1"/></Outputs>"#,
        ],
        &[],
        "twice",
    ),
    (
        "a dependency on nothing",
        [
            r#"dependencies="2"/></Outputs>"#,
            r#"dependencies="20"/></Outputs>"#,
        ],
        &[],
        "`20`",
    ),
    (
        "a start that is no number",
        [
            INPUT,
            r#"causality="input" variability="continuous"><Real start="0,5"/>"#,
        ],
        &[],
        "`0,5`",
    ),
    (
        "two starts of one quantity",
        [
            r#"name="bend" valueReference="3""#,
            r#"name="bend" valueReference="2""#,
        ],
        &[],
        "both have a start",
    ),
    (
        "a derivative of itself",
        [
            r#"initial="calculated"><Real/>"#,
            r#"initial="calculated"><Real derivative="1"/>"#,
        ],
        &[],
        "its own derivative",
    ),
    (
        "a step backwards",
        [
            "<ModelVariables>",
            r#"<DefaultExperiment stepSize="-0.1"/><ModelVariables>"#,
        ],
        &[],
        "stepSize",
    ),
    (
        "a source that is missing",
        [
            r#"providesDirectionalDerivative="false"/>"#,
            r#"providesDirectionalDerivative="false"><SourceFiles><File name="all.c"/></SourceFiles></CoSimulation>"#,
        ],
        &[("sources/other.c", "")],
        "sources/all.c",
    ),
];

const THIRD: &[Violation] = &[
    (
        "a wrong count of starts",
        [
            r#"causality="input" variability="continuous" start="0"/>"#,
            r#"causality="input" variability="continuous" start="0 1"><Dimension start="3"/></Float64>"#,
        ],
        &[],
        "2 start values for 3",
    ),
    (
        "a clock that is not there",
        [
            r#"name="y" valueReference="0""#,
            r#"name="y" valueReference="0" clocks="77""#,
        ],
        &[],
        "clock `77`",
    ),
    (
        "an internal step backwards",
        [
            r#"modelIdentifier="ring""#,
            r#"modelIdentifier="ring" fixedInternalStepSize="-0.1""#,
        ],
        &[],
        "fixedInternalStepSize",
    ),
    (
        "a terminal of nothing",
        ["", ""],
        &[(
            "terminalsAndIcons/terminalsAndIcons.xml",
            r#"<?xml version="1.0"?><fmiTerminalsAndIcons fmiVersion="3.0"><Terminals><Terminal name="t" matchingRule="bus">
<TerminalMemberVariable variableName="nothing" memberName="m" variableKind="signal"/></Terminal></Terminals></fmiTerminalsAndIcons>"#,
        )],
        "`nothing`",
    ),
    (
        "a source of the build that is missing",
        ["", ""],
        &[(
            "sources/buildDescription.xml",
            r#"<?xml version="1.0"?><fmiBuildDescription fmiVersion="3.0"><BuildConfiguration modelIdentifier="ring"><SourceFileSet>
<SourceFile name="gone.c"/></SourceFileSet></BuildConfiguration></fmiBuildDescription>"#,
        )],
        "sources/gone.c",
    ),
];

/// A copy of an FMU with another description and further files.
fn changed(from: &Path, to: &Path, [this, that]: [&str; 2], files: &[(&str, &str)]) {
    let mut old = ZipArchive::new(File::open(from).unwrap()).unwrap();
    let mut new = ZipWriter::new(File::create(to).unwrap());
    for at in 0..old.len() {
        let mut entry = old.by_index(at).unwrap();
        let name = entry.name().unwrap().into_owned();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        if name == "modelDescription.xml" && !this.is_empty() {
            let text = String::from_utf8(bytes).unwrap();
            assert_eq!(text.matches(this).count(), 1, "`{this}` is not there once");
            bytes = text.replace(this, that).into_bytes();
        }
        new.start_file(name, SimpleFileOptions::default()).unwrap();
        new.write_all(&bytes).unwrap();
    }
    for (name, text) in files {
        new.start_file(*name, SimpleFileOptions::default()).unwrap();
        new.write_all(text.as_bytes()).unwrap();
    }
    new.finish().unwrap();
}

/// The messages of errors, and the exit status.
fn errors(folder: &Path, file: &str) -> (Vec<String>, Option<i32>) {
    let output = shakebench(folder, &["validate", file, "--json"]);
    let found: serde_json::Value = serde_json::from_str(&stdout(&output))
        .unwrap_or_else(|error| panic!("{error}: {}", stderr(&output)));
    let all = found["findings"].as_array().unwrap().iter();
    let errors = all.filter(|finding| finding["severity"] == "error");
    let messages: Vec<String> = errors.map(|it| it["message"].to_string()).collect();
    assert_eq!(found["errors"], messages.len());
    (messages, output.status.code())
}

#[test]
fn violations_of_the_standard_are_errors_with_a_status() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (is_fmi3, violations) in [(false, SECOND), (true, THIRD)] {
        let derivatives = 0;
        pack(
            folder,
            "sound",
            Offer {
                is_fmi3,
                derivatives,
            },
        );
        assert_eq!(errors(folder, "sound.fmu"), (vec![], Some(0)));
        for (what, change, files, word) in violations {
            changed(
                &folder.join("sound.fmu"),
                &folder.join("other.fmu"),
                *change,
                files,
            );
            let (found, status) = errors(folder, "other.fmu");
            assert!(
                found.iter().any(|message| message.contains(word)),
                "{what}: {found:?}"
            );
            assert_eq!(status, Some(2), "{what}: {found:?}");
        }
    }
    // Derivatives that the FMU claims to give and gives with the wrong sign.
    let (is_fmi3, derivatives) = (false, 3);
    pack(
        folder,
        "claims",
        Offer {
            is_fmi3,
            derivatives,
        },
    );
    let (found, status) = errors(folder, "claims.fmu");
    assert!(
        found.iter().any(|message| message.contains("erivative")),
        "{found:?}"
    );
    assert_eq!(status, Some(2));
}

#[test]
fn what_the_second_reader_of_descriptions_finds_is_a_remark() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let offer = Offer {
        is_fmi3: false,
        derivatives: 0,
    };
    pack(folder, "sound", offer);
    let odd = INPUT.replace("start", r#"reinit="perhaps" start"#);
    let [sound, other] = ["sound.fmu", "other.fmu"].map(|name| folder.join(name));
    changed(&sound, &other, [INPUT, &odd], &[]);
    let remark = "fmi-rs cannot read it: Illegal value 'perhaps' for attribute 'reinit' in <Real>.";
    let output = shakebench(folder, &["info", "other.fmu"]);
    assert!(
        stdout(&output).contains(&format!("remark: {remark}")),
        "{}",
        stdout(&output)
    );
    let output = shakebench(folder, &["validate", "other.fmu"]);
    assert!(stdout(&output).contains(remark), "{}", stdout(&output));
    let output = shakebench(folder, &["info", "sound.fmu"]);
    assert!(!stdout(&output).contains("remark"), "{}", stdout(&output));
}

//! FMUs that are broken or hostile; nothing of them is loaded.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;

use fmi_import::{Fmu, Instance, Options};
use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

use crate::{refused, shakebench, stderr};

type Entries = Vec<(String, Vec<u8>)>;

/// The entries of a component's FMU.
fn entries(name: &str, version: pack::FmiVersion) -> Entries {
    let installation = pack::Installation::default();
    let fmu = installation.component(name, version).unwrap();
    let mut archive = ZipArchive::new(File::open(&fmu.path).unwrap()).unwrap();
    (0..archive.len())
        .map(|index| {
            let mut entry = archive.by_index(index).unwrap();
            let mut content = Vec::new();
            entry.read_to_end(&mut content).unwrap();
            (entry.name().unwrap().into_owned(), content)
        })
        .collect()
}

fn write(path: &Path, entries: &Entries) {
    let mut archive = ZipWriter::new(File::create(path).unwrap());
    for (name, content) in entries.iter().filter(|(name, _)| !name.ends_with('/')) {
        archive
            .start_file(name.as_str(), SimpleFileOptions::default())
            .unwrap();
        archive.write_all(content).unwrap();
    }
    archive.finish().unwrap();
}

/// A system whose table is the FMU `table.fmu` in `folder` is refused.
#[track_caller]
fn table_refused(folder: &Path, words: &[&str]) {
    let system = r#"
        connections = ["reference.displacement -> table.valve_command"]
        [components.table]
        fmu = "table.fmu"
    "#;
    fs::write(folder.join("rig.toml"), system).unwrap();
    let words = [&["rig.toml", "components.table", "table.fmu"], words].concat();
    refused(folder, &["run", "rig.toml"], &words);
}

/// The changed FMU of the table is refused, in both versions.
#[track_caller]
fn changed(change: impl Fn(&mut Entries), words: &[&str]) {
    for version in pack::FmiVersion::ALL {
        let folder = tempfile::tempdir().unwrap();
        let mut entries = entries("ShakeTable", version);
        change(&mut entries);
        write(&folder.path().join("table.fmu"), &entries);
        table_refused(folder.path(), words);
    }
}

/// Changes the text of the model description.
fn described(entries: &mut Entries, this: &str, that: &str) {
    let description = entries
        .iter_mut()
        .find(|(name, _)| name == "modelDescription.xml")
        .unwrap();
    let text = String::from_utf8(description.1.clone()).unwrap();
    assert!(text.contains(this), "{this}");
    description.1 = text.replace(this, that).into_bytes();
}

#[test]
fn no_archive() {
    for content in ["", "This is no archive."] {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("table.fmu"), content).unwrap();
        table_refused(folder.path(), &["not an FMU"]);
    }
    let folder = tempfile::tempdir().unwrap();
    table_refused(folder.path(), &["No such file"]);
}

#[test]
fn a_truncated_archive() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.fmu");
    write(&path, &entries("ShakeTable", pack::FmiVersion::V3));
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    table_refused(folder.path(), &["not an FMU"]);
}

#[test]
fn entries_that_would_be_written_elsewhere() {
    for (name, words) in [
        ("../outside.txt", "points outside the archive"),
        ("resources/../../outside.txt", "points outside the archive"),
        ("/tmp/outside.txt", "is an absolute path"),
        ("C:/outside.txt", "is an absolute path"),
        ("resources\\..\\outside.txt", "backslash"),
    ] {
        let add = |entries: &mut Entries| entries.push((name.to_string(), b"x".to_vec()));
        changed(add, &[words, "hostile", "was not unpacked"]);
    }
}

#[test]
fn no_model_description() {
    let remove = |entries: &mut Entries| entries.retain(|(name, _)| name != "modelDescription.xml");
    changed(remove, &["no modelDescription.xml"]);
}

#[test]
fn model_descriptions_that_cannot_be_used() {
    let cases = [
        (
            "</ModelVariables>",
            "</ModelVariable>",
            vec!["not well-formed XML"],
        ),
        ("<fmiModelDescription", "<html", vec!["not well-formed XML"]),
        ("fmiVersion=", "fmuVersion=", vec!["fmiVersion is missing"]),
        (
            "fmiVersion=\"",
            "fmiVersion=\"1",
            vec!["fmiVersion is \"1", "expected"],
        ),
        (
            "modelIdentifier=\"",
            "modelIdentifier=\"../",
            vec!["`../ShakeTable`", "not a C identifier"],
        ),
        (
            "name=\"velocity\"",
            "name=\"displacement\"",
            vec!["`displacement`", "twice"],
        ),
    ];
    for (this, that, words) in cases {
        let mut all = vec!["modelDescription.xml"];
        all.extend(words);
        changed(|entries| described(entries, this, that), &all);
    }
}

fn libraries(entries: &mut Entries) -> impl Iterator<Item = &mut (String, Vec<u8>)> {
    entries
        .iter_mut()
        .filter(|(name, _)| name.starts_with("binaries/"))
}

/// Makes an instance of a changed FMU and returns the complaint.
fn complaint(version: pack::FmiVersion, change: impl Fn(&mut Entries)) -> String {
    let folder = tempfile::tempdir().unwrap();
    let mut entries = entries("ShakeTable", version);
    change(&mut entries);
    let path = folder.path().join("table.fmu");
    write(&path, &entries);
    let fmu = Fmu::open(&path).unwrap();
    match Instance::new(&fmu, "table", &Options::default()) {
        Ok(_) => panic!("an instance was made"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn libraries_that_are_missing_or_for_another_machine() {
    for version in pack::FmiVersion::ALL {
        let said = complaint(version, |entries| {
            entries.retain(|(name, _)| !name.starts_with("binaries/"));
        });
        assert!(said.contains("table.fmu: no binary"), "{said}");
        let said = complaint(version, |entries| {
            libraries(entries).for_each(|(name, _)| *name = "binaries/mars32/ShakeTable.so".into());
        });
        assert!(said.contains("no binary for this platform"), "{said}");
        assert!(said.contains("it has mars32"), "{said}");
        let said = complaint(version, |entries| {
            libraries(entries).for_each(|(_, content)| *content = b"MZ, a Windows one".to_vec());
        });
        assert!(said.contains("is a Windows library"), "{said}");
        let said = complaint(version, |entries| {
            libraries(entries).for_each(|(_, content)| *content = vec![b'x'; 100]);
        });
        assert!(said.contains("no shared library at all"), "{said}");
    }
}

#[test]
fn a_token_that_does_not_fit() {
    for (version, attribute) in [
        (pack::FmiVersion::V2, "guid=\"{"),
        (pack::FmiVersion::V3, "instantiationToken=\"{"),
    ] {
        let said = complaint(version, |entries| {
            described(entries, attribute, &format!("{attribute}0"));
        });
        assert!(said.contains("could not be instantiated"), "{said}");
        assert!(said.contains("`table`"), "{said}");
    }
}

#[test]
fn a_loop_of_direct_feedthrough_is_named_and_iterated_on_demand() {
    let folder = tempfile::tempdir().unwrap();
    let mut entries = entries("Specimen", pack::FmiVersion::V3);
    // An output without a list of dependencies depends on every input.
    let description = entries
        .iter_mut()
        .find(|(name, _)| name == "modelDescription.xml")
        .unwrap();
    let text = String::from_utf8(description.1.clone()).unwrap();
    let start = text.find("<Output ").unwrap();
    let end = start + text[start..].find("/>").unwrap();
    let bare = text[start..end]
        .split(" dependencies")
        .next()
        .unwrap()
        .to_string();
    description.1 = [&text[..start], &bare, &text[end..]].concat().into_bytes();
    write(&folder.path().join("specimen.fmu"), &entries);
    let system = r#"
        connections = [
            "reference.displacement -> control.reference_displacement",
            "table.displacement -> control.measured_displacement",
            "control.valve_command -> table.valve_command",
            "table.acceleration -> specimen.table_acceleration",
            "specimen.force -> table.specimen_force",
        ]
        [components]
        control = { fmu = "DisplacementPid" }
        table = { fmu = "ShakeTable" }
        specimen = { fmu = "specimen.fmu" }
    "#;
    fs::write(folder.path().join("rig.toml"), system).unwrap();
    refused(
        folder.path(),
        &["run", "rig.toml"],
        &[
            "a loop of direct feedthrough",
            "table.acceleration -> specimen.table_acceleration",
            "specimen.force -> table.specimen_force",
            "--algorithm iterative",
        ],
    );
    let arguments = [
        "run",
        "rig.toml",
        "--algorithm",
        "iterative",
        "--duration",
        "1 s",
    ];
    let output = shakebench(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

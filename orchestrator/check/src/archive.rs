//! The archive of an FMU: its entries, its folders, its licences.

use std::collections::{HashMap, HashSet};
use std::io::{Cursor, Read};
use std::path::Path;

use roxmltree::Document;
use zip::{CompressionMethod, ZipArchive};

use super::{DESCRIPTION, Findings};

/// Larger descriptions are not read, bytes.
const LARGEST: u64 = 256 << 20;

/// Checks the archive; gives the text of the description.
pub(super) fn check(findings: &mut Findings, path: &Path) -> Option<String> {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) => {
            findings.error("archive", error.to_string());
            return None;
        }
    };
    let mut archive = match ZipArchive::new(Cursor::new(&bytes[..])) {
        Ok(archive) => archive,
        Err(error) => {
            findings.error("archive", fmi_import::archive::unreadable(&bytes, &error));
            return None;
        }
    };
    if let Err(doubt) = fmi_import::archive::check_overlaps(&mut archive) {
        findings.error("archive", doubt.to_string());
        return None;
    }
    let mut names: Vec<String> = Vec::new();
    let mut lower: HashMap<String, String> = HashMap::new();
    for index in 0..archive.len() {
        let entry = match archive.by_index_raw(index) {
            Ok(entry) => entry,
            Err(error) => {
                findings.error("archive", format!("entry {index} cannot be read ({error})"));
                continue;
            }
        };
        let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
        if !name.is_ascii() {
            findings.warning(
                "archive",
                format!("the name `{name}` has non-ASCII characters"),
            );
        }
        if name.contains('\\') {
            findings.error(
                "archive",
                format!("`{name}` has a backslash instead of `/`"),
            );
        }
        if entry.is_symlink() {
            findings.error("archive", format!("`{name}` is a symbolic link"));
        }
        let compression = entry.compression();
        if ![CompressionMethod::Stored, CompressionMethod::Deflated].contains(&compression) {
            findings.error(
                "archive",
                format!("`{name}` is compressed by {compression}; FMI allows deflate only"),
            );
        }
        if entry.encrypted() {
            findings.error("archive", format!("`{name}` is encrypted"));
        }
        if let Some(other) = lower.insert(name.to_lowercase(), name.clone()) {
            let reason = match other == name {
                true => format!("`{name}` occurs twice"),
                false => format!("`{name}` and `{other}` are one file on some systems"),
            };
            findings.error("archive", reason);
        }
        names.push(name);
    }
    folders(findings, &names);
    licences(findings, &names);
    let entry = match archive.by_name(DESCRIPTION) {
        Ok(entry) => entry,
        Err(_) => {
            findings.error("archive", format!("there is no {DESCRIPTION} at its top"));
            return None;
        }
    };
    let mut text = Vec::new();
    if let Err(error) = entry.take(LARGEST).read_to_end(&mut text) {
        findings.error(DESCRIPTION, format!("cannot be unpacked ({error})"));
        return None;
    }
    findings.check(format!("archive: {} entries", names.len()));
    let text = match String::from_utf8(text) {
        Ok(text) => text,
        Err(error) => {
            findings.warning(DESCRIPTION, "is not in UTF-8, which the standard requires");
            let bytes = error.into_bytes();
            bytes.iter().map(|&byte| char::from(byte)).collect()
        }
    };
    if fmi_import::archive::check_attributes(&text).is_ok() {
        let mut read = |name: &str| -> Option<String> {
            let mut content = String::new();
            let entry = archive.by_name(name).ok()?;
            entry.take(LARGEST).read_to_string(&mut content).ok()?;
            let is_bearable = fmi_import::archive::check_attributes(&content).is_ok();
            is_bearable.then_some(content)
        };
        let (terminals, build) = (read(TERMINALS), read(BUILD));
        named(
            findings,
            &text,
            &names,
            terminals.as_deref(),
            build.as_deref(),
        );
    }
    Some(text)
}

/// Where terminals are described (FMI 3.0).
const TERMINALS: &str = "terminalsAndIcons/terminalsAndIcons.xml";
/// Where sources are listed (FMI 3.0).
const BUILD: &str = "sources/buildDescription.xml";

/// Sources that are listed and not there; terminals of variables that there are not.
fn named(
    findings: &mut Findings,
    description: &str,
    names: &[String],
    terminals: Option<&str>,
    build: Option<&str>,
) {
    let there: HashSet<&str> = names.iter().map(String::as_str).collect();
    for (place, text, element) in [
        (DESCRIPTION, Some(description), "File"),
        (BUILD, build, "SourceFile"),
    ] {
        let Some(Ok(document)) = text.map(Document::parse) else {
            continue;
        };
        let files = document
            .descendants()
            .filter(|node| node.has_tag_name(element));
        for name in files.filter_map(|node| node.attribute("name")) {
            let file = format!("sources/{name}");
            if there.contains(file.as_str()) {
                continue;
            }
            let message = format!("the source `{file}` is not in the archive");
            // Whoever leaves out all sources has still binaries that run.
            match names.iter().any(|name| name.starts_with("sources/")) {
                true => findings.error(place, message),
                false => findings.warning(place, message),
            }
        }
    }
    let (Some(terminals), Ok(document)) = (terminals, Document::parse(description)) else {
        return;
    };
    let terminals = match Document::parse(terminals) {
        Ok(terminals) => terminals,
        Err(error) => {
            findings.error(TERMINALS, format!("not well-formed XML: {error}"));
            return;
        }
    };
    let variables = document
        .descendants()
        .filter(|node| node.has_tag_name("ModelVariables"))
        .flat_map(|list| list.descendants());
    let known: HashSet<&str> = variables
        .filter_map(|node| node.attribute("name"))
        .collect();
    for node in terminals.descendants() {
        if let Some(name) = node.attribute("variableName")
            && !known.contains(name)
        {
            let row = terminals.text_pos_at(node.range().start).row;
            let place = format!("{TERMINALS}:{row}");
            findings.error(&place, format!("the variable `{name}` does not exist"));
        }
    }
}

pub(super) fn folders(findings: &mut Findings, names: &[String]) {
    let known = [
        "modelDescription.xml",
        "model.png",
        "binaries",
        "sources",
        "resources",
        "documentation",
        "licenses",
        "extra",
        "terminalsAndIcons",
    ];
    let mut strange: Vec<&str> = names
        .iter()
        .filter_map(|name| name.split('/').next())
        .filter(|top| !known.contains(top))
        .collect();
    strange.sort_unstable();
    strange.dedup();
    for name in strange {
        findings.note(
            "archive",
            format!("`{name}` at the top is not part of the standard"),
        );
    }
    let has = |front: &str| {
        names
            .iter()
            .any(|name| name.starts_with(front) && name.len() > front.len())
    };
    if !has("binaries/") && !has("sources/") {
        findings.error("archive", "there are neither binaries nor sources");
    } else if !has("binaries/") {
        findings.warning(
            "archive",
            "there are only sources: importers must compile them",
        );
    }
    if !has("documentation/") {
        findings.note("archive", "there is no documentation");
    } else if !names
        .iter()
        .any(|name| name == "documentation/index.html" || name == "documentation/_main.html")
    {
        findings.warning(
            "archive",
            "documentation/index.html, the start page, is missing",
        );
    }
}

pub(super) fn licences(findings: &mut Findings, names: &[String]) {
    let folders = [
        "documentation/licenses/",
        "licenses/",
        "documentation/license",
    ];
    // A folder alone contains none.
    let is_licence = |name: &String| {
        !name.ends_with('/') && folders.iter().any(|folder| name.starts_with(folder))
    };
    if !names.iter().any(is_licence) {
        findings.note("archive", "documentation/licenses contains no licence");
    }
    let main = ["txt", "html", "spdx"].map(|end| format!("documentation/licenses/license.{end}"));
    let has_folder = names.iter().any(|name| name.starts_with(folders[0]));
    if has_folder && !names.iter().any(|name| main.contains(name)) {
        findings.note(
            "archive",
            "documentation/licenses has no license.txt, .html or .spdx",
        );
    }
}

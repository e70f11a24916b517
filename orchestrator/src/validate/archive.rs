//! The archive of an FMU: its entries, its folders, its licences.

use std::collections::HashMap;
use std::io::{Cursor, Read};
use std::path::Path;

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
    let mut archive = match ZipArchive::new(Cursor::new(bytes)) {
        Ok(archive) => archive,
        Err(error) => {
            findings.error("archive", format!("no zip archive can be read ({error})"));
            return None;
        }
    };
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
                format!("the name `{name}` has letters beyond ASCII"),
            );
        }
        if name.contains('\\') {
            findings.error(
                "archive",
                format!("`{name}` has a backslash where `/` belongs"),
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
                true => format!("`{name}` stands there twice"),
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
    match String::from_utf8(text) {
        Ok(text) => Some(text),
        Err(error) => {
            findings.warning(DESCRIPTION, "is not in UTF-8, which the standard asks for");
            let bytes = error.into_bytes();
            Some(bytes.iter().map(|&byte| char::from(byte)).collect())
        }
    }
}

fn folders(findings: &mut Findings, names: &[String]) {
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
            format!("`{name}` at the top is not of the standard"),
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
            "there are sources only: importers have to compile them",
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
            "documentation/index.html, where one begins to read, is missing",
        );
    }
}

fn licences(findings: &mut Findings, names: &[String]) {
    let folders = [
        "documentation/licenses/",
        "licenses/",
        "documentation/license",
    ];
    let is_licence = |name: &String| {
        folders
            .iter()
            .any(|folder| name.starts_with(folder) && name.len() > folder.len())
    };
    if !names.iter().any(is_licence) {
        findings.note("archive", "no licence lies in documentation/licenses");
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

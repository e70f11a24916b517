//! What lies in an FMU, and writing it so that the same contents give the same bytes.

use std::{
    fs::{self, File},
    io::{self, Cursor, Seek, Write},
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter, write::SimpleFileOptions};

use super::error::{PackError, file_error};
use crate::component_library::Descriptions;
use crate::fmu::FmiVersion;

/// An FMU that was packed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PackedFmu {
    /// The component's name.
    pub name: String,
    /// The version it is packed for.
    pub version: FmiVersion,
    /// The archive.
    pub path: PathBuf,
}

const LICENCE: &str = "This FMU is licensed under either of the Apache License, Version 2.0, or \
                       the MIT license, at your option; both texts lie beside this file.\n";

/// Names and contents of an FMU's files, sorted; a name that ends in a slash is a folder.
pub(super) fn entries(
    version: FmiVersion,
    descriptions: &Descriptions,
    binary: &[u8],
    licences: &[(String, Vec<u8>)],
) -> Vec<(String, Vec<u8>)> {
    let description = match version {
        FmiVersion::V2 => &descriptions.fmi2,
        FmiVersion::V3 => &descriptions.fmi3,
    };
    let library = format!(
        "{}/{}{}",
        version.binaries(),
        descriptions.name,
        std::env::consts::DLL_SUFFIX
    );
    let mut entries = vec![
        (
            "modelDescription.xml".to_string(),
            description.clone().into_bytes(),
        ),
        (
            "documentation/index.html".into(),
            descriptions.documentation.clone().into_bytes(),
        ),
        ("documentation/licenses/license.txt".into(), LICENCE.into()),
        ("resources/".into(), Vec::new()),
        (library, binary.to_vec()),
    ];
    entries.extend_from_slice(licences);
    entries.sort();
    entries
}

/// Writes an archive unless it is there with the same contents. The same contents give the same
/// bytes; a reader never sees half an archive.
pub(crate) fn write_archive(path: &Path, entries: &[(String, Vec<u8>)]) -> Result<(), PackError> {
    let mut sum = Sha256::new();
    for (name, content) in entries {
        sum.update((name.len() as u64).to_le_bytes());
        sum.update(name);
        sum.update((content.len() as u64).to_le_bytes());
        sum.update(content);
    }
    let stamp: String = sum
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    let old = File::open(path)
        .ok()
        .and_then(|file| ZipArchive::new(file).ok());
    if old.is_some_and(|archive| archive.comment() == stamp.as_bytes()) {
        return Ok(());
    }
    let draft = path.with_extension(format!("draft.{}", std::process::id()));
    let written = write_entries(&draft, entries, stamp);
    let moved = written.and_then(|()| fs::rename(&draft, path));
    if moved.is_err() {
        let _ = fs::remove_file(&draft);
    }
    moved.map_err(file_error(path))
}

fn write_entries(path: &Path, entries: &[(String, Vec<u8>)], stamp: String) -> io::Result<()> {
    write_to(File::create(path)?, entries, stamp)?.sync_all()
}

/// An archive in memory.
pub(super) fn archive_bytes(entries: &[(String, Vec<u8>)]) -> io::Result<Vec<u8>> {
    Ok(write_to(Cursor::new(Vec::new()), entries, String::new())?.into_inner())
}

fn write_to<W: Write + Seek>(
    writer: W,
    entries: &[(String, Vec<u8>)],
    stamp: String,
) -> io::Result<W> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default());
    let mut archive = ZipWriter::new(writer);
    archive.set_comment(stamp).map_err(io::Error::from)?;
    for (name, content) in entries {
        if let Some(folder) = name.strip_suffix('/') {
            archive.add_directory(folder, options.unix_permissions(0o755))?;
            continue;
        }
        let mode = if name.starts_with("binaries/") {
            0o755
        } else {
            0o644
        };
        archive.start_file(name, options.unix_permissions(mode))?;
        archive.write_all(content)?;
    }
    Ok(archive.finish()?)
}

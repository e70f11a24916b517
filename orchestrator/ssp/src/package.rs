//! An SSP archive, unpacked, or the folder of a description that lies open.

use std::fs;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

use percent_encoding::percent_decode_str;
use zip::ZipArchive;

use fmi_system::Archive;

use super::STRUCTURE;
use super::error::{Fault, SspError};
use fmi_import::archive::{self, Sort};
use fmi_import::folder::Folder;

/// An SSP archive.
const SSP: Sort = Sort {
    refusal: "not an SSP archive",
    file: STRUCTURE,
};
/// Larger files of parameters are mistakes or attacks, bytes.
const LARGEST: u64 = 256 << 20;

/// An SSP archive, unpacked, or the folder of a description that lies open.
#[derive(Debug)]
pub struct Package {
    /// What messages call it.
    pub path: PathBuf,
    root: Root,
}

#[derive(Debug)]
enum Root {
    Unpacked(Folder),
    Open(PathBuf),
}

impl Package {
    /// Opens an archive, or the folder of a description (`.ssd`).
    ///
    /// # Errors
    /// A file that cannot be read, an archive that is broken or would write outside its directory.
    pub fn open(path: &Path) -> Result<Self, SspError> {
        let unreadable = |error: std::io::Error| SspError::Unreadable {
            path: path.to_path_buf(),
            reason: error.to_string(),
        };
        let is_description = path
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("ssd"));
        if is_description {
            fs::metadata(path).map_err(unreadable)?;
            let folder = path.parent().unwrap_or(Path::new(""));
            return Ok(Self {
                path: path.to_path_buf(),
                root: Root::Open(folder.to_path_buf()),
            });
        }
        let bytes = fs::read(path).map_err(unreadable)?;
        Ok(Self {
            root: Root::Unpacked(archive::unpack(SSP, path, &bytes)?),
            path: path.to_path_buf(),
        })
    }

    /// The folder with its files.
    #[must_use]
    pub fn folder(&self) -> &Path {
        match &self.root {
            Root::Unpacked(folder) => folder.path(),
            Root::Open(folder) => folder,
        }
    }

    /// Whether its folder is a copy that can be written to.
    pub(super) fn is_unpacked(&self) -> bool {
        matches!(self.root, Root::Unpacked(_))
    }

    /// A text in it.
    ///
    /// # Errors
    /// It is not there, too large, or no text.
    pub(super) fn text(&self, file: &str) -> Result<String, Fault> {
        let path = self.folder().join(file);
        let size = fs::metadata(&path).map(|data| data.len());
        match size {
            Err(_) => return Err(Fault::new("is not in the archive")),
            Ok(size) if size > LARGEST => {
                return Err(Fault::new(format!("has {} MB, too many", size >> 20)));
            }
            Ok(_) => {}
        }
        let bytes = fs::read(&path).map_err(|error| Fault::new(error.to_string()))?;
        utf8(bytes)
    }

    /// A text in an FMU in it.
    ///
    /// # Errors
    /// As [`Package::text`].
    pub(super) fn text_within(&self, fmu: &str, file: &str) -> Result<String, Fault> {
        let fault = |reason: String| Fault::new(reason);
        let bytes = fs::read(self.folder().join(fmu))
            .map_err(|_| fault(format!("`{fmu}` is not in the archive")))?;
        let mut archive = ZipArchive::new(Cursor::new(bytes))
            .map_err(|error| fault(format!("`{fmu}` is not a zip archive ({error})")))?;
        let entry = archive
            .by_name(file)
            .map_err(|_| fault(format!("`{fmu}` holds no `{file}`")))?;
        let mut content = Vec::new();
        entry
            .take(LARGEST)
            .read_to_end(&mut content)
            .map_err(|error| fault(format!("`{file}` in `{fmu}`: {error}")))?;
        utf8(content)
    }
}

impl Archive for Package {
    fn shown(&self, file: &str) -> PathBuf {
        match &self.root {
            Root::Unpacked(_) => self.path.join(file),
            Root::Open(folder) => folder.join(file),
        }
    }
}

fn utf8(bytes: Vec<u8>) -> Result<String, Fault> {
    let text = String::from_utf8(bytes).map_err(|_| Fault::new("is not UTF-8 text"))?;
    Ok(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_string(),
        None => text,
    })
}

/// A URI that names no file of the archive.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{uri}` {fault}")]
pub(super) struct UriError {
    uri: String,
    fault: UriFault,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
enum UriFault {
    #[error("is not UTF-8")]
    Encoding,
    #[error("is not relative to the archive, and others are not supported")]
    Absolute,
    #[error("points outside the archive")]
    Outside,
    #[error("names no file")]
    NoFile,
}

/// The file that a URI names, relative to the folder `base` in the archive; out of it where it `is_open`,
/// a folder on the disk.
///
/// # Errors
/// A URI that is not a relative path, or one that leads out of an archive.
pub(super) fn resolve(base: &str, uri: &str, is_open: bool) -> Result<String, UriError> {
    let decoded = percent_decode_str(uri).decode_utf8();
    let fault = |fault| UriError {
        uri: uri.to_string(),
        fault,
    };
    let decoded = decoded.map_err(|_| fault(UriFault::Encoding))?;
    let has_scheme = decoded
        .split_once(':')
        .is_some_and(|(scheme, _)| !scheme.contains('/'));
    if has_scheme || decoded.starts_with('/') || decoded.contains('\\') || decoded.contains('\0') {
        return Err(fault(UriFault::Absolute));
    }
    let mut parts: Vec<&str> = base.split('/').filter(|part| !part.is_empty()).collect();
    for part in decoded.split('/') {
        match part {
            "" | "." => {}
            ".." if parts.last().is_some_and(|part| *part != "..") => {
                parts.pop();
            }
            ".." if is_open => parts.push(".."),
            ".." => return Err(fault(UriFault::Outside)),
            part => parts.push(part),
        }
    }
    if parts.last().is_none_or(|part| *part == "..") {
        return Err(fault(UriFault::NoFile));
    }
    Ok(parts.join("/"))
}

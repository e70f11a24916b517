//! Unpacking an FMU without trusting it.

use std::fs;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use zip::ZipArchive;
use zip::result::ZipError;

use super::folder::Folder;
use super::{FmiVersion, FmuError};

/// The largest FMU that is unpacked, in bytes; a small archive may claim much more than it holds.
const LARGEST: u64 = 2 << 30;

/// The name of a file as messages give it.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(
        || path.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}

/// What an archive is unpacked as: what it is called, and the file that it must have at its top.
#[derive(Debug, Clone, Copy)]
pub struct Sort {
    /// Message for a file that is not an FMU.
    pub refusal: &'static str,
    /// `modelDescription.xml`, or `SystemStructure.ssd`.
    pub file: &'static str,
}

/// An FMU.
pub(super) const FMU: Sort = Sort {
    refusal: "not an FMU",
    file: "modelDescription.xml",
};

/// Why `bytes` are not an archive that can be read, and what to do.
#[must_use]
pub fn unreadable(bytes: &[u8], error: &ZipError) -> String {
    match bytes {
        [] => "the file is empty".to_string(),
        [b'P', b'K', ..] => {
            format!("the zip archive is damaged or cut short ({error}); copy or download it again")
        }
        _ => "it is not a zip archive; expected a file that an exporting tool wrote".to_string(),
    }
}

/// Unpacks `bytes` (the file at `fmu`) into a new temporary directory.
///
/// # Errors
/// No archive, a damaged one, or one that would write outside its directory.
pub fn unpack(sort: Sort, fmu: &Path, bytes: &[u8]) -> Result<Folder, FmuError> {
    let broken = |reason: String| FmuError::Archive {
        fmu: fmu.to_path_buf(),
        sort: sort.refusal,
        reason,
    };
    if bytes.is_empty() {
        return Err(broken("the file is empty".to_string()));
    }
    let mut archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|error| broken(unreadable(bytes, &error)))?;
    check_overlaps(&mut archive).map_err(|doubt| broken(doubt.to_string()))?;
    let mut names = Vec::with_capacity(archive.len());
    let mut total = 0;
    for index in 0..archive.len() {
        let entry = archive
            .by_index(index)
            .map_err(|error| broken(format!("entry {index} cannot be read ({error})")))?;
        let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
        if let Some(reason) = refusal(&name, entry.is_symlink()) {
            return Err(FmuError::Hostile {
                fmu: fmu.to_path_buf(),
                entry: name,
                reason,
            });
        }
        total += entry.size();
        names.push(name);
    }
    if total > LARGEST {
        return Err(broken(format!(
            "it would unpack to {} MB, at most {} MB are accepted",
            total >> 20,
            LARGEST >> 20
        )));
    }
    if !names.iter().any(|name| name == sort.file) {
        return Err(broken(format!(
            "the archive has no {} at its top",
            sort.file
        )));
    }
    let directory = Folder::new().map_err(|source| FmuError::Temporary {
        fmu: fmu.to_path_buf(),
        folder: std::env::temp_dir(),
        source,
    })?;
    for (index, name) in names.iter().enumerate() {
        let target = directory.path().join(name);
        let mut write = || -> std::io::Result<()> {
            if name.ends_with('/') {
                return fs::create_dir_all(&target);
            }
            if let Some(parent) = target.parent() {
                fs::create_dir_all(parent)?;
            }
            let entry = archive.by_index(index)?;
            std::io::copy(&mut entry.take(LARGEST), &mut fs::File::create(&target)?)?;
            Ok(())
        };
        write().map_err(|error| broken(format!("`{name}` cannot be unpacked ({error})")))?;
    }
    // Some FMUs cannot do without the folder that they are told of.
    let _ = fs::create_dir_all(directory.path().join("resources"));
    Ok(directory)
}

/// An element with more attributes is not read: to see that none occurs twice, each is compared with
/// all before.
const MOST_ATTRIBUTES: usize = 10_000;

/// Why an archive, or the XML in it, is not read though its format allows it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Doubt {
    /// To compare all attributes with each other would take too long.
    #[error("line {line}: an element has more than {MOST_ATTRIBUTES} attributes")]
    Attributes {
        /// Line of the element, from 1.
        line: usize,
    },
    /// Two entries share bytes.
    #[error("the entries `{first}` and `{second}` overlap")]
    Overlap {
        /// The entry that begins first.
        first: String,
        /// The one that begins inside of it.
        second: String,
    },
    /// An entry's header is damaged.
    #[error("entry {index} cannot be read ({reason})")]
    Entry {
        /// Its number, from 0.
        index: usize,
        /// What the reader of archives says.
        reason: String,
    },
}

/// Whether the elements of an XML text have a bearable number of attributes.
///
/// # Errors
/// The line of an element that has more.
pub fn check_attributes(text: &str) -> Result<(), Doubt> {
    let bytes = text.as_bytes();
    let mut at = 0;
    while let Some(begin) = text[at..].find('<').map(|offset| at + offset) {
        let end = |mark: &str| text[begin..].find(mark).map(|end| begin + end + mark.len());
        let skipped = match &bytes[begin..] {
            [b'<', b'!', b'-', b'-', ..] => end("-->"),
            [b'<', b'!', b'[', b'C', ..] => end("]]>"),
            _ => None,
        };
        if let Some(end) = skipped {
            at = end;
            continue;
        }
        let (mut count, mut quote) = (0, None);
        at = bytes.len();
        for (offset, &byte) in bytes[begin..].iter().enumerate() {
            match (quote, byte) {
                (Some(open), byte) if byte == open => quote = None,
                (Some(_), _) => {}
                (None, b'>') => {
                    at = begin + offset + 1;
                    break;
                }
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b'=') => count += 1,
                _ => {}
            }
            if count > MOST_ATTRIBUTES {
                let before = bytes[..begin].iter().filter(|byte| **byte == b'\n');
                return Err(Doubt::Attributes {
                    line: before.count() + 1,
                });
            }
        }
    }
    Ok(())
}

/// Whether entries of an archive share bytes: a small archive could unpack to anything.
///
/// # Errors
/// An entry whose data begin before those of the one before have ended.
pub fn check_overlaps<R: Read + Seek>(archive: &mut ZipArchive<R>) -> Result<(), Doubt> {
    let mut spans = Vec::with_capacity(archive.len());
    for index in 0..archive.len() {
        let entry = archive.by_index_raw(index).map_err(|error| Doubt::Entry {
            index,
            reason: error.to_string(),
        })?;
        let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
        let start = entry.header_start();
        // The local header takes 30 bytes and the name at least.
        let data = entry.data_start().unwrap_or(start + 30 + name.len() as u64);
        spans.push((start, data.saturating_add(entry.compressed_size()), name));
    }
    spans.sort();
    match spans.windows(2).find(|pair| pair[0].1 > pair[1].0) {
        Some(pair) => Err(Doubt::Overlap {
            first: pair[0].2.clone(),
            second: pair[1].2.clone(),
        }),
        None => Ok(()),
    }
}

/// Why an entry of that name is not unpacked.
fn refusal(name: &str, is_symlink: bool) -> Option<&'static str> {
    let drive = name.as_bytes().get(1) == Some(&b':');
    if is_symlink {
        Some("is a symbolic link")
    } else if name.starts_with('/') || drive {
        Some("is an absolute path")
    } else if name.contains('\\') {
        Some("has a backslash where zip archives have `/`")
    } else if name.split('/').any(|part| part == "..") {
        Some("points outside the archive")
    } else if name.is_empty() || name.contains('\0') {
        Some("is not a file name")
    } else {
        None
    }
}

/// The folders in `binaries`, in alphabetical order.
pub(super) fn platforms(unpacked: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(unpacked.join("binaries"))
        .into_iter()
        .flatten()
        .flatten()
        .filter(|entry| entry.path().is_dir())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// The library to load, after a look at what it was built for.
pub(super) fn binary(
    fmu: &Path,
    unpacked: &Path,
    version: FmiVersion,
    model_identifier: &str,
) -> Result<PathBuf, FmuError> {
    let missing = |reason: String| FmuError::Binary {
        fmu: fmu.to_path_buf(),
        reason,
    };
    let platform = version.platform();
    let name = format!("{model_identifier}{}", std::env::consts::DLL_SUFFIX);
    let relative = format!("binaries/{platform}/{name}");
    let path = unpacked.join(&relative);
    if !path.is_file() {
        let there = platforms(unpacked);
        return Err(missing(if there.is_empty() {
            format!("no binary: `{relative}` is missing and there are none for other platforms")
        } else if there.contains(&platform) {
            format!("no binary: `{relative}` is missing (is the modelIdentifier right?)")
        } else {
            format!(
                "no binary for this platform ({platform}); it has {}",
                there.join(", ")
            )
        }));
    }
    let mut head = [0; 20];
    let read = fs::File::open(&path).and_then(|mut file| file.read(&mut head));
    read.map_err(|error| missing(format!("`{relative}`: {error}")))?;
    if let Some(other) = foreign(&head) {
        return Err(missing(format!(
            "`{relative}` is {other}, not a library for {platform}"
        )));
    }
    if is_cut_short(&path).map_err(|error| missing(format!("`{relative}`: {error}")))? {
        return Err(missing(format!("`{relative}` is cut short")));
    }
    Ok(path)
}

/// Whether a 64-bit ELF file ends before the segments that it declares: mapped, it would end the
/// process.
fn is_cut_short(path: &Path) -> std::io::Result<bool> {
    const HEADER: usize = 64;
    const SEGMENT: usize = 56;
    let mut file = fs::File::open(path)?;
    let length = file.metadata()?.len();
    let mut header = [0; HEADER];
    if length < HEADER as u64 {
        return Ok(true);
    }
    file.read_exact(&mut header)?;
    if !header.starts_with(b"\x7fELF") {
        return Ok(false);
    }
    let number = |bytes: &[u8]| {
        bytes
            .iter()
            .rev()
            .fold(0, |n, byte| (n << 8) | u64::from(*byte))
    };
    let (table, count) = (number(&header[0x20..0x28]), number(&header[0x38..0x3a]));
    let bytes = usize::try_from(count).unwrap_or(0) * SEGMENT;
    if table.saturating_add(bytes as u64) > length {
        return Ok(true);
    }
    let mut segments = vec![0; bytes];
    file.seek(SeekFrom::Start(table))?;
    file.read_exact(&mut segments)?;
    let mut ends = segments.chunks_exact(SEGMENT).map(|segment| {
        let (offset, size) = (number(&segment[0x08..0x10]), number(&segment[0x20..0x28]));
        offset.saturating_add(size)
    });
    Ok(ends.any(|end| end > length))
}

/// What a library is built for, if not for this machine, by the first bytes of its file.
fn foreign(head: &[u8; 20]) -> Option<&'static str> {
    let machine = if head.starts_with(b"\x7fELF") {
        match (head[4], head[18]) {
            (2, 0x3e) => ("linux", "x86_64", "a Linux x86-64 library"),
            (2, 0xb7) => ("linux", "aarch64", "a Linux ARM64 library"),
            _ => ("linux", "other", "a Linux library for another processor"),
        }
    } else if head.starts_with(b"MZ") {
        ("windows", std::env::consts::ARCH, "a Windows library")
    } else if matches!(
        head[..4],
        [0xcf | 0xce, 0xfa, 0xed, 0xfe] | [0xca, 0xfe, 0xba, 0xbe]
    ) {
        ("macos", std::env::consts::ARCH, "a macOS library")
    } else {
        ("none", "none", "no shared library at all")
    };
    let (system, processor, words) = machine;
    let fits = system == std::env::consts::OS && processor == std::env::consts::ARCH;
    (!fits).then_some(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_with_very_many_attributes_are_refused_at_once() {
        let attributes = |count: usize| -> String {
            let all = (0..count).map(|k| format!(" a{k}='1 > \"2'"));
            all.collect()
        };
        assert!(check_attributes(&format!("<a>\n<b{}/></a>", attributes(10_000))).is_ok());
        let many = format!("<a>\n<b{}/></a>", attributes(300_000));
        let line = Doubt::Attributes { line: 2 };
        assert_eq!(check_attributes(&many), Err(line));
    }

    /// Headers of the formats: ELF (its class and machine), PE, Mach-O and its fat form.
    #[test]
    fn a_library_of_another_system_or_processor_is_named() {
        let elf = |class: u8, machine: u8| {
            let mut head = [0; 20];
            head[..4].copy_from_slice(b"\x7fELF");
            (head[4], head[18]) = (class, machine);
            head
        };
        let begin = |bytes: &[u8]| {
            let mut head = [0; 20];
            head[..bytes.len()].copy_from_slice(bytes);
            head
        };
        let (system, processor) = (std::env::consts::OS, std::env::consts::ARCH);
        for (head, own, words) in [
            (elf(2, 0x3e), ("linux", "x86_64"), "a Linux x86-64 library"),
            (elf(2, 0xb7), ("linux", "aarch64"), "a Linux ARM64 library"),
            (
                elf(1, 0x03),
                ("linux", "x86"),
                "a Linux library for another processor",
            ),
            (begin(b"MZ"), ("windows", processor), "a Windows library"),
            (
                begin(&[0xcf, 0xfa, 0xed, 0xfe]),
                ("macos", processor),
                "a macOS library",
            ),
            (
                begin(&[0xca, 0xfe, 0xba, 0xbe]),
                ("macos", processor),
                "a macOS library",
            ),
            (begin(b"#!/bin/sh"), ("", ""), "no shared library at all"),
        ] {
            let expected = (own != (system, processor)).then_some(words);
            assert_eq!(foreign(&head), expected, "{words}");
        }
    }

    /// An archive with these entries, each of 1000 bytes.
    fn zipped(names: &[&str]) -> Vec<u8> {
        use std::io::Write;
        let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default();
        for name in names {
            writer.start_file(*name, options).unwrap();
            writer.write_all(&[7; 1000]).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    #[test]
    fn a_file_that_is_no_archive_is_told_from_a_damaged_one() {
        for (bytes, words) in [
            (&b""[..], "the file is empty"),
            (
                b"PK\x03\x04 and no more",
                "the zip archive is damaged or cut short",
            ),
            (b"text", "it is not a zip archive"),
        ] {
            let error = ZipArchive::new(Cursor::new(bytes)).err().unwrap();
            assert!(unreadable(bytes, &error).starts_with(words));
            let refused = unpack(FMU, Path::new("Own.fmu"), bytes).err().unwrap();
            assert!(refused.to_string().contains(words), "{refused}");
        }
        let none = unpack(FMU, Path::new("Own.fmu"), &zipped(&["a.txt"]));
        let refused = none.err().unwrap().to_string();
        assert!(refused.ends_with("the archive has no modelDescription.xml at its top"));
    }

    #[test]
    fn an_archive_that_claims_to_hold_too_much_is_not_unpacked() {
        let claiming = |size: u32| {
            let mut bytes = zipped(&["modelDescription.xml", "b.txt"]);
            let entries = (0..bytes.len() - 4).filter(|&at| bytes[at..].starts_with(b"PK\x01\x02"));
            let last = entries.max().unwrap();
            bytes[last + 24..last + 28].copy_from_slice(&size.to_le_bytes());
            let unpacked = unpack(FMU, Path::new("Own.fmu"), &bytes);
            unpacked
                .err()
                .map_or(String::new(), |error| error.to_string())
        };
        let refusal = "it would unpack to 2048 MB, at most 2048 MB are accepted";
        let least = u32::try_from(LARGEST).unwrap() - 1000;
        assert!(claiming(least + 1).ends_with(refusal));
        assert!(claiming(u32::MAX - 1).contains("it would unpack to 4096 MB"));
        assert!(!claiming(least).contains("would unpack"));
    }

    #[test]
    fn entries_that_would_be_written_elsewhere_are_refused() {
        for (name, reason) in [
            ("a/b.txt", None),
            ("a..b/..c", None),
            ("/a", Some("is an absolute path")),
            ("C:a", Some("is an absolute path")),
            ("a\\b", Some("has a backslash where zip archives have `/`")),
            ("../a", Some("points outside the archive")),
            ("a/../b", Some("points outside the archive")),
            ("", Some("is not a file name")),
            ("a\0b", Some("is not a file name")),
        ] {
            assert_eq!(refusal(name, false), reason, "{name}");
            assert_eq!(refusal(name, true), Some("is a symbolic link"));
        }
    }

    /// The header, and two segments of which the second ends last.
    #[test]
    fn a_library_that_ends_before_its_segments_is_cut_short() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("library");
        let is_cut = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            is_cut_short(&path).ok()
        };
        let mut file = vec![0_u8; 500];
        file[..4].copy_from_slice(b"\x7fELF");
        (file[0x20], file[0x38]) = (64, 2);
        for (segment, offset, size) in [(64, 0, 100), (64 + 56, 300, 200)] {
            let numbers = [(0x08, offset), (0x20, size)];
            for (at, number) in numbers {
                let number: u64 = number;
                file[segment + at..segment + at + 8].copy_from_slice(&number.to_le_bytes());
            }
        }
        assert_eq!(is_cut(&file), Some(false));
        for length in [0, 63, 64, 64 + 2 * 56 - 1, 64 + 2 * 56, 499] {
            assert_eq!(is_cut(&file[..length]), Some(true), "{length}");
        }
        // Another format is not looked into.
        file[0] = b'M';
        assert_eq!(is_cut(&file), Some(false));
    }

    #[test]
    fn entries_that_share_bytes_are_refused() {
        let bytes = zipped(&["a.txt", "b.txt"]);
        let mut sound = ZipArchive::new(Cursor::new(bytes.clone())).unwrap();
        assert!(check_overlaps(&mut sound).is_ok());
        // The second entry of the directory points to the first one's data.
        let mut forged = bytes;
        let directory = (0..forged.len() - 4).rev();
        let mut entries = directory.filter(|&at| forged[at..].starts_with(b"PK\x01\x02"));
        let last = entries.next().unwrap();
        forged[last + 42..last + 46].fill(0);
        // The reader of archives may refuse it itself.
        if let Ok(mut forged) = ZipArchive::new(Cursor::new(forged)) {
            assert!(check_overlaps(&mut forged).is_err());
        }
    }
}

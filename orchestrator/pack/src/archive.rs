//! What lies in an FMU, and writing it so that the same contents give the same bytes.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{self, Cursor, Read, Seek, Write},
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter, write::SimpleFileOptions};

use super::annotation;
use super::error::{PackError, file_error};
use super::platform::Platform;
use crate::component_library::Descriptions;
use fmi_import::FmiVersion;

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

/// The FMUs in a folder, sorted by name, then version.
///
/// # Errors
/// A folder that cannot be read. A missing one holds no FMUs.
pub fn fmus_in(folder: &Path) -> Result<Vec<PackedFmu>, PackError> {
    let mut found = Vec::new();
    for version in FmiVersion::ALL {
        let below = folder.join(version.folder());
        let entries = match fs::read_dir(&below) {
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::NotFound | io::ErrorKind::NotADirectory
                ) =>
            {
                continue;
            }
            entries => entries.map_err(file_error(&below))?,
        };
        for entry in entries {
            let path = entry.map_err(file_error(&below))?.path();
            if path.extension().is_some_and(|extension| extension == "fmu")
                && let Some(stem) = path.file_stem()
            {
                found.push(PackedFmu {
                    name: stem.to_string_lossy().into_owned(),
                    version,
                    path: path.clone(),
                });
            }
        }
    }
    found.sort_by(|a, b| (&a.name, a.version).cmp(&(&b.name, b.version)));
    Ok(found)
}

const LICENCE: &str = "This FMU is licensed under either of the Apache License, Version 2.0, or \
                       the MIT license, at your option; both texts are next to this file, and the \
                       notices of linked code are in third-party.txt.\n";

/// The picture that tools show.
const ICON: &[u8] = include_bytes!("assets/icon.png");

/// Files of an FMU by name, sorted; a name that ends in a slash is a folder.
pub type Entries = BTreeMap<String, Vec<u8>>;

/// What the FMUs of a component are made of.
pub(super) struct Contents<'a> {
    /// What it says of itself.
    pub(super) descriptions: Descriptions,
    /// Its libraries.
    pub(super) libraries: Vec<(Platform, Vec<u8>)>,
    /// The project's licences by file name.
    pub(super) licences: Vec<(String, Vec<u8>)>,
    /// Licences of what is linked into the libraries.
    pub(super) notices: String,
    /// Which build of the sources it is.
    pub(super) revision: Option<&'a str>,
}

impl Contents<'_> {
    /// The files of the FMU for one version.
    pub(super) fn entries(&self, version: FmiVersion) -> Entries {
        let descriptions = &self.descriptions;
        let description = match version {
            FmiVersion::V2 => &descriptions.fmi2,
            FmiVersion::V3 => &descriptions.fmi3,
        };
        let mut entries = Entries::new();
        let mut put = |name: &str, content: &[u8]| entries.insert(name.into(), content.into());
        let described = annotation::annotated(description, version, self.revision);
        put("modelDescription.xml", described.as_bytes());
        put(
            "documentation/index.html",
            descriptions.documentation.as_bytes(),
        );
        put("documentation/licenses/license.txt", LICENCE.as_bytes());
        put(
            "documentation/licenses/third-party.txt",
            self.notices.as_bytes(),
        );
        for (name, text) in &self.licences {
            put(&format!("documentation/licenses/{name}"), text);
        }
        put("resources/", &[]);
        match version {
            FmiVersion::V2 => put("model.png", ICON),
            FmiVersion::V3 => {
                put("terminalsAndIcons/icon.png", ICON);
                put(
                    "terminalsAndIcons/terminalsAndIcons.xml",
                    descriptions.terminals.as_bytes(),
                )
            }
        };
        for (platform, library) in &self.libraries {
            put(
                &platform.library_in_fmu(version, &descriptions.name),
                library,
            );
        }
        entries
    }
}

/// The files of an FMU.
pub(super) fn read_archive(path: &Path) -> Result<Entries, PackError> {
    let read = || -> io::Result<Entries> {
        let mut archive = ZipArchive::new(File::open(path)?)?;
        let mut entries = Entries::new();
        for index in 0..archive.len() {
            let mut file = archive.by_index(index)?;
            let mut content = Vec::new();
            file.read_to_end(&mut content)?;
            entries.insert(file.name()?.into_owned(), content);
        }
        Ok(entries)
    };
    read().map_err(file_error(path))
}

/// Files compressed as far as deflate goes (zopfli), 4 % below the usual: seconds for each megabyte,
/// so once for all archives that hold them.
pub struct Smallest {
    contents: Vec<Vec<u8>>,
    archive: ZipArchive<Cursor<Vec<u8>>>,
}

impl Smallest {
    /// Compresses the libraries of an FMU.
    pub(super) fn of(libraries: &[(Platform, Vec<u8>)]) -> io::Result<Self> {
        // The `zip` crate goes on from zlib's best level with the passes of zopfli.
        let options = file_options(0o755).compression_level(Some(10));
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        for (place, (_, content)) in libraries.iter().enumerate() {
            writer.start_file(place.to_string(), options)?;
            writer.write_all(content)?;
        }
        Ok(Self {
            contents: libraries.iter().map(|(_, bytes)| bytes.clone()).collect(),
            archive: ZipArchive::new(writer.finish()?)?,
        })
    }

    fn place(&self, content: &[u8]) -> Option<usize> {
        self.contents.iter().position(|own| own == content)
    }
}

/// Writes an archive unless it is there with the same contents; what `smallest` has is taken from
/// there. The same contents give the same bytes; a reader never sees half an archive.
///
/// # Errors
/// A folder or a file that cannot be written.
pub fn write_archive(
    path: &Path,
    entries: &Entries,
    smallest: Option<&mut Smallest>,
) -> Result<(), PackError> {
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
    let written = write_entries(&draft, entries, stamp, smallest);
    let moved = written.and_then(|()| fs::rename(&draft, path));
    if moved.is_err() {
        let _ = fs::remove_file(&draft);
    }
    moved.map_err(file_error(path))
}

fn write_entries(
    path: &Path,
    entries: &Entries,
    stamp: String,
    smallest: Option<&mut Smallest>,
) -> io::Result<()> {
    write_to(File::create(path)?, entries, stamp, smallest)?.sync_all()
}

/// An archive in memory.
pub(super) fn archive_bytes(entries: &Entries) -> io::Result<Vec<u8>> {
    let memory = Cursor::new(Vec::new());
    Ok(write_to(memory, entries, String::new(), None)?.into_inner())
}

/// The same for the same file, whenever it is written.
fn file_options(mode: u32) -> SimpleFileOptions {
    SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(9))
        .last_modified_time(DateTime::default())
        .unix_permissions(mode)
}

fn write_to<W: Write + Seek>(
    writer: W,
    entries: &Entries,
    stamp: String,
    mut smallest: Option<&mut Smallest>,
) -> io::Result<W> {
    let mut archive = ZipWriter::new(writer);
    archive.set_comment(stamp).map_err(io::Error::from)?;
    for (name, content) in entries {
        if let Some(folder) = name.strip_suffix('/') {
            archive.add_directory(folder, file_options(0o755))?;
            continue;
        }
        if let Some(smallest) = &mut smallest
            && let Some(place) = smallest.place(content)
        {
            archive.raw_copy_file_rename(smallest.archive.by_index_raw(place)?, name)?;
            continue;
        }
        let mode = if name.starts_with("binaries/") {
            0o755
        } else {
            0o644
        };
        archive.start_file(name, file_options(mode))?;
        archive.write_all(content)?;
    }
    Ok(archive.finish()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contents() -> Contents<'static> {
        let text = |name: &str| {
            format!("<fmiModelDescription>\n  <ModelVariables/>{name}\n</fmiModelDescription>")
        };
        Contents {
            descriptions: Descriptions {
                name: "One".into(),
                fmi2: text("two"),
                fmi3: text("three"),
                documentation: "<html/>".into(),
                terminals: "<terminals/>".into(),
            },
            libraries: vec![("x86_64-linux".parse().unwrap(), b"library".to_vec())],
            licences: vec![("LICENSE-MIT.txt".into(), b"MIT".to_vec())],
            notices: "notices".into(),
            revision: Some("1a2b"),
        }
    }

    #[test]
    fn an_fmu_holds_the_files_of_its_version() {
        let all = |version| contents().entries(version);
        let (two, three) = (all(FmiVersion::V2), all(FmiVersion::V3));
        let names = |entries: &Entries| entries.keys().cloned().collect::<Vec<_>>();
        let licences = [
            "documentation/licenses/LICENSE-MIT.txt",
            "documentation/licenses/license.txt",
            "documentation/licenses/third-party.txt",
        ];
        let mut expected = vec!["binaries/linux64/One.so", "documentation/index.html"];
        expected.extend(licences);
        expected.extend(["model.png", "modelDescription.xml", "resources/"]);
        assert_eq!(names(&two), expected);
        let mut expected = vec!["binaries/x86_64-linux/One.so", "documentation/index.html"];
        expected.extend(licences);
        expected.extend([
            "modelDescription.xml",
            "resources/",
            "terminalsAndIcons/icon.png",
            "terminalsAndIcons/terminalsAndIcons.xml",
        ]);
        assert_eq!(names(&three), expected);
        let text = |entries: &Entries| {
            String::from_utf8_lossy(&entries["modelDescription.xml"]).into_owned()
        };
        assert!(text(&two).contains("two") && text(&two).contains("build=\"1a2b\""));
        assert!(text(&three).contains("three") && text(&three).contains("build=\"1a2b\""));
        assert_eq!(two["binaries/linux64/One.so"], b"library");
        assert_eq!(two["model.png"], ICON);
        assert!(two["resources/"].is_empty());
    }

    #[test]
    fn the_same_contents_are_not_written_again_and_give_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["One.fmu", "Other.fmu"].map(|name| folder.path().join(name));
        let entries = contents().entries(FmiVersion::V3);
        write_archive(&one, &entries, None).unwrap();
        write_archive(&other, &entries, None).unwrap();
        let bytes = fs::read(&one).unwrap();
        assert_eq!(bytes, fs::read(&other).unwrap());
        assert_eq!(read_archive(&one).unwrap(), entries);
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            2,
            "no draft is left"
        );
        // Its time stays.
        let old = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000_000);
        File::options()
            .write(true)
            .open(&one)
            .unwrap()
            .set_modified(old)
            .unwrap();
        write_archive(&one, &entries, None).unwrap();
        assert_eq!(fs::metadata(&one).unwrap().modified().unwrap(), old);
        let mut changed = entries.clone();
        changed.insert("resources/more".into(), b"1".to_vec());
        write_archive(&one, &changed, None).unwrap();
        assert_eq!(read_archive(&one).unwrap(), changed);
        let told = write_archive(&folder.path().join("none/One.fmu"), &entries, None).unwrap_err();
        assert!(told.to_string().contains("One.fmu"), "{told}");
    }

    #[test]
    fn libraries_are_programs_and_smallest_where_they_were_compressed_before() {
        let own = contents();
        let entries = own.entries(FmiVersion::V2);
        let mut smallest = Smallest::of(&own.libraries).unwrap();
        assert_eq!(smallest.place(b"library"), Some(0));
        assert_eq!(smallest.place(b"another"), None);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("One.fmu");
        write_archive(&path, &entries, Some(&mut smallest)).unwrap();
        assert_eq!(read_archive(&path).unwrap(), entries);
        let mut archive = ZipArchive::new(File::open(&path).unwrap()).unwrap();
        let mut mode = |name: &str| archive.by_name(name).unwrap().unix_mode().unwrap() & 0o777;
        assert_eq!(mode("binaries/linux64/One.so"), 0o755);
        assert_eq!(mode("modelDescription.xml"), 0o644);
    }
}

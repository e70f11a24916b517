//! Joining FMUs that were built on different machines: one archive with the libraries of all.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::archive::{Entries, PackedFmu, fmus_in, read_archive, write_archive};
use super::error::{Difference, PackError, file_error};
use fmi_import::FmiVersion;

/// Joins the FMUs of several folders (each with `fmi2/NAME.fmu` and `fmi3/NAME.fmu`) into `out`.
/// Nothing is written unless all of them fit together.
///
/// # Errors
/// A folder without FMUs, FMUs of one name whose files differ in more than their platforms, two
/// libraries for one platform, files that cannot be read or written.
pub fn merge(folders: &[PathBuf], out: &Path) -> Result<Vec<PackedFmu>, PackError> {
    let mut joined: BTreeMap<(String, FmiVersion), (PathBuf, Entries)> = BTreeMap::new();
    for folder in folders {
        let found = fmus_in(folder)?;
        if found.is_empty() {
            return Err(PackError::EmptyFolder {
                folder: folder.clone(),
                by: "to be merged",
            });
        }
        for fmu in found {
            let entries = read_archive(&fmu.path)?;
            let key = (fmu.name.clone(), fmu.version);
            match joined.get_mut(&key) {
                None => {
                    joined.insert(key, (fmu.path, entries));
                }
                Some((first, together)) => {
                    join(together, entries).map_err(|problem| PackError::Unlike {
                        first: first.clone(),
                        second: fmu.path,
                        problem,
                    })?
                }
            }
        }
    }
    let mut written = Vec::new();
    for ((name, version), (_, entries)) in joined {
        let folder = out.join(version.folder());
        fs::create_dir_all(&folder).map_err(file_error(&folder))?;
        let path = folder.join(format!("{name}.fmu"));
        write_archive(&path, &entries, None)?;
        written.push(PackedFmu {
            name,
            version,
            path,
        });
    }
    Ok(written)
}

/// Adds the libraries of one archive to those of another that is otherwise the same.
fn join(together: &mut Entries, other: Entries) -> Result<(), Difference> {
    let is_library = |name: &str| name.starts_with("binaries/");
    // An empty folder may have an entry of its own or not.
    let rest = |entries: &Entries| -> Vec<String> {
        let files = entries.keys().filter(|name| !name.ends_with('/'));
        files.filter(|name| !is_library(name)).cloned().collect()
    };
    let (here, there) = (rest(together), rest(&other));
    if here != there {
        let lone = here.iter().find(|name| !there.contains(name));
        let lone = lone.or_else(|| there.iter().find(|name| !here.contains(name)));
        return Err(Difference::Lone(lone.cloned().unwrap_or_default()));
    }
    for (name, content) in other {
        match together.get(&name) {
            Some(same) if *same == content => {}
            Some(_) if is_library(&name) => {
                return Err(Difference::Library(name));
            }
            Some(_) => return Err(Difference::Content(name)),
            None => {
                together.insert(name, content);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn archive(files: &[(&str, &str)]) -> Entries {
        let owned = |(name, content): &(&str, &str)| (name.to_string(), content.as_bytes().into());
        files.iter().map(owned).collect()
    }

    #[test]
    fn libraries_are_joined_and_everything_else_has_to_be_the_same() {
        let linux = archive(&[
            ("modelDescription.xml", "a"),
            ("binaries/linux64/A.so", "l"),
        ]);
        let mac = archive(&[
            ("modelDescription.xml", "a"),
            ("binaries/darwin64/A.dylib", "m"),
        ]);
        let mut both = linux.clone();
        join(&mut both, mac).unwrap();
        join(&mut both, linux.clone()).unwrap();
        assert_eq!(both.len(), 3);
        for (other, word) in [
            (archive(&[("modelDescription.xml", "b")]), "differs"),
            (
                archive(&[
                    ("modelDescription.xml", "a"),
                    ("binaries/linux64/A.so", "x"),
                ]),
                "each has another",
            ),
            (
                archive(&[("modelDescription.xml", "a"), ("model.png", "")]),
                "only one has `model.png`",
            ),
        ] {
            let problem = join(&mut linux.clone(), other).unwrap_err();
            assert!(problem.to_string().contains(word), "{problem}");
        }
    }

    #[test]
    fn folders_of_two_platforms_become_one_with_all_libraries() {
        let folders = [(); 3].map(|()| tempfile::tempdir().unwrap());
        let [linux, mac, out] = folders.each_ref().map(|own| own.path().to_path_buf());
        let put = |folder: &Path, version: FmiVersion, name: &str, files: &[(&str, &str)]| {
            let below = folder.join(version.folder());
            fs::create_dir_all(&below).unwrap();
            write_archive(&below.join(name), &archive(files), None).unwrap();
        };
        let own = ("modelDescription.xml", "a");
        put(
            &linux,
            FmiVersion::V3,
            "One.fmu",
            &[own, ("binaries/x86_64-linux/One.so", "l")],
        );
        put(&linux, FmiVersion::V2, "One.fmu", &[own]);
        put(
            &mac,
            FmiVersion::V3,
            "One.fmu",
            &[own, ("binaries/x86_64-darwin/One.dylib", "m")],
        );
        let written = merge(&[linux.clone(), mac.clone()], &out).unwrap();
        let names: Vec<_> = written
            .iter()
            .map(|fmu| (&*fmu.name, fmu.version))
            .collect();
        assert_eq!(names, [("One", FmiVersion::V2), ("One", FmiVersion::V3)]);
        assert_eq!(written[1].path, out.join("fmi3/One.fmu"));
        assert_eq!(read_archive(&written[1].path).unwrap().len(), 3);
        put(
            &mac,
            FmiVersion::V2,
            "One.fmu",
            &[("modelDescription.xml", "b")],
        );
        let told = merge(&[linux.clone(), mac.clone()], &out)
            .unwrap_err()
            .to_string();
        assert!(
            told.contains("cannot be merged: `modelDescription.xml` differs"),
            "{told}"
        );
        let told = merge(&[linux, out.join("none")], &out)
            .unwrap_err()
            .to_string();
        assert!(
            told.contains("no FMUs in this folder, to be merged"),
            "{told}"
        );
    }
}

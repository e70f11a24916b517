//! What lies in the packed FMUs, and that packing again changes nothing.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    path::Path,
};

use shakebench::pack::{FmiVersion, build_fmus};

fn names(path: &Path) -> zip::result::ZipResult<BTreeSet<String>> {
    let archive = zip::ZipArchive::new(File::open(path)?)?;
    archive
        .file_names()
        .map(|name| Ok(name?.to_string()))
        .collect()
}

#[test]
fn same_components_give_the_same_bytes_and_are_not_written_again() {
    let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let packed = build_fmus(first.path(), &FmiVersion::ALL).unwrap();
    let again = build_fmus(second.path(), &FmiVersion::ALL).unwrap();
    assert!(packed.len() >= 8 && packed.len() == again.len());
    let modified = |path: &Path| fs::metadata(path).unwrap().modified().unwrap();
    let before: Vec<_> = packed.iter().map(|fmu| modified(&fmu.path)).collect();
    for (a, b) in packed.iter().zip(&again) {
        assert_eq!((&a.name, a.version), (&b.name, b.version));
        assert_eq!(
            fs::read(&a.path).unwrap(),
            fs::read(&b.path).unwrap(),
            "{}",
            a.name
        );
    }

    // A damaged archive is replaced, the others are left alone.
    fs::write(&packed[0].path, b"no archive").unwrap();
    assert_eq!(build_fmus(first.path(), &FmiVersion::ALL).unwrap(), packed);
    assert_eq!(
        fs::read(&packed[0].path).unwrap(),
        fs::read(&again[0].path).unwrap()
    );
    for (fmu, before) in packed.iter().zip(before).skip(1) {
        assert_eq!(
            modified(&fmu.path),
            before,
            "{} was written again",
            fmu.name
        );
    }

    // One version alone.
    let third = tempfile::tempdir().unwrap();
    let only = build_fmus(third.path(), &[FmiVersion::V3]).unwrap();
    assert!(only.iter().all(|fmu| fmu.version == FmiVersion::V3));
    assert!(!third.path().join("fmi2").exists());
}

#[test]
fn every_fmu_has_its_documentation_and_licences() {
    let folder = tempfile::tempdir().unwrap();
    for fmu in build_fmus(folder.path(), &FmiVersion::ALL).unwrap() {
        let names = names(&fmu.path).unwrap();
        let library = format!(
            "{}/{}{}",
            fmu.version.binaries(),
            fmu.name,
            std::env::consts::DLL_SUFFIX
        );
        for expected in [
            "modelDescription.xml",
            "documentation/index.html",
            "documentation/licenses/license.txt",
            "documentation/licenses/LICENSE-MIT.txt",
            "documentation/licenses/LICENSE-APACHE.txt",
            "resources/",
            &library,
        ] {
            assert!(
                names.contains(expected),
                "{} lacks {expected}: {names:?}",
                fmu.name
            );
        }
        assert_eq!(names.len(), 7, "{names:?}");
        assert_eq!(
            fmu.path.parent().unwrap(),
            folder.path().join(fmu.version.folder())
        );
    }
}

//! What lies in the packed FMUs, and that packing again changes nothing.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::Read,
    path::{Path, PathBuf},
};

use pack::{FmiVersion, Platform, build_fmus, build_of, pack_libraries};

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
fn every_fmu_has_its_documentation_licences_and_picture() {
    let folder = tempfile::tempdir().unwrap();
    let here = Platform::here().unwrap();
    for fmu in build_fmus(folder.path(), &FmiVersion::ALL).unwrap() {
        let mut expected = BTreeSet::from(
            [
                "modelDescription.xml",
                "documentation/index.html",
                "documentation/licenses/license.txt",
                "documentation/licenses/third-party.txt",
                "documentation/licenses/LICENSE-MIT.txt",
                "documentation/licenses/LICENSE-APACHE.txt",
                "resources/",
            ]
            .map(String::from),
        );
        expected.insert(here.library_in_fmu(fmu.version, &fmu.name));
        match fmu.version {
            FmiVersion::V2 => expected.extend(["model.png".into()]),
            FmiVersion::V3 => expected.extend([
                "terminalsAndIcons/icon.png".into(),
                "terminalsAndIcons/terminalsAndIcons.xml".into(),
            ]),
        }
        assert_eq!(names(&fmu.path).unwrap(), expected, "{}", fmu.name);
        assert_eq!(
            fmu.path.parent().unwrap(),
            folder.path().join(fmu.version.folder())
        );
        let notices = text(&fmu.path, "documentation/licenses/third-party.txt");
        for linked in ["Rust's standard library", "\nserde 1.", "\npostcard 1."] {
            assert!(notices.contains(linked), "{}: {notices}", fmu.name);
        }
        let described = text(&fmu.path, "modelDescription.xml");
        let release = format!("<Release version=\"{}\"/>", env!("CARGO_PKG_VERSION"));
        assert!(described.contains(&release), "{}", fmu.name);
    }
}

#[test]
fn notices_hold_what_a_component_is_linked_with_and_no_more() {
    let notices = |name: &str| {
        let all = build_fmus(&folder(), &[FmiVersion::V3]).unwrap();
        let own = all.into_iter().find(|fmu| fmu.name == name).unwrap();
        text(&own.path, "documentation/licenses/third-party.txt")
    };
    // The quadratic program's solver is in the controller that solves one.
    assert!(notices("ModelPredictive").contains("\nclarabel "));
    assert!(!notices("Specimen").contains("\nclarabel "));
    assert!(!notices("ModelPredictive").contains("\nclap "));
}

#[test]
fn libraries_compiled_before_are_packed_for_their_platforms() {
    let folder = tempfile::tempdir().unwrap();
    let here = Platform::here().unwrap();
    let (own, foreign) = (folder.path().join("own"), folder.path().join("foreign"));
    let windows: Platform = "x86_64-windows".parse().unwrap();
    fs::create_dir(&own).unwrap();
    fs::create_dir(&foreign).unwrap();
    let mut names = BTreeSet::new();
    for fmu in build_fmus(&self::folder(), &[FmiVersion::V2]).unwrap() {
        let mut archive = zip::ZipArchive::new(File::open(&fmu.path).unwrap()).unwrap();
        let mut library = Vec::new();
        let inside = here.library_in_fmu(fmu.version, &fmu.name);
        archive
            .by_name(&inside)
            .unwrap()
            .read_to_end(&mut library)
            .unwrap();
        fs::write(own.join(here.library_file(&fmu.name)), library).unwrap();
        fs::write(foreign.join(windows.library_file(&fmu.name)), b"MZ").unwrap();
        names.insert(fmu.name);
    }
    let out = folder.path().join("out");
    let libraries = [(here.clone(), own), (windows.clone(), foreign.clone())];
    let packed = pack_libraries(&libraries, &out, &FmiVersion::ALL, Some("v1 & 2"), false).unwrap();
    assert_eq!(packed.len(), 2 * names.len());
    for fmu in packed {
        for platform in [&here, &windows] {
            let library = platform.library_in_fmu(fmu.version, &fmu.name);
            assert!(
                self::names(&fmu.path).unwrap().contains(&library),
                "{library}"
            );
        }
        let described = text(&fmu.path, "modelDescription.xml");
        let document = roxmltree::Document::parse(&described).unwrap();
        assert_eq!(build_of(&document).as_deref(), Some("v1 & 2"));
    }
    fs::remove_file(foreign.join(windows.library_file("Specimen"))).unwrap();
    let missing = pack_libraries(&libraries, &out, &FmiVersion::ALL, None, false).unwrap_err();
    assert!(missing.to_string().contains("Specimen.dll"), "{missing}");
    let lone = pack_libraries(&libraries[1..], &out, &FmiVersion::ALL, None, false).unwrap_err();
    assert!(lone.to_string().contains("no libraries for"), "{lone}");
}

fn folder() -> PathBuf {
    pack::default_folder().unwrap()
}

fn text(path: &Path, name: &str) -> String {
    let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    let mut text = String::new();
    let mut file = archive.by_name(name).unwrap();
    file.read_to_string(&mut text).unwrap();
    text
}

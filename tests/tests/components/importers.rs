//! Every FMU of both versions in the importers at hand. The list of FMUs is what the build packs:
//! a new component needs no line here.

use std::path::{Path, PathBuf};

use acceptance::python::run_script;
use pack::{
    FmiVersion, PackedFmu, StartValue, all_fmus, build_component, default_folder, write_variant,
};

fn paths(wanted: impl Fn(&PackedFmu) -> bool) -> Vec<PathBuf> {
    let fmus = all_fmus().unwrap_or_else(|e| panic!("{e}"));
    let paths: Vec<_> = fmus
        .iter()
        .filter(|f| wanted(f))
        .map(|f| f.path.clone())
        .collect();
    assert!(!paths.is_empty());
    paths
}

/// Runs a script on FMUs and checks that it did something with each; those whose equations are another
/// program's have tests of their own. Returns what it printed.
fn gate(script: &str, fmus: &[PathBuf]) -> String {
    let report = run_script(script, fmus);
    println!("{report}");
    let passed = report
        .lines()
        .filter(|line| line.starts_with("ok ") || line.ends_with(": needs another program"))
        .count();
    assert!(
        passed >= fmus.len(),
        "{script} checked only {passed} times for {}",
        fmus.len()
    );
    report
}

#[test]
fn fmpy_runs_every_fmu_like_the_code_without_fmi() {
    gate("fmpy_gate.py", &paths(|_| true));
}

#[test]
fn fmpy_integrates_what_offers_model_exchange() {
    gate("fmpy_model_exchange.py", &paths(|_| true));
}

#[test]
fn ecos_steps_every_fmu() {
    gate("ecos_gate.py", &paths(|_| true));
}

#[test]
fn libcosim_steps_every_fmu_of_version_2_without_a_warning() {
    let report = gate("libcosim_gate.py", &paths(|f| f.version == FmiVersion::V2));
    // The strictest reader of model descriptions: its log is silent unless something is odd.
    assert!(!report.contains("FMI Library"), "{report}");
}

#[test]
fn faults_inside_a_component_reach_the_importer_as_errors() {
    let out = default_folder().unwrap().with_file_name("fmus-for-tests");
    let packed = build_component("tests/importers/faulty", &out, &FmiVersion::ALL).unwrap();
    let paths: Vec<_> = packed.into_iter().map(|fmu| fmu.path).collect();
    gate("fmpy_faults.py", &paths);
    assert!(
        all_fmus().unwrap().iter().all(|fmu| fmu.name != "Faulty"),
        "the component for tests is packed as a product"
    );
}

#[test]
fn variant_of_an_fmu_starts_with_its_own_values_in_fmpy() {
    let folder = tempfile::tempdir().unwrap();
    let mut pairs = Vec::new();
    for fmu in all_fmus()
        .unwrap()
        .iter()
        .filter(|fmu| fmu.name == "ShakeTable")
    {
        let out = folder.path().join(format!("{}.fmu", fmu.version.folder()));
        let mass = StartValue {
            name: "table_mass".into(),
            value: 1.0 / 3.0,
            note: "identified, standard error < 0.1 kg".into(),
        };
        write_variant(&fmu.path, &out, "ShakeTable & payload", &[mass]).unwrap();
        let unknown = StartValue {
            name: "displacement".into(),
            value: 1.0,
            note: String::new(),
        };
        let refused = write_variant(&fmu.path, &out, "x", &[unknown]).unwrap_err();
        assert!(
            refused
                .to_string()
                .ends_with("`displacement` is not a parameter of it"),
            "{refused}"
        );
        let again = write_variant(&out, &out, "x", &[]).unwrap_err();
        assert!(again.to_string().contains("is a variant itself"), "{again}");
        pairs.extend([fmu.path.clone(), out]);
    }
    let report = run_script("fmpy_variant.py", &pairs);
    assert_eq!(
        report.matches("table_mass = 0.333333").count(),
        2,
        "{report}"
    );
}

#[test]
fn fmi_rs_finds_nothing_wrong_with_any_description() {
    for fmu in all_fmus().unwrap() {
        let folder = tempfile::tempdir().unwrap();
        let mut archive = zip::ZipArchive::new(std::fs::File::open(&fmu.path).unwrap()).unwrap();
        archive.extract(folder.path()).unwrap();
        let problems = problems(fmu.version, &folder.path().join("modelDescription.xml"));
        assert_eq!(problems, Vec::<String>::new(), "{}", fmu.path.display());
    }
}

/// The parser of variable names in `fmi-rs` keeps its state in globals: one at a time.
static PARSER: std::sync::Mutex<()> = std::sync::Mutex::new(());

fn problems(version: FmiVersion, description: &Path) -> Vec<String> {
    use fmi_rs::model_description::{fmi2, fmi3};
    let _alone = PARSER.lock();
    let problems = match version {
        FmiVersion::V2 => fmi2::ModelDescription::from_path(description).map(|d| d.validate()),
        FmiVersion::V3 => fmi3::ModelDescription::from_path(description).map(|d| d.validate()),
    };
    match problems {
        Ok(problems) => problems
            .into_iter()
            .map(|problem| problem.message)
            .collect(),
        Err(unreadable) => vec![unreadable.to_string()],
    }
}

#[test]
fn fmi_rs_reports_a_description_that_is_wrong() {
    // The check above can fail: an output missing from the model structure is found.
    for fmu in all_fmus().unwrap() {
        let folder = tempfile::tempdir().unwrap();
        let mut archive = zip::ZipArchive::new(std::fs::File::open(&fmu.path).unwrap()).unwrap();
        archive.extract(folder.path()).unwrap();
        let path = folder.path().join("modelDescription.xml");
        let text = std::fs::read_to_string(&path).unwrap();
        let wrong = text.replacen("causality=\"output\"", "causality=\"local\"", 1);
        assert_ne!(text, wrong);
        std::fs::write(&path, wrong).unwrap();
        assert_ne!(
            problems(fmu.version, &path),
            Vec::<String>::new(),
            "{}",
            fmu.path.display()
        );
    }
}

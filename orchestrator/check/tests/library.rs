//! A library that is called in another process, which is this program again: sound, and with one fault at a
//! time.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

#[allow(dead_code, reason = "other tests need more")]
#[path = "../../fmi/tests/compiled/made.rs"]
mod made;

use std::path::Path;
use std::process::ExitCode;

use fmi_check::{Findings, validate};
use fmi_import::{FmiVersion, isolation};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [isolation::COMMAND, frame] = *arguments.iter().map(String::as_str).collect::<Vec<_>>() {
        return isolation::guest(Path::new(frame));
    }
    for (name, test) in [
        ("a_sound_library_passes", a_sound_library_passes as fn()),
        ("derivatives_are_compared", derivatives_are_compared),
        (
            "faults_of_the_library_are_found",
            faults_of_the_library_are_found,
        ),
        (
            "a_reference_is_compared_with_a_run",
            a_reference_is_compared_with_a_run,
        ),
    ] {
        println!("test {name}");
        test();
    }
    ExitCode::SUCCESS
}

/// What is found of an FMU that answers so, with these attributes and further files.
fn checked(version: FmiVersion, answer: i32, attributes: &str, more: &[(&str, &str)]) -> Findings {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("Minimal.fmu");
    let description = made::description(version, [Some(attributes), None], "");
    let description = made::answering(&description, answer);
    made::pack(&path, &description, made::library(), more);
    let guest = std::env::current_exe().unwrap();
    validate(&path, Some(&guest)).unwrap()
}

/// What is said of the library, or in the place that is named.
fn said(findings: &Findings, place: &str) -> Vec<String> {
    let all = findings.findings.iter().filter(|own| own.place == place);
    all.map(|own| format!("{}: {}", own.severity, own.message))
        .collect()
}

const STATES: &str = r#"canGetAndSetFMUState="true""#;

fn a_sound_library_passes() {
    let found = checked(FmiVersion::V3, 0, STATES, &[]);
    assert_eq!(said(&found, "library"), [""; 0]);
    let expected = [
        "library: instantiated, initialized, 20 steps of 0.001 s, every variable read, terminated",
        "library: two instances in one process",
        "library: steps repeated from a saved state, the same to the bit",
        "library: 6 calls out of order",
    ];
    for line in expected {
        assert!(
            found.checked.iter().any(|known| known == line),
            "{:?}",
            found.checked
        );
    }
    assert_eq!((found.kind, found.version.as_deref()), ("fmu", Some("3.0")));
    assert!(found.file.ends_with("Minimal.fmu"));
}

fn derivatives_are_compared() {
    for (version, attributes) in [
        (FmiVersion::V2, r#"providesDirectionalDerivative="true""#),
        (FmiVersion::V3, r#"providesDirectionalDerivatives="true""#),
        (FmiVersion::V3, r#"providesAdjointDerivatives="true""#),
    ] {
        let is_of_derivatives = |line: &String| line.contains("derivative");
        let found = checked(version, 0, attributes, &[]);
        assert!(!said(&found, "library").iter().any(is_of_derivatives));
        // Of `y` and `x'` by `u` and `x`.
        let line = "library: 4 derivatives against differences".to_string();
        assert!(found.checked.contains(&line), "{:?}", found.checked);
        let wrong = checked(version, 104, attributes, &[]);
        let mut wrong = said(&wrong, "library");
        wrong.retain(is_of_derivatives);
        let expected = [
            ("y", "u", "2.200000", "2.000000"),
            ("slope", "x", "-1.100000", "-1.000000"),
        ];
        let expected = expected.map(|(unknown, known, given, found)| {
            format!(
                "error: the derivative of `{unknown}` by `{known}` is given as {given}, and differences of its \
                 values are {found}"
            )
        });
        assert_eq!(wrong, expected);
    }
    let attributes = r#"providesDirectionalDerivatives="true""#;
    for (answer, expected) in [
        (
            105,
            "warning: it says that it gives derivatives, and gives none by `u`",
        ),
        (
            106,
            "error: it says that it gives derivatives; by `u`: fmi3GetDirectionalDerivative returned error",
        ),
    ] {
        let attributes = format!("{attributes} {STATES}");
        let found = said(
            &checked(FmiVersion::V3, answer, &attributes, &[]),
            "library",
        );
        assert_eq!(found, [expected]);
    }
}

fn faults_of_the_library_are_found() {
    for (answer, expected) in [
        (3, "returned error"),
        (2, "returned discard (it came to 0.0005 s)"),
        (101, "ended its process by exit(3)"),
    ] {
        let found = checked(FmiVersion::V2, answer, "", &[]);
        let lines = said(&found, "library");
        let is_it = |line: &String| line.starts_with("error") && line.contains(expected);
        assert!(lines.iter().any(is_it), "{lines:?}");
        assert!(
            !found
                .checked
                .iter()
                .any(|line| line.contains("two instances"))
        );
    }
}

const TABLE: &str = "extra/org.fmi-standard.fmi-ls-ref/minimal_out.csv";

fn a_reference_is_compared_with_a_run() {
    let rows = |error: f64| -> String {
        let rows = (0..=10).map(|n| {
            let time = 0.1 * f64::from(n);
            let off = if n == 4 { error } else { 0.0 };
            format!("{time:.1},{},{n},0\n", (-time).exp() + off)
        });
        format!("time,x,answer,strange\n{}", rows.collect::<String>())
    };
    let sound = checked(FmiVersion::V3, 0, "", &[(TABLE, &rows(0.9e-3))]);
    assert_eq!(
        said(&sound, TABLE),
        ["warning: `strange` is not a variable"]
    );
    let line = format!("{TABLE}: 1 columns compared with a run of 0.1 s steps");
    assert!(sound.checked.contains(&line), "{:?}", sound.checked);
    let off = checked(FmiVersion::V3, 0, "", &[(TABLE, &rows(1.5e-3))]);
    let expected = "error: `x` differs by 1.500e-3 at 0.4 s (its largest value is 1.000e0)";
    assert!(
        said(&off, TABLE).iter().any(|line| line == expected),
        "{:?}",
        said(&off, TABLE)
    );
    let failed = checked(FmiVersion::V3, 3, "", &[(TABLE, &rows(0.0))]);
    let failed = said(&failed, TABLE);
    let front = "error: the run for comparison failed: ";
    assert!(
        failed[0].starts_with(front) && failed[0].contains("returned error"),
        "{failed:?}"
    );
    let none = checked(FmiVersion::V3, 0, "", &[(TABLE, "t,x\n0,1\n")]);
    assert_eq!(
        said(&none, TABLE),
        ["warning: the first column is not `time`"]
    );
}

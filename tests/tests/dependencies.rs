//! What the project builds on: licences, the oldest compiler, and one set of features a crate.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Licences that may go into a program under "MIT OR Apache-2.0": they ask for their own text to
/// be kept, or (MPL-2.0) for the source of the file itself.
const LICENCES: [&str; 14] = [
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "MPL-2.0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
    "bzip2-1.0.6",
];

fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .args(["--offline", "--locked", "--manifest-path"])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml"))
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {arguments:?}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

fn packages() -> Vec<Value> {
    let metadata = cargo(&["metadata", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&metadata).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

/// Whether an expression such as `(MIT OR Apache-2.0) AND Unicode-3.0` can be met.
fn allowed(expression: &str) -> bool {
    // Parentheses occur around alternatives only, so "and" may be split first.
    expression.split(" AND ").all(|part| {
        let part = part.trim().trim_matches(['(', ')']).replace('/', " OR ");
        part.split(" OR ")
            .any(|licence| LICENCES.contains(&licence.trim()))
    })
}

/// Whether a package that names no licence brings the text of the MIT licence.
fn is_mit(package: &Value) -> bool {
    let (Some(file), Some(manifest)) = (
        package["license_file"].as_str(),
        package["manifest_path"].as_str(),
    ) else {
        return false;
    };
    let text = std::fs::read_to_string(Path::new(manifest).with_file_name(file));
    text.is_ok_and(|text| {
        let words: Vec<&str> = text.split_whitespace().collect();
        let text = words.join(" ");
        text.contains(
            "Permission is hereby granted, free of charge, to any person obtaining a copy",
        ) && text.contains("THE SOFTWARE IS PROVIDED \"AS IS\", WITHOUT WARRANTY OF ANY KIND")
    })
}

#[test]
fn licences_of_all_dependencies_are_allowed() {
    let refused: Vec<String> = packages()
        .iter()
        .filter(|package| !package["license"].as_str().is_some_and(allowed) && !is_mit(package))
        .map(|package| format!("{}: {}", package["name"], package["license"]))
        .collect();
    assert!(refused.is_empty(), "{refused:#?}");
    assert!(!allowed("GPL-3.0") && !allowed("MIT AND GPL-3.0") && allowed("GPL-3.0 OR MIT"));
}

#[test]
fn no_dependency_needs_a_newer_compiler_than_the_project() {
    // `1.89` and `1.89.0` are the same.
    let version = |text: &str| -> [u32; 3] {
        let mut numbers = [0; 3];
        for (place, number) in numbers.iter_mut().zip(text.split('.')) {
            *place = number.parse().unwrap();
        }
        numbers
    };
    let packages = packages();
    let own = packages.iter().find(|p| p["name"] == "shakebench").unwrap();
    let oldest = version(own["rust_version"].as_str().unwrap());
    for package in &packages {
        if let Some(needs) = package["rust_version"].as_str() {
            let name = &package["name"];
            assert!(version(needs) <= oldest, "{name} needs Rust {needs}");
        }
    }
}

/// Otherwise `cargo run`, `cargo test` and the build of the components compile everything anew
/// each for itself, and overwrite each other's components. A dependency of tests that switches on
/// a feature of something the program uses as well needs another choice, or the feature stated
/// where the program uses it.
#[test]
fn programs_and_tests_are_built_with_the_same_features() {
    let features = |selection: &str, edges: &str| -> BTreeSet<String> {
        let format = ["-f", "{p} [{f}]", "--prefix", "none"];
        let arguments = [&["tree", selection, "-e", edges][..], &format].concat();
        let tree = cargo(&arguments);
        // A package that was shown before is marked.
        tree.lines()
            .map(|line| line.trim_end_matches(" (*)").to_string())
            .collect()
    };
    let tests = features("--workspace", "normal,build,dev");
    for (what, set) in [
        ("cargo run", features("--workspace", "normal,build")),
        (
            "-p shakebench",
            features("-pshakebench", "normal,build,dev"),
        ),
        (
            "-p acceptance",
            features("-pacceptance", "normal,build,dev"),
        ),
    ] {
        let others: Vec<&String> = set.difference(&tests).collect();
        assert!(others.is_empty(), "features of {what} alone: {others:#?}");
    }
}

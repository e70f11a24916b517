//! Effects hidden by an independent program are found, and nothing is found where nothing is.

use std::process::Command;

use acceptance::hidden_suite::{Plan, rates, run_all, table};

#[test]
fn the_generator_shares_no_code_with_the_plant() {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--offline",
            "--package",
            "hidden-effects",
            "--edges",
            "all",
        ])
        .args(["--prefix", "none", "--manifest-path"])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml"))
        .output()
        .expect("cargo tree runs");
    let tree = String::from_utf8_lossy(&output.stdout);
    assert!(
        tree.contains("hidden-effects"),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    for package in [
        "plant",
        "controllers",
        "identification",
        "shakebench",
        "nalgebra",
    ] {
        let shared = tree
            .lines()
            .any(|line| line.split(' ').next() == Some(package));
        assert!(!shared, "the generator depends on `{package}`:\n{tree}");
    }
}

#[test]
fn a_few_fresh_cases_are_diagnosed() {
    let plan = Plan {
        seed: rand::random_range(1..1_000_000_000),
        one: 16,
        two: 4,
        nothing: 4,
        outside: 6,
        mismatch: 0.01,
        noise: 1.0,
    };
    println!("{plan:?}");
    let results = run_all(&plan, |_| {});
    let report = table(&results);
    println!("{report}");
    // Bounds that the required rates (95 %, 85 %, 95 %; wrong 1 %) miss once in some thousand
    // runs; the command `hidden_effects_suite` measures the rates themselves.
    assert!(
        rates(&results, "one").0 >= 0.75,
        "seed {}\n{report}",
        plan.seed
    );
    assert!(
        rates(&results, "two").0 >= 0.25,
        "seed {}\n{report}",
        plan.seed
    );
    assert!(
        rates(&results, "outside").0 >= 0.5,
        "seed {}\n{report}",
        plan.seed
    );
    assert!(
        rates(&results, "nothing").0 >= 1.0,
        "seed {}\n{report}",
        plan.seed
    );
    let wrong: f64 = ["one", "two", "nothing", "outside"]
        .iter()
        .map(|kind| rates(&results, kind).1)
        .sum();
    assert!(wrong <= 0.25, "seed {}\n{report}", plan.seed);
}

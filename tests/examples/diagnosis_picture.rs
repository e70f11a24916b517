//! Makes the case of `docs/diagnosis-walkthrough.md`, diagnoses it and pictures the report as
//! `docs/diagnosis-report.png`.
//!
//! `cargo run --release -p acceptance --example diagnosis_picture`; the picture needs a Chromium,
//! named by CHROMIUM where it is not called `chromium`.

use std::path::Path;
use std::process::Command;

use hidden_effects::case::{Case, Kind, Settings};
use identification::diagnosis::engine::Observer;
use laboratory::diagnosis::diagnose;
use laboratory::results::Out;
use pages::report::FILE;

/// Seed of the case.
const SEED: u64 = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("..")
        .canonicalize()?;
    let folder = root.join("target/diagnosis-walkthrough");
    // The page shows the place of the case as it is called.
    std::fs::create_dir_all(&folder)?;
    std::env::set_current_dir(&folder)?;
    let case = Path::new("cases").join(format!("case-{SEED:05}"));
    Case::draw(SEED, &Settings::new(Kind::This("valve_dead_band"))).write(&case)?;
    let report = diagnose(&case, &[], None, &Out::new("results"), Observer::none())?;
    println!("{}", report.sentence);
    let page = folder.join("results").join(FILE);
    let picture = root.join("docs/diagnosis-report.png");
    let browser = std::env::var("CHROMIUM").unwrap_or_else(|_| "chromium".into());
    let status = Command::new(&browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu"])
        .args(["--hide-scrollbars", "--virtual-time-budget=4000"])
        .arg("--window-size=1200,640")
        .arg(format!("--screenshot={}", picture.display()))
        .arg(format!("file://{}", page.display()))
        .status()
        .map_err(|error| format!("{browser}: {error}"))?;
    if !status.success() {
        return Err(format!("{browser}: {status}").into());
    }
    println!("written: {}", picture.display());
    Ok(())
}

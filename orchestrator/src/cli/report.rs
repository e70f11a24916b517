//! `shakebench report`

use super::out::{given, units};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use laboratory::comparison;
use laboratory::diagnosis;
use laboratory::error::Error;
use laboratory::iteration;
use laboratory::results::write_report;
use laboratory::run::page;

/// Options of `shakebench report`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    shakebench report shakebench-results/three-variable-synthetic-1")]
pub struct Arguments {
    /// Folder of a run, a comparison or a diagnosis
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Writes `report.html` again from the other files of a folder.
///
/// # Errors
/// A folder without such files, or a file at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let folder = &arguments.folder;
    let fault = |reason: &str| Error::File {
        path: folder.clone(),
        reason: reason.to_string(),
    };
    if !folder.is_dir() {
        return Err(fault(
            "is not a folder; expected the folder of a run, a comparison or a diagnosis",
        ));
    }
    let has = |name: &str| folder.join(name).is_file();
    let (kind, page) = if has("manifest.json") || has("results.csv") {
        ("run", page::page_again(folder, units())?)
    } else if has(comparison::COMPARISON) {
        ("comparison", comparison::page_again(folder)?)
    } else if has(diagnosis::DIAGNOSIS) {
        ("diagnosis", diagnosis::page_again(folder, units())?)
    } else if let Some(command) = made_by(folder) {
        return Err(fault(&format!(
            "its page contains more than its other files; expected the folder of a run, a \
             comparison or a diagnosis; `{command}` writes it again"
        )));
    } else {
        return Err(fault(
            "contains no results; expected results.csv, summary.json and manifest.json of a run, \
             comparison.json of a comparison, or diagnosis.json of a diagnosis",
        ));
    };
    let report = write_report(&page, &given(folder))?;
    if arguments.json {
        println!("{}", serde_json::json!({"of": kind, "report": report}));
    } else {
        println!("written, of a {kind}:\n  {}", report.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// What writes the page of a folder whose other files do not hold all of it.
fn made_by(folder: &Path) -> Option<&'static str> {
    [
        ("findings.json", "shakebench campaign STUDY.toml --out DIR"),
        ("tuned.json", "shakebench tune STUDY.toml --out DIR"),
        ("commission.json", "shakebench commission --out DIR"),
        (iteration::ITERATION, "shakebench iterate SYSTEM --out DIR"),
        ("runs.json", "shakebench compare A B --out DIR"),
    ]
    .into_iter()
    .find(|(file, _)| folder.join(file).is_file())
    .map(|(_, command)| command)
}

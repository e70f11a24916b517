//! `shakebench report`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use crate::comparison;
use crate::diagnosis;
use crate::error::Error;
use crate::report;
use crate::run::page;

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
            "is no folder; expected that of a run, a comparison or a diagnosis",
        ));
    }
    let has = |name: &str| folder.join(name).is_file();
    let (kind, page) = if has("manifest.json") || has("results.csv") {
        ("run", page::page_again(folder)?)
    } else if has(comparison::COMPARISON) {
        ("comparison", comparison::page_again(folder)?)
    } else if has(diagnosis::DIAGNOSIS) {
        ("diagnosis", diagnosis::page_again(folder)?)
    } else {
        return Err(fault(
            "holds no results; expected results.csv, summary.json and manifest.json of a run, \
             comparison.json of a comparison, or diagnosis.json of a diagnosis",
        ));
    };
    let report = report::write(&page, folder)?;
    if arguments.json {
        println!("{}", serde_json::json!({"of": kind, "report": report}));
    } else {
        println!("written, of a {kind}:\n  {}", report.display());
    }
    Ok(ExitCode::SUCCESS)
}

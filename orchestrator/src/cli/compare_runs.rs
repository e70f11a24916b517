//! `shakebench compare-runs`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use laboratory::error::Error;
use laboratory::results::unused;
use laboratory::run_comparison;
use pages::report::columns::aligned;

/// Options of `shakebench compare-runs`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    shakebench run three-variable --out first\n  \
    shakebench run three-variable --set control.proportional_gain=\"5 V/in\" --out second\n  \
    shakebench compare-runs first second")]
pub struct Arguments {
    /// Folders of runs, or folders that contain runs
    #[arg(value_name = "DIR", required = true)]
    folders: Vec<PathBuf>,
    /// Folder for report.html, runs.json and runs.csv [default: shakebench-results/runs]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Overlays runs and lists their differences.
///
/// # Errors
/// A folder that holds no run; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let comparison = run_comparison::read(&arguments.folders)?;
    let folder = arguments.out.clone();
    let folder = folder.unwrap_or_else(|| unused(Path::new("shakebench-results/runs"), |_| false));
    let files = comparison.write(&folder)?;
    if arguments.json {
        println!("{}", serde_json::json!(comparison));
        return Ok(ExitCode::SUCCESS);
    }
    println!("{}", aligned(&comparison.figures()));
    let mut rows = vec![vec!["differs".to_string()]];
    rows[0].extend(comparison.runs.iter().map(|run| run.label.clone()));
    rows.extend(comparison.differences.iter().map(|difference| {
        let mut row = vec![difference.what.clone()];
        row.extend(difference.values.iter().cloned());
        row
    }));
    println!("{}", aligned(&rows));
    println!("written:");
    for file in files {
        println!("  {}", file.display());
    }
    Ok(ExitCode::SUCCESS)
}

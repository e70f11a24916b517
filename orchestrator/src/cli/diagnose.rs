//! `shakebench diagnose`: a case of the shake table, or the description of a rig.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use identification::diagnosis::engine::{Observer, Progress};

use super::progress;
use crate::diagnosis::{diagnose, files, text};
use crate::error::Error;
use crate::results::unused;

/// What `diagnose` takes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench diagnose cases/dev-03 --out results/dev-03 --json\n  \
    shakebench diagnose identification/rigs/positioning_drive.toml --out results\n\n\
    A case is a folder with nominal.toml, identification.csv and validation.csv, and may have\n\
    small.csv and baseline.csv. Each header cell is `name [unit]`, in any order and unit; columns\n\
    of other names are left alone.")]
pub struct Arguments {
    /// Folder of a case (nominal.toml and records), or description of a rig (.toml)
    case: PathBuf,
    /// Data files in place of those that the description of a rig names
    #[arg(long, value_name = "FILE")]
    data: Vec<PathBuf>,
    /// Folder for report, JSON and extended model [default: shakebench-results/diagnosis-NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Tell on standard error what is tried
    #[arg(long)]
    verbose: bool,
}

/// Diagnoses, writes the files and prints what was found.
///
/// # Errors
/// As [`diagnose`]; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let folder = arguments.out.clone().unwrap_or_else(|| {
        let case = &arguments.case;
        let place = std::path::absolute(case).unwrap_or_else(|_| case.clone());
        let name = if place.is_dir() {
            place.file_name()
        } else {
            place.file_stem()
        };
        let name = name.unwrap_or_default().to_string_lossy();
        let folder = Path::new("shakebench-results").join(format!("diagnosis-{name}"));
        unused(&folder, |_| false)
    });
    let bar = progress::spinner("reading");
    let tell = |event: &Progress| {
        if arguments.verbose {
            eprintln!("{event}");
        } else {
            let words = event.to_string();
            bar.set_message(words.lines().next().unwrap_or_default().to_string());
        }
    };
    if arguments.verbose {
        bar.finish_and_clear();
    }
    let report = diagnose(
        &arguments.case,
        &arguments.data,
        &folder,
        Observer::new(&tell),
    );
    bar.finish_and_clear();
    let report = report?;
    if arguments.json {
        println!("{}", serde_json::json!(report));
    } else {
        print!("{}", text::text(&report));
        println!("\nwritten ({:.1} s):", report.wall_s);
        for file in files(&report, &folder) {
            println!("  {}", file.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}

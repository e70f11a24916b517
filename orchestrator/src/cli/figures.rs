//! `shakebench figures`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::progress;
use laboratory::error::Error;
use laboratory::figures;
use laboratory::results::unused;

/// Options of `shakebench figures`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench figures\n  \
    shakebench figures --figure 3-7,3-10 --out figures")]
pub struct Arguments {
    /// Figure numbers, such as 3-7 [default: all]
    #[arg(long = "figure", value_name = "N-N", value_delimiter = ',')]
    only: Vec<String>,
    /// Ground motion to play [default: the built-in motion]
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Folder for report.html and the pictures [default: shakebench-results/figures]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Draws the thesis's figures with what this program computes.
///
/// # Errors
/// A figure that is not drawn, a record at fault, a folder that cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let bar = progress::spinner("drawing figures");
    let tell = |number: &str| bar.set_message(format!("figure {number}"));
    let drawn = figures::figures(&arguments.only, arguments.record.as_deref(), &tell)?;
    bar.finish_and_clear();
    let folder = arguments.out.clone();
    let folder =
        folder.unwrap_or_else(|| unused(Path::new("shakebench-results/figures"), |_| false));
    let motion = arguments.record.as_ref().map_or_else(
        || "the built-in motion".to_string(),
        |path| path.display().to_string(),
    );
    for figure in &drawn {
        println!("Figure {}: {}", figure.number, figure.text);
    }
    println!("\nwritten:");
    for file in figures::write(&drawn, &motion, &folder)? {
        println!("  {}", file.display());
    }
    Ok(ExitCode::SUCCESS)
}

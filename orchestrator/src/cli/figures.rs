//! The thesis's figures: `design --figures` and `compare --figures`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::out::{installation, unused};
use super::{print_files, progress};
use laboratory::error::Error;
use laboratory::figures;

/// Options of `shakebench figures`, the former name.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Figure numbers, such as 3-7 [default: all]
    #[arg(long = "figure", value_name = "N-N", value_delimiter = ',')]
    only: Vec<String>,
    /// Ground motion to play [default: the built-in motion]
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Folder for report.html and the pictures [default: shakebench-results/figures]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Figures that are drawn where no number is given.
pub enum Kind {
    /// Of models and loops.
    Loops,
    /// Of tables under control.
    Runs,
    /// Both.
    All,
}

/// Draws the figures under their former name.
///
/// # Errors
/// As [`draw`].
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let Arguments {
        only,
        record,
        out,
        json,
    } = arguments;
    draw(only, Kind::All, record.as_deref(), out.as_deref(), *json)
}

/// Draws the thesis's figures with what this program computes.
///
/// # Errors
/// A figure that is not drawn, a record at fault, a folder that cannot be written.
pub fn draw(
    only: &[String],
    kind: Kind,
    record: Option<&Path>,
    out: Option<&Path>,
    is_json: bool,
) -> Result<ExitCode, Error> {
    let numbers: Vec<String> = match (only, kind) {
        ([], Kind::Loops) => figures::of_loops().map(String::from).collect(),
        ([], Kind::Runs) => figures::of_runs().map(String::from).collect(),
        (only, _) => only.to_vec(),
    };
    let bar = progress::spinner("drawing figures");
    let tell = |number: &str| progress::say(&bar, format!("figure {number}"));
    let drawn = figures::figures(&numbers, record, installation(), &tell);
    bar.finish_and_clear();
    let drawn = drawn?;
    let folder = out.map(super::out::given);
    let folder =
        folder.unwrap_or_else(|| unused(Path::new("shakebench-results/figures"), |_| false));
    let motion = record.map_or_else(
        || "the built-in motion".to_string(),
        |path| path.display().to_string(),
    );
    let files = figures::write(&drawn, &motion, &folder)?;
    if is_json {
        let figures = drawn
            .iter()
            .map(|figure| serde_json::json!({"number": figure.number, "text": figure.text}));
        let figures: Vec<serde_json::Value> = figures.collect();
        println!(
            "{}",
            serde_json::json!({"figures": figures, "files": files})
        );
        return Ok(ExitCode::SUCCESS);
    }
    for figure in &drawn {
        println!("Figure {}: {}", figure.number, figure.text);
    }
    println!();
    print_files(&files);
    Ok(ExitCode::SUCCESS)
}

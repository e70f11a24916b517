//! `shakebench tune`

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use clap::Args;

use super::out::{given, installation, unused};
use super::{interrupt, progress};
use laboratory::error::Error;
use laboratory::results::Results;
use pages::report::columns::aligned;
use study::campaign::Study;
use study::tune::tune;

/// Options of `shakebench tune`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    shakebench tune STUDY.toml --out TUNED\n\n\
    The table [tune] of the study defines the parameters and the margins (docs/campaigns.md).")]
pub struct Arguments {
    /// The study, with a table [tune]
    study: PathBuf,
    /// Folder for tuned.toml, tuned.json and report.html [default: shakebench-results/STUDY-tuned]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Optimises parameters and writes the result.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let study = Study::read(&arguments.study)?;
    let folder = arguments.out.clone().map(given).unwrap_or_else(|| {
        let stem = arguments.study.file_stem().unwrap_or_default();
        let name = format!("{}-tuned", stem.to_string_lossy());
        unused(&Path::new("shakebench-results").join(name), |_| false)
    });
    Results::check(&folder)?;
    let asked = interrupt::heed();
    let bar = progress::spinner("first set of parameters");
    let count = std::cell::Cell::new(0);
    let tuned = tune(&study, installation(), asked, &|trial| {
        count.set(count.get() + 1);
        let (count, last) = (count.get(), trial.score.quantile);
        progress::say(&bar, format!("{count} sets tried, the last {last:.3}"));
    });
    bar.finish_and_clear();
    let tuned = tuned?;
    let files = tuned.write(&folder)?;
    if arguments.json {
        super::print_json(serde_json::json!(tuned), &folder);
    } else {
        println!("{}\n", tuned.sentence());
        println!("{}", aligned(&tuned.gains()));
        println!("{}", aligned(&tuned.values()));
        println!(
            "{} sets were tried in {:.1} s\n\nwritten:",
            tuned.trials.len(),
            tuned.wall_s
        );
        for file in files {
            println!("  {}", file.display());
        }
    }
    if asked.load(Ordering::Relaxed) {
        eprintln!("error: interrupted; the best set so far is written");
        return Ok(ExitCode::from(1));
    }
    Ok(ExitCode::SUCCESS)
}

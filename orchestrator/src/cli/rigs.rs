//! `shakebench rigs`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use indicatif::ProgressBar;

use crate::comparison::Played;
use crate::error::Error;
use crate::report::columns::aligned;
use crate::results::Results;
use crate::rigs::{Request, study};
use crate::system::built_in;

/// Options of `shakebench rigs`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    shakebench rigs --rigs 40 --seed 1 --out RIGS\n\n\
    Spreads: payload 0 to 50 % of the table's mass, oil stiffness and valve gain 80 to 120 %, dry\n\
    friction 0.5 to 2, supply 85 to 115 %, noise 0.5 to 2.")]
pub struct Arguments {
    /// Rigs drawn about the physical one
    #[arg(long, value_name = "N", default_value_t = 20)]
    rigs: u64,
    /// Seed of the draw
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Specimen on the tables: none, linear, yielding
    #[arg(long, default_value = "yielding")]
    specimen: String,
    /// Controllers, parted by commas [default: all]
    #[arg(long, value_delimiter = ',')]
    controllers: Vec<String>,
    /// Records or folders of them [default: two built-in motions]
    #[arg(long, num_args = 1.., value_name = "FILE|DIR")]
    records: Vec<PathBuf>,
    /// Length of the recordings that are identified, s
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    duration: f64,
    /// Folder for rigs.json and report.html
    #[arg(long, value_name = "DIR", default_value = "shakebench-results/rigs")]
    out: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Draws rigs, designs controllers for each, and compares.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let fault = |option, reason: String| Err(Error::Option { option, reason });
    if !(1..=10_000).contains(&arguments.rigs) {
        return fault("--rigs", format!("{}; expected 1 to 10000", arguments.rigs));
    }
    if !(20.0..=600.0).contains(&arguments.duration) {
        return fault(
            "--duration",
            format!("{} s; expected 20 to 600", arguments.duration),
        );
    }
    let mut motions = Vec::new();
    for path in &arguments.records {
        if path.is_dir() {
            motions.extend(Played::records_in(path)?);
        } else {
            motions.push(Played::Record(path.clone()));
        }
    }
    if motions.is_empty() {
        motions = vec![Played::Seed(1), Played::Seed(2)];
    }
    let mut controllers: Vec<String> = arguments
        .controllers
        .iter()
        .map(|name| name.trim().to_string())
        .collect();
    if controllers.is_empty() {
        controllers = built_in::names().map(String::from).collect();
    }
    Results::check(&arguments.out)?;
    let bar = ProgressBar::new(arguments.rigs);
    let found = study(
        &Request {
            rigs: arguments.rigs,
            seed: arguments.seed,
            specimen: arguments.specimen.clone(),
            controllers,
            motions,
            duration: arguments.duration,
        },
        &|done| bar.set_position(done as u64),
    )?;
    bar.finish_and_clear();
    let files = found.write(&arguments.out)?;
    if arguments.json {
        println!("{}", serde_json::json!(found));
        return Ok(ExitCode::SUCCESS);
    }
    println!("{} rigs, seed {}\n", found.rows.len(), found.seed);
    println!("{}", aligned(&found.table()));
    for line in found.ranking_in_words() {
        println!("{line}");
    }
    println!("\nwritten:");
    for file in files {
        println!("  {}", file.display());
    }
    Ok(ExitCode::SUCCESS)
}

//! `shakebench compare`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use super::rig::RigArguments;
use laboratory::comparison::{self, Plan, Played, Progress};
use laboratory::error::Error;
use laboratory::results::unused;
use laboratory::systems::built_in;

/// Options of `shakebench compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench compare --records NGA --specimen none\n  \
    shakebench compare --controllers three-variable,sliding-mode --json")]
pub struct Arguments {
    /// Built-in systems, separated by commas [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    controllers: Vec<String>,
    /// Records, or folders of them [default: the built-in motion with eight seeds]
    #[arg(long, value_name = "FILE|DIR", num_args = 1.., conflicts_with = "reference")]
    records: Vec<PathBuf>,
    /// Reference: .csv with time, displacement, velocity, acceleration, played as given
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    #[command(flatten)]
    rig: RigArguments,
    /// Folder for report.html, comparison.json and errors.csv [default: shakebench-results/comparison]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Plays every motion under every controller, in parallel, and prints the errors next to those of
/// the thesis.
///
/// # Errors
/// Unknown names, or a motion at fault: nothing is run then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let plan = Plan {
        controllers: controllers(&arguments.controllers)?,
        motions: played(arguments)?,
        plant: arguments.rig.plant(),
        specimen: arguments.rig.specimen(),
        tuning: arguments.rig.tuning,
        control_model: arguments.rig.control_model.clone(),
    };
    let bar = ProgressBar::hidden();
    // A template that cannot be read leaves the plain bar.
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos} of {len} runs, {eta} left") {
        bar.set_style(style);
    }
    let found = comparison::compare(&plan, &|Progress { done, of }| {
        if done == 0 {
            bar.set_length(of as u64);
            bar.reset();
            bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
        } else {
            bar.inc(1);
        }
    });
    bar.finish_and_clear();
    let found = found?;

    let folder = arguments.out.clone();
    let folder =
        folder.unwrap_or_else(|| unused(Path::new("shakebench-results/comparison"), |_| false));
    let files = comparison::write(&found, &folder)?;
    if arguments.json {
        println!("{}", serde_json::json!(found));
    } else {
        println!("plant {}, specimen {}\n", found.plant, found.specimen);
        for table in comparison::tables(&found) {
            println!("{}", table.text());
        }
        println!("written:");
        for file in files {
            println!("  {}", file.display());
        }
    }
    for row in found.ended_early() {
        eprintln!(
            "error: {} on {} ended early ({}): {}",
            row.controller,
            row.record,
            row.ended.word(),
            row.ended_because.as_deref().unwrap_or_default()
        );
    }
    Ok(match found.ended_early().next() {
        None => ExitCode::SUCCESS,
        Some(_) => ExitCode::from(1),
    })
}

fn controllers(asked: &[String]) -> Result<Vec<String>, Error> {
    if asked.is_empty() {
        return Ok(built_in::names().map(String::from).collect());
    }
    asked
        .iter()
        .map(|name| match built_in::check(name.trim()) {
            Ok(()) => Ok(name.trim().to_string()),
            Err(error) => Err(Error::Option {
                option: "--controllers",
                reason: error.to_string(),
            }),
        })
        .collect()
}

fn played(arguments: &Arguments) -> Result<Vec<Played>, Error> {
    if let Some(reference) = &arguments.reference {
        return Ok(vec![Played::Reference(reference.clone())]);
    }
    if arguments.records.is_empty() {
        return Ok((1..=8).map(Played::Seed).collect());
    }
    let mut found = Vec::new();
    for path in &arguments.records {
        if path.is_dir() {
            found.extend(Played::records_in(path)?);
        } else {
            found.push(Played::Record(path.clone()));
        }
    }
    Ok(found)
}

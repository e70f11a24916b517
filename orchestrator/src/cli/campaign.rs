//! `shakebench campaign`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::out::{given, installation, units, unused};
use super::quantity::ValueError;
use super::{interrupt, progress};
use laboratory::error::Error;
use laboratory::results::{Out, Results};
use pages::report::columns::aligned;
use study::campaign::{self, Bench, Left, Plan, Progress, Runs, Shard, Study, carry_out};

/// Options of `shakebench campaign`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    shakebench campaign STUDY.toml --out RUNS\n  \
    shakebench campaign rigs --shard 1/8 --out RIGS\n\n\
    Repeating the command resumes an interrupted study. An extended study runs only the new runs.")]
pub struct Arguments {
    /// Study file (docs/campaigns.md), or `rigs`: the controllers on 200 rigs that differ from the
    /// one they were designed for
    study: PathBuf,
    /// Folder for runs.parquet, runs.csv and report.html [default: shakebench-results/STUDY]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Run the I-th of N parts of the study; without this, the parts in the folder are collected
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Number of parallel runs [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Check the study and print the number of runs, without running it
    #[arg(long, conflicts_with_all = ["shard", "rows"])]
    plan: bool,
    /// Run the runs A to B - 1 and print them as journal entries
    #[arg(long, value_name = "A-B", value_parser = range, conflicts_with_all = ["shard", "json"])]
    rows: Option<std::ops::Range<u64>>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

fn range(text: &str) -> Result<std::ops::Range<u64>, ValueError> {
    let read = |(from, to): (&str, &str)| Some(from.trim().parse().ok()?..to.trim().parse().ok()?);
    let range = text.split_once('-').and_then(read);
    let range = range.filter(|range| !range.is_empty());
    range.ok_or(ValueError::Expected("A-B with A < B, such as 0-64"))
}

/// Runs a study and writes its table.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let study = Study::read(&arguments.study)?;
    if arguments.plan {
        return plan(
            &study,
            arguments.out.clone().map(given).as_ref(),
            arguments.json,
        );
    }
    if let Some(rows) = &arguments.rows {
        if rows.end > study.runs() {
            return Err(Error::Option {
                option: "--rows",
                reason: format!("the study has the runs 0 to {}", study.runs() - 1),
            });
        }
        let mut output = std::io::stdout().lock();
        campaign::rows(&study, rows.clone(), installation(), &mut output)?;
        return Ok(ExitCode::SUCCESS);
    }
    let folder = arguments.out.clone().map(given).unwrap_or_else(|| {
        let name = arguments.study.file_stem().unwrap_or_default();
        let is_same = |place: &Path| {
            let before = std::fs::read_to_string(place.join(campaign::STUDY));
            before.is_ok_and(|before| before == study.text)
        };
        unused(&Path::new("shakebench-results").join(name), is_same)
    });
    Results::check(&folder)?;
    let bar = progress::hidden_bar("{bar:40} {pos} of {len} runs, {eta} left");
    let asked = interrupt::heed();
    let how = Plan {
        folder: folder.clone(),
        shard: arguments.shard,
        jobs: arguments.jobs.map(usize::from),
    };
    let is_shown = std::sync::Once::new();
    let bench = Bench::new(&study, installation());
    let carried = carry_out(&bench, &how, asked, &|Progress { done, of }| {
        is_shown.call_once(|| {
            progress::show(&bar, of as usize);
            bar.set_position(done);
            bar.reset_eta();
        });
        bar.set_position(done);
    });
    bar.finish_and_clear();
    let carried = carried?;
    let summary = &carried.summary;
    let is_whole = summary.missing == 0;
    let mut files = Vec::new();
    let mut said = String::new();
    if is_whole {
        let findings = campaign::findings(&study, &bench, &carried)?;
        files = campaign::write(&study, &carried, &findings, &folder)?;
        said = campaign::page::summary(&findings, units());
        if let Some(ranking) = &findings.ranking {
            said += &format!("\n\n{}", aligned(&campaign::page::standings(ranking)));
            for line in campaign::page::sentences(ranking) {
                said += &format!("\n{line}");
            }
        }
    }
    if arguments.json {
        super::print_json(serde_json::json!(summary), &folder);
    } else {
        println!(
            "{} runs: {} complete, {} stopped by the interlock, {} failed{}; {:.1} s",
            summary.runs,
            summary.complete,
            summary.interlock,
            summary.failed,
            match summary.invalid {
                0 => String::new(),
                some => format!(", {some} with invalid input"),
            },
            summary.wall_s
        );
        if summary.from_before > 0 {
            println!("{} of them were finished before", summary.from_before);
        }
        if !is_whole {
            println!(
                "{} runs are missing; the results are written when all are in {}",
                summary.missing,
                folder.display()
            );
        }
        if !said.is_empty() {
            println!("\n{said}");
        }
        if !files.is_empty() {
            println!("\nwritten:");
        }
        for file in files {
            println!("  {}", file.display());
        }
    }
    let is_done = is_whole || arguments.shard.is_some();
    if asked.load(std::sync::atomic::Ordering::Relaxed) && !is_done {
        eprintln!("error: interrupted; repeat the command to resume");
        return Ok(ExitCode::from(1));
    }
    Ok(ExitCode::SUCCESS)
}

fn plan(study: &Study, folder: Option<&Out>, json: bool) -> Result<ExitCode, Error> {
    let bench = Bench::new(study, installation());
    bench.check()?;
    if let Some(folder) = folder {
        Results::check(folder)?;
    }
    let columns = bench.columns()?;
    let files: Vec<&PathBuf> = study.files().keys().collect();
    if json {
        let Left { head, missing } = Left::new(&bench, folder)?;
        println!(
            "{}",
            serde_json::json!({
                "runs": study.runs(),
                "design": study.design,
                "seed": study.seed,
                "folder": study.folder(),
                "files": files,
                "columns": columns,
                "head": head,
                "missing": missing,
            })
        );
        return Ok(ExitCode::SUCCESS);
    }
    println!("{} runs; the study has no errors", study.runs());
    for column in &columns {
        let unit = column
            .unit
            .as_ref()
            .map_or(String::new(), |unit| format!(" [{unit}]"));
        println!("  {}{unit}", column.name);
    }
    Ok(ExitCode::SUCCESS)
}

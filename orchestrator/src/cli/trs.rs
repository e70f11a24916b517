//! `shakebench trs`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::out::given;
use laboratory::error::Error;
use laboratory::qualify::{spectrum_panel, trs_page};
use laboratory::results::Results;
use pages::report;
use pages::report::columns::aligned;
use qualification::{Verdict, doubts, load};

/// Options of `shakebench trs`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench trs table.csv --rrs ac156 --set s_ds=1.0 --set z_h=0.5\n  \
    shakebench trs table.AT2 --rrs ieee693 --set level=moderate --set damping_percent=2 --out trs\n  \
    shakebench trs table.csv --rrs floor.toml --json\n\n\
    A verdict states that the spectrum is within these bounds of this rule, computed so. It is not a \
    certificate.")]
pub struct Arguments {
    /// Acceleration of the table: PEER .AT2 or .csv
    #[arg(value_name = "RECORD")]
    record: PathBuf,
    /// Required response spectrum: ac156, ieee693, or a .toml or .csv file
    #[arg(long, value_name = "RULE")]
    rrs: String,
    /// Value of the rule, such as s_ds=1.0 or damping_percent=5; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder for report.html and spectra.svg [default: none are written]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Compares and prints.
///
/// # Errors
/// A record or rule at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let rule = load(&arguments.rrs, &arguments.set)?;
    let record = motion::read_acceleration(&arguments.record)?;
    let warnings = doubts(&rule, &record)?;
    let verdict = Verdict::new(&rule, &record.acceleration, record.dt, warnings);
    let mut written = Vec::new();
    if let Some(folder) = &arguments.out {
        let mut results = Results::begin(&given(folder))?;
        results.write_page(report::FILE, &trs_page(&rule, &record, &verdict))?;
        let panel = spectrum_panel(&rule, &record.acceleration, record.dt);
        results.write_picture("spectra.svg", &panel)?;
        written = results.finish()?;
    }
    if arguments.json {
        println!("{}", serde_json::json!(verdict));
        return Ok(ExitCode::SUCCESS);
    }
    print!("{}", text(&verdict, rule.highest_ratio));
    for warning in &verdict.warnings {
        eprintln!("warning: {warning}");
    }
    if !written.is_empty() {
        println!("\nwritten:");
        written
            .iter()
            .for_each(|file| println!("  {}", file.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// The verdict, and the points that are below or above.
fn text(verdict: &Verdict, highest_ratio: f64) -> String {
    let mut rows = vec![
        ["Hz", "required g", "test g", "ratio", ""]
            .map(str::to_string)
            .to_vec(),
    ];
    for own in &verdict.points {
        let ratio = own.ratio();
        rows.push(vec![
            format!("{:.3}", own.frequency_hz),
            format!("{:.4}", own.rrs_g),
            format!("{:.4}", own.trs_g),
            format!("{ratio:.3}"),
            match ratio {
                r if r < 1.0 => "below",
                r if r > highest_ratio => "above",
                _ => "",
            }
            .to_string(),
        ]);
    }
    format!(
        "{}, {} % damping\n\n{}\nThe test response spectrum {}: ratios of {:.3} to {:.3}, {} of {} points below 1.\n",
        verdict.rule,
        (verdict.damping_percent * 1e4).round() / 1e4,
        aligned(&rows),
        verdict.verdict,
        verdict.lowest_ratio,
        verdict.highest_ratio,
        verdict.below_1,
        verdict.points.len()
    )
}

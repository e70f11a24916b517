//! `shakebench drive`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::motion::MotionArguments;
use super::quantity::band;
use laboratory::error::Error;
use laboratory::iteration::circle::{self, Circle, Plan};
use laboratory::iteration::on_model::Search;
use laboratory::results::{Results, unused};
use pages::report::columns::aligned;

/// Options of `shakebench drive`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench diagnose my-case --out results\n  \
    shakebench drive my-case --model results/extended_model.toml --record NGA/RSN1633_MANJIL_ABBAR--L.AT2\n  \
    shakebench drive my-case --model results/extended_model.toml --pga 0.15 --out drives")]
pub struct Arguments {
    /// Case of a diagnosis: a folder with nominal.toml, which states the control law
    #[arg(value_name = "CASE")]
    case: PathBuf,
    /// Extended model of the case from `shakebench diagnose`
    #[arg(long, value_name = "MODEL.toml")]
    model: PathBuf,
    #[command(flatten)]
    motion: MotionArguments,
    /// Largest number of corrections
    #[arg(long, default_value_t = Search::default().corrections)]
    corrections: usize,
    /// Lowest and highest corrected frequency, Hz
    #[arg(long, value_names = ["LOW", "HIGH"], num_args = 2, default_values_t = Search::default().band)]
    band: Vec<f64>,
    /// Folder for drive.csv and drive.json [default: shakebench-results/drive-CASE-MOTION]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Computes the drive and writes it.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    if let Some(folder) = &arguments.out {
        Results::check(folder)?;
    }
    let found = circle::close(&plan(arguments)?)?;
    let folder = arguments.out.clone().unwrap_or_else(|| {
        let name = format!("drive-{}-{}", found.case, found.motion);
        let name = name.replace(['/', '\\', ' '], "-");
        unused(&Path::new("shakebench-results").join(name), |_| false)
    });
    let files = circle::write(&found, &folder)?;
    if arguments.json {
        println!("{}", serde_json::json!(found));
    } else {
        print!("{}", text(&found));
        println!("\nwritten:");
        for file in files {
            println!("  {}", file.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn plan(arguments: &Arguments) -> Result<Plan, Error> {
    Ok(Plan {
        case: arguments.case.clone(),
        model: arguments.model.clone(),
        record: arguments.motion.record.clone(),
        reference: arguments.motion.reference.clone(),
        scaling: arguments.motion.scaling()?,
        seed: arguments.motion.seed(),
        search: Search {
            corrections: arguments.corrections,
            band: band(&arguments.band)?,
        },
    })
}

fn text(found: &Circle) -> String {
    let head = ["drive", "RMS error", "spectrum", "largest command"];
    let mut rows = vec![head.map(str::to_string).to_vec()];
    for (name, expected) in found.expected() {
        rows.push(vec![
            name.to_string(),
            format!("{:.3} %", expected.time_domain_percent),
            expected
                .response_spectrum_percent
                .map_or("-".into(), |value| format!("{value:.3} %")),
            format!("{:.2} V", expected.peak_command_v),
        ]);
    }
    let named = match found.effects.as_slice() {
        [] => "which has no effect".to_string(),
        some => format!("with {}", some.join(", ")),
    };
    let warnings: String = found
        .warnings
        .iter()
        .map(|line| format!("warning: {line}\n"))
        .collect();
    format!(
        "{} on the extended model, {named}\n\n{}\n{warnings}",
        found.motion,
        aligned(&rows)
    )
}

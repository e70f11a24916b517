//! `shakebench design`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use crate::design::{self, LoopName, Options, Synthesis};
use crate::error::Error;
use crate::report::columns::aligned;
use crate::report::number::significant;
use crate::results::unused;
use crate::units::INCH;

/// Options of `shakebench design`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench design\n  \
    shakebench design --loop loop-shaping-synthesis --crossover 50 --json")]
pub struct Arguments {
    /// One loop: displacement-pid, force-pid, loop-shaping, loop-shaping-synthesis,
    /// three-variable or sliding-mode [default: all]
    #[arg(long = "loop", value_name = "NAME")]
    only: Option<String>,
    /// Target crossover of the loop-shaping synthesis, rad/s [default: 65, which comes nearest to
    /// Eq 3-10]
    #[arg(long, value_name = "RAD_PER_S")]
    crossover: Option<f64>,
    /// What stands on the table: none, linear [default: none]
    #[arg(long, value_name = "NAME")]
    specimen: Option<String>,
    /// Folder for report.html [default: shakebench-results/design]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Prints margins, crossover, bandwidth and stability of the loops and draws their responses.
///
/// # Errors
/// An unknown name, a crossover for which there is no controller, or a report that cannot be
/// written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let fault = |option| move |reason| Error::Option { option, reason };
    let only = arguments.only.as_deref().map(str::parse).transpose();
    let specimen = arguments.specimen.as_deref().map(str::parse).transpose();
    let options = Options {
        only: only.map_err(fault("--loop"))?,
        crossover: arguments.crossover,
        specimen: specimen.map_err(fault("--specimen"))?.unwrap_or_default(),
    };
    let design =
        design::design(&options).map_err(|error| fault("--crossover")(error.to_string()))?;
    let folder = arguments.out.clone();
    let folder =
        folder.unwrap_or_else(|| unused(Path::new("shakebench-results/design"), |_| false));
    let report = design::write(&design, &folder)?;
    if arguments.json {
        let mut json = serde_json::json!(design);
        json["report"] = report.display().to_string().into();
        println!("{json}");
        return Ok(ExitCode::SUCCESS);
    }
    print!("{}", aligned(&design::table(&design.loops)));
    println!();
    for row in design.loops.iter().filter(|row| !row.note.is_empty()) {
        println!("{}: {}", row.name, row.note);
    }
    let synthesis = LoopName::LoopShapingSynthesis;
    if design.loops.iter().any(|row| row.name == synthesis) {
        print!("{}", words(&design.synthesis));
    }
    println!("\nwritten:\n  {}", report.display());
    Ok(ExitCode::SUCCESS)
}

fn words(synthesis: &Synthesis) -> String {
    format!(
        "loop-shaping-synthesis: target {} rad/s, gamma_min {:.4}; C = {:.4} (s^2 + {:.4} s + {:.4}) / \
             (s (s + {:.5})) V/in (Eq 3-10: 6.986, 0.2975, 0.5892, 0.01046)\n",
        significant(synthesis.crossover_rad_s, 3),
        synthesis.gamma_min,
        synthesis.gain_v_m * INCH,
        synthesis.numerator_rate_1_s,
        synthesis.numerator_constant_1_s2,
        synthesis.pole_1_s
    )
}

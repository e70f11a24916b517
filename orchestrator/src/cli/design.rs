//! `shakebench design`

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;

use super::out::{given, unused};
use super::quantity::whole;
use super::{figures, multivariable};
use laboratory::design::{self, LoopName, NoLinearModel, Options, Synthesis, UnknownLoop, model};
use laboratory::error::Error;
use pages::report::columns::aligned;
use pages::report::number::significant;
use units::INCH;

/// Options of `shakebench design`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench design\n  \
    shakebench design --loop loop-shaping-synthesis --crossover 50 --json\n  \
    shakebench design --model MODEL.toml\n  \
    shakebench design --figures 3-7,3-10               # the thesis's figures of loops")]
pub struct Arguments {
    /// One loop: displacement-pid, force-pid, loop-shaping, loop-shaping-synthesis,
    /// three-variable or sliding-mode [default: all]
    #[arg(long = "loop", value_name = "NAME")]
    only: Option<String>,
    /// Crossover for loop shaping, rad/s [default: the synthesis closest to Eq 3-10; with --model
    /// the fastest with 6 dB and 45 degrees]
    #[arg(long, value_name = "RAD_PER_S")]
    crossover: Option<f64>,
    /// Design every controller on this model from `shakebench identify`: displacement-pid,
    /// three-variable, loop-shaping, sliding-mode, mpc
    #[arg(
        long,
        alias = "control-model",
        value_name = "MODEL.toml",
        conflicts_with = "specimen"
    )]
    model: Option<PathBuf>,
    /// With --model: number of rigs drawn from its uncertainty
    #[arg(long, value_name = "N", default_value_t = model::DRAWS, requires = "model")]
    draws: u64,
    /// With --model: seed of the draws
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>, requires = "model")]
    seed: u64,
    /// Specimen on the table: none, linear [default: none]
    #[arg(long, value_name = "NAME")]
    specimen: Option<String>,
    /// Draw these figures of the thesis instead, such as 3-7,3-10 [default: all figures of models and loops]
    #[arg(long, value_name = "N-N", num_args = 0.., value_delimiter = ',', conflicts_with_all = [
        "only", "crossover", "model", "specimen",
    ])]
    figures: Option<Vec<String>>,
    /// Folder for report.html [default: shakebench-results/design]
    #[arg(short, long, value_name = "DIR")]
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
    if let Some(only) = &arguments.figures {
        let kind = figures::Kind::Loops;
        return figures::draw(only, kind, None, arguments.out.as_deref(), arguments.json);
    }
    if let Some(path) = &arguments.model {
        if multivariable::is_model(path) {
            return multivariable::designed(path, arguments.json);
        }
        return on_model(arguments, path);
    }
    let fault = |option, error: &dyn Display| Error::Option {
        option,
        reason: error.to_string(),
    };
    let only = arguments.only.as_deref().map(str::parse).transpose();
    let specimen = arguments.specimen.as_deref().map(str::parse).transpose();
    let options = Options {
        only: only.map_err(|error: UnknownLoop| fault("--loop", &error))?,
        crossover: arguments.crossover,
        specimen: specimen
            .map_err(|error: NoLinearModel| fault("--specimen", &error))?
            .unwrap_or_default(),
    };
    let design = design::design(&options).map_err(|error| fault("--crossover", &error))?;
    let folder = arguments.out.clone();
    let folder = folder
        .map(given)
        .unwrap_or_else(|| unused(Path::new("shakebench-results/design"), |_| false));
    let report = design::write(&design, &folder)?;
    if arguments.json {
        let mut json = serde_json::json!(design);
        json["report"] = report.display().to_string().into();
        super::print_json(json, &folder);
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

/// Designs every controller on a model; one that was asked for alone and is not robust is an error.
fn on_model(arguments: &Arguments, path: &Path) -> Result<ExitCode, Error> {
    let bar = super::progress::spinner("designing");
    let design = model::design(&model::Options {
        model: path.to_path_buf(),
        only: arguments.only.clone(),
        crossover: arguments.crossover,
        draws: arguments.draws,
        seed: arguments.seed,
    });
    bar.finish_and_clear();
    let design = design?;
    if let (Some(_), [only]) = (&arguments.only, design.loops.as_slice())
        && !only.robust
    {
        return Err(Error::Option {
            option: "--model",
            reason: format!("{}: {} {}", path.display(), only.name, only.note),
        });
    }
    let folder = arguments.out.clone();
    let folder = given(folder.unwrap_or_else(|| "shakebench-results/design".into()));
    let report = design.write(&folder)?;
    if arguments.json {
        let mut json = serde_json::json!(design);
        json["report"] = report.display().to_string().into();
        super::print_json(json, &folder);
        return Ok(ExitCode::SUCCESS);
    }
    for warning in &design.warnings {
        println!("{warning}");
    }
    println!(
        "measurement delay {:.2} ms; band: 5 to 95 % of {} rigs drawn from the model's errors \
         (seed {})\n",
        design.late_ms, design.draws, design.seed
    );
    print!("{}", aligned(&design.table()));
    for own in design.loops.iter().filter(|own| !own.robust) {
        println!("\n{}: refused, it {}", own.name, own.note);
    }
    println!("\nwritten:\n  {}", report.display());
    Ok(ExitCode::SUCCESS)
}

fn words(synthesis: &Synthesis) -> String {
    let reached = synthesis
        .reached_crossover_rad_s
        .map_or(String::new(), |reached| {
            format!(", reached {}", significant(reached, 4))
        });
    let sections: String = synthesis
        .sections
        .iter()
        .map(|[b2, b1, a2, a1]| {
            let cell = |value: &f64| significant(*value, 4);
            format!(
                " ({} s^2 + {} s + 1)/({} s^2 + {} s + 1)",
                cell(b2),
                cell(b1),
                cell(a2),
                cell(a1)
            )
        })
        .collect();
    format!(
        "loop-shaping-synthesis: target {} rad/s{reached}, gamma_min {:.4}; C = {:.4} (s^2 + {:.4} s + {:.4}) / \
             (s (s + {:.5})){sections} V/in (Eq 3-10: 6.986, 0.2975, 0.5892, 0.01046)\n",
        significant(synthesis.crossover_rad_s, 3),
        synthesis.gamma_min,
        synthesis.gain_v_m * INCH,
        synthesis.numerator_rate_1_s,
        synthesis.numerator_constant_1_s2,
        synthesis.pole_1_s
    )
}

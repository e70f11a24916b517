//! `shakebench iterate`

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use indicatif::ProgressBar;

use super::motion::MotionArguments;
use super::quantity::{band, if_given};
use super::rig::RigArguments;
use super::run;
use laboratory::error::Error;
use laboratory::iteration::{self, Iteration, Plan};
use laboratory::results::{Results, unused};
use pages::report::columns::aligned;

/// Options of `shakebench iterate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench iterate three-variable --plant servohydraulic --specimen yielding --record NGA/RSN1633_MANJIL_ABBAR--L.AT2\n  \
    shakebench iterate mpc --plant servohydraulic --dummy-mass \"25 lbm\" --exposure 3\n  \
    shakebench iterate three-variable --drive shakebench-results/iteration-three-variable-synthetic-1/drive.csv --iterations 0")]
pub struct Arguments {
    /// Built-in system or .toml file [default: three-variable]
    #[arg(value_name = "SYSTEM")]
    system: Option<String>,
    #[command(flatten)]
    motion: MotionArguments,
    #[command(flatten)]
    rig: RigArguments,
    /// Parameter, such as control.valve_limit="5 V"; repeatable
    #[arg(long, value_name = "INSTANCE.VARIABLE=VALUE")]
    set: Vec<String>,
    /// Largest number of corrections
    #[arg(long, default_value_t = 3)]
    iterations: usize,
    /// Fraction of the inverse that a correction applies, above 0 and at most 1
    #[arg(long, default_value_t = 0.8)]
    gain: f64,
    /// Measured error at which to stop, %
    #[arg(long, value_name = "PERCENT", default_value_t = 0.3)]
    target: f64,
    /// Lowest and highest corrected frequency, Hz
    #[arg(long, value_names = ["LOW", "HIGH"], num_args = 2, default_values_t = [0.3, 20.0])]
    band: Vec<f64>,
    /// Limit of the motion energy on the specimen, relative to one run [default: none]
    #[arg(long, value_name = "TIMES")]
    exposure: Option<f64>,
    /// Delay of the measurements, such as "2 ms" [default: from the model for tuning]
    #[arg(long, value_name = "T")]
    measurement_delay: Option<String>,
    /// Rigid mass that replaces the specimen while the transfer function is measured, such as "25
    /// lbm"
    #[arg(long, value_name = "MASS")]
    dummy_mass: Option<String>,
    /// Initial drive: the drive.csv of an earlier iteration
    #[arg(long, value_name = "FILE")]
    drive: Option<PathBuf>,
    /// Folder for drive.csv, iteration.json and report.html [default: shakebench-results/iteration-SYSTEM-MOTION]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Iterates and writes the best drive.
///
/// # Errors
/// Input at fault; nothing is written then.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let plan = plan(arguments)?;
    if let Some(folder) = &arguments.out {
        Results::check(folder)?;
    }
    let bar = ProgressBar::new(plan.iterations as u64 + 2);
    let found = iteration::iterate(&plan, &mut |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    let found = found?;
    let folder = arguments.out.clone().unwrap_or_else(|| {
        let name = format!("iteration-{}-{}", found.system, found.motion);
        let name = name.replace(['/', '\\', ' '], "-");
        unused(&Path::new("shakebench-results").join(name), |_| false)
    });
    let files = iteration::write(&plan, &found, &folder)?;
    if arguments.json {
        println!("{}", serde_json::json!(found));
    } else {
        print!("{}", text(&found));
        println!("\nwritten:");
        for file in files {
            println!("  {}", file.display());
        }
    }
    if found.stop == iteration::Stop::EndedEarly {
        let reason = found
            .runs
            .last()
            .and_then(|run| run.ended_because.as_deref());
        eprintln!(
            "error: a run ended early: {}",
            reason.unwrap_or("no reason given")
        );
        return Ok(ExitCode::from(1));
    }
    Ok(ExitCode::SUCCESS)
}

fn plan(arguments: &Arguments) -> Result<Plan, Error> {
    let fault = |option, reason: String| Err(Error::Option { option, reason });
    let gain = arguments.gain;
    if !(gain > 0.0 && gain <= 1.0) {
        return fault("--gain", format!("{gain} is not above 0 and at most 1"));
    }
    let band = band(&arguments.band)?;
    if !arguments.target.is_finite() || arguments.target < 0.0 {
        return fault(
            "--target",
            format!("{} is not an error in %", arguments.target),
        );
    }
    if let Some(exposure) = arguments
        .exposure
        .filter(|most| most.is_nan() || *most < 1.0)
    {
        return fault(
            "--exposure",
            format!(
                "{exposure} is less than the exposure of the first run, which measures the \
                error"
            ),
        );
    }
    Ok(Plan {
        request: run::request(&run::Arguments::of(
            arguments.system.clone(),
            arguments.motion.clone(),
            arguments.rig.clone(),
            arguments.set.clone(),
        ))?,
        iterations: arguments.iterations,
        gain,
        target_percent: arguments.target,
        band,
        exposure: arguments.exposure,
        measurement_delay: if_given("--measurement-delay", &arguments.measurement_delay, "s")?,
        dummy_mass: if_given("--dummy-mass", &arguments.dummy_mass, "kg")?,
        drive: arguments.drive.clone(),
    })
}

fn text(found: &Iteration) -> String {
    let head = [
        "corrections",
        "measured",
        "RMS error",
        "Fourier error",
        "spectrum",
        "exposure",
        "",
    ];
    let mut rows = vec![head.map(str::to_string).to_vec()];
    let percent =
        |value: Option<f64>| value.map_or("-".to_string(), |value| format!("{value:.3} %"));
    for (n, run) in found.runs.iter().enumerate() {
        rows.push(vec![
            run.iteration.to_string(),
            percent(run.measured_percent),
            percent(run.time_domain_percent),
            percent(run.frequency_domain_percent),
            percent(run.response_spectrum_percent),
            format!("{:.2}", run.exposure),
            if n == found.best { "best" } else { "" }.to_string(),
        ]);
    }
    format!(
        "{} on {}, transfer function with a mean coherence of {:.3}\n\n{}\n{}\n",
        found.system,
        found.motion,
        found.coherence,
        aligned(&rows),
        found.stop.sentence()
    )
}

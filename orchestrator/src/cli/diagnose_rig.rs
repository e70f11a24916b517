//! `diagnose` of a real rig: a description with its data, in place of a case of the shake table.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use identification::diagnosis::rigs::{
    self, Description, DescriptionError, Measurement, PartReport, Report,
};

use super::diagnose;
use crate::error::Error;
use crate::report::{Abscissa, Axis, Panel, Series, Style, Units, svg};

/// What `diagnose` takes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench diagnose cases/dev-03 --out results/dev-03 --json\n  \
    shakebench diagnose identification/rigs/positioning_drive.toml --out results\n\n\
    A case is a folder with nominal.toml, identification.csv and validation.csv, and may have\n\
    small.csv and baseline.csv. Each header cell is `name [unit]`, in any order and unit; columns\n\
    of other names are left alone.")]
pub struct Arguments {
    /// Folder of a case (nominal.toml and records), or description of a rig (.toml)
    case: PathBuf,
    /// Data files in place of those that the description names
    #[arg(long, value_name = "FILE")]
    data: Vec<PathBuf>,
    /// Folder for the extended model, or for the pictures and the report of a rig
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Tell on standard error what is tried
    #[arg(long)]
    verbose: bool,
}

/// Does what the arguments say.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let out = arguments.out.as_deref();
    if arguments
        .case
        .extension()
        .is_none_or(|extension| extension != "toml")
    {
        return diagnose::execute(&arguments.case, out, arguments.json);
    }
    let begun = Instant::now();
    let fail = |error: DescriptionError| fault(&arguments.case, error);
    let description = Description::read(&arguments.case).map_err(fail)?;
    let measurement = description.measurement(&arguments.data).map_err(fail)?;
    let report = rigs::diagnose(&description, &measurement, arguments.verbose).map_err(fail)?;
    let mut value = contract(&report);
    value["wall_s"] = begun.elapsed().as_secs_f64().into();
    if let Some(folder) = out {
        let model = folder.join(diagnose::EXTENDED_MODEL);
        value["extended_model"] = model.display().to_string().into();
        std::fs::create_dir_all(folder)
            .and_then(|()| std::fs::write(&model, extended_model(&report)))
            .map_err(|error| fault(&model, error))?;
        let path = folder.join(diagnose::DIAGNOSIS);
        std::fs::write(&path, format!("{value:#}\n")).map_err(|error| fault(&path, error))?;
        for (name, panel) in pictures(&description, &measurement, &report).map_err(fail)? {
            let path = folder.join(name);
            std::fs::write(&path, svg(&panel)).map_err(|error| fault(&path, error))?;
        }
    }
    if arguments.json {
        println!("{value}");
    } else {
        print!("{}", words(&report));
    }
    Ok(ExitCode::SUCCESS)
}

fn fault(path: &Path, error: impl std::fmt::Display) -> Error {
    Error::File {
        path: path.into(),
        reason: error.to_string(),
    }
}

/// The refitted parameters and the effects, each in the form that a description's `[nominal]` has.
fn extended_model(report: &Report) -> String {
    let part = &report.as_described;
    let line = |p: &rigs::Value| {
        // The debug form always has a point or an exponent: a TOML float.
        format!(
            "{} = {{ value = {:?}, plus_minus = {:?}, unit = \"{}\" }}\n",
            p.name, p.value, p.standard_error, p.unit
        )
    };
    let section = |name: &str, values: &[rigs::Value]| {
        let lines: String = values.iter().map(line).collect();
        format!("\n[{name}]\n{lines}")
    };
    let mut text = format!(
        "# What the data say of this rig: value and standard error, SI.\nname = {}\nkind = \"{}\"\n",
        toml::Value::from(report.name.clone()),
        report.kind
    );
    text += &section("nominal", &part.parameters);
    for effect in &part.effects {
        text += &section(&format!("effects.{}", effect.effect), &effect.parameters);
    }
    text
}

/// The fields that scripts read from every diagnosis, and `rig` with everything.
fn contract(report: &Report) -> serde_json::Value {
    let part = &report.as_described;
    let effects: Vec<serde_json::Value> = part
        .effects
        .iter()
        .map(|effect| {
            let parameters: serde_json::Map<String, serde_json::Value> = effect
                .parameters
                .iter()
                .map(|p| {
                    let value = serde_json::json!({
                        "value": p.value, "unit": p.unit, "standard_error": p.standard_error
                    });
                    (p.name.clone(), value)
                })
                .collect();
            serde_json::json!({
                "effect": effect.effect,
                "parameters": parameters,
                "confidence": effect.confidence,
                "share_explained": effect.share,
                "on_every_part": !report.not_confirmed.contains(&effect.effect),
            })
        })
        .collect();
    let alternatives: Vec<Vec<&String>> =
        part.rivals.iter().map(|(rival, _)| vec![rival]).collect();
    serde_json::json!({
        "verdict": report.verdict,
        "effects": effects,
        "alternatives": alternatives,
        "separating_experiment": null,
        "gain": {
            "before_nrmse": part.nominal_error,
            "after_nrmse": part.extended_error,
            "noise_floor_nrmse": null,
            "interval_95": [part.gain_interval.0, part.gain_interval.1],
            "interval_of": "share of the refitted model's squared error that the effects take away",
            "record": "left out",
        },
        "unexplained_share": report.unexplained,
        "extended_model": null,
        "extended_fmu": null,
        "rig": report,
    })
}

fn words(report: &Report) -> String {
    let list = |names: &[String]| match names {
        [] => "none".to_owned(),
        names => names.join(", "),
    };
    let mut text = format!(
        "{}: {} ({})\n",
        report.name,
        list(&report.named),
        report.verdict
    );
    if !report.not_confirmed.is_empty() {
        text += &format!(
            "on one part of the data only: {}\n",
            list(&report.not_confirmed)
        );
    }
    for (title, part) in [
        (
            "fitted as described, tested on what is left out",
            &report.as_described,
        ),
        ("parts swapped", &report.swapped),
    ] {
        text += &part_words(title, report.output, part);
    }
    text += &format!(
        "\nunexplained: {:.0} % of the nominal model's squared error on the data left out\n",
        100.0 * report.unexplained
    );
    text
}

fn part_words(title: &str, output: &str, part: &PartReport) -> String {
    let percent = |x: f64| 100.0 * x;
    let mut text = format!(
        "\n{title}\n  error of {output}: nominal {:.2} %, refitted {:.2} %, extended {:.2} % \
         (on the fitted data {:.2} %)\n  squared error less than refitted by {:.0} % \
         (95 %: {:.0} to {:.0} %)\n",
        percent(part.nominal_error),
        percent(part.refitted_error),
        percent(part.extended_error),
        percent(part.fitted_error),
        percent(1.0 - (part.extended_error / part.refitted_error).powi(2)),
        percent(part.gain_interval.0),
        percent(part.gain_interval.1),
    );
    for effect in &part.effects {
        let values: Vec<String> = effect
            .parameters
            .iter()
            .map(|p| {
                let unit = if p.unit == "1" { "" } else { p.unit };
                format!(
                    "{} {:.4e} ± {:.1e} {unit}",
                    p.name, p.value, p.standard_error
                )
            })
            .collect();
        text += &format!(
            "  {}: {:.1} % of the squared error; {}\n",
            effect.effect,
            percent(effect.share),
            values.join(", ").trim_end()
        );
    }
    for (rival, against) in &part.rivals {
        text += &format!("  {rival} would do nearly as well as {against}\n");
    }
    text
}

fn units(si: &str) -> Units {
    match si {
        "m" => Units::pair("mm", 1e-3, "mm", 1e-3),
        "N" => Units::pair("kN", 1e3, "kN", 1e3),
        "V" => Units::VOLTAGE,
        "Pa" => Units::pair("MPa", 1e6, "MPa", 1e6),
        _ => Units::NONE,
    }
}

/// Pictures of the first series that holds data left out: errors over time, and loops or a close
/// look.
fn pictures(
    description: &Description,
    measurement: &Measurement,
    report: &Report,
) -> Result<Vec<(&'static str, Panel)>, DescriptionError> {
    let rig = description.rig()?;
    let (output, si) = rig.output();
    let (input, input_si) = rig.inputs()[0];
    let curves = report.curves(description, measurement)?;
    let shown = measurement
        .series
        .iter()
        .position(|s| s.left_out.contains(&true))
        .unwrap_or(0);
    let (series, [measured, nominal, extended]) = (&measurement.series[shown], &curves[shown]);
    let errors = |model: &[f64]| -> Vec<f64> {
        let pairs = measured.iter().zip(model).zip(&series.left_out);
        pairs
            .map(|((m, y), out)| if *out { m - y } else { f64::NAN })
            .collect()
    };
    let (nominal_errors, extended_errors) = (errors(nominal), errors(extended));
    let every = measured.len().div_ceil(1500);
    let thin = |values: &[f64]| -> Vec<f64> { values.iter().step_by(every).copied().collect() };
    let step = series.step * every as f64;
    let over_time = Panel {
        title: format!("{}: error of {output} on the data left out", report.name),
        x: if description.columns.contains_key("time") {
            Axis::linear("time", Units::TIME)
        } else {
            Axis::linear("sample", Units::NONE)
        },
        y: Axis::linear("measured - simulated", units(si)),
        series: vec![
            Series::history("nominal", step, &thin(&nominal_errors)).coloured(2),
            Series::history("extended", step, &thin(&extended_errors)).coloured(1),
        ],
    };
    let loops = matches!(
        report.kind.as_str(),
        "hysteretic_device" | "cyclic_material"
    );
    let close = if loops {
        let places: Arc<[f64]> = thin(&series.inputs[0]).into();
        let path = |name: &str, values: &[f64], colour| {
            Series::line(name, Abscissa::At(places.clone()), thin(values))
                .styled(Style::Path)
                .coloured(colour)
        };
        Panel {
            title: format!("{}, {}", report.name, series.name),
            x: Axis::linear(input, units(input_si)),
            y: Axis::linear(output, units(si)),
            series: vec![
                path("measured", measured, 0),
                path("nominal", nominal, 2),
                path("extended", extended, 1),
            ],
        }
    } else {
        // Where the nominal model is worst, a fortieth of the record.
        let length = (measured.len() / 40).max(64).min(measured.len());
        let worst = (0..measured.len().saturating_sub(length) / length)
            .map(|block| block * length)
            .max_by(|&a, &b| {
                let sum = |start: usize| -> f64 {
                    let block = &nominal_errors[start..start + length];
                    block.iter().filter(|e| e.is_finite()).map(|e| e * e).sum()
                };
                sum(a).total_cmp(&sum(b))
            })
            .unwrap_or(0);
        let start = worst as f64 * series.step;
        let line = |name: &str, values: &[f64], colour| {
            let abscissa = Abscissa::Even {
                start,
                step: series.step,
            };
            Series::line(name, abscissa, values[worst..worst + length].to_vec()).coloured(colour)
        };
        Panel {
            title: format!("{}: {output} where the nominal model is worst", report.name),
            x: Axis::linear("time", Units::TIME),
            y: Axis::linear(output, units(si)),
            series: vec![
                line("measured", measured, 0),
                line("nominal", nominal, 2),
                line("extended", extended, 1),
            ],
        }
    };
    Ok(vec![("error.svg", over_time), ("close.svg", close)])
}

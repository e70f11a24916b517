//! Rigs of several actuators in `identify`, `design` and `diagnose`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use identification::diagnosis::rigs::{INTERVAL_95, column_map};
use multivariable::diagnose::{Found, diagnose};
use multivariable::interaction::{Interaction, interaction};
use multivariable::{Description, KIND, Model, Names, Recording, TEMPLATE, is_multivariable};

use super::out::given;
use laboratory::error::Error;
use laboratory::results::Results;
use pages::report::columns::aligned;
use pages::report::number::significant;

fn fault(error: multivariable::Error) -> Error {
    Error::File {
        path: error.place.into(),
        reason: error.what,
    }
}

/// The columns that a map names.
fn names(map: Option<&Path>) -> Result<Names, Error> {
    map.map_or_else(
        || Ok(BTreeMap::new()),
        |map| {
            column_map(map).map_err(|error| Error::Option {
                option: "--columns",
                reason: error.to_string(),
            })
        },
    )
}

/// Whether a file, perhaps renamed by a map, has several commands. A map at fault is reported by what reads it.
pub fn has_several(data: &[PathBuf], map: Option<&Path>) -> bool {
    let names = names(map).unwrap_or_default();
    data.first()
        .is_some_and(|file| is_multivariable(file, &names))
}

/// Whether a file is a model of such a rig.
pub fn is_model(path: &Path) -> bool {
    has_kind(path, multivariable::identify::MODEL)
}

/// Whether a file is the description of such a rig.
pub fn is_description(path: &Path) -> bool {
    has_kind(path, KIND)
}

fn has_kind(path: &Path, kind: &str) -> bool {
    let text = identification::data::read_written(path).unwrap_or_default();
    let quoted = format!("\"{kind}\"");
    text.lines().any(|line| {
        let mut parts = line.splitn(2, '=');
        let (key, value) = (parts.next(), parts.next());
        key.is_some_and(|key| key.trim() == "kind")
            && value.is_some_and(|value| value.trim().starts_with(&quoted))
    })
}

/// The description to fill in, if `kind` asks for it.
pub fn template(kind: &str) -> Option<&'static str> {
    let word = kind.trim().to_lowercase().replace([' ', '-'], "_");
    ["two_actuators", "actuators", "coupler"]
        .contains(&word.as_str())
        .then_some(TEMPLATE)
}

/// Identifies a rig of several actuators and writes its model.
///
/// # Errors
/// Data at fault, or a file that cannot be written.
pub fn identified(
    data: &[PathBuf],
    map: Option<&Path>,
    fit_part: f64,
    out: &Path,
    json: bool,
) -> Result<ExitCode, Error> {
    let started = Instant::now();
    let [file] = data else {
        return Err(Error::Option {
            option: "DATA.csv",
            reason: "several recordings of several actuators; expected one recording in which all actuators move".into(),
        });
    };
    let recording = Recording::read_called(file, &names(map)?).map_err(fault)?;
    let model = multivariable::identify::identify(&recording, fit_part).map_err(fault)?;
    let interaction = interaction(&model);
    let text = toml::to_string(&model).map_err(|error| Error::File {
        path: out.into(),
        reason: error.to_string(),
    })?;
    let folder = out
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut results = Results::begin(&given(folder))?;
    results.write_text(
        &out.file_name().unwrap_or_default().to_string_lossy(),
        &text,
    )?;
    results.finish()?;
    let mut warnings = Vec::new();
    match &interaction {
        Ok(found) => warnings.extend(found.warnings()),
        Err(singular) => warnings.push(singular.to_string()),
    }
    for (i, fit) in model
        .fit_percent
        .iter()
        .enumerate()
        .filter(|(_, fit)| **fit < 90.0)
    {
        warnings.push(format!(
            "stroke {}: the model explains {fit:.1} % of data that were not fitted; expected play, friction or limits",
            i + 1
        ));
    }
    if json {
        let fits: BTreeMap<String, f64> = model
            .fit_percent
            .iter()
            .enumerate()
            .map(|(i, fit)| (format!("stroke_{}", i + 1), *fit))
            .collect();
        let summary = serde_json::json!({
            "model": out,
            "actuator_poles_rad_s": model.poles_rad_s,
            "actuator_poles_standard_error": model.poles_standard_error,
            "delay_s": model.delay_s,
            "delay_standard_error_s": model.delay_standard_error_s,
            "static_gain": model.static_gain,
            "static_gain_standard_error": model.static_gain_standard_error,
            "fit_percent": fits,
            "residual_m": model.residual_m,
            "identifiable": model.static_gain_standard_error.iter().flatten().all(|error| error.is_finite()),
            "interaction": interaction.ok(),
            "warnings": warnings,
            "wall_s": started.elapsed().as_secs_f64(),
        });
        println!("{summary}");
        return Ok(ExitCode::SUCCESS);
    }
    print!("{}", model_text(&model));
    if let Ok(found) = &interaction {
        print!("{}", interaction_text(found));
    }
    for warning in &warnings {
        println!("warning: {warning}");
    }
    println!("model: {}", out.display());
    Ok(ExitCode::SUCCESS)
}

/// Prints the interaction of a model.
///
/// # Errors
/// A file at fault, a plant that cannot be inverted.
pub fn designed(path: &Path, json: bool) -> Result<ExitCode, Error> {
    let model = Model::read(path).map_err(fault)?;
    let found = interaction(&model).map_err(|singular| Error::File {
        path: path.into(),
        reason: singular.to_string(),
    })?;
    if json {
        println!("{}", serde_json::json!(found));
    } else {
        print!("{}{}", model_text(&model), interaction_text(&found));
    }
    for warning in found.warnings() {
        eprintln!("warning: {warning}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Diagnoses recordings of a rig whose description is `path`.
///
/// # Errors
/// What is at fault, by file and place; nothing is written then.
pub fn diagnosed(
    path: &Path,
    data: &[PathBuf],
    map: Option<&Path>,
    out: Option<&Path>,
    json: bool,
) -> Result<ExitCode, Error> {
    let started = Instant::now();
    let (model, pins, recordings) = Description::read(path, data, &names(map)?).map_err(fault)?;
    let found = diagnose(&model, &pins, &recordings).map_err(fault)?;
    let effect = |own: &Found| {
        let parameters = match (own.value, own.standard_error) {
            (Some(value), Some(error)) => serde_json::json!({
                own.effect.clone(): { "value": value, "unit": own.unit, "standard_error": error }
            }),
            _ => serde_json::json!({}),
        };
        serde_json::json!({ "effect": own.effect, "actuators": own.actuators, "parameters": parameters, "words": own.words })
    };
    let channels: Vec<_> = found
        .channels
        .iter()
        .zip(found.before.iter().zip(&found.after))
        .map(|(channel, (before, after))| serde_json::json!({ "channel": channel, "before_over_noise": before, "after_over_noise": after }))
        .collect();
    let summary = serde_json::json!({
        "verdict": found.verdict,
        "sentence": found.sentence,
        "effects": found.effects.iter().map(effect).collect::<Vec<_>>(),
        "alternatives": found.alternatives.iter().map(effect).collect::<Vec<_>>(),
        "channels": channels,
        "wall_s": started.elapsed().as_secs_f64(),
    });
    if let Some(folder) = out {
        let mut results = Results::begin(&given(folder))?;
        results.write_json("diagnosis.json", &summary)?;
        results.finish()?;
    }
    if json {
        match out {
            Some(folder) => super::print_json(summary, folder),
            None => println!("{summary}"),
        }
        return Ok(ExitCode::SUCCESS);
    }
    println!("{}", found.sentence);
    let mut rows = vec![
        ["residual over noise", "model", "with faults"]
            .map(String::from)
            .to_vec(),
    ];
    for (channel, (before, after)) in found
        .channels
        .iter()
        .zip(found.before.iter().zip(&found.after))
    {
        rows.push(vec![
            channel.clone(),
            format!("{before:.2}"),
            format!("{after:.2}"),
        ]);
    }
    print!("{}", aligned(&rows));
    Ok(ExitCode::SUCCESS)
}

fn model_text(model: &Model) -> String {
    let mut text = String::new();
    let with_error = |value: f64, error: f64| {
        format!(
            "{} ± {}",
            significant(value, 5),
            significant(INTERVAL_95 * error, 2)
        )
    };
    let mut rows = vec![vec!["static gain".to_string()]];
    rows[0].extend((1..=model.actuators()).map(|j| format!("command {j}")));
    for (i, (gains, errors)) in model
        .static_gain
        .iter()
        .zip(&model.static_gain_standard_error)
        .enumerate()
    {
        let mut row = vec![format!("stroke {}", i + 1)];
        row.extend(
            gains
                .iter()
                .zip(errors)
                .map(|(gain, error)| with_error(*gain, *error)),
        );
        rows.push(row);
    }
    text += &aligned(&rows);
    let poles: Vec<String> = model
        .poles_rad_s
        .iter()
        .map(|[re, im]| {
            format!(
                "{} Hz{}",
                significant(re.hypot(*im) / std::f64::consts::TAU, 4),
                if *im > 0.0 { " (pair)" } else { "" }
            )
        })
        .collect();
    text += &format!("poles: {}\n", poles.join(", "));
    let delays = model.delay_s.iter().zip(&model.delay_standard_error_s);
    let delays: Vec<String> = delays
        .map(|(delay, error)| format!("{} ms", with_error(1e3 * delay, 1e3 * error)))
        .collect();
    text += &format!("delays: {}\n", delays.join(", "));
    let fits: Vec<String> = model
        .fit_percent
        .iter()
        .map(|fit| format!("{fit:.2} %"))
        .collect();
    text += &format!(
        "predicted on data that were not fitted: {}\n",
        fits.join(", ")
    );
    text
}

fn interaction_text(found: &Interaction) -> String {
    let mut rows = vec![
        ["frequency", "singular values", "condition", "relative gain"]
            .map(String::from)
            .to_vec(),
    ];
    for point in &found.points {
        let list = |values: &[f64]| {
            values
                .iter()
                .map(|value| significant(*value, 3))
                .collect::<Vec<_>>()
                .join("  ")
        };
        rows.push(vec![
            format!("{} Hz", significant(point.frequency_hz, 3)),
            list(&point.singular_values),
            significant(point.condition, 3),
            list(&point.relative_gain),
        ]);
    }
    let mut text = aligned(&rows);
    if let Some(own) = &found.decoupled {
        let list = |values: &[f64], unit: &str| {
            values
                .iter()
                .map(|value| format!("{} {unit}", significant(*value, 3)))
                .collect::<Vec<_>>()
                .join(", ")
        };
        text += &format!(
            "integrators behind the inverse static gain, crossover {} Hz: phase margins {}, gain margins {}; all commands \
             at once may change by {:.0} %\n",
            significant(own.crossover_hz, 3),
            list(&own.phase_margin_deg, "degrees"),
            list(&own.gain_margin_db, "dB"),
            100.0 * own.simultaneous
        );
    }
    text
}

//! A diagnosis on the terminal, and the tables that it shares with the report.

use identification::diagnosis::{Estimate, amount, laboratory_unit};

use super::{DiagnosisReport, GainReport, ParameterReport};
use crate::commands::table::{aligned, significant};

fn in_unit(name: &str, parameter: &ParameterReport, unit: &str) -> String {
    let estimate = Estimate {
        name: name.into(),
        value: parameter.value,
        unit: parameter.unit,
        standard_error: parameter.standard_error,
        is_shape: false,
    };
    amount(&estimate, unit)
}

pub(super) const PARAMETERS: [&str; 5] = ["effect", "parameter", "laboratory", "SI", "confidence"];

/// Rows of [`PARAMETERS`].
pub(super) fn parameters(report: &DiagnosisReport) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for effect in &report.effects {
        let row = |name: &str, laboratory: String, si: String| {
            let effect_name = effect.effect.to_string();
            let confidence = format!("{:.3}", effect.confidence);
            vec![effect_name, name.into(), laboratory, si, confidence]
        };
        if effect.parameters.is_empty() {
            rows.push(row("-", "-".into(), "-".into()));
        }
        for (name, p) in &effect.parameters {
            let unit = laboratory_unit(p.unit);
            rows.push(row(name, in_unit(name, p, unit), in_unit(name, p, p.unit)));
        }
    }
    rows
}

pub(super) const GAIN: [&str; 6] = [
    "channel",
    "before",
    "after",
    "noise floor",
    "before/floor",
    "after/floor",
];

/// Rows of [`GAIN`]; the overall ratios are those of the gain itself.
pub(super) fn channels(gain: &GainReport) -> Vec<Vec<String>> {
    let row = |name: &str, [before, after, floor]: [f64; 3], ratios: [f64; 2]| {
        let mut row = vec![name.to_string()];
        row.extend([before, after, floor].map(|error| significant(error, 3)));
        row.extend(ratios.map(|ratio| significant(ratio, 3)));
        row
    };
    let mut rows: Vec<_> = gain
        .channels
        .iter()
        .map(|(name, e)| row(&name.replace('_', " "), *e, [e[0] / e[2], e[1] / e[2]]))
        .collect();
    rows.push(row(
        "all",
        [gain.before_nrmse, gain.after_nrmse, gain.noise_floor_nrmse],
        [gain.before_ratio, gain.after_ratio],
    ));
    rows
}

/// How much of the error is gone, with its interval.
pub(super) fn share(gain: &GainReport) -> String {
    let [low, high] = gain.interval_95.map(|share| 100.0 * share);
    format!("error gone: {low:.0} to {high:.0} % (95 % interval, block bootstrap)")
}

/// What else the reader should know, a line each.
pub(super) fn remarks(report: &DiagnosisReport) -> Vec<String> {
    let mut lines: Vec<String> = report
        .alternatives
        .iter()
        .map(|set| format!("as likely: {}", set.join(" and ")))
        .collect();
    if let Some(experiment) = &report.separating_experiment {
        lines.push(format!("what would separate them: {experiment}"));
    }
    for (what, deviate) in &report.remaining {
        lines.push(format!(
            "left over: {what} ({deviate:.1} standard deviations)"
        ));
    }
    lines.extend(report.notes.iter().cloned());
    lines
}

/// Words for a relation's errors in units of its noise, with the nominal parameters and with the
/// re-estimated ones, which leave what only an effect can be.
pub(super) fn word(nominal: f64, estimated: f64) -> &'static str {
    match (nominal < 1.3, estimated < 1.3) {
        (_, false) => "broken",
        (false, true) => "within the parameters' uncertainty",
        (true, true) => "holds",
    }
}

fn headed(columns: &[&str], rows: Vec<Vec<String>>) -> String {
    let mut all = vec![columns.iter().map(ToString::to_string).collect()];
    all.extend(rows);
    aligned(&all)
}

/// What is printed without `--json`.
pub(super) fn text(report: &DiagnosisReport) -> String {
    let mut text = format!("{}\n", report.sentence);
    if !report.effects.is_empty() {
        text += &format!("\n{}", headed(&PARAMETERS, parameters(report)));
    }
    text += &format!(
        "\nerror one step ahead on the validation record, which was not fitted (NRMSE)\n{}{}\n",
        headed(&GAIN, channels(&report.gain)),
        share(&report.gain)
    );
    if let Some(gain) = &report.co_simulation {
        text += &format!(
            "\nthe same record co-simulated in closed loop by the FMUs (NRMSE)\n{}{}\n",
            headed(&GAIN, channels(gain)),
            share(gain)
        );
    }
    let relations = report
        .relations
        .iter()
        .map(|(name, ratio)| vec![(*name).to_string(), significant(*ratio, 3)]);
    text += &format!(
        "\n{}",
        headed(
            &["relation, nominal model", "times the noise"],
            relations.collect()
        )
    );
    let remarks = remarks(report);
    if !remarks.is_empty() {
        text += &format!("\nnotes\n  {}\n", remarks.join("\n  "));
    }
    text
}

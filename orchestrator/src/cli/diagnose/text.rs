//! A diagnosis on the terminal, and the tables that it shares with the report.

use identification::diagnosis::engine::Estimate;
use identification::diagnosis::rigs::shake_table::{amount, laboratory_unit};

use super::{DiagnosisReport, GainReport, ParameterReport};
use crate::report::columns::{aligned, significant};

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
    let decimals = usize::from(high - low < 2.0);
    format!("Of the error {low:.decimals$} to {high:.decimals$} % is gone (95 %, block bootstrap)")
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
    lines.extend(report.notes.iter().cloned());
    // The strongest traces tell enough; diagnosis.json has them all.
    for (what, deviate) in report.remaining.iter().take(5) {
        lines.push(format!(
            "left over: {what} ({deviate:.1} standard deviations)"
        ));
    }
    lines
}

/// Columns of [`relations`].
pub(super) const RELATIONS: [&str; 5] = [
    "relation",
    "nominal",
    "re-estimated",
    "healthy rig",
    "state",
];

/// The relations with a word each: how they are with the nominal parameters, and with re-estimated
/// ones, against a healthy rig.
pub(super) fn relations(report: &DiagnosisReport) -> Vec<Vec<String>> {
    let holds = |ratio: f64, healthy: f64| ratio < 1.3 * healthy;
    let relations = report.relations.iter();
    relations
        .map(|(name, relation)| {
            let healthy = relation.healthy;
            let word = healthy.map_or("", |healthy| {
                match (
                    holds(relation.nominal, healthy),
                    holds(relation.estimated, healthy),
                ) {
                    (_, false) => "broken",
                    (false, true) => "within the parameters' uncertainty",
                    (true, true) => "holds",
                }
            });
            vec![
                (*name).to_string(),
                significant(relation.nominal, 3),
                significant(relation.estimated, 3),
                healthy.map_or("-".into(), |healthy| significant(healthy, 3)),
                word.to_string(),
            ]
        })
        .collect()
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
    text += &format!(
        "\nrelations on the identification record, errors in units of the noise\n{}",
        headed(&RELATIONS, relations(report))
    );
    let remarks = remarks(report);
    if !remarks.is_empty() {
        text += &format!("\nnotes\n  {}\n", remarks.join("\n  "));
    }
    text
}

//! A diagnosis as text and as a report.

use identification::case::CHANNELS;
use identification::diagnosis::shake_table::{Diagnosis, Validation};
use realfft::RealFftPlanner;

use super::{DiagnosisReport, ParameterReport};
use crate::commands::table::{aligned, significant};
use crate::report::{
    Abscissa, Axis, Cell, Fact, Panel, Report, Section, Series, Style, Table, Units,
};
use crate::units::convert;

/// The laboratory's unit for an SI unit of the catalogue.
fn laboratory(unit: &str) -> &str {
    match unit {
        "m" => "in",
        "N" => "lbf",
        "kg" => "lbf s^2/in",
        "m/s^2" => "in/s^2",
        "N s/m" => "lbf s/in",
        "N/m^3" => "lbf/in^3",
        "V/N" => "V/lbf",
        "V s/N" => "V s/lbf",
        "rad/m" => "rad/in",
        same => same,
    }
}

/// Value, standard error and unit in one cell.
fn amount(parameter: &ParameterReport, unit: &str) -> String {
    let factor = match unit == parameter.unit {
        true => 1.0,
        false => convert(1.0, parameter.unit, unit).unwrap_or(f64::NAN),
    };
    let name = if unit == "1" { "" } else { unit };
    format!(
        "{} +- {} {name}",
        significant(factor * parameter.value, 4),
        significant(factor * parameter.standard_error, 2)
    )
    .trim_end()
    .to_string()
}

const PARAMETERS: [&str; 5] = ["effect", "parameter", "laboratory", "SI", "confidence"];

fn parameters(report: &DiagnosisReport) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for effect in &report.effects {
        let confidence = format!("{:.3}", effect.confidence);
        if effect.parameters.is_empty() {
            let none = String::from("-");
            rows.push(vec![
                effect.effect.into(),
                none.clone(),
                none.clone(),
                none,
                confidence.clone(),
            ]);
        }
        for (name, parameter) in &effect.parameters {
            rows.push(vec![
                effect.effect.into(),
                name.clone(),
                amount(parameter, laboratory(parameter.unit)),
                amount(parameter, parameter.unit),
                confidence.clone(),
            ]);
        }
    }
    rows
}

const GAIN: [&str; 4] = ["channel", "before", "after", "noise floor"];

fn channels(report: &DiagnosisReport) -> Vec<Vec<String>> {
    let row = |name: &str, errors: &[f64; 3]| {
        let mut row = vec![name.to_string()];
        row.extend(errors.iter().map(|error| significant(*error, 3)));
        row
    };
    let gain = &report.gain;
    let all = [gain.before_nrmse, gain.after_nrmse, gain.noise_floor_nrmse];
    let mut rows: Vec<_> = gain
        .channels
        .iter()
        .map(|(name, errors)| row(name, errors))
        .collect();
    rows.push(row("all", &all));
    rows
}

fn share(report: &DiagnosisReport) -> String {
    let gain = &report.gain;
    format!(
        "in units of the noise floor: {:.2} before, {:.3} after; share of the error gone, 95 % \
         interval: {:.3} to {:.3}",
        gain.before_ratio, gain.after_ratio, gain.interval_95[0], gain.interval_95[1]
    )
}

/// What else the reader should know, a line each.
fn remarks(report: &DiagnosisReport) -> Vec<String> {
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

fn relations(report: &DiagnosisReport) -> Vec<Vec<String>> {
    let relations = report.relations.iter();
    relations
        .map(|(name, ratio)| vec![(*name).to_string(), significant(*ratio, 3)])
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
        "\nNRMSE of one step on the validation record, which was not fitted\n{}{}\n",
        headed(&GAIN, channels(report)),
        share(report)
    );
    text += &format!(
        "\n{}",
        headed(
            &["relation, nominal model", "times the noise"],
            relations(report)
        )
    );
    let remarks = remarks(report);
    if !remarks.is_empty() {
        text += &format!("\nnotes\n  {}\n", remarks.join("\n  "));
    }
    text
}

fn table(caption: &str, columns: &[&str], rows: Vec<Vec<String>>) -> Table {
    Table {
        caption: caption.into(),
        columns: columns.iter().map(ToString::to_string).collect(),
        rows: rows
            .into_iter()
            .map(|row| row.into_iter().map(Cell::from).collect())
            .collect(),
    }
}

/// The report.
pub(super) fn page(case: &str, report: &DiagnosisReport, diagnosis: &Diagnosis) -> Report {
    let fact = |label: &str, value: Cell, note: &str| Fact {
        label: label.into(),
        value,
        note: note.into(),
    };
    let floors = "times the noise floor, unseen record";
    let mut tables = Vec::new();
    if !report.effects.is_empty() {
        tables.push(table(
            "Effects, value +- standard error",
            &PARAMETERS,
            parameters(report),
        ));
    }
    tables.push(table(
        "NRMSE of one step on the validation record, which was not fitted",
        &GAIN,
        channels(report),
    ));
    tables.push(table(
        "Relations on the identification record, nominal model",
        &["relation", "times the noise"],
        relations(report),
    ));
    let [time, spectra, states] = pictures(&diagnosis.validation);
    let pictures = |heading: &str, text: &str, panels| Section {
        heading: heading.into(),
        text: vec![text.into()],
        panels,
        ..Section::default()
    };
    Report {
        title: format!("Diagnosis of {case}"),
        summary: report.sentence.clone(),
        facts: vec![
            fact("Verdict", report.verdict.into(), ""),
            fact(
                "Error before",
                Cell::Number(report.gain.before_ratio, 3),
                floors,
            ),
            fact(
                "Error after",
                Cell::Number(report.gain.after_ratio, 3),
                floors,
            ),
        ],
        sections: vec![
            Section {
                heading: "Findings".into(),
                text: vec![format!("Validation error {}.", share(report))],
                notes: remarks(report),
                tables,
                ..Section::default()
            },
            pictures(
                "Errors in time",
                "One-step errors on the validation record in standard deviations of the noise \
                 floor, channels whitened in their order. A perfect model leaves noise of size one.",
                time,
            ),
            pictures(
                "Errors in frequency",
                "A perfect model leaves a level line at 1.",
                spectra,
            ),
            pictures(
                "Errors against the state",
                "A line that is not level shows what the model lacks: mean error by the size of \
                 command, displacement and velocity.",
                states,
            ),
        ],
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
    }
}

/// Errors in time, their spectra, and against command, displacement and velocity.
fn pictures(validation: &Validation) -> [Vec<Panel>; 3] {
    let Validation {
        period, signals, ..
    } = validation;
    let displacement: Vec<f64> = signals.channels.iter().map(|row| row[0]).collect();
    let states = [
        ("command", Units::VOLTAGE, signals.command.clone()),
        ("velocity", Units::VELOCITY, slope(&displacement, *period)),
        ("displacement", Units::DISPLACEMENT, displacement),
    ];
    let [mut time, mut spectra, mut against] = [Vec::new(), Vec::new(), Vec::new()];
    for (channel, name) in CHANNELS.iter().enumerate() {
        let pick = |errors: &[f64]| -> Vec<f64> {
            errors.iter().skip(channel).step_by(4).copied().collect()
        };
        let before = pick(&validation.before);
        let after = pick(&validation.after);
        // A missing channel has no errors.
        if before.iter().all(|error| *error == 0.0) {
            continue;
        }
        let title = name.replace('_', " ");
        let y = || Axis::linear("error, noise floors", Units::NONE);
        time.push(Panel {
            title: title.clone(),
            x: Axis::linear("time", Units::TIME),
            y: y(),
            series: vec![
                Series::history("before", *period, &before),
                Series::history("after", *period, &after),
            ],
        });
        spectra.push(Panel {
            title: title.clone(),
            x: Axis::logarithmic("frequency", Units::FREQUENCY),
            y: Axis::logarithmic("error, noise floors", Units::NONE),
            series: vec![
                spectrum("before", &before, *period),
                spectrum("after", &after, *period),
            ],
        });
        for (state, units, values) in &states {
            against.push(Panel {
                title: format!("{title} against {state}"),
                x: Axis::linear(state, units.clone()),
                y: y(),
                series: vec![
                    binned("before", values, &before),
                    binned("after", values, &after),
                ],
            });
        }
    }
    [time, spectra, against]
}

/// Slope over a tenth of a second, where the noise of single samples is small.
fn slope(values: &[f64], period: f64) -> Vec<f64> {
    let half = (0.05 / period).round().max(1.0) as usize;
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(half), (k + half).min(last));
            (values[to] - values[from]) / (period * (to - from).max(1) as f64)
        })
        .collect()
}

/// Mean errors in bins of equally many samples, by the state.
fn binned(name: &str, state: &[f64], errors: &[f64]) -> Series {
    const BINS: usize = 40;
    let mut pairs: Vec<(f64, f64)> = state.iter().copied().zip(errors.iter().copied()).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mean = |values: &mut dyn Iterator<Item = f64>, n: usize| values.sum::<f64>() / n as f64;
    let (places, means): (Vec<f64>, Vec<f64>) = pairs
        .chunks(pairs.len().div_ceil(BINS).max(1))
        .map(|bin| {
            let place = mean(&mut bin.iter().map(|pair| pair.0), bin.len());
            (place, mean(&mut bin.iter().map(|pair| pair.1), bin.len()))
        })
        .unzip();
    Series::line(name, Abscissa::At(places.into()), means).styled(Style::Line)
}

/// Root of the averaged periodogram (Hann, 2 s, half overlapped); white noise of size one gives 1.
fn spectrum(name: &str, errors: &[f64], period: f64) -> Series {
    let length = ((2.0 / period) as usize).min(errors.len()) & !1;
    let window: Vec<f64> = (0..length)
        .map(|k| {
            (std::f64::consts::PI * k as f64 / length as f64)
                .sin()
                .powi(2)
        })
        .collect();
    let weight: f64 = window.iter().map(|w| w * w).sum();
    let mut power = vec![0.0; length / 2 + 1];
    let mut count = 0.0;
    if length >= 4 {
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let mut lines = transform.make_output_vec();
        for start in (0..=errors.len() - length).step_by(length / 2) {
            let mut piece: Vec<f64> = errors[start..start + length]
                .iter()
                .zip(&window)
                .map(|(error, weight)| error * weight)
                .collect();
            if transform.process(&mut piece, &mut lines).is_ok() {
                count += 1.0;
                for (sum, line) in power.iter_mut().zip(&lines) {
                    *sum += line.norm_sqr() / weight;
                }
            }
        }
    }
    let frequency = (1..power.len())
        .map(|k| k as f64 / (length as f64 * period))
        .collect();
    let root = power
        .iter()
        .skip(1)
        .map(|sum| (sum / f64::max(count, 1.0)).sqrt());
    Series::line(name, Abscissa::At(frequency), root.collect())
}

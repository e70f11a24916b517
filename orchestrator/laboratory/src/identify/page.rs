//! The report of an identification.

use identification::data::Recording;
use identification::identify::identified::RigIdentification;
use units::vocabulary;

use super::parameters::{parameter_table, parameters};
use super::summary::Summary;
use super::{poles, residuals, responses};
use pages::report::identity::{entry, version};
use pages::report::{Abscissa, Axis, Cell, Panel, Report, Section, Series, Style, Units};

fn identity(
    found: &RigIdentification,
    recordings: &[Recording],
    summary: &Summary,
) -> Vec<(String, Cell)> {
    let names: Vec<&str> = recordings.iter().map(|own| own.name.as_str()).collect();
    let seconds: f64 = recordings.iter().map(Recording::duration).sum();
    let rate = recordings
        .first()
        .map_or(f64::NAN, |own| 1.0 / own.period());
    vec![
        entry("Recordings", names.join(", ")),
        entry("Length", Cell::Quantity(seconds, Units::TIME, 4)),
        entry("Sampled at", Cell::Quantity(rate, Units::FREQUENCY, 4)),
        entry("Specimen", if found.specimen { "yes" } else { "none" }),
        entry("Model file", summary.model.display().to_string()),
        entry(
            "Elapsed time",
            Cell::Quantity(summary.wall_s, Units::TIME, 2),
        ),
        version(),
    ]
}

/// The report with plots like Fig 2-7 and 2-10.
pub(super) fn report(
    found: &RigIdentification,
    recordings: &[Recording],
    summary: &Summary,
) -> Report {
    let table = parameter_table("Parameters with standard errors", &parameters(found));
    let mut sections = vec![Section {
        heading: "Model".into(),
        notes: summary.warnings.clone(),
        panels: vec![poles::panel(summary)],
        tables: vec![table, poles::table(summary)],
        ..Section::default()
    }];
    let period = found.model.experiments.first().map_or(1.0, |e| e.period);
    let panels = found
        .fits
        .iter()
        .map(|fit| {
            let units = match fit.channel {
                "displacement" => Units::DISPLACEMENT,
                vocabulary::ACTUATOR_FORCE => Units::FORCE,
                _ => Units::ACCELERATION,
            };
            let line = |name: &str, values: &[f64]| {
                let abscissa = Abscissa::Even {
                    start: fit.start,
                    step: period,
                };
                Series::line(name, abscissa, values.to_vec())
            };
            Panel {
                title: format!(
                    "{}: {} ({:.2} %)",
                    fit.recording, fit.channel, fit.simulated
                ),
                x: Axis::linear("time", Units::TIME),
                y: Axis::linear(fit.channel, units),
                series: vec![
                    line("measured", &fit.measured).coloured(0),
                    line("simulated", &fit.model).styled(Style::Dashed),
                ],
            }
        })
        .collect();
    sections.push(Section {
        heading: "Validation".into(),
        text: vec![
            "Simulated on the part of each recording that was not fitted: displacement from the \
             measured force (Fig 2-10), the others from the command, stabilised only by the \
             measured displacement (Fig 2-7)."
                .into(),
        ],
        panels,
        ..Section::default()
    });
    let orders = (1..=found.singular_values.len().min(20))
        .map(|n| n as f64)
        .collect();
    sections.push(residuals::section(found));
    sections.push(Section {
        heading: "Order".into(),
        panels: vec![Panel {
            title: format!(
                "Singular values of the subspace method (the model has order {})",
                if found.specimen { 7 } else { 5 }
            ),
            x: Axis::linear("order", Units::NONE),
            y: Axis::logarithmic("singular value", Units::NONE),
            series: vec![
                Series::line(
                    "singular value",
                    Abscissa::At(orders),
                    found.singular_values.iter().copied().take(20).collect(),
                )
                .styled(Style::Points),
            ],
        }],
        ..Section::default()
    });
    sections.push(responses::section(found, recordings));
    Report {
        title: "Identified rig".into(),
        summary: format!(
            "{}; {}.",
            if found.identifiable {
                "The data determine actuator and table"
            } else {
                "The data determine the table and not the actuator"
            },
            match summary.warnings.len() {
                0 => "no warnings".to_string(),
                1 => "one warning".to_string(),
                several => format!("{several} warnings"),
            }
        ),
        identity: identity(found, recordings, summary),
        sections,
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
        ..Report::default()
    }
}

//! The result of an identification as text and as a report.

use std::f64::consts::TAU;

use identification::data::Recording;
use identification::identify::model_file::{ModelFile, StandardErrors};
use identification::identify::rig::RigIdentification;

use super::{Summary, responses};
use crate::report::columns::{aligned, significant};
use crate::report::{Abscissa, Axis, Cell, Panel, Report, Section, Series, Style, Table, Units};

/// Rows of name, value, standard error and unit, in inch and pound-force.
fn parameters(found: &RigIdentification) -> Vec<[String; 4]> {
    let file = ModelFile::from_identification(found);
    let Some(errors) = file.standard_errors.clone() else {
        return Vec::new();
    };
    let mut rows = Vec::new();
    let mut row = |name: &str, value: f64, error: f64, unit: &str| {
        rows.push([
            name.to_string(),
            significant(value, 6),
            match error {
                0.0 if name.starts_with("specimen") => "given".to_string(),
                0.0 => "held".to_string(),
                _ => significant(error, 2),
            },
            unit.to_string(),
        ]);
    };
    if let (
        Some(actuator),
        StandardErrors {
            actuator: Some(own),
            ..
        },
    ) = (&file.actuator, &errors)
    {
        let units = ["1/s", "1/s^2", "1/s^3"];
        for i in 0..3 {
            let name = format!("denominator a{}", 2 - i);
            row(
                &name,
                actuator.denominator[i + 1],
                own.denominator[i + 1],
                units[i],
            );
        }
        let units = ["lbf/(V s)", "lbf/(V s^2)", "lbf/(V s^3)"];
        for i in 0..3 {
            let name = format!("voltage to force b{}", 2 - i);
            row(
                &name,
                actuator.voltage_to_force[i],
                own.voltage_to_force[i],
                units[i],
            );
        }
        let units = ["lbf/in", "lbf/(in s)", "lbf/(in s^2)"];
        for i in 0..3 {
            let name = format!("velocity to force e{}", 2 - i);
            row(
                &name,
                actuator.velocity_to_force[i],
                own.velocity_to_force[i],
                units[i],
            );
        }
    }
    let mut bodies = vec![("table", file.table, errors.table)];
    if let (Some(body), Some(error)) = (file.specimen, errors.specimen) {
        bodies.push(("specimen", body, error));
    }
    for (name, body, error) in bodies {
        row(&format!("{name} mass"), body.mass, error.mass, "lbf s^2/in");
        row(
            &format!("{name} damping"),
            body.damping,
            error.damping,
            "lbf s/in",
        );
        row(
            &format!("{name} stiffness"),
            body.stiffness,
            error.stiffness,
            "lbf/in",
        );
    }
    if let (Some(delay), Some(error)) = (file.command_delay, errors.command_delay) {
        row("command delay", 1e3 * delay, 1e3 * error, "ms");
    }
    rows
}

fn pole(pole: &[f64; 2]) -> String {
    let frequency = pole[0].hypot(pole[1]) / TAU;
    format!(
        "{} {:+.4}i 1/s ({} Hz)",
        significant(pole[0], 5),
        pole[1],
        significant(frequency, 4)
    )
}

/// What is printed without `--json`.
pub(super) fn text(found: &RigIdentification, summary: &Summary) -> String {
    let mut text = String::new();
    if summary.identifiable {
        text += "actuator poles\n";
        for own in &summary.actuator_poles_rad_s {
            text += &format!("  {}\n", pole(own));
        }
    } else {
        text += "actuator: not determined by these data, see the warnings\n";
    }
    text += "table poles\n";
    for own in &summary.table_poles_rad_s {
        text += &format!("  {}\n", pole(own));
    }
    let mut rows = vec![
        ["parameter", "value", "standard error", "unit"]
            .map(String::from)
            .to_vec(),
    ];
    rows.extend(parameters(found).into_iter().map(|row| row.to_vec()));
    text += &format!("\n{}", aligned(&rows));
    for (index, (payload, error)) in found.payload.iter().enumerate().skip(1) {
        text += &format!(
            "payload of {} over the first: {} kg (standard error {})\n",
            found.model.experiments[index].name,
            significant(*payload, 5),
            significant(*error, 2)
        );
    }
    let mut rows = vec![
        [
            "recording, channel",
            "simulated %",
            "one step %",
            "lags outside 99 %",
            "with command",
        ]
        .map(String::from)
        .to_vec(),
    ];
    for fit in &found.fits {
        let test = found
            .residuals
            .iter()
            .find(|(recording, channel, _)| *recording == fit.recording && *channel == fit.channel)
            .map(|(_, _, test)| (test.outside(), test.cross_outside()));
        let share =
            |value: Option<f64>| value.map_or("-".into(), |v| format!("{:.0} %", 100.0 * v));
        rows.push(vec![
            format!("{}, {}", fit.recording, fit.channel),
            format!("{:.2}", fit.simulated),
            format!("{:.2}", fit.predicted),
            share(test.map(|t| t.0)),
            share(test.map(|t| t.1)),
        ]);
    }
    text += &format!("\nfit on the part that was not fitted\n{}", aligned(&rows));
    if !summary.warnings.is_empty() {
        text += "\nwarnings\n";
        for warning in &summary.warnings {
            text += &format!("  {warning}\n");
        }
    }
    text += &format!(
        "\nwritten: {} ({:.1} s)\n",
        summary.model.display(),
        summary.wall_s
    );
    text
}

/// The report with plots like Fig 2-7 and 2-10.
pub(super) fn report(
    found: &RigIdentification,
    recordings: &[Recording],
    summary: &Summary,
) -> Report {
    let table = Table {
        caption: "Parameters with standard errors".into(),
        columns: ["parameter", "value", "standard error", "unit"]
            .map(String::from)
            .to_vec(),
        rows: parameters(found)
            .into_iter()
            .map(|row| row.map(Cell::from).to_vec())
            .collect(),
    };
    let mut sections = vec![Section {
        heading: "Model".into(),
        notes: summary.warnings.clone(),
        tables: vec![table],
        ..Section::default()
    }];
    let period = found.model.experiments.first().map_or(1.0, |e| e.period);
    let panels = found
        .fits
        .iter()
        .map(|fit| {
            let units = match fit.channel {
                "displacement" => Units::DISPLACEMENT,
                "actuator_force" => Units::FORCE,
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
             measured force (Fig 2-10), the others from the command, held to the path by the \
             measured displacement alone (Fig 2-7)."
                .into(),
        ],
        panels,
        ..Section::default()
    });
    let orders = (1..=found.singular_values.len().min(20))
        .map(|n| n as f64)
        .collect();
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
        sections,
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
        ..Report::default()
    }
}

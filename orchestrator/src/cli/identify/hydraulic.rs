//! The identification of a hydraulic rig as `shakebench identify` makes and tells it.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use identification::IdentificationError;
use identification::closed_loop::equations::NAMES;
use identification::closed_loop::{self, Check, Found, Settings};
use identification::data::Recording;
use identification::identify::model_file::ModelFile;
use identification::identify::rig::Options;

use super::{Arguments, Summary, write};
use crate::error::Error;
use crate::report::columns::{aligned, significant};
use crate::report::{Cell, Report, Section, Table};

/// What was found from the first part of the recordings, and how the rest obeys it.
pub(super) struct Validated {
    found: Found,
    check: Check,
    file: ModelFile,
}

impl Validated {
    /// Whether both parts obey the equations.
    pub(super) fn holds(&self) -> bool {
        const MOST: f64 = 4.0;
        self.found.holds() && self.check.mean_squares.iter().all(|square| *square < MOST)
    }
}

/// Fits the first part of `recordings` and checks the rest.
pub(super) fn identify(
    recordings: &[Recording],
    options: Options,
) -> Result<Validated, IdentificationError> {
    let settings = Settings::default();
    let split = |recording: &Recording| (recording.len() as f64 * options.fit_part) as usize;
    let fitted: Vec<Recording> = recordings.iter().map(|r| r.cut(0, split(r))).collect();
    let rest: Vec<Recording> = recordings
        .iter()
        .map(|r| r.cut(split(r), r.len()))
        .collect();
    let found = closed_loop::identify(&fitted, settings)?;
    if !found.holds() && recordings.len() > 1 {
        let alone = |r: &Recording| closed_loop::identify(std::slice::from_ref(r), settings);
        if fitted.iter().all(|r| alone(r).is_ok_and(|own| own.holds())) {
            return Err(IdentificationError::Unstable {
                what: "each recording is that of a hydraulic rig, but together they are not".into(),
                remedy: "give recordings of one rig, whose payloads alone differ".into(),
            });
        }
    }
    let check = closed_loop::check(&found, &rest, settings)?;
    let file = found.model_file()?;
    Ok(Validated { found, check, file })
}

/// Writes and prints what was found.
pub(super) fn execute(
    arguments: &Arguments,
    folder: &Path,
    own: Validated,
    mut warnings: Vec<String>,
    started: Instant,
) -> Result<ExitCode, Error> {
    warnings.extend(own.found.warnings.iter().cloned());
    if !own.holds() {
        warnings.insert(
            0,
            "the model does not explain these recordings to their noise: see the mean squares"
                .into(),
        );
    }
    let channels = ["acceleration", "actuator_force", "valve_command"];
    let fit_percent: BTreeMap<String, Option<f64>> = channels
        .iter()
        .zip(own.check.relative_errors)
        .map(|(name, error)| ((*name).to_string(), Some(100.0 * (1.0 - error))))
        .collect();
    let rig = own.found.rig.shake_table();
    let pairs = |poles: Vec<nalgebra::Complex<f64>>| poles.iter().map(|p| [p.re, p.im]).collect();
    let summary = Summary {
        model: arguments.out.clone(),
        actuator_poles_rad_s: rig.map_or(Vec::new(), |rig| pairs(rig.actuator.g1().poles())),
        table_poles_rad_s: rig.map_or(Vec::new(), |rig| {
            pairs(rig.table.transfer_function().poles())
        }),
        fit_percent,
        identifiable: true,
        warnings,
        wall_s: started.elapsed().as_secs_f64(),
    };
    write(
        arguments,
        folder,
        &own.file.to_toml()?,
        &report(&own, &summary),
    )?;
    if arguments.json {
        println!(
            "{}",
            serde_json::to_string_pretty(&summary).unwrap_or_default()
        );
    } else {
        print!("{}", text(&own, &summary));
    }
    Ok(ExitCode::SUCCESS)
}

/// Units of [`NAMES`].
const UNITS: [&str; NAMES.len()] = [
    "s", "s^2", "N/(V s)", "N/m", "1/s", "N s/m", "N", "kg", "N s/m", "N/m", "kg", "s", "s", "s",
    "1",
];

fn parameters(own: &Validated) -> Vec<Vec<String>> {
    let values: [f64; NAMES.len()] = own.found.rig.into();
    let row = |name: &str, value: f64, error: Option<f64>, unit: &str| {
        vec![
            name.to_string(),
            significant(value, 6),
            error.map_or("-".to_string(), |error| significant(error, 2)),
            unit.to_string(),
        ]
    };
    let mut rows: Vec<Vec<String>> = NAMES
        .iter()
        .zip(values)
        .zip(own.found.standard_error.iter().zip(UNITS))
        .filter(|((name, value), _)| **name != "specimen mass" || *value > 0.0)
        .map(|((name, value), (error, unit))| row(name, value, Some(*error), unit))
        .collect();
    let shape = own.found.shape;
    if own.found.rig.seal_friction > 0.0 {
        rows.push(row("seal presliding", shape.presliding, None, "m"));
        rows.push(row("seal excess", shape.excess, None, "1"));
        let velocity = shape.stribeck_velocity;
        rows.push(row("seal Stribeck velocity", velocity, None, "m/s"));
    }
    if let Some(fit) = &own.found.specimen {
        let s = fit.specimen;
        let error = |i: usize| Some(fit.covariance[(i, i)].max(0.0).sqrt());
        let frequency = s.stiffness.sqrt() / TAU;
        rows.push(row("specimen frequency", frequency, None, "Hz"));
        rows.push(row("specimen damping/mass", s.damping, error(0), "1/s"));
        rows.push(row(
            "specimen stiffness/mass",
            s.stiffness,
            error(1),
            "1/s^2",
        ));
        if s.yield_displacement.is_finite() {
            let drift = s.yield_displacement;
            rows.push(row("specimen yield displacement", drift, error(2), "m"));
            rows.push(row(
                "specimen stiffness after it",
                s.post_ratio,
                error(3),
                "1",
            ));
        }
    }
    for (index, payload) in own.found.payloads.iter().enumerate() {
        let name = format!("payload of recording {}", index + 2);
        rows.push(row(&name, *payload, None, "kg"));
    }
    rows
}

fn equations(own: &Validated) -> Vec<Vec<String>> {
    let names = ["motion: a = s^2 x", "table: force", "actuator: command"];
    (0..names.len())
        .map(|i| {
            vec![
                names[i].to_string(),
                format!("{:.2}", own.found.mean_squares[i]),
                format!("{:.2}", own.check.mean_squares[i]),
                format!("{:.2} %", 100.0 * own.check.relative_errors[i]),
            ]
        })
        .collect()
}

const PARAMETER_COLUMNS: [&str; 4] = ["parameter", "value", "standard error", "unit"];
const EQUATION_COLUMNS: [&str; 4] = [
    "equation",
    "left over noise, fitted",
    "not fitted",
    "left over largest term",
];

fn text(own: &Validated, summary: &Summary) -> String {
    let table = |columns: [&str; 4], rows: Vec<Vec<String>>| {
        let mut all = vec![columns.map(String::from).to_vec()];
        all.extend(rows);
        aligned(&all)
    };
    let mut text = String::new();
    if let Some(first) = summary.warnings.first() {
        text += &format!("{first}\n\n");
    }
    text += "hydraulic rig, with the reference as instrument\n\n";
    text += &table(PARAMETER_COLUMNS, parameters(own));
    text += &format!("\n{}", table(EQUATION_COLUMNS, equations(own)));
    if summary.warnings.len() > 1 {
        text += "\nwarnings\n";
        for warning in &summary.warnings[1..] {
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

fn report(own: &Validated, summary: &Summary) -> Report {
    let table = |caption: &str, columns: [&str; 4], rows: Vec<Vec<String>>| Table {
        caption: caption.into(),
        columns: columns.map(String::from).to_vec(),
        rows: rows
            .into_iter()
            .map(|row| row.into_iter().map(Cell::from).collect())
            .collect(),
    };
    Report {
        title: "Identified hydraulic rig".into(),
        summary: summary
            .warnings
            .first()
            .cloned()
            .unwrap_or_else(|| "What is left of the equations is noise.".into()),
        sections: vec![Section {
            heading: "Model".into(),
            notes: summary.warnings.clone(),
            tables: vec![
                table(
                    "Parameters with standard errors",
                    PARAMETER_COLUMNS,
                    parameters(own),
                ),
                table(
                    "What is left of the equations",
                    EQUATION_COLUMNS,
                    equations(own),
                ),
            ],
            ..Section::default()
        }],
        footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
        ..Report::default()
    }
}

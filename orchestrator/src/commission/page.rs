//! The report of a commissioned rig.

use super::Commissioned;
use crate::identify::{EQUATION_COLUMNS, Form, PARAMETER_COLUMNS};
use crate::report::number::significant;
use crate::report::{Abscissa, Axis, Cell, Fact, Panel, Report, Section, Series, Table, Units};
use crate::units::STANDARD_GRAVITY;
use identification::data::Channel;

pub(super) fn report(own: &Commissioned) -> Report {
    let robust = own.design.loops.iter().filter(|one| one.robust).count();
    let worst = own.predictions.iter().map(|p| p.largest_percent);
    let worst = worst.fold(f64::NAN, f64::max);
    let mut facts = vec![Fact {
        label: "Controllers".into(),
        value: Cell::Text(format!("{robust} of {}", own.design.loops.len())),
        note: "robust to the model's uncertainty".into(),
    }];
    if worst.is_finite() {
        facts.push(Fact {
            label: "Other motions".into(),
            value: Cell::Text(format!("{} %", significant(worst, 2))),
            note: "largest error of the predicted acceleration over its peak".into(),
        });
    }
    let mut sections = vec![growth(own), model(own), recordings(own)];
    sections.extend(own.design.sections());
    sections.push(Section {
        heading: "Running it".into(),
        text: vec![
            "Each system file holds the rig, the controller and every parameter: shakebench run \
             NAME.toml. On a real rig: shakebench identify RECORDING.csv --out model.toml, shakebench \
             design --model model.toml, shakebench run NAME --control-model model.toml."
                .into(),
        ],
        ..Section::default()
    });
    Report {
        title: format!("Commissioning of {}", own.plant),
        summary: own.warnings.first().cloned().unwrap_or_else(|| {
            "What is left of the model's equations is noise, and all controllers are robust to it."
                .into()
        }),
        facts,
        sections,
        footer: format!(
            "shakebench {}; seed {}",
            env!("CARGO_PKG_VERSION"),
            own.seed
        ),
        ..Report::default()
    }
}

fn growth(own: &Commissioned) -> Section {
    let rows = own.growth.iter().map(|trial| {
        [
            Cell::Quantity(trial.reference_m, Units::DISPLACEMENT, 3),
            Cell::Quantity(trial.displacement_m, Units::DISPLACEMENT, 3),
            Cell::Text(significant(trial.acceleration_m_s2 / STANDARD_GRAVITY, 3)),
            Cell::Text(trial.ended.clone().unwrap_or_else(|| "complete".into())),
        ]
    });
    Section {
        heading: "Growth of the excitation".into(),
        notes: own.warnings.clone(),
        tables: vec![Table::of(
            "Peaks of each trial, with the interlock armed",
            ["reference", "displacement", "acceleration (g)", "end"],
            rows,
        )],
        ..Section::default()
    }
}

fn model(own: &Commissioned) -> Section {
    let mut tables = match &own.identified.form {
        Form::Hydraulic(found) => vec![
            Table::of("Parameters", PARAMETER_COLUMNS, found.parameters()),
            Table::of(
                "What is left of the equations",
                EQUATION_COLUMNS,
                found.equations(),
            ),
        ],
        Form::General(found) => {
            let rows = crate::identify::parameters(found);
            vec![Table::of("Parameters", PARAMETER_COLUMNS, rows)]
        }
    };
    if !own.predictions.is_empty() {
        let number = |value: f64| Cell::Text(significant(value, 3));
        tables.push(Table::of(
            "The model on motions that were not fitted, under the same controller",
            [
                "motion",
                "peak acceleration (g)",
                "largest error (%)",
                "rms error (%)",
                "rms error of the command (%)",
            ],
            own.predictions.iter().map(|one| {
                [
                    Cell::Text(one.motion.clone()),
                    number(one.peak_m_s2 / STANDARD_GRAVITY),
                    number(one.largest_percent),
                    number(one.rms_percent),
                    number(one.command_percent),
                ]
            }),
        ));
    }
    Section {
        heading: "Model".into(),
        tables,
        ..Section::default()
    }
}

fn recordings(own: &Commissioned) -> Section {
    let panels = own.recordings.iter().map(|recording| {
        let series = |name: &str, channel: Channel| {
            Series::line(
                name,
                Abscissa::Even {
                    start: 0.0,
                    step: recording.period(),
                },
                recording.samples(channel).to_vec(),
            )
        };
        Panel {
            title: recording.name.clone(),
            x: Axis::linear("time", Units::TIME),
            y: Axis::linear("displacement", Units::DISPLACEMENT),
            series: vec![
                series("reference", Channel::Reference),
                series("measured", Channel::Displacement),
            ],
        }
    });
    Section {
        heading: "Recordings".into(),
        panels: panels.collect(),
        ..Section::default()
    }
}

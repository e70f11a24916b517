//! The report of a commissioned rig.

use super::{BOUND, Commissioned, Verdict};
use crate::identify::{EQUATION_COLUMNS, Form, parameter_table, parameters};
use identification::data::Channel;
use pages::report::identity::{entry, version};
use pages::report::number::significant;
use pages::report::{Abscissa, Axis, Cell, Fact, Panel, Report, Section, Series, Table, Units};

pub(super) fn report(own: &Commissioned) -> Report {
    let robust = own.design.loops.iter().filter(|one| one.robust).count();
    let mut facts = vec![Fact {
        label: "Controllers".into(),
        value: Cell::Text(format!("{robust} of {}", own.design.loops.len())),
        note: "robust to the model's uncertainty".into(),
    }];
    facts.insert(
        0,
        Fact {
            label: "Model".into(),
            value: Cell::Text(
                match own.verdict {
                    Verdict::Used => "used",
                    Verdict::Extended => "extended",
                    Verdict::Robust => "not used",
                }
                .into(),
            ),
            note: if own.causes.is_empty() {
                "no effect beyond the first form".into()
            } else {
                own.causes.join(", ")
            },
        },
    );
    if let Some(error) = own.validation_percent {
        facts.push(Fact {
            label: "Other motions".into(),
            value: Cell::Text(format!("{} %", significant(error, 2))),
            note: format!(
                "RMS error of the replayed acceleration; the bound is {BOUND} %{}",
                worst(own)
            ),
        });
    }
    let mut sections = vec![growth(own), model(own), predicted(own), recordings(own)];
    sections.retain(|section| !(section.tables.is_empty() && section.panels.is_empty()));
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
            "The residual of the model's equations is noise, and all controllers are robust to \
             the model's uncertainty."
                .into()
        }),
        identity: identity(own),
        facts,
        sections,
        footer: format!(
            "shakebench {}; seed {}",
            env!("CARGO_PKG_VERSION"),
            own.seed
        ),
    }
}

/// The motion whose acceleration the model replays worst.
fn worst(own: &Commissioned) -> String {
    let replayed = own
        .predictions
        .iter()
        .filter_map(|one| Some((one.replayed_percent?, &one.motion)));
    let largest = replayed.max_by(|a, b| a.0.total_cmp(&b.0));
    largest.map_or(String::new(), |(percent, motion)| {
        format!(
            "; the worst motion, {motion}: {} %",
            significant(percent, 2)
        )
    })
}

fn identity(own: &Commissioned) -> Vec<(String, Cell)> {
    let request = &own.request;
    let mut all = vec![
        entry("Plant", own.plant.as_str()),
        entry("Specimen", own.specimen.as_str()),
    ];
    if own.plant == crate::systems::biaxial::PLANT {
        all.push(entry(
            "Axis",
            "x is excited and y rests; both get its model",
        ));
    }
    if !request.set.is_empty() {
        all.push(entry("Set", request.set.join(", ")));
    }
    all.extend([
        entry(
            "Level",
            Cell::Quantity(request.level, Units::ACCELERATION, 3),
        ),
        entry(
            "Stroke, half",
            Cell::Quantity(request.stroke, Units::DISPLACEMENT, 3),
        ),
        entry("Recorded", Cell::Quantity(request.duration, Units::TIME, 3)),
        entry("Seed", own.seed.to_string()),
        version(),
    ]);
    all
}

fn growth(own: &Commissioned) -> Section {
    let rows = own.growth.iter().map(|trial| {
        [
            Cell::Quantity(trial.reference_m, Units::DISPLACEMENT, 3),
            Cell::Quantity(trial.displacement_m, Units::DISPLACEMENT, 3),
            Cell::Quantity(trial.acceleration_m_s2, Units::ACCELERATION, 3),
            Cell::Text(trial.ended.clone().unwrap_or_else(|| "complete".into())),
        ]
    });
    Section {
        heading: "Growth of the excitation".into(),
        notes: own.warnings.clone(),
        tables: vec![Table::of(
            "Peaks of each trial, with the interlock armed",
            ["reference", "displacement", "acceleration", "end"],
            rows,
        )],
        ..Section::default()
    }
}

fn model(own: &Commissioned) -> Section {
    let mut tables = match &own.identified.form {
        Form::Hydraulic(found) => vec![
            parameter_table("Parameters", &found.parameters()),
            Table::of(
                "Residual of the equations",
                EQUATION_COLUMNS,
                found.equations(),
            ),
        ],
        Form::General(found) => vec![parameter_table("Parameters", &parameters(found))],
    };
    if !own.predictions.is_empty() {
        let percent = |value: f64| Cell::Quantity(value, Units::PERCENT, 3);
        tables.push(Table::of(
            "The model on motions that were not fitted, under the same controller",
            [
                "motion",
                "peak acceleration",
                "largest error",
                "RMS error",
                "RMS error of the command",
                "RMS error of the replay",
            ],
            own.predictions.iter().map(|one| {
                [
                    Cell::Text(one.motion.clone()),
                    Cell::Quantity(one.peak_m_s2, Units::ACCELERATION, 3),
                    percent(one.largest_percent),
                    percent(one.rms_percent),
                    percent(one.command_percent),
                    one.replayed_percent.map_or(Cell::Text("-".into()), percent),
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

fn predicted(own: &Commissioned) -> Section {
    let rows = own.predicted_percent.iter().map(|(name, value)| {
        let value = value.map_or(Cell::Text("stopped".into()), |own| {
            Cell::Quantity(own, Units::PERCENT, 3)
        });
        [Cell::Text(name.clone()), value]
    });
    let mut tables = Vec::new();
    if !own.predicted_percent.is_empty() {
        tables.push(Table::of(
            "Each controller on the identified rig, on the motion to be played",
            ["controller", "RMS error of the acceleration over its peak"],
            rows,
        ));
    }
    Section {
        heading: "Predicted tracking error".into(),
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

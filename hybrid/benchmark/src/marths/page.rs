//! The report of the benchmark.

use pages::report::{Bar, BarGroup, Bars, Report, Section, Table, identity};

use super::outcome::Outcome;

/// The report.
#[must_use]
pub fn report(outcome: &Outcome) -> Report {
    let summary = format!(
        "Motions {}; {}; seed {}.",
        outcome.motions.join(", "),
        outcome.plants,
        outcome.seed
    );
    let sections = outcome.classes().into_iter().map(|(class, title)| Section {
        heading: title.into(),
        text: vec![
            "Bars are means over the runs, whiskers reach the largest. J1 to J3 compare measured \
             strokes with targets and hold the sensors' noise; the true tracking error does not. \
             H8 compares the storeys above with those under a perfect actuator."
                .into(),
        ],
        notes: outcome.notes.clone(),
        bars: ["true_J2_1", "true_J2_2", "H8"]
            .into_iter()
            .map(|column| bars(outcome, class, column))
            .collect(),
        tables: vec![Table::headed(
            "Mean/largest: J1 in ms, the others in %",
            outcome.rows(class),
        )],
        panels: Vec::new(),
    });
    let mut sections: Vec<Section> = sections.collect();
    let coupling = outcome.coupling();
    if !coupling.is_empty() {
        sections.push(Section {
            heading: "What coupling costs".into(),
            text: vec![
                "Laws that treat each actuator by its own entry of the plant, and the same laws with both actuators in \
                 the model."
                    .into(),
            ],
            tables: vec![Table::headed("Mean/largest, %", coupling)],
            ..Section::default()
        });
    }
    Report {
        title: "Multi-axial real-time hybrid simulation".into(),
        summary,
        facts: Vec::new(),
        sections,
        identity: vec![
            identity::entry("Benchmark", "multi-axial hybrid simulation (2023)"),
            identity::entry("Controllers", outcome.controllers.len().to_string()),
            identity::entry("Motions", outcome.motions.join(", ")),
            identity::entry("Seed", outcome.seed.to_string()),
            identity::version(),
        ],
        footer: format!(
            "shakebench {}. Benchmark of Condori Uribe et al. (2023).",
            env!("CARGO_PKG_VERSION")
        ),
    }
}

fn bars(outcome: &Outcome, class: hybrid::marths::laws::Class, column: &'static str) -> Bars {
    let of = outcome
        .controllers
        .iter()
        .filter(|(_, score)| score.class == class && score.mean[column].is_finite());
    Bars {
        title: format!("{column}, %"),
        groups: of
            .map(|(name, score)| BarGroup {
                label: (*name).into(),
                bars: vec![Bar {
                    name: column.into(),
                    value: score.mean[column],
                    interval: Some([score.mean[column], score.max[column]]),
                    colour: 1,
                }],
            })
            .collect(),
        mark: None,
    }
}

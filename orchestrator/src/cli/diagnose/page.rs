//! A diagnosis as a report.

use std::path::Path;

use identification::diagnosis::case::Case;
use identification::diagnosis::rigs::shake_table::Diagnosis;

use super::co_simulation::Comparison;
use super::{DIAGNOSIS, DiagnosisReport, GainReport, pictures, text};
use crate::extended_model::ExtendedModel;
use crate::report::columns::significant;
use crate::report::{Bar, BarGroup, Bars, Cell, Fact, Report, Section, Table};
use plant::identified::nominal::{shake_table_values, specimen_values};

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
pub(super) fn page(
    place: &Path,
    case: &Case,
    report: &DiagnosisReport,
    diagnosis: &Diagnosis,
    model: &ExtendedModel,
    comparison: Option<&Comparison>,
) -> Report {
    let name = place.file_name().unwrap_or(place.as_os_str());
    let mut sections = vec![findings(report), gain(report, Some(diagnosis))];
    if let Some(found) = comparison {
        sections.push(Section {
            panels: pictures::closed_loop(case, found),
            ..closed_loop(&found.gain)
        });
    }
    sections.push(relations(report));
    sections.extend(errors(case, diagnosis));
    sections.push(extended(case, model));
    Report {
        title: format!("Diagnosis of {}", name.to_string_lossy()),
        summary: report.sentence.clone(),
        facts: facts(report),
        sections,
        footer: format!(
            "shakebench {} on {}",
            env!("CARGO_PKG_VERSION"),
            place.display()
        ),
    }
}

/// The report of what `diagnosis.json` in `folder` tells.
pub(super) fn without_pictures(folder: &Path, report: &DiagnosisReport) -> Report {
    let mut sections = vec![findings(report), gain(report, None)];
    sections.extend(report.co_simulation.as_ref().map(closed_loop));
    sections.push(relations(report));
    sections.push(Section {
        heading: "Errors and the extended model".into(),
        text: vec![
            "Their pictures and tables need the records of the case: `shakebench diagnose CASE` \
             draws them. The extended model lies in extended_model.toml."
                .into(),
        ],
        ..Section::default()
    });
    Report {
        title: "Diagnosis".into(),
        summary: report.sentence.clone(),
        facts: facts(report),
        sections,
        footer: format!(
            "shakebench {} on {DIAGNOSIS} in {}",
            env!("CARGO_PKG_VERSION"),
            folder.display()
        ),
    }
}

fn facts(report: &DiagnosisReport) -> Vec<Fact> {
    let fact = |label: &str, value: Cell, note: &str| Fact {
        label: label.into(),
        value,
        note: note.into(),
    };
    let fall = |gain: &GainReport| {
        let (before, after) = (gain.before_ratio, gain.after_ratio);
        Cell::Text(format!(
            "{} → {}",
            significant(before, 3),
            significant(after, 3)
        ))
    };
    let verdict = match report.effects.as_slice() {
        [one] => format!("confidence {:.3}", one.confidence),
        [] => String::new(),
        [first, ..] => format!(
            "{} effects, confidence {:.3}",
            report.effects.len(),
            first.confidence
        ),
    };
    let mut facts = vec![
        fact("Verdict", report.verdict.into(), &verdict),
        fact(
            "Error one step ahead",
            fall(&report.gain),
            "times the noise floor, on the unseen record",
        ),
    ];
    if let Some(gain) = &report.co_simulation {
        facts.push(fact(
            "Error in closed loop",
            fall(gain),
            "times the noise floor, co-simulated by the FMUs",
        ));
    }
    facts
}

fn findings(report: &DiagnosisReport) -> Section {
    let mut tables = Vec::new();
    if !report.effects.is_empty() {
        tables.push(table(
            "Estimates with one standard error",
            &text::PARAMETERS,
            text::parameters(report),
        ));
    }
    let notes = text::remarks(report);
    let text = match report.verdict {
        "adequate" => {
            "Nothing is there that the stated uncertainty of the nominal model and the \
                       noise of the sensors do not explain."
        }
        "named" => {
            "Of all effects in the catalogue, alone and in pairs, only these leave nothing \
                    but noise on the records."
        }
        "ambiguous" => {
            "The records cannot tell these effects from the rivals below, which do as well."
        }
        _ => {
            "No effect of the catalogue, alone or in pairs, leaves only noise. What follows is \
              evidence, not a cause."
        }
    };
    Section {
        heading: "What was found".into(),
        text: vec![text.into()],
        notes,
        tables,
        ..Section::default()
    }
}

/// Bars of a gain by channel, in noise floors.
fn bars(title: &str, gain: &GainReport, interval: impl Fn(&str) -> Option<[[f64; 2]; 2]>) -> Bars {
    let bar = |name: &str, value, interval, colour| Bar {
        name: name.into(),
        value,
        interval,
        colour,
    };
    let groups = gain
        .channels
        .iter()
        .map(|(channel, [before, after, floor])| {
            let intervals = interval(channel);
            BarGroup {
                label: channel.replace('_', " "),
                bars: vec![
                    bar("nominal model", before / floor, intervals.map(|i| i[0]), 2),
                    bar("extended model", after / floor, intervals.map(|i| i[1]), 1),
                ],
            }
        });
    Bars {
        title: title.into(),
        groups: groups.collect(),
        mark: Some((1.0, "noise floor".into())),
    }
}

fn gain(report: &DiagnosisReport, diagnosis: Option<&Diagnosis>) -> Section {
    let interval = |channel: &str| {
        let mut all = diagnosis?.gain.channels.iter();
        let found = all.find(|one| one.channel == channel)?;
        let in_floors = |interval: [f64; 2]| interval.map(|end| end / found.floor);
        Some(found.intervals_95.map(in_floors))
    };
    Section {
        heading: "What it brings".into(),
        text: vec![format!(
            "Errors on the validation record, which was not fitted, in units of what the sensors' \
             noise leaves a perfect model. {}{}.",
            match diagnosis {
                Some(_) => "Whiskers: 95 % interval from a moving-block bootstrap. ",
                None => "",
            },
            text::share(&report.gain)
        )],
        bars: vec![bars("One step ahead", &report.gain, interval)],
        tables: vec![table(
            "NRMSE one step ahead, and in noise floors",
            &text::GAIN,
            text::channels(&report.gain),
        )],
        ..Section::default()
    }
}

fn closed_loop(gain: &GainReport) -> Section {
    Section {
        heading: "The same in closed loop".into(),
        text: vec![
            "The FMUs of table, specimen, sensors and three-variable control play the reference of \
             the validation record under the laboratory's own law; the rig is unstable without its \
             controller, so that only in closed loop a whole record can be compared. The noise \
             floor is what the sensors' noise alone makes of the extended FMUs, in the readings \
             and through the loop; a rig whose valve is disturbed besides lies a little above it."
                .into(),
            format!("{}.", text::share(gain)),
        ],
        bars: vec![bars("Whole record, co-simulated", gain, |_| None)],
        tables: vec![table(
            "NRMSE in closed-loop co-simulation, and in noise floors",
            &text::GAIN,
            text::channels(gain),
        )],
        ..Section::default()
    }
}

fn relations(report: &DiagnosisReport) -> Section {
    let rows = text::relations(report).into_iter().map(|mut row| {
        let about = match row[0].get(..2) {
            Some("R1") => "command and velocity against force: valve, oil, load cell",
            Some("R2") => "force against inertia, damping, stiffness: friction, payload, sensors",
            Some("R3") => "table's against specimen's acceleration: the specimen",
            Some("R4") => "acceleration against displacement: these two sensors, foundation",
            _ => "recorded command against the stated law: the controller",
        };
        row.push(about.to_string());
        row
    });
    let mut columns = text::RELATIONS.to_vec();
    columns.push("what it joins, and what breaks it");
    Section {
        heading: "Where the nominal model is wrong".into(),
        text: vec![
            "Five relations of a healthy rig on the identification record, their errors in units \
             of the sensors' noise: with the nominal parameters, with those that were estimated \
             along within their stated uncertainty, and what the same figure is on a simulated \
             healthy rig. An effect breaks the relations that it acts in, and others through the \
             sensor or the motion that they share."
                .into(),
        ],
        tables: vec![table("", &columns, rows.collect())],
        ..Section::default()
    }
}

fn errors(case: &Case, diagnosis: &Diagnosis) -> [Section; 3] {
    let pictures::Errors {
        time,
        spectra,
        state,
    } = pictures::errors(case, diagnosis);
    let section = |heading: &str, text: &str, panels| Section {
        heading: heading.into(),
        text: vec![text.into()],
        panels,
        ..Section::default()
    };
    [
        section(
            "Errors in time",
            "One-step errors on the validation record in noise floors, channels whitened in their \
             order: a perfect model leaves noise of deviation one, nearly all of it in the band.",
            time,
        ),
        section(
            "Errors in frequency",
            "A perfect model leaves a level line at 1.",
            spectra,
        ),
        section(
            "Errors against the state",
            "Mean error by the size of command, displacement, velocity and drift; a line that is \
             not level shows what the model lacks. The pictures in which the nominal model's line \
             bends most.",
            state,
        ),
    ]
}

fn extended(case: &Case, model: &ExtendedModel) -> Section {
    let mut nominal = shake_table_values(&case.nominal.shake_table);
    if let Some(specimen) = &case.nominal.specimen {
        nominal.extend(specimen_values(specimen));
    }
    let mut rows = Vec::new();
    for (component, parameters) in &model.parameters {
        for (name, estimate) in parameters {
            let before = nominal.iter().find(|(known, _)| known == name);
            let (before, change) = before.map_or(("-".into(), "new".into()), |(_, before)| {
                let change = 100.0 * (estimate.value / before - 1.0);
                (significant(*before, 5), format!("{change:+.2} %"))
            });
            let error = estimate.standard_error;
            rows.push(vec![
                (*component).to_string(),
                name.clone(),
                before,
                significant(estimate.value, 5),
                error.map_or("-".into(), |error| significant(error, 2)),
                change,
            ]);
        }
    }
    Section {
        heading: "The extended model".into(),
        text: vec![
            "Parameters of the FMUs beside this page (fmi2/ and fmi3/), which start with these \
             values, and of extended_model.toml, which `shakebench run --set table.model=FILE` \
             reads. SI."
                .into(),
        ],
        tables: vec![table(
            "",
            &[
                "FMU",
                "parameter",
                "nominal",
                "extended",
                "standard error",
                "change",
            ],
            rows,
        )],
        ..Section::default()
    }
}

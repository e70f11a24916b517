//! A diagnosis as a report.

use std::path::Path;

use identification::diagnosis::case::Case;
use identification::diagnosis::engine::Verdict;
use identification::diagnosis::rigs::curves::Curves;
use identification::diagnosis::rigs::foreign::KIND;
use identification::diagnosis::rigs::shake_table::Diagnosis;
use identification::diagnosis::rigs::{NamedValue, RigDiagnosis};
use identification::diagnosis::{DiagnosisReport, Evidence, GainReport, ShakeTableEvidence};

use super::case::Extended;
use super::{DIAGNOSIS, pictures, rig, text};
use pack::extended_model::ExtendedModel;
use pages::report::number::{estimated, significant};
use pages::report::{
    Bar, BarGroup, Bars, Cell, Fact, Panel, Report, Section, Table, UnitSystem, identity,
};
use plant::identified::nominal::{shake_table_values, specimen_values};

/// A table of `rows`, of which the first are the headings.
fn page(name: &str, source: &str, report: &DiagnosisReport, sections: Vec<Section>) -> Report {
    Report {
        title: format!("Diagnosis of {name}"),
        summary: report.sentence.clone(),
        facts: facts(report),
        sections,
        identity: vec![
            identity::entry("Diagnosed", source),
            identity::entry("Elapsed time", format!("{:.1} s", report.wall_s)),
            identity::version(),
        ],
        footer: format!("shakebench {} on {source}", env!("CARGO_PKG_VERSION")),
    }
}

/// The report on a case.
pub(super) fn of_case(
    place: &Path,
    report: &DiagnosisReport,
    case: &Case,
    found: &Diagnosis,
    extended: &Extended,
    units: UnitSystem,
) -> Report {
    let mut sections = vec![findings(report, units), gain(report, Some(found))];
    if let Some(played) = &extended.comparison {
        sections.push(Section {
            panels: pictures::overlays(case, played)
                .into_iter()
                .chain(pictures::closed_loop(case, played))
                .collect(),
            ..closed_loop(&played.gain)
        });
    }
    if let Evidence::ShakeTable(evidence) = &report.evidence {
        sections.push(relations(evidence));
    }
    sections.extend(errors(case, found));
    sections.push(extended_case(case, &extended.model));
    let name = place.file_name().unwrap_or(place.as_os_str());
    let source = place.display().to_string();
    page(&name.to_string_lossy(), &source, report, sections)
}

/// The report on the rig called `name`.
pub(super) fn of_rig(
    name: &str,
    place: &Path,
    report: &DiagnosisReport,
    curves: &[Curves],
    units: UnitSystem,
) -> Report {
    let sections = rig_sections(report, Some(curves), units);
    page(name, &place.display().to_string(), report, sections)
}

/// The report on a model that came as the FMU `place`.
pub(super) fn of_foreign(
    name: &str,
    place: &Path,
    report: &DiagnosisReport,
    panels: Vec<Panel>,
    units: UnitSystem,
) -> Report {
    let mut sections = rig_sections(report, None, units);
    let pictures = Section {
        heading: "Measured and simulated".into(),
        text: vec!["The first record that contains held-out data.".into()],
        panels,
        ..Section::default()
    };
    sections.insert(sections.len().saturating_sub(1), pictures);
    page(name, &place.display().to_string(), report, sections)
}

/// The report of what `diagnosis.json` in `folder` tells, with pictures of `curves`.
pub(super) fn again(
    folder: &Path,
    report: &DiagnosisReport,
    curves: Option<&[Curves]>,
    units: UnitSystem,
) -> Report {
    let source = format!("{DIAGNOSIS} in {}", folder.display());
    let sections = match &report.evidence {
        Evidence::Rig(_) => rig_sections(report, curves, units),
        Evidence::ShakeTable(evidence) => {
            let mut sections = vec![findings(report, units), gain(report, None)];
            sections.extend(evidence.co_simulation.as_ref().map(closed_loop));
            sections.push(relations(evidence));
            sections.push(Section {
                heading: "Errors and the extended model".into(),
                text: vec![
                    "Their plots and tables need the records of the case: `shakebench diagnose \
                     CASE` draws them. The extended model is in extended_model.toml."
                        .into(),
                ],
                ..Section::default()
            });
            sections
        }
    };
    let name = match &report.evidence {
        Evidence::Rig(evidence) => &evidence.rig.name,
        Evidence::ShakeTable(_) => "a case",
    };
    page(name, &source, report, sections)
}

fn rig_sections(
    report: &DiagnosisReport,
    curves: Option<&[Curves]>,
    units: UnitSystem,
) -> Vec<Section> {
    let Evidence::Rig(evidence) = &report.evidence else {
        return Vec::new();
    };
    let rig = &evidence.rig;
    let mut sections = vec![
        findings(report, units),
        Section {
            heading: "What it brings".into(),
            text: vec![format!(
                "Errors of {} on held-out data, relative to its variation: for the nominal model, \
                 with its parameters refitted, and with the effects. {:.0} % of the nominal \
                 model's squared error on the held-out data is unexplained. Intervals: block \
                 bootstrap, blocks of ten correlation times.",
                rig.output,
                100.0 * evidence.unexplained_share
            )],
            tables: vec![Table::headed("", text::parts(rig))],
            ..Section::default()
        },
    ];
    if let Some(curves) = curves {
        sections.push(Section {
            heading: "Measured and simulated".into(),
            text: vec!["The first record that contains held-out data.".into()],
            panels: rig::overlay(rig, curves)
                .into_iter()
                .chain(rig::pictures(rig, curves))
                .collect(),
            ..Section::default()
        });
    }
    sections.push(extended_rig(rig));
    sections
}

fn extended_rig(rig: &RigDiagnosis) -> Section {
    let heading = ["of", "parameter", "value", "standard error", "unit"];
    let mut rows = vec![heading.map(String::from).to_vec()];
    let mut add = |of: &str, values: &[NamedValue]| {
        rows.extend(values.iter().map(|p| {
            vec![
                of.to_string(),
                p.name.clone(),
                estimated(p.value, p.standard_error),
                significant(p.standard_error, 2),
                p.unit.clone(),
            ]
        }));
    };
    let confirmed = &rig.confirmed;
    add("nominal model, refitted", &confirmed.refitted);
    add("with the effects", &confirmed.parameters);
    for (effect, parameters) in &confirmed.effects {
        add(effect, parameters);
    }
    Section {
        heading: "The extended model".into(),
        text: vec![match rig.kind.as_str() {
            KIND => "Effects around the model in extended_model.toml, in the model's units.".into(),
            _ => "The values of extended_model.toml. SI.".into(),
        }],
        tables: vec![Table::headed("", rows)],
        ..Section::default()
    }
}

fn facts(report: &DiagnosisReport) -> Vec<Fact> {
    let fact = |label: &str, value: Cell, note: &str| Fact {
        label: label.into(),
        value,
        note: note.into(),
    };
    let fall = |before: f64, after: f64| {
        let [before, after] = [before, after].map(|error| significant(error, 3));
        Cell::Text(format!("{before} → {after}"))
    };
    let verdict = match report.effects.as_slice() {
        [one] => format!("confidence {}", text::confidence(one.confidence)),
        [] => String::new(),
        [first, ..] => format!(
            "{} effects, confidence {}",
            report.effects.len(),
            text::confidence(first.confidence)
        ),
    };
    let mut facts = vec![fact("Verdict", report.verdict.to_string().into(), &verdict)];
    let mut against_noise = |label: &str, gain: &GainReport, note: &str| {
        let noise = gain.against_noise.iter();
        facts.extend(noise.map(|n| fact(label, fall(n.before_ratio, n.after_ratio), note)));
    };
    against_noise(
        "Error one step ahead",
        &report.gain,
        "times the noise floor, on the validation record",
    );
    match &report.evidence {
        Evidence::ShakeTable(evidence) => {
            if let Some(gain) = &evidence.co_simulation {
                against_noise(
                    "Error in closed loop",
                    gain,
                    "times the noise floor, co-simulated by the FMUs",
                );
            }
        }
        Evidence::Rig(evidence) => facts.push(fact(
            "Error",
            fall(
                100.0 * report.gain.before_nrmse,
                100.0 * report.gain.after_nrmse,
            ),
            &format!("% of {}, on the held-out data", evidence.rig.output),
        )),
    }
    facts
}

fn findings(report: &DiagnosisReport, units: UnitSystem) -> Section {
    let mut tables = Vec::new();
    if !report.effects.is_empty() {
        tables.push(Table::headed(
            "Estimates ± half of their 95 % interval",
            text::parameters(report, units),
        ));
    }
    let notes = text::remarks(report);
    let is_case = matches!(report.evidence, Evidence::ShakeTable(_));
    let text = match (report.verdict, is_case) {
        (Verdict::Adequate, true) => {
            "The stated uncertainty of the nominal model and the sensor noise explain the records."
        }
        (Verdict::Named, true) => {
            "Of the sets of effects that were searched, only these reduce the residual to noise."
        }
        (Verdict::Ambiguous, true) => {
            "The records cannot distinguish these effects from the rivals below, which fit as well."
        }
        (Verdict::TooSmall, _) => {
            "An effect of the catalogue explains the records, but it is weaker than what matters."
        }
        (Verdict::Unexplained, true) => {
            "None of the sets of effects that were searched reduces the residual to noise. The \
             following is evidence, not a cause."
        }
        (Verdict::Adequate, false) => {
            "No effect of this kind of rig improves the prediction of held-out data."
        }
        (Verdict::Named | Verdict::Ambiguous, false) => {
            "Effects that improve the prediction of held-out data. The data are divided into two \
             parts; an effect in only one part is not confirmed."
        }
        (Verdict::Unexplained, false) => {
            "One part of the data shows effects that the other does not confirm. The following is \
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

/// Bars of a gain by channel, in noise floors; none where the noise is not known.
fn bars(
    title: &str,
    gain: &GainReport,
    interval: impl Fn(&str) -> Option<[[f64; 2]; 2]>,
) -> Vec<Bars> {
    let Some(noise) = &gain.against_noise else {
        return Vec::new();
    };
    let bar = |name: &str, value, interval, colour| Bar {
        name: name.into(),
        value,
        interval,
        colour,
    };
    let groups = noise
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
    vec![Bars {
        title: title.into(),
        groups: groups.collect(),
        mark: Some((1.0, "noise floor".into())),
    }]
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
            "Errors on the validation record, which was not fitted, in units of the error of a \
             perfect model due to sensor noise. {}{}.",
            match diagnosis {
                Some(_) => "Whiskers: 95 % interval from a moving-block bootstrap. ",
                None => "",
            },
            text::share(&report.gain)
        )],
        bars: bars("One step ahead", &report.gain, interval),
        tables: vec![Table::headed(
            "NRMSE one step ahead, and in noise floors",
            text::channels(&report.gain).unwrap_or_default(),
        )],
        ..Section::default()
    }
}

fn closed_loop(gain: &GainReport) -> Section {
    Section {
        heading: "The same in closed loop".into(),
        text: vec![
            "The FMUs of table, specimen, sensors and three-variable control play the reference \
             of the validation record under the laboratory's own law. The rig is unstable without \
             its controller, so a whole record can be compared only in closed loop. The noise \
             floor is the error that sensor noise causes in the extended FMUs, in the readings \
             and through the loop; if the valve is also disturbed, the error is slightly above it."
                .into(),
            format!("{}.", text::share(gain)),
        ],
        bars: bars("Whole record, co-simulated", gain, |_| None),
        tables: vec![Table::headed(
            "NRMSE in closed-loop co-simulation, and in noise floors",
            text::channels(gain).unwrap_or_default(),
        )],
        ..Section::default()
    }
}

fn relations(evidence: &ShakeTableEvidence) -> Section {
    let mut rows = text::relations(evidence);
    for row in &mut rows {
        let about = match row[0].get(..2) {
            Some("R1") => "command and velocity against force: valve, oil, load cell",
            Some("R2") => "force against inertia, damping, stiffness: friction, payload, sensors",
            Some("R3") => "table's against specimen's acceleration: the specimen",
            Some("R4") => "acceleration against displacement: these two sensors, foundation",
            Some("R5") => "recorded command against the stated law: the controller",
            _ => "relation, and effects that violate it",
        };
        row.push(about.to_string());
    }
    Section {
        heading: "Where the nominal model is wrong".into(),
        text: vec![
            "Five relations of a healthy rig on the identification record, their errors in units \
             of the sensor noise: with the nominal parameters, with parameters estimated within \
             their stated uncertainty, and for a simulated healthy rig. An effect violates the \
             relations in which it acts, and others through a shared sensor or motion."
                .into(),
        ],
        tables: vec![Table::headed("", rows)],
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
             order: the residual of a perfect model is noise with a deviation of one, nearly all \
             of it in the band.",
            time,
        ),
        section(
            "Errors in frequency",
            "A perfect model has a level line at 1.",
            spectra,
        ),
        section(
            "Errors against the state",
            "Mean error by the size of command, displacement, velocity and drift; a line that is \
             not level shows what the model lacks. These are the plots in which the nominal \
             model's line bends most.",
            state,
        ),
    ]
}

fn extended_case(case: &Case, model: &ExtendedModel) -> Section {
    let mut nominal = shake_table_values(&case.nominal.shake_table);
    if let Some(specimen) = &case.nominal.specimen {
        nominal.extend(specimen_values(specimen));
    }
    let heading = [
        "FMU",
        "parameter",
        "nominal",
        "extended",
        "standard error",
        "change",
    ];
    let mut rows = vec![heading.map(String::from).to_vec()];
    for (component, parameters) in &model.parameters {
        for (name, estimate) in parameters {
            let before = nominal.iter().find(|(known, _)| known == name);
            let (before, change) = before.map_or(("-".into(), "new".into()), |(_, before)| {
                let change = 100.0 * (estimate.value / before - 1.0);
                (significant(*before, 5), format!("{change:+.2} %"))
            });
            let error = estimate.standard_error;
            let value = estimated(estimate.value, error.unwrap_or(f64::NAN));
            rows.push(vec![
                (*component).to_string(),
                name.clone(),
                before,
                value,
                error.map_or("-".into(), |error| significant(error, 2)),
                change,
            ]);
        }
    }
    Section {
        heading: "The extended model".into(),
        text: vec![
            "Parameters of the FMUs next to this page (fmi2/ and fmi3/), which start with these \
             values, and of extended_model.toml, which `shakebench run --set table.model=FILE` \
             reads. SI."
                .into(),
        ],
        tables: vec![Table::headed("", rows)],
        ..Section::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn gain(before: f64) -> Value {
        json!({
            "before_nrmse": before, "after_nrmse": 0.05, "noise_floor_nrmse": 0.04, "interval_95": [0.6, 0.9],
            "record": "validation", "before_ratio": before / 0.04, "after_ratio": 1.25,
            "channels": {
                "actuator_force": [0.5, 0.06, 0.05], "displacement": [0.3, 0.03, 0.03],
            },
        })
    }

    /// A report on a case with these effects and alternatives.
    fn case(verdict: &str, effects: Value) -> DiagnosisReport {
        let report = json!({
            "sentence": "The valve has a dead band.", "verdict": verdict, "effects": effects,
            "alternatives": [["valve_flow_gain", "seal_friction"]],
            "separating_experiment": "a triangle of 2 mm", "separating_motion": "case/separating.csv",
            "gain": gain(0.4), "extended_model": null, "extended_fmu": null, "extended_fmus": [],
            "notes": ["The record is short."], "wall_s": 12.34,
            "co_simulation": gain(0.8),
            "relations": {
                "R1 valve": {"nominal": 9.0, "estimated": 1.1, "healthy": 1.0},
                "R2 force": {"nominal": 1.2, "estimated": 1.1, "healthy": 1.0},
                "R3 specimen": {"nominal": 3.0, "estimated": 2.5, "healthy": 1.0},
                "R4 sensors": {"nominal": 1.0, "estimated": 1.0, "healthy": null},
                "R5 law": {"nominal": 1.31, "estimated": 1.29, "healthy": 1.0},
                "all": {"nominal": 2.0, "estimated": 1.3, "healthy": 1.0},
            },
            "remaining": [["a", 9.0], ["b", 8.0], ["c", 7.0], ["d", 6.0], ["e", 5.25], ["f", 4.0]],
            "share_explained": 0.9,
        });
        serde_json::from_value(report).unwrap()
    }

    fn dead_band() -> Value {
        json!({
            "effect": "valve_dead_band", "confidence": 0.9995,
            "parameters": {"half_width": {"value": 0.25, "unit": "V", "standard_error": 0.01}},
        })
    }

    fn friction() -> Value {
        json!({
            "effect": "seal_friction", "confidence": 0.951,
            "parameters": {
                "force": {"value": 1000.0, "unit": "N", "standard_error": 20.0},
                "velocity": {"value": 0.01, "unit": "m/s", "standard_error": null},
            },
        })
    }

    /// A report on a rig of this kind, fitted and tested on its two parts.
    fn rig(verdict: &str, kind: &str, effects: Value) -> DiagnosisReport {
        let value = |name: &str, value: f64, unit: &str| json!({"name": name, "value": value, "unit": unit, "standard_error": 0.012_34});
        let part = |extended: f64| {
            json!({
                "nominal_error": 0.5, "refitted_error": 0.4, "extended_error": extended, "fitted_error": 0.09,
                "gain_interval": [0.5, 0.95], "parameters": [], "effects": [], "explained": 0.9,
                "rivals": [["play", "friction"]],
            })
        };
        let report = json!({
            "sentence": "The arm has friction.", "verdict": verdict, "effects": effects, "alternatives": [],
            "separating_experiment": "a slow triangle",
            "gain": {"before_nrmse": 0.5, "after_nrmse": 0.1, "noise_floor_nrmse": null, "interval_95": [0.1, 0.2],
                "record": "held out"},
            "extended_model": null, "extended_fmu": null, "extended_fmus": [], "notes": [], "wall_s": 3.0,
            "unexplained_share": 0.123,
            "rig": {
                "name": "arm", "kind": kind, "output": "position", "verdict": verdict, "named": ["friction"],
                "not_confirmed": [], "as_described": part(0.1), "swapped": part(0.2),
                "confirmed": {
                    "error": 0.12, "swapped_error": 0.22, "gain_interval": [0.4, 0.8], "refitted_error": 0.4,
                    "fitted_error": 0.1, "refitted": [value("mass", 2.5, "kg")],
                    "parameters": [value("mass", 2.25, "kg")],
                    "effects": [["friction", [value("force", 12.345_678, "N")]]],
                },
                "unexplained": 0.123,
            },
        });
        serde_json::from_value(report).unwrap()
    }

    fn shown(report: &DiagnosisReport, units: UnitSystem) -> String {
        let page = again(Path::new("out"), report, None, units);
        expected::text_of(&page, units).replace(env!("CARGO_PKG_VERSION"), "VERSION")
    }

    #[test]
    fn a_case_is_reported_on_the_terminal_and_on_its_page() {
        let found = case("named", json!([dead_band(), friction()]));
        let mut all = Vec::new();
        for units in [UnitSystem::Us, UnitSystem::Si] {
            all.extend([text::text(&found, units), shown(&found, units)]);
        }
        let none = case("adequate", json!([]));
        all.extend([
            text::text(&none, UnitSystem::Si),
            shown(&none, UnitSystem::Si),
        ]);
        let unexplained = case("unexplained", json!([dead_band()]));
        all.push(text::text(&unexplained, UnitSystem::Si));
        expected::compare(
            env!("CARGO_MANIFEST_DIR"),
            "diagnosis-case.txt",
            &all.join("\n======\n"),
        );
    }

    #[test]
    fn a_rig_is_reported_on_the_terminal_and_on_its_page() {
        let mut own = friction();
        own["on_every_part"] = true.into();
        let mut other = dead_band();
        other["on_every_part"] = false.into();
        other["parameters"] = json!({});
        let mut all = Vec::new();
        for (verdict, kind) in [
            ("named", "arm"),
            ("ambiguous", KIND),
            ("unexplained", "arm"),
        ] {
            let found = rig(verdict, kind, json!([own, other]));
            all.extend([
                text::text(&found, UnitSystem::Us),
                shown(&found, UnitSystem::Us),
            ]);
        }
        expected::compare(
            env!("CARGO_MANIFEST_DIR"),
            "diagnosis-rig.txt",
            &all.join("\n======\n"),
        );
    }

    #[test]
    fn a_verdict_is_explained_in_a_sentence_of_its_own() {
        let sentence = |report: &DiagnosisReport| findings(report, UnitSystem::Si).text[0].clone();
        let verdicts = ["adequate", "named", "ambiguous", "too_small", "unexplained"];
        let mut all: Vec<String> = verdicts.map(|own| sentence(&case(own, json!([])))).to_vec();
        all.extend(verdicts.map(|own| sentence(&rig(own, "arm", json!([])))));
        // An effect that is too small is so on a case and on a rig; what is named or ambiguous is the same on a rig.
        assert_eq!((&all[3], &all[6]), (&all[8], &all[7]));
        all.sort();
        all.dedup();
        assert_eq!(all.len(), 8);
    }

    #[test]
    fn a_foreign_model_has_its_pictures_before_the_extended_model() {
        let report = rig("named", KIND, json!([friction()]));
        let panel = pages::report::Panel {
            title: "position".into(),
            x: pages::report::Axis::linear("time", pages::report::Units::TIME),
            y: pages::report::Axis::linear("position", pages::report::Units::NONE),
            series: Vec::new(),
        };
        let page = of_foreign(
            "arm",
            Path::new("arm.fmu"),
            &report,
            vec![panel],
            UnitSystem::Si,
        );
        let headings: Vec<&str> = page.sections.iter().map(|own| &*own.heading).collect();
        assert_eq!(
            headings,
            [
                "What was found",
                "What it brings",
                "Measured and simulated",
                "The extended model"
            ]
        );
        assert_eq!(
            (page.sections[2].panels.len(), &*page.title),
            (1, "Diagnosis of arm")
        );
    }
}

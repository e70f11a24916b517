//! The report of the benchmark, with the pictures that papers show.

use std::sync::Arc;

use hybrid::vrths::{PERIOD, TransferSystemParameters};
use plant::ModelError;

use pages::report::{
    Abscissa, Axis, Bar, BarGroup, Bars, Cell, Fact, Panel, Report, Section, Series, Style, Table,
    Units, identity,
};

use super::criteria::Histories;
use super::outcome::Outcome;
use super::roster::BEST;
use super::simulation::{NO_EFFECTS, Setting, independent_noise, run};
use super::study::Study;

/// A run for the pictures.
pub struct Picture {
    name: &'static str,
    histories: Histories,
}

/// Runs the controllers of a study once more on the nominal plant, the first case and the first
/// motion.
///
/// # Errors
/// A plant, frame or controller that cannot be simulated.
pub fn pictures(study: &Study) -> Result<Vec<Picture>, ModelError> {
    let (Some(case), Some(motion)) = (study.cases.first(), study.motions.first()) else {
        return Ok(Vec::new());
    };
    let frame = case.frame();
    let noise = independent_noise(study.seed, 0, motion.ground.samples());
    study
        .controllers
        .iter()
        .map(|entry| {
            let setting = Setting {
                frame: &frame,
                plant: &TransferSystemParameters::default(),
                effects: &NO_EFFECTS,
                form: study.form,
                ground: &motion.ground,
                noise: &noise,
                own_converters: entry.own_converters,
            };
            Ok(Picture {
                name: entry.name,
                histories: run(&setting, entry.make()?.as_mut())?,
            })
        })
        .collect()
}

/// The report.
#[must_use]
pub fn report(outcome: &Outcome, pictures: &[Picture]) -> Report {
    let scene = format!(
        "Nominal plant, case {}, {}.",
        outcome.cases.first().copied().unwrap_or_default(),
        outcome.motions.first().map_or("", String::as_str)
    );
    let mut sections = vec![scores(outcome)];
    if outcome.table3.is_some() {
        sections.push(published(outcome));
    }
    sections.push(tracking(&scene, pictures));
    sections.push(subspace(&scene, pictures));
    Report {
        title: "Virtual real-time hybrid simulation".into(),
        summary: format!(
            "Cases {}; motions {}; seed {}.",
            outcome
                .cases
                .iter()
                .map(u8::to_string)
                .collect::<Vec<_>>()
                .join(", "),
            outcome.motions.join(", "),
            outcome.seed
        ),
        facts: facts(outcome),
        sections,
        identity: vec![
            identity::entry("Benchmark", "virtual real-time hybrid simulation (2020)"),
            identity::entry("Controllers", outcome.controllers.len().to_string()),
            identity::entry(
                "Cases",
                outcome
                    .cases
                    .iter()
                    .map(u8::to_string)
                    .collect::<Vec<_>>()
                    .join(", "),
            ),
            identity::entry("Motions", outcome.motions.join(", ")),
            identity::entry("Seed", outcome.seed.to_string()),
            identity::version(),
        ],
        footer: format!(
            "shakebench {}. Benchmark of Silva, Gomez, Maghareh, Dyke and Spencer (2020).",
            env!("CARGO_PKG_VERSION")
        ),
    }
}

fn facts(outcome: &Outcome) -> Vec<Fact> {
    let best = outcome
        .controllers
        .iter()
        .filter(|(_, score)| score.unstable == 0)
        .min_by(|a, b| a.1.mean[3].total_cmp(&b.1.mean[3]));
    let Some((name, score)) = best else {
        return Vec::new();
    };
    let fact = |label: &str, value: f64, note: String| Fact {
        label: label.into(),
        value: Cell::Quantity(value, Units::PERCENT, 3),
        note,
    };
    vec![
        fact(
            &format!("J4 of {name}"),
            score.mean[3],
            format!("mean of {} runs, largest {:.2}", score.runs, score.max[3]),
        ),
        fact(
            &format!("J6 of {name}"),
            score.mean[5],
            format!("largest {:.2}", score.max[5]),
        ),
    ]
}

fn scores(outcome: &Outcome) -> Section {
    let bars = |title: &str, place: usize| Bars {
        title: title.into(),
        groups: outcome
            .controllers
            .iter()
            .filter(|(_, score)| score.mean[place].is_finite())
            .map(|(name, score)| BarGroup {
                label: (*name).into(),
                bars: vec![Bar {
                    name: title.into(),
                    value: score.mean[place],
                    interval: Some([
                        (score.mean[place] - score.deviation[place]).max(0.0),
                        score.max[place],
                    ]),
                    colour: if *name == BEST { 2 } else { 1 },
                }],
            })
            .collect(),
        mark: None,
    };
    Section {
        heading: "Scores".into(),
        text: vec![
            "Bars are means over the runs; the whiskers extend from one standard deviation below \
             to the largest value. J1 to J3 compare the measured displacement of the specimen \
             with the desired \
             one, J4 and J5 with the first floor of the undivided structure, J6 to J9 the floors \
             above with theirs. J2 to J5 include sensor noise; the true tracking error does not."
                .into(),
        ],
        notes: outcome.notes.clone(),
        bars: vec![
            bars("J2, tracking, %", 1),
            bars("J4, first floor, %", 3),
            bars("J6, second floor, %", 5),
        ],
        tables: vec![Table::headed(
            "Mean/largest: J1 in ms, the others in %",
            outcome.score_rows(),
        )],
        panels: Vec::new(),
    }
}

fn published(outcome: &Outcome) -> Section {
    Section {
        heading: "The published table".into(),
        text: vec![match outcome.table3_largest_difference {
            Some(difference) => format!(
                "Sample controller on El Centro with the published program's noise and derivative \
                 blocks, with the published scores; the largest difference is {difference:.2}."
            ),
            None => "Sample controller on El Centro with the published program's noise and \
                     derivative blocks."
                .into(),
        }],
        tables: vec![Table::headed(
            "J1 in ms, J2 to J9 in %",
            outcome.table3_rows(),
        )],
        ..Section::default()
    }
}

/// Half of what the zoom shows, s.
const ZOOM: f64 = 0.25;

/// Samples around the largest desired displacement.
fn zoom(histories: &Histories) -> std::ops::Range<usize> {
    let desired = &histories.numerical[0];
    let peak = desired
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        .map_or(0, |(place, _)| place);
    let half = (ZOOM / PERIOD) as usize;
    peak.saturating_sub(half)..(peak + half).min(desired.len())
}

fn tracking(scene: &str, pictures: &[Picture]) -> Section {
    let panels = pictures
        .iter()
        .map(|picture| {
            let range = zoom(&picture.histories);
            let start = range.start as f64 * PERIOD;
            let cut = |name: &str, values: &[f64]| {
                let abscissa = Abscissa::Even {
                    start,
                    step: PERIOD,
                };
                Series::line(name, abscissa, values[range.clone()].to_vec())
            };
            Panel {
                title: picture.name.into(),
                x: Axis::linear("Time", Units::TIME),
                y: Axis::linear("Displacement", Units::DISPLACEMENT),
                series: vec![
                    cut("desired", &picture.histories.numerical[0]).coloured(0),
                    cut("measured", &picture.histories.measured).styled(Style::Dashed),
                ],
            }
        })
        .collect();
    Section {
        heading: "Tracking around the largest displacement".into(),
        text: vec![scene.into()],
        panels,
        ..Section::default()
    }
}

fn subspace(scene: &str, pictures: &[Picture]) -> Section {
    let panels = pictures
        .iter()
        .map(|picture| {
            let range = zoom(&picture.histories);
            let places: Arc<[f64]> = picture.histories.numerical[0][range.clone()].into();
            Panel {
                title: picture.name.into(),
                x: Axis::linear("Desired displacement", Units::DISPLACEMENT),
                y: Axis::linear("Measured displacement", Units::DISPLACEMENT),
                series: vec![
                    Series::line(
                        picture.name,
                        Abscissa::At(places),
                        picture.histories.measured[range].to_vec(),
                    )
                    .styled(Style::Path),
                ],
            }
        })
        .collect();
    Section {
        heading: "Synchronisation subspace".into(),
        text: vec![format!(
            "{scene} A straight line is perfect tracking; an ellipse indicates a delay, and \
             another slope an error of amplitude."
        )],
        panels,
        ..Section::default()
    }
}

//! A run along two axes: one summary of both, then each axis as a run of its own.

use super::{Run, fact, panels, sections, what_was_run};
use crate::report::{
    Abscissa, Axis, Cell, Fact, Panel, Report, Section, Series, Style, Table, Units,
};
use motion::peak;

/// An axis of a run.
#[derive(Debug, Clone)]
pub struct AxisRun<'a> {
    /// Its name, such as `x`.
    pub name: &'a str,
    /// What happened along it.
    pub run: Run<'a>,
    /// Of an axis that was to rest: RMS of its displacement and acceleration over the peaks of the other axis'
    /// reference, %.
    pub at_rest: Option<[f64; 2]>,
}

/// The report of a run along two axes; system, identity, settings and components are those of the first.
#[must_use]
pub fn run_along(axes: &[AxisRun<'_>; 2]) -> Report {
    let [first, second] = axes;
    let mut all = vec![Section {
        heading: "Both axes".into(),
        text: vec![
            "Errors are relative to the peak of the axis' own reference. An axis that was to rest has the RMS of \
             its motion over the peak of the other axis' reference: what coupling moves it."
                .into(),
        ],
        tables: vec![figures(axes)],
        panels: vec![path(axes)],
        ..Section::default()
    }];
    for axis in axes {
        all.extend(sections(&axis.run).into_iter().map(|section| Section {
            heading: format!("Along {}: {}", axis.name, lower(&section.heading)),
            ..section
        }));
    }
    if let Some(specimen) = &first.run.specimen {
        all.push(Section {
            heading: "The specimen".into(),
            panels: panels::specimen(&first.run, specimen),
            ..Section::default()
        });
    }
    all.push(Section {
        heading: "The motions".into(),
        notes: axes
            .iter()
            .flat_map(|axis| {
                let notes = axis.run.motion.notes.iter();
                notes.map(|note| format!("{}: {note}", axis.name))
            })
            .collect(),
        ..Section::default()
    });
    all.push(what_was_run(&first.run));
    Report {
        title: format!(
            "{} on {} and {}",
            first.run.system, first.run.motion.name, second.run.motion.name
        ),
        summary: sentence(axes),
        identity: first.run.identity.clone(),
        facts: axes.iter().flat_map(facts).collect(),
        sections: all,
        footer: first.run.footer.clone(),
    }
}

/// The heading within a sentence.
fn lower(heading: &str) -> String {
    let mut letters = heading.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_lowercase().chain(letters).collect()
    })
}

fn sentence(axes: &[AxisRun<'_>; 2]) -> String {
    let one = |axis: &AxisRun<'_>| match (axis.run.tracking, axis.at_rest) {
        (Some(tracking), _) => format!(
            "Along {} the table followed the reference with a normalised RMS acceleration error of {:.2} % and a \
             displacement error of {:.2} %.",
            axis.name, tracking.time_domain_percent, tracking.displacement_percent
        ),
        (None, Some([displacement, acceleration])) => format!(
            "Axis {} was to rest and moved by {displacement:.2} % of the other axis' displacement and {acceleration:.2} % \
             of its acceleration (RMS over peak).",
            axis.name
        ),
        (None, None) => format!("Along {} there is no tracking error.", axis.name),
    };
    let run = &axes[0].run;
    let both = format!("{} {}", one(&axes[0]), one(&axes[1]));
    match &run.trip {
        _ if run.ended == "complete" => both,
        Some((time, cause)) => format!("The run was stopped at {time:.3} s: {cause}. {both}"),
        None => format!("The run ended early: {}. {both}", run.ended),
    }
}

fn facts(axis: &AxisRun<'_>) -> Vec<Fact> {
    let named = |text: &str| format!("{}: {text}", axis.name);
    let percent = |value| Cell::Quantity(value, Units::PERCENT, 3);
    let mut facts = Vec::new();
    if let Some(tracking) = axis.run.tracking {
        facts.push(fact(
            &named("acceleration error"),
            percent(tracking.time_domain_percent),
            "RMS over the peak of the reference",
        ));
        facts.push(fact(
            &named("displacement error"),
            percent(tracking.displacement_percent),
            "RMS over the peak of the reference",
        ));
    }
    if let Some([displacement, acceleration]) = axis.at_rest {
        facts.push(fact(
            &named("acceleration at rest"),
            percent(acceleration),
            "RMS over the peak of the other axis",
        ));
        facts.push(fact(
            &named("displacement at rest"),
            percent(displacement),
            "RMS over the peak of the other axis",
        ));
    }
    facts.push(fact(
        &named("peak displacement"),
        Cell::Quantity(peak(axis.run.displacement), Units::DISPLACEMENT, 3),
        "of the table",
    ));
    facts
}

fn figures(axes: &[AxisRun<'_>; 2]) -> Table {
    let rests = axes.iter().any(|axis| axis.at_rest.is_some());
    let mut rows = vec![
        [
            "axis",
            "reference, peak",
            "table, peak",
            "displacement error",
            "acceleration error",
            "Fourier error",
            "delay",
        ]
        .map(Cell::from)
        .to_vec(),
    ];
    if rests {
        rows[0].extend(["displacement at rest", "acceleration at rest"].map(Cell::from));
    }
    for axis in axes {
        let run = &axis.run;
        let played = run.acceleration.len().min(run.motion.len());
        let length = |values: &[f64]| Cell::Quantity(peak(values), Units::DISPLACEMENT, 4);
        let percent = |value: Option<f64>| {
            value.map_or("-".into(), |value| Cell::Quantity(value, Units::PERCENT, 3))
        };
        let mut row = vec![
            axis.name.into(),
            length(&run.motion.displacement[..played]),
            length(run.displacement),
            percent(run.tracking.map(|own| own.displacement_percent)),
            percent(run.tracking.map(|own| own.time_domain_percent)),
            percent(run.tracking.map(|own| own.frequency_domain_percent)),
            run.tracking.map_or("-".into(), |own| {
                Cell::Quantity(1e3 * own.delay, Units::same("ms"), 3)
            }),
        ];
        if rests {
            let at = |n: usize| percent(axis.at_rest.map(|own| own[n]));
            row.extend([at(0), at(1)]);
        }
        rows.push(row);
    }
    Table::headed("", rows)
}

/// The table's way in the plane.
fn path(axes: &[AxisRun<'_>; 2]) -> Panel {
    let [x, y] = axes;
    let played = x.run.displacement.len().min(x.run.motion.len());
    let way = |name: &str, x: &[f64], y: &[f64], colour| {
        Series::line(name, Abscissa::At(x.into()), y.to_vec())
            .styled(Style::Path)
            .coloured(colour)
    };
    Panel {
        title: "Displacement in the plane".into(),
        x: Axis::linear(&format!("along {}", x.name), Units::DISPLACEMENT),
        y: Axis::linear(&format!("along {}", y.name), Units::DISPLACEMENT),
        series: vec![
            way(
                "reference",
                &x.run.motion.displacement[..played],
                &y.run.motion.displacement[..played],
                panels::REFERENCE,
            ),
            way(
                "table",
                x.run.displacement,
                y.run.displacement,
                panels::TABLE,
            ),
        ],
    }
}

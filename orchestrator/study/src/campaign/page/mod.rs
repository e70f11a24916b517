//! The page of a study: the sentence first, then pictures, then tables.

mod pictures;
mod ranking;
mod tables;
mod words;

use super::analysis::{Findings, Method};
use super::table::Table;
use pages::report::{Cell, Report, Section, UnitSystem};

pub use ranking::{sentences, standings};
pub use words::summary;

/// What the page says beside the findings.
#[derive(Debug, Clone, Default)]
pub struct About {
    /// Heading and title.
    pub title: String,
    /// What was studied, in few words.
    pub identity: Vec<(String, Cell)>,
    /// Last line: versions, seed, how to repeat.
    pub footer: String,
    /// Units of its sentences.
    pub units: UnitSystem,
}

/// The page of what `table` says, as [`super::analysis::analyse`] found it.
#[must_use]
pub fn report(table: &Table, findings: &Findings, about: About) -> Report {
    let mut sections = vec![error(table, findings)];
    sections.extend(findings.ranking.as_ref().map(ranking::section));
    sections.push(fragility(findings, about.units));
    sections.extend(importance(findings));
    sections.push(Section {
        heading: "The worst runs".into(),
        text: vec![
            "Failed runs, then stopped runs, both in order of time, then the largest acceleration \
             errors. The command repeats the run with its own report."
                .into(),
        ],
        tables: vec![tables::worst(findings)],
        ..Section::default()
    });
    if !findings.invalid.is_empty() {
        sections.push(Section {
            heading: "Runs that could not begin".into(),
            text: vec![
                "Their input is invalid. They say nothing about the rig, and no figure counts \
                 them. Narrow the factors so that all runs can begin."
                    .into(),
            ],
            tables: vec![tables::invalid(findings)],
            ..Section::default()
        });
    }
    sections.push(Section {
        heading: "All figures".into(),
        text: vec![words::QUANTILES.into()],
        tables: tables::quantiles(findings),
        ..Section::default()
    });
    Report {
        title: about.title,
        summary: summary(findings, about.units),
        identity: about.identity,
        facts: tables::facts(findings),
        sections,
        footer: about.footer,
    }
}

fn error(table: &Table, findings: &Findings) -> Section {
    Section {
        heading: "Tracking".into(),
        text: vec![
            "Acceleration error: RMS over the peak of the reference. Bars: median, with 5th and \
             95th percentile."
                .into(),
        ],
        bars: pictures::errors(findings).into_iter().collect(),
        panels: pictures::scatter(table, findings).into_iter().collect(),
        tables: vec![tables::standings(findings)],
        ..Section::default()
    }
}

fn fragility(findings: &Findings, units: UnitSystem) -> Section {
    Section {
        heading: "Fragility".into(),
        text: vec![words::fragility(findings)],
        notes: words::without_curve(findings, units),
        panels: pictures::fragility(findings, units),
        tables: tables::fragility(findings, units),
        ..Section::default()
    }
}

fn importance(findings: &Findings) -> Option<Section> {
    let first = findings.importance.first()?;
    let how = match first.method {
        Method::Sobol => words::SOBOL,
        Method::CorrelationRatio => words::ALONE,
    };
    Some(Section {
        heading: "Which factor matters".into(),
        text: vec![how.into()],
        notes: findings.importance.iter().map(words::importance).collect(),
        bars: findings
            .importance
            .iter()
            .map(pictures::importance)
            .collect(),
        tables: tables::importance(findings),
        ..Section::default()
    })
}

#[cfg(test)]
mod tests;

//! Who is better on the points that they share: for a terminal and on the page.

use crate::campaign::analysis::Ranking;
use pages::report::number::significant;
use pages::report::{Bar, BarGroup, Bars, Section, Table};

/// Heads, then one row per value.
#[must_use]
pub fn standings(ranking: &Ranking) -> Vec<Vec<String>> {
    let mut heads = vec![ranking.factor.clone()];
    heads.extend(ranking.among.iter().cloned());
    let figures = ["complete", "tripped", "failed", "error 5 %", "50 %", "95 %"];
    heads.extend(figures.map(String::from));
    let mut rows = vec![heads];
    let cell = |value: Option<f64>| value.map_or("-".to_string(), |value| significant(value, 3));
    for own in &ranking.standings {
        let mut row = vec![own.value.clone()];
        row.extend(own.among.iter().cloned());
        row.extend([own.complete, own.tripped, own.failed].map(|count| count.to_string()));
        let spread = own.error_percent;
        row.extend([spread.p5, spread.p50, spread.p95].map(cell));
        rows.push(row);
    }
    rows
}

/// A sentence for each pair of neighbours.
#[must_use]
pub fn sentences(ranking: &Ranking) -> Vec<String> {
    let pairs = ranking.pairs.iter().map(|pair| {
        let [low, high] = pair.difference_percent;
        let certain = if low > 0.0 { "" } else { " (not certain)" };
        let others = ranking.among.iter().zip(&pair.among);
        let others: String = others
            .map(|(name, value)| format!("{name} {value}: "))
            .collect();
        format!(
            "{others}{} before {} at {:.0} % of the points, by {} to {} % in the median{certain}",
            pair.better,
            pair.worse,
            100.0 * pair.part,
            difference(low),
            difference(high),
        )
    });
    pairs.collect()
}

/// A difference of two medians; without end where one of them is of runs that were not played to theirs.
fn difference(percent: f64) -> String {
    match percent.is_finite() {
        true => significant(percent, 2),
        false if percent > 0.0 => "∞".to_string(),
        false => "-∞".to_string(),
    }
}

/// The part of the page.
pub(super) fn section(ranking: &Ranking) -> Section {
    let mut groups: Vec<BarGroup> = Vec::new();
    let mut names: Vec<String> = Vec::new();
    for own in &ranking.standings {
        let Some(middle) = own.error_percent.p50 else {
            continue;
        };
        let name = match own.among.is_empty() {
            true => ranking.factor.clone(),
            false => own.among.join(", "),
        };
        let colour = names
            .iter()
            .position(|known| *known == name)
            .unwrap_or_else(|| {
                names.push(name.clone());
                names.len() - 1
            });
        let bar = Bar {
            name,
            value: middle,
            interval: own
                .error_percent
                .p5
                .zip(own.error_percent.p95)
                .map(|(a, b)| [a, b]),
            colour: colour + 1,
        };
        match groups.iter_mut().find(|group| group.label == own.value) {
            Some(group) => group.bars.push(bar),
            None => groups.push(BarGroup {
                label: own.value.clone(),
                bars: vec![bar],
            }),
        }
    }
    Section {
        heading: "On the same points".into(),
        text: vec![format!(
            "Every {} was run at each of {} points of the design. Mean acceleration error at a \
             point; a point with a stopped or failed run counts as worse than any other. The \
             order of two neighbours is certain if the 95 % interval of the difference of their \
             medians, from resampling the points, does not contain zero. Bars: median, with 5th \
             and 95th percentile.",
            ranking.factor, ranking.points
        )],
        notes: sentences(ranking),
        bars: vec![Bars {
            title: "Acceleration error, %".into(),
            groups,
            mark: None,
        }],
        tables: vec![Table::headed("Standings", standings(ranking))],
        ..Section::default()
    }
}

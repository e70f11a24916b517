//! The study as a table and as a page.

use super::{DesignedOn, Study};
use crate::report::number::significant;
use crate::report::{Bar, BarGroup, Bars, Report, Section, Table};

fn word(design: DesignedOn) -> &'static str {
    match design {
        DesignedOn::Nominal => "nominal rig",
        DesignedOn::Own => "its own recordings",
    }
}

/// Heads, then a row a standing.
pub(super) fn table(study: &Study) -> Vec<Vec<String>> {
    let heads = [
        "controller",
        "designed on",
        "complete",
        "tripped",
        "none",
        "error 5 %",
        "50 %",
        "95 %",
    ];
    let mut rows = vec![heads.map(String::from).to_vec()];
    let cell = |value: Option<f64>| value.map_or("-".to_string(), |value| significant(value, 3));
    for own in &study.standings {
        let spread = own.error_percent;
        rows.push(vec![
            own.controller.clone(),
            word(own.designed_on).to_string(),
            own.complete.to_string(),
            own.tripped.to_string(),
            own.none.to_string(),
            cell(spread.p5),
            cell(spread.p50),
            cell(spread.p95),
        ]);
    }
    rows
}

/// A sentence for each pair of neighbours.
pub(super) fn ranking(study: &Study) -> Vec<String> {
    let sentence = |pair: &super::Pair| {
        let [low, high] = pair.difference_percent;
        let certain = if low > 0.0 { "" } else { " (not certain)" };
        format!(
            "designed on {}: {} before {} on {:.0} % of the rigs, by {} to {} % in the median{certain}",
            word(pair.designed_on),
            pair.better,
            pair.worse,
            100.0 * pair.part,
            significant(low, 2),
            significant(high, 2),
        )
    };
    study.ranking.iter().map(sentence).collect()
}

/// The page.
pub(super) fn page(study: &Study) -> Report {
    let mut groups: Vec<BarGroup> = Vec::new();
    for own in &study.standings {
        let Some(middle) = own.error_percent.p50 else {
            continue;
        };
        let bar = Bar {
            name: format!("designed on {}", word(own.designed_on)),
            value: middle,
            interval: own
                .error_percent
                .p5
                .zip(own.error_percent.p95)
                .map(|(a, b)| [a, b]),
            colour: match own.designed_on {
                DesignedOn::Nominal => 1,
                DesignedOn::Own => 2,
            },
        };
        match groups
            .last_mut()
            .filter(|group| group.label == own.controller)
        {
            Some(group) => group.bars.push(bar),
            None => groups.push(BarGroup {
                label: own.controller.clone(),
                bars: vec![bar],
            }),
        }
    }
    let failed: Vec<String> = study
        .rows
        .iter()
        .filter_map(|row| {
            let reason = row.not_commissioned.as_ref()?;
            Some(format!("rig {}: {reason}", row.rig.number))
        })
        .collect();
    Report {
        title: format!("{} rigs", study.rows.len()),
        summary: ranking(study).first().cloned().unwrap_or_default(),
        sections: vec![
            Section {
                heading: "Controllers".into(),
                text: vec![format!(
                    "Rigs drawn about the physical one: payload 0 to 50 % of the table, oil stiffness \
                     and valve gain 80 to 120 %, dry friction 0.5 to 2, supply 85 to 115 %, noise 0.5 \
                     to 2. Mean time-domain error of the acceleration over {}; bars: median, with 5th \
                     and 95th percentile.",
                    study.motions.join(", ")
                )],
                bars: vec![Bars {
                    title: "Error of the acceleration, %".into(),
                    groups,
                    mark: None,
                }],
                tables: vec![Table::headed("Standings", table(study))],
                ..Section::default()
            },
            Section {
                heading: "Ranking".into(),
                notes: ranking(study),
                ..Section::default()
            },
            Section {
                heading: "Rigs without controllers of their own".into(),
                notes: failed,
                ..Section::default()
            },
        ],
        footer: format!(
            "shakebench {}; seed {}",
            env!("CARGO_PKG_VERSION"),
            study.seed
        ),
        ..Report::default()
    }
}

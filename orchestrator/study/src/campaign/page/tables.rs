//! Tables and large figures.

use super::words;
use crate::campaign::analysis::{
    ERROR, Ended, Findings, Fit, Group, Importance, Method, Quantiles,
};
use pages::report::{Cell, Fact, Table, UnitSystem, Units};

/// Values of one factor that get a row each.
const MOST_VALUES: usize = 40;

fn optional(value: Option<f64>, units: &Units) -> Cell {
    match value {
        Some(value) => Cell::Quantity(value, units.clone(), 3),
        None => NOTHING,
    }
}

/// Shown as a dash.
const NOTHING: Cell = Cell::Number(f64::NAN, 1);

fn whole(number: usize) -> Cell {
    Cell::Number(number as f64, number.to_string().len())
}

/// Shares of the endings.
pub(super) fn facts(findings: &Findings) -> Vec<Fact> {
    let Some(all) = findings.groups.first() else {
        return Vec::new();
    };
    let endings = all.endings;
    let fact = |label: &str, part: usize| Fact {
        label: label.into(),
        value: words::percent(part, endings.runs).into(),
        note: format!("{} of {}", words::count(part), words::count(endings.runs)),
    };
    vec![
        fact("Played to the end", endings.complete),
        fact("Stopped by the interlock", endings.interlock),
        fact("Failed", endings.failed),
    ]
}

const PARTS: [&str; 5] = ["5 %", "25 %", "50 %", "75 %", "95 %"];

fn parts(own: Option<&Quantiles>, units: &Units) -> Vec<Cell> {
    let values = own.map_or([None; 5], |own| {
        [own.p5, own.p25, own.p50, own.p75, own.p95]
    });
    values.iter().map(|value| optional(*value, units)).collect()
}

fn name(group: &Group) -> &str {
    if group.factor.is_some() {
        &group.value
    } else {
        "all"
    }
}

/// Endings and quantiles of the error of what is compared.
pub(super) fn standings(findings: &Findings) -> Table {
    let heads = ["runs of", "number", "complete", "stopped", "failed"];
    let mut rows = vec![
        heads
            .iter()
            .chain(&PARTS)
            .map(|head| Cell::from(*head))
            .collect(),
    ];
    rows.extend(words::compared(findings).into_iter().map(|group| {
        let endings = group.endings;
        let mut row = vec![Cell::from(name(group)), whole(endings.runs)];
        row.extend([endings.complete, endings.interlock, endings.failed].map(whole));
        row.extend(parts(group.figure(ERROR), &Units::PERCENT));
        row
    }));
    Table::headed("Endings, and quantiles of the acceleration error", rows)
}

/// Every figure over all runs, then the error over the values of each list.
pub(super) fn quantiles(findings: &Findings) -> Vec<Table> {
    let Some(all) = findings.groups.first() else {
        return Vec::new();
    };
    let units = |own: &Quantiles| words::units(&own.figure, own.unit.as_deref());
    let head = |first: &str| -> Vec<Cell> {
        let heads = [first, "runs"].into_iter().chain(PARTS);
        heads.map(Cell::from).collect()
    };
    let mut rows = vec![head("figure")];
    rows.extend(all.figures.iter().map(|own| {
        let mut row = vec![Cell::from(words::label(&own.figure)), whole(own.runs)];
        row.extend(parts(Some(own), &units(own)));
        row
    }));
    let mut tables = vec![Table::headed("Quantiles over all runs", rows)];
    let mut factors: Vec<&str> = Vec::new();
    for factor in findings
        .groups
        .iter()
        .filter_map(|group| group.factor.as_deref())
    {
        if !factors.contains(&factor) {
            factors.push(factor);
        }
    }
    for factor in factors {
        let groups = || {
            let own = findings.groups.iter();
            own.filter(|group| group.factor.as_deref() == Some(factor))
        };
        for figure in compared_figures(findings) {
            let mut rows = vec![head(factor)];
            rows.extend(groups().take(MOST_VALUES).filter_map(|group| {
                let own = group.figure(figure)?;
                let mut row = vec![Cell::from(group.value.as_str()), whole(own.runs)];
                row.extend(parts(Some(own), &units(own)));
                Some(row)
            }));
            let more = groups().count().saturating_sub(MOST_VALUES);
            let mut caption = format!("{} by {factor}", words::capital(&words::label(figure)));
            if more > 0 {
                caption += &format!(" (the first {MOST_VALUES}; {more} more)");
            }
            tables.push(Table::headed(&caption, rows));
        }
    }
    tables
}

/// The error, and the figures that have limits.
fn compared_figures(findings: &Findings) -> Vec<&str> {
    let mut all = vec![ERROR];
    for own in findings
        .fragility
        .iter()
        .filter_map(|own| own.column.as_deref())
    {
        if !all.contains(&own) {
            all.push(own);
        }
    }
    all
}

/// The curves' medians and dispersions, one table per limit.
pub(super) fn fragility(findings: &Findings, system: UnitSystem) -> Vec<Table> {
    let units = words::intensity_units(findings);
    let heads = [
        "runs of",
        "number",
        "exceed",
        "unknown",
        "median",
        "from",
        "to",
        "dispersion",
        "from",
        "to",
    ];
    let limits = findings.fragility.chunk_by(|a, b| a.limit == b.limit);
    limits
        .map(|curves| {
            let mut rows = vec![heads.map(Cell::from).to_vec()];
            rows.extend(curves.iter().map(|own| {
                let mut row = vec![
                    Cell::from(own.controller.as_deref().unwrap_or("all")),
                    whole(own.runs),
                    words::percent(own.exceeded, own.runs).into(),
                    whole(own.unknown),
                ];
                if let Fit::Lognormal(fit) = &own.fit {
                    let [low, high] = fit.median_band;
                    row.extend([fit.median, low, high].map(|own| optional(Some(own), &units)));
                    let [low, high] = fit.dispersion_band;
                    row.extend([fit.dispersion, low, high].map(|own| Cell::Number(own, 3)));
                } else {
                    row.extend([NOTHING; 6]);
                }
                row
            }));
            let caption = format!(
                "{}: intensity at which half of the runs exceed the limit, and deviation of its \
                 logarithm, with 95 % intervals",
                words::limit(&curves[0], system)
            );
            Table::headed(&caption, rows)
        })
        .collect()
}

/// The shares of every factor, one table per outcome.
pub(super) fn importance(findings: &Findings) -> Vec<Table> {
    let percent = |share: f64| Cell::Quantity(100.0 * share, Units::PERCENT, 3);
    let table = |own: &Importance| {
        let mut heads = vec!["factor", "alone", "from", "to"];
        if own.method == Method::Sobol {
            heads.extend(["in total", "from", "to"]);
        }
        let mut rows = vec![heads.into_iter().map(Cell::from).collect()];
        rows.extend(own.factors.iter().map(|factor| {
            let mut row = vec![Cell::from(factor.factor.as_str()), percent(factor.alone)];
            row.extend(factor.alone_band.map(percent));
            if let (Some(total), Some(band)) = (factor.total, factor.total_band) {
                row.push(percent(total));
                row.extend(band.map(percent));
            }
            row
        }));
        let outcome = words::capital(&words::outcome(own));
        Table::headed(
            &format!("{outcome}: share of its variance, with 95 % intervals"),
            rows,
        )
    };
    findings.importance.iter().map(table).collect()
}

/// The worst runs and their commands.
pub(super) fn worst(findings: &Findings) -> Table {
    let heads = ["run", "ended", "acceleration error", "repeat it with"];
    let mut rows = vec![heads.map(Cell::from).to_vec()];
    for own in &findings.worst {
        let word = match own.ended {
            Ended::Complete => "complete",
            Ended::Interlock => "stopped",
            Ended::Failed => "failed",
        };
        let mut ended = word.to_string();
        if own.ended != Ended::Complete {
            if let Some(at) = own.ended_s {
                ended += &format!(" at {at:.2} s");
            }
            if let Some(reason) = &own.reason {
                ended += &format!(": {reason}");
            }
        }
        rows.push(vec![
            Cell::Text(own.number.to_string()),
            ended.into(),
            optional(own.time_domain_percent, &Units::PERCENT),
            own.command.as_str().into(),
        ]);
    }
    Table::headed("", rows)
}

/// Runs that could not begin, by their fault.
pub(super) fn invalid(findings: &Findings) -> Table {
    let heads = ["runs", "first", "reason"];
    let mut rows = vec![heads.map(Cell::from).to_vec()];
    rows.extend(findings.invalid.iter().map(|own| {
        vec![
            Cell::Text(own.runs.to_string()),
            Cell::Text(own.first.to_string()),
            own.reason.as_str().into(),
        ]
    }));
    Table::headed("", rows)
}

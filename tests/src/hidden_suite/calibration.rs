//! Whether what is stated is true: confidences and intervals of several worlds beside each other.

use std::fmt::Write as _;

use hidden_effects::Outcome;
use hidden_effects::score::{names, wilson};
use pages::report::{Abscissa, Axis, Panel, Series, Style, Units};

use super::tables::{DEVIATE_95, held, quantile, sorted};
use super::{Plan, Scored};

/// Shares of an interval, and its half-width in standard errors.
const INTERVALS: [(f64, f64); 6] = [
    (0.5, 0.6745),
    (0.68, 0.9945),
    (0.8, 1.2816),
    (0.9, 1.6449),
    (0.95, DEVIATE_95),
    (0.99, 2.5758),
];

/// Bounds of the confidences that are counted together.
pub(super) const SURE: [f64; 4] = [0.0, 0.5, 0.9, 1.0];

/// Names whose stated confidences lie together.
pub(super) struct Names {
    /// From where to where.
    pub(super) bounds: [f64; 2],
    /// Mean of what was stated.
    pub(super) stated: f64,
    /// How many.
    pub(super) named: usize,
    /// Of effects that are there.
    pub(super) there: usize,
}

/// All names by how sure they are said to be.
pub(super) fn by_confidence(results: &[Scored]) -> Vec<Names> {
    let all: Vec<(f64, bool)> = results
        .iter()
        .flat_map(|scored| names(&scored.truth, &scored.verdict))
        .collect();
    let groups = SURE.windows(2).filter_map(|bounds| {
        let last = bounds[1] == 1.0;
        let within = |sure: f64| bounds[0] <= sure && (sure < bounds[1] || last);
        let own: Vec<&(f64, bool)> = all.iter().filter(|(sure, _)| within(*sure)).collect();
        (!own.is_empty()).then(|| Names {
            bounds: [bounds[0], bounds[1]],
            stated: own.iter().map(|(sure, _)| sure).sum::<f64>() / own.len() as f64,
            named: own.len(),
            there: own.iter().filter(|(_, there)| *there).count(),
        })
    });
    groups.collect()
}

/// Against what is stated, how often it is true: as a line of each world the intervals of the parameters, as upright
/// strokes the 95 % intervals of all names together. On the diagonal statements are worth what they say, above
/// it more.
pub fn picture(worlds: &[(String, Vec<Scored>)]) -> Panel {
    let mut series = vec![
        Series::stroke("as stated", [45.0, 45.0], [100.0, 100.0])
            .styled(Style::Dashed)
            .coloured(0),
    ];
    for (world, results) in worlds {
        let parameters: usize = results.iter().map(|r| r.errors.len()).sum();
        let share = |deviate| 100.0 * held(results, deviate) as f64 / parameters.max(1) as f64;
        series.push(Series::line(
            world,
            Abscissa::At(INTERVALS.iter().map(|(p, _)| 100.0 * p).collect()),
            INTERVALS.iter().map(|(_, z)| share(*z)).collect(),
        ));
    }
    let all: Vec<Scored> = worlds.iter().flat_map(|(_, r)| r.clone()).collect();
    for names in by_confidence(&all) {
        let (low, high) = wilson(names.there, names.named);
        let stated = 100.0 * names.stated;
        let name = format!("{} names", names.named);
        series.push(Series::stroke(
            &name,
            [stated, 100.0 * low],
            [stated, 100.0 * high],
        ));
    }
    Panel {
        title: "Stated and true".to_string(),
        x: Axis::linear("stated", Units::PERCENT).between(45.0, 101.0),
        y: Axis::linear("true", Units::PERCENT).between(45.0, 101.0),
        series,
    }
}

/// The worlds as the columns of one table, in Markdown.
pub fn beside_each_other(worlds: &[(String, Vec<Scored>)]) -> String {
    let mut text = String::from("| right / all |");
    for (world, _) in worlds {
        let _ = write!(text, " {world} |");
    }
    let _ = writeln!(text, "\n|---|{}", "---|".repeat(worlds.len()));
    let mut row = |name: &str, cell: &dyn Fn(&[Scored]) -> String| {
        let _ = write!(text, "| {name} |");
        for (_, results) in worlds {
            let _ = write!(text, " {} |", cell(results));
        }
        text.push('\n');
    };
    let count = |results: &[Scored], kind: &str, outcome| {
        let own = results.iter().filter(|r| kind.is_empty() || r.kind == kind);
        own.filter(|r| r.outcome == outcome).count()
    };
    for (name, kind) in Plan::KINDS {
        row(name, &|results| {
            let all = results.iter().filter(|r| r.kind == kind).count();
            format!("{} / {all}", count(results, kind, Outcome::Right))
        });
    }
    row("all, 95 % interval", &|results| {
        let (low, high) = wilson(count(results, "", Outcome::Right), results.len());
        format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high)
    });
    row("named wrongly", &|results| {
        count(results, "", Outcome::Wrong).to_string()
    });
    row("parameter error, median", &|results| {
        let errors = sorted(results, |r| r.errors.iter().map(|e| e.relative).collect());
        let median = (!errors.is_empty()).then(|| quantile(&errors, 0.5));
        median.map_or("-".into(), |median| format!("{:.2} %", 100.0 * median))
    });
    row("95 % intervals that hold the truth", &|results| {
        let all: usize = results.iter().map(|r| r.errors.len()).sum();
        let share = held(results, DEVIATE_95) as f64 / all.max(1) as f64;
        format!("{:.1} % of {all}", 100.0 * share)
    });
    row("seconds of one core, median (mean, longest)", &|results| {
        let seconds = sorted(results, |r| vec![r.seconds]);
        let mean = seconds.iter().sum::<f64>() / seconds.len().max(1) as f64;
        let longest = seconds.last().copied().unwrap_or(f64::NAN);
        let median = (!seconds.is_empty()).then(|| quantile(&seconds, 0.5));
        let median = median.unwrap_or(f64::NAN);
        format!("{median:.1} ({mean:.1}, {longest:.0})")
    });
    text
}

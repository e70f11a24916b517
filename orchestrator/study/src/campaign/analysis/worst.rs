//! The worst runs, with what repeats them.

use serde::Serialize;

use super::ERROR;
use super::endings::{Ended, Runs};

/// Number of runs in the list.
const MOST: usize = 10;

/// A run that went badly.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Worst {
    /// Its number.
    pub number: usize,
    /// How it ended.
    pub ended: Ended,
    /// Why, where it was not played to its end.
    pub reason: Option<String>,
    /// When it ended, s.
    pub ended_s: Option<f64>,
    /// Time-domain error over what was played, %.
    pub time_domain_percent: Option<f64>,
    /// The command that repeats it.
    pub command: String,
}

/// Failed runs first, then stopped ones, each the earliest first; then the largest error.
pub(super) fn worst(runs: &Runs, command: &dyn Fn(usize) -> String) -> Vec<Worst> {
    let table = runs.table;
    let finite = |column: &str, run: usize| -> Option<f64> {
        let own = table.rows[run][table.place(column)?].number()?;
        Some(own).filter(|own| own.is_finite())
    };
    let mut rows: Vec<(Ended, f64, usize)> = runs
        .all()
        .into_iter()
        .map(|run| match runs.ended(run) {
            Ended::Complete => (
                Ended::Complete,
                finite(ERROR, run).unwrap_or(f64::NEG_INFINITY),
                run,
            ),
            early => (early, -finite("ended_s", run).unwrap_or(0.0), run),
        })
        .collect();
    rows.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)));
    let numbers = table.numbers("number");
    let reasons = table.texts("reason");
    rows.into_iter()
        .take(MOST)
        .map(|(ended, _, run)| {
            let number = numbers.get(run).filter(|own| own.is_finite());
            let number = number.map_or(run, |own| *own as usize);
            let reason = reasons.get(run).filter(|own| !own.is_empty());
            Worst {
                number,
                ended,
                reason: reason.map(|own| (*own).to_string()),
                ended_s: finite("ended_s", run),
                time_domain_percent: finite(ERROR, run),
                command: command(number),
            }
        })
        .collect()
}

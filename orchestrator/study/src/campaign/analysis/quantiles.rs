//! Quantiles of the figures of tracking.

use serde::Serialize;

use super::endings::{Ended, Runs};
use super::percentile::percentile;
use crate::campaign::table::{Kind, Role};

/// Figures of the motion that was played, not of how it was followed.
const OF_THE_MOTION: [&str; 2] = ["pga_g", "peak_reference_m"];

/// Which runs a quantile is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// All; those that were stopped or failed count as worse than any other.
    All,
    /// Those that were played to their end: of a figure that is not better when it is smaller.
    Complete,
}

/// 5, 25, 50, 75 and 95 % of the runs have at most this; absent where so many were not played to
/// their end.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantiles {
    /// The column.
    pub figure: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Which runs they are over.
    pub over: Over,
    /// How many these are.
    pub runs: usize,
    /// 5 %.
    pub p5: Option<f64>,
    /// 25 %.
    pub p25: Option<f64>,
    /// 50 %.
    pub p50: Option<f64>,
    /// 75 %.
    pub p75: Option<f64>,
    /// 95 %.
    pub p95: Option<f64>,
}

/// The quantiles of every figure over the given rows.
pub(super) fn quantiles(runs: &Runs, rows: &[usize], intensity: &str) -> Vec<Quantiles> {
    let columns = runs.table.columns.iter().filter(|column| {
        column.role == Role::Result
            && column.kind == Kind::Number
            && column.name != intensity
            && !OF_THE_MOTION.contains(&column.name.as_str())
    });
    columns
        .map(|column| {
            let numbers = runs.table.numbers(&column.name);
            let is_error = column.name.ends_with("_percent") || column.name.contains("_error_");
            let over = if is_error { Over::All } else { Over::Complete };
            let mut own: Vec<f64> = rows
                .iter()
                .filter_map(|&run| match (runs.ended(run), over) {
                    (Ended::Complete, _) => Some(numbers[run]).filter(|own| !own.is_nan()),
                    (_, Over::All) => Some(f64::INFINITY),
                    (_, Over::Complete) => None,
                })
                .collect();
            own.sort_by(f64::total_cmp);
            let at = |part| Some(percentile(&own, part)).filter(|own| own.is_finite());
            Quantiles {
                figure: column.name.clone(),
                unit: column.unit.clone(),
                over,
                runs: own.len(),
                p5: at(0.05),
                p25: at(0.25),
                p50: at(0.5),
                p75: at(0.75),
                p95: at(0.95),
            }
        })
        .collect()
}

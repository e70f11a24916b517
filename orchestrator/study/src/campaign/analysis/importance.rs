//! Which factor matters: Sobol' indices where the design gives them, else the share of the variance
//! that each factor explains alone.

use serde::Serialize;

use super::endings::{Ended, Runs};
use super::sobol_indices::{self, Banded};
use super::{Design, ERROR, Settings, explained};
use crate::campaign::table::Kind;

/// Runs stopped, and runs not, from which on it is asked which factor stops them.
const FEWEST_STOPPED: usize = 5;

/// What decides over one outcome.
#[derive(Debug, Clone, Serialize)]
pub struct Importance {
    /// The column; none: whether a run was stopped by the interlock.
    pub column: Option<String>,
    /// The values of crossed factors, where the indices are those of their runs.
    pub among: Option<String>,
    /// How the shares were found.
    pub method: Method,
    /// Runs that tell.
    pub runs: usize,
    /// Runs that do not: failed or, of a figure, stopped.
    pub left_out: usize,
    /// The factors, the one that matters most first.
    pub factors: Vec<Share>,
    /// What no factor explains alone: interactions, and what bins do not resolve.
    pub rest: f64,
}

/// How shares of variance were found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Sobol' indices of the design's base samples.
    Sobol,
    /// Correlation ratio of the factor's values, of numbers in bins of equal counts.
    CorrelationRatio,
}

/// A factor's share of the variance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Share {
    /// The factor.
    pub factor: String,
    /// Alone: the first-order index.
    pub alone: f64,
    /// Its 95 % band.
    pub alone_band: [f64; 2],
    /// With all its interactions: the total index.
    pub total: Option<f64>,
    /// Its 95 % band.
    pub total_band: Option<[f64; 2]>,
}

/// An outcome of every run, NaN where it does not tell.
struct Outcome {
    column: Option<String>,
    values: Vec<f64>,
}

pub(super) fn importance(runs: &Runs, settings: &Settings) -> Vec<Importance> {
    let outcomes = outcomes(runs, settings);
    let found = outcomes.iter().flat_map(|outcome| match &settings.design {
        Design::Other => alone(runs, outcome, settings.seed).into_iter().collect(),
        saltelli => sobol(runs, outcome, saltelli, settings.seed),
    });
    found.filter(|own| !own.factors.is_empty()).collect()
}

fn outcomes(runs: &Runs, settings: &Settings) -> Vec<Outcome> {
    let mut columns = vec![ERROR];
    for limit in &settings.limits {
        if !columns.contains(&limit.column.as_str()) {
            columns.push(&limit.column);
        }
    }
    let mut all: Vec<Outcome> = columns
        .into_iter()
        .map(|column| {
            let numbers = runs.table.numbers(column).into_iter().enumerate();
            Outcome {
                column: Some(column.to_string()),
                values: numbers
                    .map(|(run, own)| match runs.ended(run) {
                        Ended::Complete => own,
                        _ => f64::NAN,
                    })
                    .collect(),
            }
        })
        .filter(|outcome| !outcome.values.is_empty())
        .collect();
    let endings = runs.endings(&runs.all());
    if endings.interlock.min(endings.complete) >= FEWEST_STOPPED {
        let values = runs.ended.iter().map(|ended| match ended {
            Ended::Complete => 0.0,
            Ended::Interlock => 1.0,
            Ended::Failed => f64::NAN,
        });
        all.push(Outcome {
            column: None,
            values: values.collect(),
        });
    }
    all
}

/// Indices for each combination of crossed values.
fn sobol(runs: &Runs, outcome: &Outcome, design: &Design, seed: u64) -> Vec<Importance> {
    let Design::Saltelli {
        sampled,
        crossed,
        crossings,
        rows,
    } = design
    else {
        return Vec::new();
    };
    let table = runs.table;
    let places: Vec<usize> = sampled
        .iter()
        .filter_map(|name| table.place(name))
        .collect();
    if places.len() != sampled.len() || sampled.is_empty() {
        return Vec::new();
    }
    let found = (0..*crossings).filter_map(|crossing| {
        let own = rows.iter().skip(crossing).step_by(*crossings);
        let own: Vec<Option<usize>> = own.copied().collect();
        let blocks = own.chunks_exact(sampled.len() + 2);
        let values: Vec<Vec<f64>> = blocks
            .filter(|block| is_mixed(runs, &places, block))
            .map(|block| {
                let values = block.iter().map(|run| run.map(|run| outcome.values[run]));
                values.map(|own| own.unwrap_or(f64::NAN)).collect()
            })
            .collect();
        let told = values.iter().flatten();
        let told = told.filter(|own| own.is_finite()).count();
        let indices = sobol_indices::indices(&values, sampled.len(), seed)?;
        let shares = sampled.iter().zip(&indices);
        let shares = shares.map(|(factor, (one, all))| Share {
            total: Some(all.value),
            total_band: Some(all.band),
            ..Share::alone(factor, *one)
        });
        let among = own
            .iter()
            .flatten()
            .next()
            .map(|&run| words(runs, crossed, run));
        let among = among.filter(|own| !own.is_empty());
        Some(Importance::of(
            outcome,
            Method::Sobol,
            shares.collect(),
            told,
            own.len(),
            among,
        ))
    });
    found.collect()
}

/// The values that a run has of some factors.
fn words(runs: &Runs, factors: &[String], run: usize) -> String {
    let words = factors.iter().filter_map(|name| {
        let cell = &runs.table.rows[run][runs.table.place(name)?];
        let text = cell.text().map(str::to_string);
        text.or(cell.number().map(|number| number.to_string()))
    });
    words.collect::<Vec<_>>().join(", ")
}

/// Whether runs are a base sample, its mixed samples and the other base sample, as far as they are
/// there.
fn is_mixed(runs: &Runs, places: &[usize], block: &[Option<usize>]) -> bool {
    let cell = |row: usize, place: usize| Some(&runs.table.rows[block[row]?][place]);
    let last = block.len() - 1;
    block[0].is_some()
        && block[last].is_some()
        && places.iter().enumerate().all(|(factor, &place)| {
            (1..last).all(|row| {
                let from = if row == factor + 1 { last } else { 0 };
                block[row].is_none() || cell(row, place) == cell(from, place)
            })
        })
}

/// What each varied factor explains alone.
fn alone(runs: &Runs, outcome: &Outcome, seed: u64) -> Option<Importance> {
    let rows: Vec<usize> = (0..runs.len())
        .filter(|&run| outcome.values[run].is_finite())
        .collect();
    let values: Vec<f64> = rows.iter().map(|&run| outcome.values[run]).collect();
    let shares = runs.varied().into_iter().filter_map(|name| {
        let place = runs.table.place(name)?;
        let groups = match runs.list(name) {
            Some(list) => {
                let own: Option<Vec<usize>> = rows.iter().map(|&run| list.places[run]).collect();
                own?
            }
            None if runs.table.columns[place].kind == Kind::Number => {
                let numbers = runs.table.numbers(name);
                let own: Vec<f64> = rows.iter().map(|&run| numbers[run]).collect();
                explained::bins(&own)
            }
            None => return None,
        };
        Some(Share::alone(
            name,
            explained::share(&values, &groups, seed)?,
        ))
    });
    let shares = shares.collect();
    let method = Method::CorrelationRatio;
    Some(Importance::of(
        outcome,
        method,
        shares,
        rows.len(),
        runs.len(),
        None,
    ))
}

impl Importance {
    fn of(
        outcome: &Outcome,
        method: Method,
        mut factors: Vec<Share>,
        told: usize,
        asked: usize,
        among: Option<String>,
    ) -> Self {
        factors.sort_by(|a, b| b.size().total_cmp(&a.size()));
        let sum: f64 = factors.iter().map(|own| own.alone).sum();
        Self {
            column: outcome.column.clone(),
            among,
            method,
            runs: told,
            left_out: asked - told,
            factors,
            rest: (1.0 - sum).max(0.0),
        }
    }
}

impl Share {
    fn alone(factor: &str, found: Banded) -> Self {
        Self {
            factor: factor.to_string(),
            alone: found.value,
            alone_band: found.band,
            total: None,
            total_band: None,
        }
    }

    /// What it is sorted by: all that it has a part in.
    #[must_use]
    pub fn size(&self) -> f64 {
        self.total.unwrap_or(self.alone)
    }
}

//! Who is better than whom, on the same points of a design: a ranking with its certainty.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::percentile::percentile;
use crate::campaign::table::Table;
use fmi_master::Ending;

/// 5th, 50th and 95th percentile; absent where so many points were not played to their end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// 5th.
    pub p5: Option<f64>,
    /// 50th.
    pub p50: Option<f64>,
    /// 95th.
    pub p95: Option<f64>,
}

/// A value of the ranked factor over all points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Standing {
    /// The other crossed factors' values, the same for all that are compared.
    pub among: Vec<String>,
    /// The value.
    pub value: String,
    /// Points at which every run was played to its end.
    pub complete: usize,
    /// Points at which an interlock stopped a run.
    pub tripped: usize,
    /// Points at which a run failed or is missing.
    pub failed: usize,
    /// Mean error at a point, %; a point that is not complete counts as worse than any other.
    pub error_percent: Spread,
}

/// Two neighbours in the ranking.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pair {
    /// As in [`Standing`].
    pub among: Vec<String>,
    /// The better by the median.
    pub better: String,
    /// The worse.
    pub worse: String,
    /// Part of the points at which it is better.
    pub part: f64,
    /// 95 % interval of the difference of the medians (worse less better), %, by resampling the points;
    /// the order is certain where it does not hold zero.
    pub difference_percent: [f64; 2],
}

/// A factor's values ranked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranking {
    /// The factor.
    pub factor: String,
    /// The other crossed factors that are texts.
    pub among: Vec<String>,
    /// Points of the design.
    pub points: usize,
    /// The values in the order of the study, for each set of the others.
    pub standings: Vec<Standing>,
    /// Neighbours by the median.
    pub pairs: Vec<Pair>,
}

/// How often the points are resampled.
const RESAMPLED: usize = 1000;

/// The runs at a point for one value.
#[derive(Clone, Default)]
struct Runs {
    errors: Vec<f64>,
    tripped: bool,
    failed: bool,
}

impl Runs {
    /// The mean error, infinite where there is none.
    fn error(&self) -> f64 {
        match self.errors.is_empty() || self.tripped || self.failed {
            true => f64::INFINITY,
            false => self.errors.iter().sum::<f64>() / self.errors.len() as f64,
        }
    }
}

/// What is ranked.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranked {
    /// The factor, one that is crossed with every point.
    pub factor: String,
    /// Other crossed factors that part the comparison; over the rest the mean is taken.
    pub among: Vec<String>,
    /// Runs at each point, which follow each other.
    pub crossings: u64,
}

/// Ranks the values of a factor by `figure` over points that they share.
#[must_use]
pub fn ranking(table: &Table, ranked: &Ranked, figure: &str, seed: u64) -> Ranking {
    let Ranked {
        factor,
        among,
        crossings,
    } = ranked;
    let numbers = table.numbers("number");
    let values = table.texts(factor);
    let others: Vec<Vec<&str>> = among.iter().map(|name| table.texts(name)).collect();
    let errors = table.numbers(figure);
    let ended = table.texts("ended");
    let points = numbers.iter().map(|n| (*n as u64) / (*crossings).max(1));
    let points: Vec<u64> = points.collect();
    // Points that are the same run have one row among them, and are one.
    let mut known = points.clone();
    known.sort_unstable();
    known.dedup();
    let count = known.len();
    let points: Vec<usize> = points
        .iter()
        .map(|point| known.partition_point(|own| own < point))
        .collect();
    // In the order in which they come.
    let mut groups: Vec<Vec<String>> = Vec::new();
    let mut names: Vec<String> = Vec::new();
    let mut runs: Vec<Vec<Vec<Runs>>> = Vec::new();
    for row in 0..table.rows.len() {
        let group: Vec<String> = others.iter().map(|own| own[row].to_string()).collect();
        let place = |all: &mut Vec<Vec<String>>, one: Vec<String>| {
            let known = all.iter().position(|own| *own == one);
            known.unwrap_or_else(|| {
                all.push(one);
                all.len() - 1
            })
        };
        let group = place(&mut groups, group);
        let name = names.iter().position(|own| own == values[row]);
        let name = name.unwrap_or_else(|| {
            names.push(values[row].to_string());
            names.len() - 1
        });
        if runs.len() <= group {
            runs.resize(group + 1, Vec::new());
        }
        if runs[group].len() <= name {
            runs[group].resize(name + 1, vec![Runs::default(); count]);
        }
        let own = &mut runs[group][name][points[row]];
        match ended[row] {
            word if word == Ending::Interlock.word() => own.tripped = true,
            word if word == Ending::Complete.word() && errors[row].is_finite() => {
                own.errors.push(errors[row]);
            }
            _ => own.failed = true,
        }
    }
    let mut standings = Vec::new();
    let mut pairs = Vec::new();
    for (group, runs) in groups.iter().zip(&runs) {
        let mut order = Vec::new();
        for (name, runs) in names.iter().zip(runs) {
            let errors: Vec<f64> = runs.iter().map(Runs::error).collect();
            let sorted = sorted(&errors);
            let complete = sorted.iter().filter(|own| own.is_finite()).count();
            let tripped = runs.iter().filter(|own| own.tripped && !own.failed).count();
            let at = |part| Some(percentile(&sorted, part)).filter(|own| own.is_finite());
            standings.push(Standing {
                among: group.clone(),
                value: name.clone(),
                complete,
                tripped,
                failed: count - complete - tripped,
                error_percent: Spread {
                    p5: at(0.05),
                    p50: at(0.5),
                    p95: at(0.95),
                },
            });
            order.push((percentile(&sorted, 0.5), name, errors));
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        for neighbours in order.windows(2) {
            let [(_, better, a), (_, worse, b)] = neighbours else {
                continue;
            };
            let wins = a.iter().zip(b).filter(|(a, b)| a < b).count();
            pairs.push(Pair {
                among: group.clone(),
                better: (*better).clone(),
                worse: (*worse).clone(),
                part: wins as f64 / count.max(1) as f64,
                difference_percent: difference(a, b, seed),
            });
        }
    }
    Ranking {
        factor: factor.clone(),
        among: among.clone(),
        points: count,
        standings,
        pairs,
    }
}

/// 95 % interval of the difference of the medians, the points resampled in pairs.
fn difference(better: &[f64], worse: &[f64], seed: u64) -> [f64; 2] {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut differences: Vec<f64> = (0..RESAMPLED)
        .map(|_| {
            let picked: Vec<usize> = (0..better.len())
                .map(|_| random.random_range(0..better.len()))
                .collect();
            let median = |of: &[f64]| {
                let own: Vec<f64> = picked.iter().map(|&place| of[place]).collect();
                percentile(&sorted(&own), 0.5)
            };
            let (a, b) = (median(better), median(worse));
            // Two infinite ones are equal.
            if a == b { 0.0 } else { b - a }
        })
        .collect();
    differences.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|part| percentile(&differences, part))
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table::{Cell, Column, Kind, Role};

    #[test]
    fn a_trip_is_worse_than_any_error_and_a_clear_order_is_certain() {
        let column = |name: &str, role, kind| Column {
            name: name.to_string(),
            unit: None,
            role,
            kind,
        };
        let mut rows = Vec::new();
        // Two controllers on two motions at each of forty points, in one way of design.
        for point in 0..40 {
            for (place, name) in ["b", "a"].into_iter().enumerate() {
                for motion in 0..2 {
                    let error = match name {
                        "a" => 4.0 + 0.01 * f64::from(point),
                        _ => 8.0 - 0.02 * f64::from(point),
                    };
                    let tripped = name == "b" && point == 0 && motion == 1;
                    rows.push(vec![
                        Cell::Number(f64::from(4 * point + 2 * place as i32 + motion)),
                        name.into(),
                        "own".into(),
                        Cell::Number(error + f64::from(motion) - 0.5),
                        if tripped { "interlock" } else { "complete" }.into(),
                    ]);
                }
            }
        }
        let mut table = Table {
            columns: vec![
                column("number", Role::Run, Kind::Number),
                column("controller", Role::Factor, Kind::Text),
                column("control_model", Role::Factor, Kind::Text),
                column("error", Role::Result, Kind::Number),
                column("ended", Role::Ending, Kind::Text),
            ],
            rows,
        };
        let ranked = Ranked {
            factor: "controller".to_string(),
            among: vec!["control_model".to_string()],
            crossings: 4,
        };
        let found = ranking(&table, &ranked, "error", 3);
        assert_eq!(found.points, 40);
        let b = &found.standings[0];
        assert_eq!((b.value.as_str(), b.among[0].as_str()), ("b", "own"));
        assert_eq!((b.complete, b.tripped, b.failed), (39, 1, 0));
        assert!((b.error_percent.p50.unwrap() - 7.61).abs() < 0.02);
        let pair = &found.pairs[0];
        assert_eq!(
            (pair.better.as_str(), pair.worse.as_str(), pair.part),
            ("a", "b", 1.0)
        );
        assert!(pair.difference_percent[0] > 2.0);
        // Points that have no row are none.
        table.rows.drain(28..36);
        let found = ranking(&table, &ranked, "error", 3);
        assert_eq!((found.points, found.standings[1].failed), (38, 0));
    }
}

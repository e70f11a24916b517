//! Percentiles over rigs, and how certain a ranking is.

use plant::sensors::channel;
use serde::Serialize;

use super::{DesignedOn, Row, Run};

/// 5th, 50th and 95th percentile; absent where so many runs did not come to their end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// 5th.
    pub p5: Option<f64>,
    /// 50th.
    pub p50: Option<f64>,
    /// 95th.
    pub p95: Option<f64>,
}

/// A controller, designed one way, over all rigs.
#[derive(Debug, Clone, Serialize)]
pub struct Standing {
    /// The controller.
    pub controller: String,
    /// Where it was designed.
    pub designed_on: DesignedOn,
    /// Rigs on which every motion was played to its end.
    pub complete: usize,
    /// Rigs on which the interlock tripped.
    pub tripped: usize,
    /// Rigs on which there was no controller, or a model failed.
    pub none: usize,
    /// Time-domain error, %; a run that ended early counts as worse than any other.
    pub error_percent: Spread,
}

/// Two neighbours in the ranking of a design.
#[derive(Debug, Clone, Serialize)]
pub struct Pair {
    /// The design.
    pub designed_on: DesignedOn,
    /// The better by the median.
    pub better: String,
    /// The worse.
    pub worse: String,
    /// Part of the rigs on which it is better.
    pub part: f64,
    /// 95 % interval of the difference of the medians (worse less better), %, by resampling the
    /// rigs; the order is certain where it does not hold zero.
    pub difference_percent: [f64; 2],
}

const DESIGNS: [DesignedOn; 2] = [DesignedOn::Nominal, DesignedOn::Own];

fn of<'a>(row: &'a Row, controller: &str, design: DesignedOn) -> Option<&'a Run> {
    let mut runs = row.runs.iter();
    runs.find(|run| run.controller == controller && run.designed_on == design)
}

/// The error, infinite where there is none.
fn error(row: &Row, controller: &str, design: DesignedOn) -> f64 {
    of(row, controller, design)
        .and_then(|run| run.error_percent)
        .unwrap_or(f64::INFINITY)
}

/// The percentile `part` by linear interpolation between the sorted values.
pub(crate) fn percentile(sorted: &[f64], part: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let place = part * last as f64;
    let (low, rest) = (place.floor() as usize, place.fract());
    let high = (low + 1).min(last);
    if rest == 0.0 || sorted[low] == sorted[high] {
        return sorted[low];
    }
    sorted[low] + rest * (sorted[high] - sorted[low])
}

fn sorted(rows: &[Row], controller: &str, design: DesignedOn) -> Vec<f64> {
    let mut all: Vec<f64> = rows
        .iter()
        .map(|row| error(row, controller, design))
        .collect();
    all.sort_by(f64::total_cmp);
    all
}

/// Standings of every controller under both designs.
pub(super) fn standings(rows: &[Row], controllers: &[String]) -> Vec<Standing> {
    let mut all = Vec::new();
    for controller in controllers {
        for design in DESIGNS {
            let errors = sorted(rows, controller, design);
            let complete = errors.iter().filter(|own| own.is_finite()).count();
            let runs = rows.iter().filter_map(|row| of(row, controller, design));
            let tripped = runs
                .filter(|run| run.ended == crate::master::Ending::Interlock)
                .count();
            let at = |part| Some(percentile(&errors, part)).filter(|own| own.is_finite());
            all.push(Standing {
                controller: controller.clone(),
                designed_on: design,
                complete,
                tripped,
                none: rows.len() - complete - tripped,
                error_percent: Spread {
                    p5: at(0.05),
                    p50: at(0.5),
                    p95: at(0.95),
                },
            });
        }
    }
    all
}

/// Neighbours by the median, with the certainty of their order.
pub(super) fn ranking(rows: &[Row], controllers: &[String], seed: u64) -> Vec<Pair> {
    const RESAMPLED: u64 = 1000;
    let mut all = Vec::new();
    for design in DESIGNS {
        let median = |controller: &str| percentile(&sorted(rows, controller, design), 0.5);
        let mut order: Vec<&String> = controllers.iter().collect();
        order.sort_by(|a, b| median(a).total_cmp(&median(b)));
        for pair in order.windows(2) {
            let (better, worse) = (pair[0], pair[1]);
            let both: Vec<[f64; 2]> = rows
                .iter()
                .map(|row| [better, worse].map(|own| error(row, own, design)))
                .collect();
            let wins = both.iter().filter(|[a, b]| a < b).count();
            let mut differences: Vec<f64> = (0..RESAMPLED)
                .map(|round| {
                    let picked: Vec<[f64; 2]> = (0..both.len())
                        .map(|k| both[pick(seed, round, k as u64, both.len())])
                        .collect();
                    let middle = |side: usize| {
                        let mut own: Vec<f64> = picked.iter().map(|p| p[side]).collect();
                        own.sort_by(f64::total_cmp);
                        percentile(&own, 0.5)
                    };
                    let (a, b) = (middle(0), middle(1));
                    if a == b { 0.0 } else { b - a }
                })
                .collect();
            differences.sort_by(f64::total_cmp);
            all.push(Pair {
                designed_on: design,
                better: better.clone(),
                worse: worse.clone(),
                part: wins as f64 / both.len().max(1) as f64,
                difference_percent: [0.025, 0.975].map(|p| percentile(&differences, p)),
            });
        }
    }
    all
}

/// A rig for place `k` of a round of resampling.
fn pick(seed: u64, round: u64, k: u64, count: usize) -> usize {
    let noise = channel::Noise {
        seed,
        channel: 100 + round,
        sample: k,
    };
    // The fraction of a Gaussian far wider than one is even.
    let even = (1e3 * noise.gaussian()).rem_euclid(1.0);
    ((even * count as f64) as usize).min(count.saturating_sub(1))
}

#[cfg(test)]
mod tests {
    use super::super::Rig;
    use super::*;
    use crate::master::Ending;

    fn rows(errors: &[[Option<f64>; 2]]) -> Vec<Row> {
        errors
            .iter()
            .enumerate()
            .map(|(number, pair)| Row {
                rig: Rig::draw(1, number as u64),
                not_commissioned: None,
                runs: ["a", "b"]
                    .iter()
                    .zip(pair)
                    .map(|(name, error)| Run {
                        controller: (*name).to_string(),
                        designed_on: DesignedOn::Nominal,
                        error_percent: *error,
                        ended: if error.is_some() {
                            Ending::Complete
                        } else {
                            Ending::Interlock
                        },
                    })
                    .collect(),
            })
            .collect()
    }

    #[test]
    fn a_trip_is_worse_than_any_error_and_a_clear_order_is_certain() {
        let mut errors: Vec<[Option<f64>; 2]> = (0..40)
            .map(|k| {
                [
                    Some(4.0 + 0.01 * f64::from(k)),
                    Some(8.0 - 0.02 * f64::from(k)),
                ]
            })
            .collect();
        errors[0][1] = None;
        let rows = rows(&errors);
        let names = ["b".to_string(), "a".to_string()];
        let standings = standings(&rows, &names);
        let b = &standings[0];
        assert_eq!((b.complete, b.tripped, b.none), (39, 1, 0));
        assert!((b.error_percent.p50.unwrap() - 7.61).abs() < 0.02);
        assert_eq!(standings[1].none, 40, "designed on its own: not run");
        let ranking = ranking(&rows, &names, 3);
        assert_eq!((ranking[0].better.as_str(), ranking[0].part), ("a", 1.0));
        assert!(ranking[0].difference_percent[0] > 2.0);
    }
}

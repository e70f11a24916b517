//! Fragility: the share of runs that exceed a limit, or that are stopped, against intensity.
//!
//! `P(exceeded | im) = Φ(ln(im / θ) / β)`, the lognormal curve with median θ and dispersion β, by
//! maximum likelihood on the runs themselves (Baker, Earthquake Spectra 31, 2015; Shinozuka et al., J.
//! Eng. Mech. 126, 2000).

use serde::Serialize;

use super::endings::{Ended, List, Runs};
use super::probit::Probit;
use super::{Limit, Settings};

/// Points of a curve, and places at which shares are reported.
const POINTS: usize = 60;
const PLACES: usize = 8;
/// Fewer motions are taken as they are, not as a sample of others.
const FEWEST_MOTIONS: usize = 5;
/// The likelihood's gain that a slope gives by chance once in twenty times (χ² with one degree of
/// freedom, one side).
const CHANCE: f64 = 2.7055;

/// How one limit fares.
#[derive(Debug, Clone, Serialize)]
pub struct Fragility {
    /// The limit; none: stopped by the interlock.
    pub limit: Option<String>,
    /// Column that is compared.
    pub column: Option<String>,
    /// What is exceeded, in the column's unit.
    pub above: Option<f64>,
    /// That unit.
    pub unit: Option<String>,
    /// The controller, where several were compared.
    pub controller: Option<String>,
    /// Runs that tell.
    pub runs: usize,
    /// Those that exceeded it.
    pub exceeded: usize,
    /// Runs with an unknown outcome: failed, or stopped before the limit was reached.
    pub unknown: usize,
    /// Share of runs in stretches of intensity with equal counts.
    pub observed: Vec<Observed>,
    /// The curve, or why there is none.
    pub fit: Fit,
}

/// The runs of a stretch of intensity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Observed {
    /// Mean intensity.
    pub intensity: f64,
    /// Runs.
    pub runs: usize,
    /// Share that exceeded.
    pub share: f64,
}

/// Result for the curve.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Fit {
    /// A lognormal curve.
    Lognormal(Box<Lognormal>),
    /// All runs below the first intensity stay within, all above the second exceed: any curve between
    /// them fits, and none is the likeliest.
    Separated {
        /// The two intensities.
        between: [f64; 2],
    },
    /// No run exceeded it.
    Never {
        /// The share of all is below this, with 95 % confidence (Clopper and Pearson).
        share_below: f64,
    },
    /// Every run exceeded it.
    Always {
        /// The share of all is above this, with 95 % confidence.
        share_above: f64,
    },
    /// No curve.
    None {
        /// Why.
        why: Why,
    },
}

/// Why there is no curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Why {
    /// No run tells.
    NoRuns,
    /// The runs have no intensity, or all have the same one.
    SameIntensity,
    /// The share does not grow with intensity, beyond chance.
    DoesNotGrow,
}

/// A fitted curve.
#[derive(Debug, Clone, Serialize)]
pub struct Lognormal {
    /// Intensity at which half of the runs exceed.
    pub median: f64,
    /// Its 95 % interval.
    pub median_band: [f64; 2],
    /// Deviation of the logarithm of the intensity.
    pub dispersion: f64,
    /// Its 95 % interval.
    pub dispersion_band: [f64; 2],
    /// Motions, where the band is that of other motions like them; none: runs count as independent.
    pub motions: Option<usize>,
    /// The curve over the intensities that were run.
    pub curve: Curve,
}

/// A curve with its 95 % band, pointwise. The share grows with intensity, so that each end of the band holds for
/// all places beside it: the lower end for those above, the upper end for those below.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Curve {
    /// Places.
    pub intensity: Vec<f64>,
    /// Share.
    pub share: Vec<f64>,
    /// Lower end of the band.
    pub low: Vec<f64>,
    /// Upper end.
    pub high: Vec<f64>,
}

impl Curve {
    fn of(fit: &Probit, [from, to]: [f64; 2]) -> Self {
        let mut curve = Self::default();
        for n in 0..POINTS {
            let place = from + (to - from) * n as f64 / (POINTS - 1) as f64;
            let [share, low, high] = fit.at(place.ln());
            curve.intensity.push(place);
            curve.share.push(share);
            curve.low.push(low);
            curve.high.push(high);
        }
        // Far from the runs the ends go their own way: the upper one to 1 where nothing was exceeded.
        for n in 1..POINTS {
            curve.low[n] = curve.low[n].max(curve.low[n - 1]);
            let from_above = POINTS - 1 - n;
            curve.high[from_above] = curve.high[from_above].min(curve.high[from_above + 1]);
        }
        curve
    }
}

/// Whether a run exceeded; none where it does not tell.
type Exceeded<'a> = &'a dyn Fn(usize) -> Option<bool>;

/// Every limit, then the interlock; each for every controller.
pub(super) fn fragility(runs: &Runs, settings: &Settings) -> Vec<Fragility> {
    let intensity = runs.table.numbers(&settings.intensity);
    let controllers = runs.controllers();
    let motions = runs.motions();
    let groups: Vec<(Option<String>, Vec<usize>)> = match &controllers {
        None => vec![(None, runs.all())],
        Some(list) => {
            let values = list.values.iter().enumerate();
            values
                .map(|(place, name)| (Some(name.clone()), list.rows(place)))
                .collect()
        }
    };
    let mut all = Vec::new();
    let mut each = |limit: Option<&Limit>, exceeded: Exceeded| {
        for (controller, rows) in &groups {
            let mut own = one(rows, &intensity, motions.as_ref(), exceeded);
            own.controller.clone_from(controller);
            if let Some(limit) = limit {
                let place = runs.table.place(&limit.column);
                own.limit = Some(limit.name.clone());
                own.column = Some(limit.column.clone());
                own.above = Some(limit.above);
                own.unit = place.and_then(|place| runs.table.columns[place].unit.clone());
            }
            all.push(own);
        }
    };
    for limit in &settings.limits {
        let numbers = runs.table.numbers(&limit.column);
        let is_peak = limit.column.starts_with("peak.");
        each(Some(limit), &|run| {
            let found = numbers.get(run).copied().unwrap_or(f64::NAN);
            match runs.ended(run) {
                Ended::Failed => None,
                // A peak is one whenever it comes; a figure of a part of the motion is no figure, and
                // a run that was stopped has not met what is asked of it.
                Ended::Interlock if is_peak => (found > limit.above).then_some(true),
                Ended::Interlock => Some(true),
                Ended::Complete if found.is_nan() => None,
                Ended::Complete => Some(found > limit.above),
            }
        });
    }
    each(None, &|run| match runs.ended(run) {
        Ended::Failed => None,
        ended => Some(ended == Ended::Interlock),
    });
    all
}

/// One limit over the given rows.
fn one(rows: &[usize], intensity: &[f64], motions: Option<&List>, exceeded: Exceeded) -> Fragility {
    let told: Vec<(usize, bool)> = rows
        .iter()
        .filter_map(|&run| Some((run, exceeded(run)?)))
        .collect();
    let count = told.iter().filter(|(_, yes)| *yes).count();
    let place = |run: usize| intensity.get(run).copied().filter(|own| *own > 0.0);
    let placed: Vec<(f64, bool, usize)> = told
        .iter()
        .filter_map(|&(run, yes)| Some((place(run)?, yes, run)))
        .collect();
    Fragility {
        limit: None,
        column: None,
        above: None,
        unit: None,
        controller: None,
        runs: told.len(),
        exceeded: count,
        unknown: rows.len() - told.len(),
        observed: observed(&placed),
        fit: fit(told.len(), count, &placed, motions),
    }
}

fn fit(runs: usize, exceeded: usize, placed: &[(f64, bool, usize)], motions: Option<&List>) -> Fit {
    // 1 - share of the exact one-sided interval: n runs alike have the probability 0.05.
    let alike = 0.05_f64.powf(1.0 / runs.max(1) as f64);
    match (runs, exceeded) {
        (0, _) => return Fit::None { why: Why::NoRuns },
        (_, 0) => {
            return Fit::Never {
                share_below: 1.0 - alike,
            };
        }
        (all, yes) if yes == all => return Fit::Always { share_above: alike },
        _ => {}
    }
    let ends = |wanted: Option<bool>| {
        let own = placed
            .iter()
            .filter(|(_, yes, _)| wanted.is_none_or(|wanted| *yes == wanted));
        own.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], own| {
            [low.min(own.0), high.max(own.0)]
        })
    };
    let [all, no, yes] = [ends(None), ends(Some(false)), ends(Some(true))];
    if all[1] <= all[0] * (1.0 + 1e-9) || !no[0].is_finite() || !yes[0].is_finite() {
        let why = Why::SameIntensity;
        return Fit::None { why };
    }
    if yes[1] <= no[0] {
        let why = Why::DoesNotGrow;
        return Fit::None { why };
    }
    if no[1] <= yes[0] {
        return Fit::Separated {
            between: [no[1], yes[0]],
        };
    }
    let x: Vec<f64> = placed.iter().map(|own| own.0.ln()).collect();
    let said: Vec<bool> = placed.iter().map(|own| own.1).collect();
    let clusters = motions.and_then(|list| clusters(list, placed));
    let numbered = clusters
        .as_ref()
        .map(|(own, count)| (own.as_slice(), *count));
    match Probit::fit(&x, &said, numbered) {
        Some(found) if found.coefficients[1] > 0.0 && found.gain > CHANCE => {
            let [median, low, high] = found.half().map(f64::exp);
            let [dispersion, least, most] = found.deviation();
            Fit::Lognormal(Box::new(Lognormal {
                median,
                median_band: [low, high],
                dispersion,
                dispersion_band: [least, most],
                motions: clusters.map(|(_, count)| count),
                curve: Curve::of(&found, all),
            }))
        }
        _ => Fit::None {
            why: Why::DoesNotGrow,
        },
    }
}

/// The motions of the runs, numbered; none where they are too few to stand for others.
fn clusters(list: &List, placed: &[(f64, bool, usize)]) -> Option<(Vec<usize>, usize)> {
    let mut known: Vec<Option<usize>> = vec![None; list.values.len()];
    let mut count = 0;
    let mut own = Vec::with_capacity(placed.len());
    for (_, _, run) in placed {
        let place = list.places[*run]?;
        own.push(*known[place].get_or_insert_with(|| {
            count += 1;
            count - 1
        }));
    }
    (count >= FEWEST_MOTIONS && count < placed.len()).then_some((own, count))
}

/// Shares in stretches of equal counts; runs of the same intensity stay together.
fn observed(placed: &[(f64, bool, usize)]) -> Vec<Observed> {
    let mut sorted: Vec<(f64, bool)> = placed.iter().map(|own| (own.0, own.1)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let length = sorted.len().div_ceil(PLACES).max(1);
    let mut all: Vec<Observed> = Vec::new();
    let mut rest = sorted.as_slice();
    while let Some(last) = rest.get(length.min(rest.len()).wrapping_sub(1)) {
        // The same intensity, but for the last digits of what was scaled.
        let end = rest.partition_point(|own| own.0 <= last.0 * (1.0 + 1e-9));
        let (own, others) = rest.split_at(end);
        let runs = own.len();
        all.push(Observed {
            intensity: own.iter().map(|own| own.0).sum::<f64>() / runs as f64,
            runs,
            share: own.iter().filter(|own| own.1).count() as f64 / runs as f64,
        });
        rest = others;
    }
    all
}

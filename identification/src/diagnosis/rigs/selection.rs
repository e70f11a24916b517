//! Which effects a part of the data asks for.
//!
//! Forward, one effect a round: the one with which a model fitted to one half of the part predicts
//! the other half best, both ways, as long as the gain is no chance when correlated samples are
//! counted once. Backward at the end by the same test.

use super::measured::{Measured, Selection};
use super::resampling::correlation_time;
use crate::diagnosis::engine::{Fit, Jacobian, Point, RigModel, evaluate, fit, polish};

/// Standard deviations by which the likelihood of unseen data must rise. A dozen candidates are
/// tried, so that one in a thousand times would be chance.
const LEAST_DEVIATE: f64 = 3.0;
/// Share of the squared error below which an effect is not worth a name.
const LEAST_GAIN: f64 = 0.01;
/// A candidate that gains this share of what the one taken gains is its rival.
const RIVAL: f64 = 0.9;
/// Effects in one model.
const MOST_EFFECTS: usize = 8;
/// Candidates that are fitted to the end in a round.
const FINALISTS: usize = 4;

/// A model fitted to a part.
#[derive(Clone)]
pub struct Model {
    /// Where.
    pub point: Point,
    /// Sum of squared errors on the part.
    pub squares: f64,
    /// Independent samples among them.
    pub samples: f64,
}

/// An effect that lost against the one taken by little.
#[derive(Debug, Clone, PartialEq)]
pub struct Rival {
    /// Its candidate.
    pub effect: usize,
    /// The candidate taken in its place.
    pub against: usize,
}

/// What a part asks for.
pub struct Selected {
    /// Nominal parameters refitted, no effect.
    pub nominal: Model,
    /// With all effects.
    pub extended: Model,
    /// What each effect gains on unseen data, in standard deviations of that gain.
    pub deviates: Vec<f64>,
    /// The extended model without each effect.
    pub without: Vec<Model>,
    /// Rivals that are not in the extended model.
    pub rivals: Vec<Rival>,
    /// One standard deviation of each coordinate: nuisance first, then the effects'.
    pub deviations: Vec<f64>,
}

fn model_of(measured: &Measured<'_>, fit: &Fit, record: usize) -> Model {
    let errors = measured.errors(&fit.point, record);
    Model {
        point: fit.point.clone(),
        squares: errors.iter().map(|e| e * e).sum(),
        samples: errors.len() as f64 / correlation_time(&errors),
    }
}

/// Error that counts as one, such that the cost has as many units as there are independent samples.
fn scale_of(model: &Model) -> f64 {
    (model.squares / model.samples)
        .sqrt()
        .max(f64::MIN_POSITIVE)
}

/// Fits everything from `start`, the error's scale once taken anew.
fn settle(
    measured: &Measured<'_>,
    start: &Point,
    scale: f64,
    record: usize,
    rounds: usize,
) -> Option<Model> {
    let mut point = start.clone();
    let mut scale = scale;
    let mut model = None;
    for _ in 0..2 {
        let rig = measured.with_scale(scale);
        let begin = evaluate(&rig, &point, &[record])?;
        let fit = polish(&rig, &begin, &[record], rounds).map_or(begin, |(fit, _)| fit);
        let settled = model_of(measured, &fit, record);
        point = settled.point.clone();
        let next = scale_of(&settled);
        model = Some(settled);
        if (next / scale - 1.0).abs() < 0.2 {
            break;
        }
        scale = next;
    }
    model
}

/// What a model fitted to one fold gains on the other, both ways.
struct Inside {
    /// Share of the squared error that goes.
    gain: f64,
    /// The larger of two normal deviates: root of twice the logarithm of the likelihood ratio, and
    /// mean of the differences of squared errors over its standard deviation.
    deviate: f64,
    /// True when both ways gain.
    both: bool,
}

impl Inside {
    fn holds(&self) -> bool {
        self.both && self.deviate > LEAST_DEVIATE && self.gain > LEAST_GAIN
    }
}

/// Errors of `model` on each fold when its parameters are refitted to the other.
fn crossed(measured: &Measured<'_>, part: Selection, model: &Model) -> Option<[Vec<f64>; 2]> {
    let [one, two] = part.folds();
    let scale = scale_of(model);
    let on_other = |fitted: usize, tested: usize| {
        let fitted = settle(measured, &model.point, scale, fitted, 2)?;
        Some(measured.errors(&fitted.point, tested))
    };
    Some([on_other(two, one)?, on_other(one, two)?])
}

/// Compares two models by their errors from [`crossed`].
fn compare(before: &[Vec<f64>; 2], after: &[Vec<f64>; 2]) -> Inside {
    let both = before
        .iter()
        .zip(after)
        .all(|(b, a)| b.iter().map(|e| e * e).sum::<f64>() > a.iter().map(|e| e * e).sum::<f64>());
    let squares = |errors: &[Vec<f64>; 2]| errors.iter().flatten().map(|e| e * e).sum::<f64>();
    let (worse, better) = (squares(before), squares(after));
    let independent: f64 = after
        .iter()
        .map(|a| a.len() as f64 / correlation_time(a))
        .sum();
    // Twice the logarithm of the likelihood ratio on data that neither model was fitted to.
    let ratio = independent * (worse / better).ln();
    // A small effect all along a record hides behind slow drift there: its own differences tell.
    let pairs = before.iter().flatten().zip(after.iter().flatten());
    let differences: Vec<f64> = pairs.map(|(b, a)| b * b - a * a).collect();
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / n;
    let paired = mean / (variance * correlation_time(&differences) / n).sqrt();
    Inside {
        gain: 1.0 - better / worse,
        deviate: ratio.abs().sqrt().copysign(ratio).max(paired),
        both,
    }
}

/// The extensions of `base` by one of `among` that fit best.
fn extensions(
    measured: &Measured<'_>,
    base: &Model,
    among: &[usize],
    record: usize,
) -> Option<Vec<(usize, Model)>> {
    let rig = measured.with_scale(scale_of(base));
    let start = evaluate(&rig, &base.point, &[record])?;
    let jacobian = Jacobian::at(&rig, &start, &[record])?;
    let mut quick: Vec<(usize, Fit)> = Vec::new();
    for &effect in among {
        let candidate = &rig.candidates()[effect];
        let held =
            |i: usize| i == effect || candidate.look_alikes.contains(&rig.candidates()[i].effect);
        if base.point.effects.iter().any(|(i, _)| held(*i)) {
            continue;
        }
        let best = candidate
            .starts
            .iter()
            .filter_map(|values| {
                let mut point = base.point.clone();
                point.effects.push((effect, candidate.internal(values)));
                fit(&rig, &point, &[record], &jacobian, 4)
            })
            .min_by(|a, b| a.cost.total_cmp(&b.cost));
        quick.extend(best.map(|best| (effect, best)));
    }
    quick.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let finished = quick.into_iter().take(FINALISTS);
    Some(
        finished
            .filter_map(|(effect, quick)| {
                Some((
                    effect,
                    settle(measured, &quick.point, rig.scale, record, 4)?,
                ))
            })
            .collect(),
    )
}

/// Whether `rival` in the place of the effect that `without` lacks gains nearly what that gains.
fn replaces(
    measured: &Measured<'_>,
    part: Selection,
    rival: usize,
    without: &Model,
    current: &Model,
) -> Option<bool> {
    let (_, replaced) = extensions(measured, without, &[rival], part as usize)?.pop()?;
    let before = crossed(measured, part, without)?;
    let gain = |model: &Model| Some(compare(&before, &crossed(measured, part, model)?).gain);
    Some(gain(&replaced)? > RIVAL * gain(current)?)
}

/// Finds the effects that `part` asks for.
pub fn select(measured: &Measured<'_>, part: Selection, verbose: bool) -> Option<Selected> {
    let record = part as usize;
    let names = |model: &Model| -> Vec<&str> {
        model
            .point
            .effects
            .iter()
            .map(|(i, _)| measured.candidates()[*i].effect)
            .collect()
    };
    let origin = Point {
        nuisance: vec![0.0; measured.nuisance()],
        effects: Vec::new(),
    };
    let errors = measured.errors(&origin, record);
    let power = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    let scale = (power * correlation_time(&errors)).sqrt();
    let nominal = settle(measured, &origin, scale, record, 6)?;
    let mut current = nominal.clone();
    let mut rivals: Vec<Rival> = Vec::new();
    let all: Vec<usize> = (0..measured.candidates().len()).collect();
    while current.point.effects.len() < MOST_EFFECTS {
        let before = crossed(measured, part, &current)?;
        let mut tried: Vec<(Inside, usize, Model)> = extensions(measured, &current, &all, record)?
            .into_iter()
            .filter_map(|(effect, model)| {
                let after = crossed(measured, part, &model)?;
                Some((compare(&before, &after), effect, model))
            })
            .collect();
        tried.sort_by(|a, b| b.0.gain.total_cmp(&a.0.gain));
        if verbose {
            for (inside, _, model) in &tried {
                eprintln!(
                    "  {}: error {:.3} %, on the other fold {:.2} % of the square less, {:.1} deviations{} {:?}",
                    names(model).join(" + "),
                    100.0 * measured.normalised_error(&model.point, record),
                    100.0 * inside.gain,
                    inside.deviate,
                    if inside.holds() { ", holds" } else { "" },
                    model
                        .point
                        .effects
                        .last()
                        .map(|(i, q)| measured.candidates()[*i].values(q)),
                );
            }
        }
        let pays = |model: &Model| model.squares < (1.0 - LEAST_GAIN) * current.squares;
        tried.retain(|(inside, _, model)| inside.holds() && pays(model));
        let mut tried = tried.into_iter();
        let Some((best, effect, model)) = tried.next() else {
            break;
        };
        let near = tried.filter(|(inside, ..)| inside.gain > RIVAL * best.gain);
        rivals.extend(near.map(|(_, rival, _)| Rival {
            effect: rival,
            against: effect,
        }));
        current = model;
    }
    // What no longer pays goes.
    let (deviates, without) = loop {
        let after = crossed(measured, part, &current)?;
        let mut compared = Vec::new();
        let mut without = Vec::new();
        for i in 0..current.point.effects.len() {
            let mut point = current.point.clone();
            point.effects.remove(i);
            let smaller = settle(measured, &point, scale_of(&current), record, 3)?;
            compared.push(compare(&crossed(measured, part, &smaller)?, &after));
            without.push(smaller);
        }
        let least = (0..compared.len())
            .min_by(|&a, &b| compared[a].gain.total_cmp(&compared[b].gain))
            .filter(|&i| !compared[i].holds());
        match least {
            Some(i) => current = without.swap_remove(i),
            None => {
                break (
                    compared.iter().map(|inside| inside.deviate).collect(),
                    without,
                );
            }
        }
    };
    // What came near while other effects were still missing may be far behind at the end.
    let place = |effect: usize| current.point.effects.iter().position(|(i, _)| *i == effect);
    rivals.retain(|rival| match (place(rival.against), place(rival.effect)) {
        (Some(i), None) => {
            replaces(measured, part, rival.effect, &without[i], &current).unwrap_or(false)
        }
        _ => false,
    });
    let rig = measured.with_scale(scale_of(&current));
    let last = evaluate(&rig, &current.point, &[record])?;
    let covariance =
        Jacobian::at(&rig, &last, &[record]).and_then(|jacobian| jacobian.covariance(&rig, &last));
    let deviations = covariance.map_or_else(Vec::new, |covariance| {
        (0..covariance.nrows())
            .map(|i| covariance[(i, i)].max(0.0).sqrt())
            .collect()
    });
    Some(Selected {
        nominal,
        extended: current,
        deviates,
        without,
        rivals,
        deviations,
    })
}

//! Which effects a part of the data asks for.
//!
//! Forward, one effect a round; an effect is taken when it pays against its price with as many
//! samples as are independent, and when a model fitted to one half of the part with it predicts
//! the other half better than without, both ways. Backward at the end.

use super::measured::{Measured, Selection};
use super::resampling::correlation_time;
use crate::diagnosis::{Fit, Jacobian, Point, RigModel, evaluate, fit, polish};

/// Price of an effect in units of `2 log` likelihood; the engine's search asks the same.
const PRICE_OF_AN_EFFECT: f64 = 18.0;
const PRICE_OF_A_PARAMETER: f64 = 6.0;
/// Share of the squared error below which an effect is not worth a name.
const LEAST_GAIN: f64 = 0.01;
/// A candidate within this of the one taken is its rival.
const RIVAL_WITHIN: f64 = 12.0;
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
    /// What each effect gains over the extended model without it, in `2 log` likelihood over its
    /// price.
    pub margins: Vec<f64>,
    /// The extended model without each effect.
    pub without: Vec<Model>,
    /// Rivals that are not in the extended model.
    pub rivals: Vec<Rival>,
    /// One standard deviation of each coordinate: nuisance first, then the effects'.
    pub deviations: Vec<f64>,
}

fn price(measured: &Measured<'_>, effect: usize) -> f64 {
    let parameters = measured.candidates()[effect].parameters.len();
    PRICE_OF_AN_EFFECT + PRICE_OF_A_PARAMETER * parameters.saturating_sub(1) as f64
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
    (model.squares / model.samples).sqrt().max(f64::MIN_POSITIVE)
}

/// Fits everything from `start`, the error's scale once taken anew.
fn settle(measured: &Measured<'_>, start: &Point, scale: f64, record: usize, rounds: usize) -> Option<Model> {
    let mut point = start.clone();
    let mut scale = scale;
    let mut model = None;
    for _ in 0..2 {
        let rig = measured.with_scale(scale);
        let begin = evaluate(&rig, &point, &[record])?;
        let (fit, _) = polish(&rig, &begin, &[record], rounds)?;
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

/// Log-likelihood ratio, doubled, by the independent samples of the better model.
fn gain(worse: &Model, better: &Model) -> f64 {
    better.samples * (worse.squares / better.squares).ln()
}

/// True when the effect added last predicts each fold better from the other.
fn holds_inside(measured: &Measured<'_>, part: Selection, base: &Model, extended: &Model) -> bool {
    let folds = part.folds();
    let scale = scale_of(extended);
    let on_other = |model: &Model, fitted: usize, tested: usize| -> Option<f64> {
        let fitted = settle(measured, &model.point, scale, fitted, 2)?;
        Some(measured.errors(&fitted.point, tested).iter().map(|e| e * e).sum())
    };
    [(folds[0], folds[1]), (folds[1], folds[0])].iter().all(|&(fitted, tested)| {
        match (on_other(base, fitted, tested), on_other(extended, fitted, tested)) {
            (Some(before), Some(after)) => after < before,
            _ => false,
        }
    })
}

/// Best extensions of `base` by one effect, the best first, with what they gain over their price.
fn extensions(measured: &Measured<'_>, base: &Model, record: usize) -> Option<Vec<(f64, usize, Model)>> {
    let rig = measured.with_scale(scale_of(base));
    let start = evaluate(&rig, &base.point, &[record])?;
    let jacobian = Jacobian::at(&rig, &start, &[record])?;
    let mut quick: Vec<(usize, Fit)> = Vec::new();
    for (effect, candidate) in rig.candidates().iter().enumerate() {
        if base.point.effects.iter().any(|(i, _)| *i == effect) {
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
    let mut finished: Vec<_> = quick
        .into_iter()
        .take(FINALISTS)
        .filter_map(|(effect, quick)| {
            let model = settle(measured, &quick.point, rig.scale, record, 4)?;
            Some((gain(base, &model) - price(measured, effect), effect, model))
        })
        .collect();
    finished.sort_by(|a, b| b.0.total_cmp(&a.0));
    Some(finished)
}

/// Finds the effects that `part` asks for.
pub fn select(measured: &Measured<'_>, part: Selection, verbose: bool) -> Option<Selected> {
    let record = part as usize;
    let names = |model: &Model| -> Vec<&str> {
        model.point.effects.iter().map(|(i, _)| measured.candidates()[*i].effect).collect()
    };
    let origin = Point { nuisance: vec![0.0; measured.nuisance()], effects: Vec::new() };
    let errors = measured.errors(&origin, record);
    let power = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    let scale = (power * correlation_time(&errors)).sqrt();
    let nominal = settle(measured, &origin, scale, record, 6)?;
    let mut current = nominal.clone();
    let mut rivals = Vec::new();
    while current.point.effects.len() < MOST_EFFECTS {
        let finished = extensions(measured, &current, record)?;
        let mut taken = None;
        for (i, (score, effect, model)) in finished.iter().enumerate() {
            let pays = *score > 0.0 && model.squares < (1.0 - LEAST_GAIN) * current.squares;
            let holds = pays && holds_inside(measured, part, &current, model);
            if verbose {
                eprintln!(
                    "  {}: error {:.3} %, score {score:.1}{}{} {:?}",
                    names(model).join(" + "),
                    100.0 * measured.normalised_error(&model.point, record),
                    if pays { ", pays" } else { "" },
                    if holds { ", holds" } else { "" },
                    model.point.effects.last().map(|(i, q)| measured.candidates()[*i].values(q)),
                );
            }
            if holds {
                for (other, rival, _) in &finished[i + 1..] {
                    if score - other < RIVAL_WITHIN && *other > 0.0 {
                        rivals.push(Rival { effect: *rival, against: *effect });
                    }
                }
                taken = Some(model.clone());
                break;
            }
        }
        let Some(model) = taken else { break };
        current = model;
    }
    // What no longer pays goes.
    let (margins, without) = loop {
        let mut margins = Vec::new();
        let mut without = Vec::new();
        for i in 0..current.point.effects.len() {
            let mut point = current.point.clone();
            let (effect, _) = point.effects.remove(i);
            let smaller = settle(measured, &point, scale_of(&current), record, 3)?;
            margins.push(gain(&smaller, &current) - price(measured, effect));
            without.push(smaller);
        }
        let least = (0..margins.len()).min_by(|&a, &b| margins[a].total_cmp(&margins[b]));
        match least {
            Some(i)
                if margins[i] < 0.0
                    || current.squares > (1.0 - LEAST_GAIN) * without[i].squares =>
            {
                current = without.swap_remove(i);
            }
            _ => break (margins, without),
        }
    };
    let held = |effect: usize| current.point.effects.iter().any(|(i, _)| *i == effect);
    rivals.retain(|rival| held(rival.against) && !held(rival.effect));
    let rig = measured.with_scale(scale_of(&current));
    let last = evaluate(&rig, &current.point, &[record])?;
    let covariance = Jacobian::at(&rig, &last, &[record])?.covariance(&rig, &last)?;
    let deviations = (0..covariance.nrows()).map(|i| covariance[(i, i)].max(0.0).sqrt()).collect();
    Some(Selected { nominal, extended: current, margins, without, rivals, deviations })
}

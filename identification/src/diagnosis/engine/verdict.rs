//! From a search to a verdict: is the best model adequate, and does anything rival it?

use super::adequacy::{self, Test};
use super::fit::{Fit, Jacobian, evaluate, fit as refit, polish_to};
use super::likelihood::{
    Hypothesis, NEAR_NOISE, PenalisedLikelihood, RIVAL_WITHIN, ROUNDS, SETTLED,
};
use super::model::{Candidate, ExtensibleModel, Lesson, Point, Role};
use super::progress::{Observer, Progress};
use super::search::{Found, Selection, resumed, search};
use serde::{Deserialize, Serialize};

/// Largest deviate that noise alone may show among the few hundred tests. Were they exact, 4.5
/// would be passed by chance once in a thousand cases (300 tests); what is above that allows for
/// the constant gain of the predictor, which is the best one for the linear part only. Chosen on
/// the generator's cases.
pub const LARGEST_DEVIATE: f64 = 5.6;

/// Twice the log likelihood that other noises must gain before the search is repeated with them. Where
/// the assumed ones are right, a dozen parameters gain about a dozen.
pub(super) const NEWS: f64 = 60.0;
/// Largest deviate up to which noises that were learned are taken for most of what a model leaves over:
/// what remains is the work of further effects. Saves time only.
pub(super) const NEARLY_NOISE: f64 = 4.0 * LARGEST_DEVIATE;
/// Times that they are learned at most: at the first model found, and at what was found with them.
const LESSONS: usize = 2;

/// No name is surer than hidden effects have shown. Of 231 effects that were named in the plain and the
/// noisy cases of docs/diagnosis.md none was wrong: by Laplace's rule of succession one in 233 may be.
/// Rounded down, for rigs of another hand.
const SUREST: f64 = 0.99;

/// What came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The nominal model explains the records within its uncertainty.
    Adequate,
    /// The effects are these.
    Named,
    /// The effects are these, or one of the alternatives.
    Ambiguous,
    /// Something is there that the catalogue does not hold.
    Unexplained,
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Adequate => "adequate",
            Self::Named => "named",
            Self::Ambiguous => "ambiguous",
            Self::Unexplained => "unexplained",
        })
    }
}

/// An estimated parameter, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterEstimate {
    /// Its name in the catalogue.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
    /// One standard deviation.
    pub standard_error: f64,
    /// True for a detail of the effect's form rather than its size.
    pub is_shape: bool,
}

/// An effect with its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedEffect {
    /// Its name in the catalogue.
    pub effect: &'static str,
    /// Its parameters.
    pub parameters: Vec<ParameterEstimate>,
    /// Posterior share against the models tried in its place, 0 to 1, no surer than the diagnosis has
    /// been shown to be.
    pub confidence: f64,
}

/// The judged search.
pub struct Judgement {
    /// The verdict.
    pub verdict: Verdict,
    /// Effects of the best model (also under `Unexplained`, where they only help).
    pub effects: Vec<NamedEffect>,
    /// Rival sets of effects.
    pub alternatives: Vec<Vec<&'static str>>,
    /// Points of the rivals, in the order of `alternatives`.
    pub rival_points: Vec<Point>,
    /// Standard errors of the nominal parameters, in their stated standard deviations.
    pub nuisance_errors: Vec<f64>,
    /// The best model, fitted to the fitting records.
    pub best: Fit,
    /// The best model fitted to all records, the held-out ones too, where it is adequate.
    pub all: Fit,
    /// Tests of what is left over, strongest first.
    pub tests: Vec<Test>,
    /// Share of the nominal model's excess error that the best model explains.
    pub share_explained: f64,
}

/// Estimates of the effects at `point`, with `deviations` of all coordinates, nuisance first; not a
/// number where they are unknown.
pub fn estimates(candidates: &[Candidate], point: &Point, deviations: &[f64]) -> Vec<NamedEffect> {
    let mut deviations = deviations.iter().skip(point.nuisance.len());
    point
        .effects
        .iter()
        .map(|(i, internal)| {
            let candidate = &candidates[*i];
            let pairs = candidate.parameters.iter().zip(internal);
            NamedEffect {
                effect: candidate.effect,
                parameters: pairs
                    .map(|(parameter, &q)| ParameterEstimate {
                        name: parameter.name.into(),
                        value: parameter.scale.to_value(q),
                        unit: parameter.unit,
                        standard_error: deviations.next().copied().unwrap_or(f64::NAN)
                            * parameter.scale.slope(q).abs(),
                        is_shape: matches!(parameter.role, Role::Shape { .. }),
                    })
                    .collect(),
                confidence: 1.0,
            }
        })
        .collect()
}

fn names<M: ExtensibleModel>(model: &M, hypothesis: &Hypothesis) -> Vec<&'static str> {
    let effects = hypothesis.effects();
    effects
        .iter()
        .map(|&i| model.candidates()[i].effect)
        .collect()
}

/// Searches on the records `fitted`, judges on all of them and `held_out`. Where the noises that the
/// model assumes are not those of the records, they are learned along, and `model` has them afterwards.
///
/// The search begins with what the quiet records show of the noises, where they show it. What is there of
/// an effect at low level is then partly taken for noise, until the search has found it; where it names
/// nothing, the search is made with the assumed noises as well, and that counts.
pub fn judge<M: ExtensibleModel + Clone>(
    model: &mut M,
    fitted: &[usize],
    held_out: &[usize],
    observer: Observer<'_>,
) -> Option<Judgement> {
    let quiet = model.quiet_records(fitted);
    if let Some((lesson, is_noise)) = learned_at_rest(model, &quiet) {
        tell(observer, &lesson);
        let models = [&lesson.model, &*model];
        if let Some((judgement, learned)) = concluded(&models, fitted, held_out, observer)
            && (is_noise || judgement.verdict == Verdict::Named)
        {
            *model = learned;
            return Some(judgement);
        }
    }
    let (judgement, learned) = concluded(&[&*model], fitted, held_out, observer)?;
    *model = learned;
    Some(judgement)
}

fn tell<M>(observer: Observer<'_>, lesson: &Lesson<M>) {
    observer.tell(|| Progress::Noise {
        gain: lesson.gain,
        figures: lesson.figures.clone(),
    });
}

/// A search from the noises that the first of `models` assumes, then with those that were learned after it;
/// the judgement and the model with its noises. What is adequate with noises that were assumed is adequate,
/// whatever was learned after: where that leaves something over, what was found is weighed with those of
/// `models` as well.
fn concluded<M: ExtensibleModel + Clone>(
    models: &[&M],
    fitted: &[usize],
    held_out: &[usize],
    observer: Observer<'_>,
) -> Option<(Judgement, M)> {
    let model = *models.first()?;
    let mut found = search(&mut PenalisedLikelihood::of(model, fitted, observer))?;
    let mut learned: Option<M> = None;
    for _ in 0..LESSONS {
        let current = learned.as_ref().unwrap_or(model);
        let best = found.best.as_ref().unwrap_or(&found.nominal);
        let lesson = current.with_learned_noise(&best.fit.point, &best.fit.residuals, fitted);
        let Some(lesson) = lesson else { break };
        tell(observer, &lesson);
        if lesson.gain < NEWS || !lesson.is_believable {
            break;
        }
        let mut again = PenalisedLikelihood::of(&lesson.model, fitted, observer);
        let Some(next) = searched_again(&mut again, &found) else {
            break;
        };
        found = next;
        learned = Some(lesson.model);
    }
    let last = learned.as_ref().unwrap_or(model);
    let judgement = weigh(last, found.clone(), fitted, held_out);
    if judgement.verdict != Verdict::Unexplained {
        return Some((judgement, last.clone()));
    }
    let assumed = models.iter().skip(usize::from(learned.is_none()));
    let explained = assumed.copied().find_map(|model| {
        let mut selection = PenalisedLikelihood::of(model, fitted, observer);
        let earlier = selection.refitted(&found)?;
        let best = earlier.best.as_ref().unwrap_or(&earlier.nominal);
        let near = best.mean_square() < NEAR_NOISE;
        let again = near.then(|| resumed(&mut selection, earlier))??;
        let again = weigh(model, again, fitted, held_out);
        (again.verdict != Verdict::Unexplained).then(|| (again, model.clone()))
    });
    Some(explained.unwrap_or_else(|| (judgement, last.clone())))
}

/// The noises that the `quiet` records show under the nominal model, and whether with them nothing but
/// noise is left there: what the model lacks then shows at a higher level only, and is no part of them.
/// None where they are what was assumed, or far from explaining those records.
fn learned_at_rest<M: ExtensibleModel>(model: &M, quiet: &[usize]) -> Option<(Lesson<M>, bool)> {
    if quiet.is_empty() {
        return None;
    }
    let fitted = |model: &M| PenalisedLikelihood::of(model, quiet, Observer::none()).nominal();
    let before = fitted(model)?.fit;
    let lesson = model.with_learned_noise(&before.point, &before.residuals, quiet)?;
    if lesson.gain < NEWS || !lesson.is_believable {
        return None;
    }
    let after = fitted(&lesson.model)?.fit;
    let tests = left_over(&lesson.model, &after, quiet);
    let worst = tests
        .iter()
        .fold(0.0f64, |worst, test| worst.max(test.deviate));
    (worst < NEARLY_NOISE).then_some((lesson, worst < LARGEST_DEVIATE))
}

/// A search under noises that were learned after an earlier one had `found` something: what that found is
/// a start. Where it comes near the noise nothing but small effects can be missing; elsewhere the search
/// begins anew, and the better one counts.
fn searched_again<M: ExtensibleModel>(
    selection: &mut PenalisedLikelihood<'_, M>,
    found: &Found<Hypothesis>,
) -> Option<Found<Hypothesis>> {
    let earlier = selection.refitted(found)?;
    let best = earlier.best.as_ref().unwrap_or(&earlier.nominal);
    if best.mean_square() < NEAR_NOISE {
        return resumed(selection, earlier);
    }
    let mut anew = search(selection)?;
    let score = |found: &Found<Hypothesis>| {
        let best = found.best.as_ref().unwrap_or(&found.nominal);
        best.score
    };
    if score(&anew) <= score(&earlier) {
        anew.others.extend(earlier.best);
        return Some(anew);
    }
    Some(earlier)
}

/// Tests of whether what `fit` leaves over on `records` is noise, and its parameters plausible.
pub(super) fn left_over<M: ExtensibleModel>(model: &M, fit: &Fit, records: &[usize]) -> Vec<Test> {
    let mut tests = Vec::new();
    let mut rest = fit.residuals.as_slice();
    for &record in records {
        let count = model.residual_count(record).min(rest.len());
        let (mine, others) = rest.split_at(count);
        rest = others;
        tests.extend(adequacy::tests(
            model.record_name(record),
            mine,
            model.channels(),
            &model.regressors(record),
        ));
    }
    let nuisance = &fit.point.nuisance;
    tests.push(Test {
        what: "nominal parameters against their stated uncertainty".into(),
        deviate: adequacy::chi_square_deviate(
            nuisance.iter().map(|p| p * p).sum(),
            nuisance.len() as f64,
        ),
    });
    let priors = fit.point.prior_rows(model.candidates());
    for (_, off, spread) in priors {
        tests.push(Test {
            what: "form of an effect against what is usual".into(),
            deviate: (off / spread).abs(),
        });
    }
    tests
}

fn weigh<M: ExtensibleModel>(
    model: &M,
    found: Found<Hypothesis>,
    fitted: &[usize],
    held_out: &[usize],
) -> Judgement {
    let Found {
        nominal,
        best,
        others,
    } = found;
    let nominal_square = nominal.mean_square();
    let named = best.is_some();
    let best = best.unwrap_or(nominal);
    let everything: Vec<usize> = fitted.iter().chain(held_out).copied().collect();
    // The held-out record is predicted with the fitted parameters for the gain; whether noise is
    // all that is left is asked of a fit to everything, free of the parameters' own errors.
    let joint = evaluate(model, &best.fit.point, &everything)
        .and_then(|start| polish_to(model, &start, &everything, ROUNDS, SETTLED))
        .map(|(fit, jacobian)| {
            // Directions that only the priors hold are told from others by exact derivatives only.
            let exact = Jacobian::central(model, &fit, &everything).unwrap_or(jacobian);
            let settled = refit(model, &fit.point, &everything, &exact, 3);
            (settled.unwrap_or(fit), exact)
        });
    let (joint_fit, joint_jacobian) = match joint {
        Some((fit, jacobian)) => (fit, Some(jacobian)),
        None => (best.fit.clone(), None),
    };
    let mut tests = left_over(model, &joint_fit, &everything);
    tests.sort_by(|a, b| b.deviate.total_cmp(&a.deviate));
    let effects = best.fit.point.effects.iter();
    let tolerance = effects.fold(1.0f64, |most, (i, _)| {
        most.max(model.candidates()[*i].tolerance)
    });
    let adequate = tests
        .first()
        .is_none_or(|worst| worst.deviate < tolerance * LARGEST_DEVIATE);

    let best_names = names(model, &best);
    let nested = |set: &[&'static str]| {
        let without = |a: &[&'static str], b: &[&'static str]| -> Vec<&'static str> {
            a.iter().filter(|name| !b.contains(name)).copied().collect()
        };
        let (mine, theirs) = (without(&best_names, set), without(set, &best_names));
        let [mine, theirs] = [mine.as_slice(), theirs.as_slice()];
        let contains = |outer: &str, inner: &str| {
            let mut all = model.candidates().iter();
            all.any(|c| c.effect == outer && c.contains == Some(inner))
        };
        matches!((mine, theirs), ([a], [b]) if contains(a, b) || contains(b, a))
    };
    let mut alternatives = Vec::new();
    let mut rival_points = Vec::new();
    let mut weight = 1.0;
    for other in &others {
        let behind = other.score - best.score;
        let set = names(model, other);
        if named && !nested(&set) {
            weight += (-0.5 * behind).exp();
            if behind < RIVAL_WITHIN && set.len() == best_names.len() {
                alternatives.push(set);
                rival_points.push(other.fit.point.clone());
            }
        }
    }
    let verdict = match (adequate, named, alternatives.is_empty()) {
        (false, _, _) => Verdict::Unexplained,
        (true, false, _) => Verdict::Adequate,
        (true, true, true) => Verdict::Named,
        (true, true, false) => Verdict::Ambiguous,
    };
    let excess = |square: f64| (square - 1.0).max(0.0);
    let share_explained = if excess(nominal_square) > 0.0 {
        1.0 - excess(best.mean_square()) / excess(nominal_square)
    } else {
        1.0
    };
    // What is told of the effects rests on all records, as long as the model holds on them.
    let (all, jacobian) = match joint_jacobian.filter(|_| adequate) {
        Some(jacobian) => (joint_fit, jacobian),
        None => (best.fit.clone(), best.jacobian),
    };
    let deviations = jacobian.deviations(model, &all).unwrap_or_default();
    let mut effects = estimates(model.candidates(), &all.point, &deviations);
    let mut nuisance_errors = deviations;
    nuisance_errors.truncate(all.point.nuisance.len());
    for effect in &mut effects {
        effect.confidence = SUREST / weight;
    }
    Judgement {
        verdict,
        effects,
        alternatives,
        rival_points,
        nuisance_errors,
        best: best.fit,
        all,
        tests,
        share_explained,
    }
}

//! From a search to a verdict: is the best model adequate, and does anything rival it?

use super::ablation::{self, Settled, settled};
use super::adequacy::{Test, left_over};
use super::fit::{Fit, Jacobian, evaluate, fit as refit, polish};
use super::likelihood::{
    FLOOR, Hypothesis, NEAR_NOISE, NEARLY_NOISE, PenalisedLikelihood, RIVAL_WITHIN, ROUNDS,
    SETTLED, lacks, matters,
};
use super::model::{Candidate, ExtensibleModel, Point, Role};
use super::progress::Observer;
use super::rounds::Rounds;
use serde::{Deserialize, Serialize};

/// No name is surer than hidden effects in worlds of another form have shown, of which too few were judged for
/// more (docs/diagnosis.md). In those of the engine's own form 233 of 234 names were right.
pub const SUREST: f64 = 0.95;
/// Standard deviations by which an effect predicts unseen records worse than the model without it, and goes.
const REFUTED: f64 = 3.0;
/// Standard errors by which a size of an effect that is named differs from zero at least. Of 73 effects that were named
/// in worlds of another form, right ones differed by 7 and more but for one (3.6). Where no effect of the catalogue was,
/// four of five wrong ones differed by 2.8 to 4.6 (`judge_tables`, seeds 7000 and 8000).
const SURE: f64 = 5.0;
/// Share of the excess error that a single effect explains to lead what is ranked.
const MOST_OF_IT: f64 = 0.9;
/// Share beyond which a single burst that is left says nothing of the model.
const NEARLY_ALL: f64 = 0.99;
/// How much larger than usual an error of a channel may be that effects leave which explain as much: noises of another
/// form leave a little. In worlds of that kind three right models left 5.6 to 8.1 deviations (`judge_tables`, seeds 6000
/// and 7000). Correlations with the motion stay as usual: a wrong model left 7.8 in one (8085).
const LEFT_BY_FORM: f64 = 1.5;
/// Models that are reported with their weights at most.
const CANDIDATES: usize = 5;

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
    /// What is there is an effect of the catalogue, weaker than what matters.
    #[serde(rename = "too_small")]
    TooSmall,
    /// Something is there that the catalogue does not hold.
    Unexplained,
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Adequate => "adequate",
            Self::Named => "named",
            Self::Ambiguous => "ambiguous",
            Self::TooSmall => "too small",
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

/// A model with effects, weighed against the others that were fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct WeighedModel {
    /// Where it is.
    pub point: Point,
    /// Its effects.
    pub effects: Vec<NamedEffect>,
    /// Posterior share among the models weighed, 0 to 1.
    pub weight: f64,
    /// Share of the nominal model's excess error that it explains.
    pub explains: f64,
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
    /// Tests of the residual, strongest first.
    pub tests: Vec<Test>,
    /// Share of the nominal model's excess error that the best model explains.
    pub share_explained: f64,
    /// All models that were weighed, the best first.
    pub candidates: Vec<WeighedModel>,
    /// The nominal model, refitted under the same noises.
    pub nominal: Point,
    /// Of every effect of [`Self::best`]: the model without it, refitted under the same noises.
    pub without: Vec<Option<Point>>,
    /// And by how many standard deviations the effect predicts the held-out records better than that.
    pub unseen_gains: Vec<Option<f64>>,
}

impl WeighedModel {
    /// The fitted model `own`. Unless it is `adequate`, what it leaves may belong to its effects: their sizes are known
    /// no better than to the root of the share of power that it does not explain.
    fn of<M: ExtensibleModel>(
        model: &M,
        own: &Hypothesis,
        weight: f64,
        explains: f64,
        adequate: bool,
    ) -> Self {
        let deviations = own.jacobian.deviations(model, &own.fit).unwrap_or_default();
        let mut effects = estimates(model.candidates(), &own.fit.point, &deviations);
        if !adequate {
            widen(&mut effects, 1.0 - explains);
        }
        Self {
            point: own.fit.point.clone(),
            effects,
            weight,
            explains,
        }
    }
}

/// Widens the standard errors of sizes where a share `left` of the power is not explained.
fn widen(effects: &mut [NamedEffect], left: f64) {
    let left = left.clamp(0.0, 1.0).sqrt();
    let sizes = effects.iter_mut().flat_map(|own| &mut own.parameters);
    for size in sizes.filter(|own| !own.is_shape) {
        size.standard_error = size.standard_error.hypot(left * size.value);
    }
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

/// Whether `set` has all effects of `best` and more. What it has more did not pay, though its score may be lower, as
/// by an effect that a noise of another form imitates: it says nothing against the effects that both have.
fn extends(set: &[&str], best: &[&str]) -> bool {
    set.len() > best.len() && best.iter().all(|name| set.contains(name))
}

fn names<M: ExtensibleModel>(model: &M, hypothesis: &Hypothesis) -> Vec<&'static str> {
    let effects = hypothesis.effects();
    effects
        .iter()
        .map(|&i| model.candidates()[i].effect)
        .collect()
}

/// Searches on the records `fitted`, judges on all of them and `held_out`. Every model is fitted under the
/// noises that its own residuals show, and `model` has those of the best one afterwards.
///
/// A round proposes effects under the noises of the model found so far. Where those are louder than is
/// usual, they may be the missing effect: it is looked for under the noises of the quiet records as well, or
/// under the assumed ones. What was proposed is fitted under noises of its own and kept if its score is
/// better. In the end every effect that the noises can take the place of goes.
///
/// Effects are not named where the observer's deadline cut the search short.
pub fn judge<M: ExtensibleModel + Clone>(
    model: &mut M,
    fitted: &[usize],
    held_out: &[usize],
    observer: Observer<'_>,
) -> Option<Judgement> {
    let at_rest = learned_at_rest(model, &model.quiet_records(fitted));
    let quiet = at_rest.as_ref().unwrap_or(&*model);
    let rounds = Rounds::of(&*model, quiet, fitted, observer);
    let origin = Point {
        nuisance: vec![0.0; model.nuisance()],
        effects: Vec::new(),
    };
    let nominal = rounds.settled(None, &origin)?;
    let (best, others) = rounds.search(nominal, FLOOR);
    let (mut best, mut judgement) = weighed(&rounds, best, &others, held_out)?;
    let is_near = best.model.is_usual() && best.hypothesis.mean_square() < NEAR_NOISE;
    if judgement.verdict == Verdict::Unexplained && is_near && !observer.is_over() {
        // Too weak to matter, but perhaps all that is left.
        let (weak, rivals) = rounds.search(best.clone(), 0.0);
        let (weak, again) = weighed(&rounds, weak, &rivals, held_out)?;
        if matches!(again.verdict, Verdict::Named | Verdict::Ambiguous) {
            let strong = matters(model.candidates(), &again.best.point, FLOOR);
            judgement = Judgement {
                verdict: if strong {
                    again.verdict
                } else {
                    Verdict::TooSmall
                },
                ..again
            };
            best = weak;
        }
    }
    if judgement.verdict == Verdict::Unexplained && !observer.is_over() {
        let core = core(&rounds, &best.hypothesis.fit.point);
        if let Some(core) = core.filter(|core| core.explains > MOST_OF_IT) {
            let names = |own: &WeighedModel| -> Vec<&str> {
                own.effects.iter().map(|effect| effect.effect).collect()
            };
            judgement
                .candidates
                .retain(|own| names(own) != names(&core));
            judgement.candidates.insert(0, core);
            judgement.candidates.truncate(CANDIDATES);
        }
    }
    *model = best.model;
    if observer.has_cut() && judgement.verdict != Verdict::Adequate {
        judgement.verdict = Verdict::Unexplained;
    }
    Some(judgement)
}

/// The place of the effect with which unseen records are predicted worst, where that is worse than without it.
fn refuted(unseen_gains: &[Option<f64>]) -> Option<usize> {
    let gains = unseen_gains.iter().enumerate();
    let known = gains.filter_map(|(place, gain)| Some((place, (*gain)?)));
    let worst = known.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (worst.1 < -REFUTED).then_some(worst.0)
}

/// The place of the effect of `point` that is known worst, where none of its sizes is known to be other than zero. With
/// errors as `effects` have them, which bursts and noises of another form widen, it did not earn its price.
fn unsure(candidates: &[Candidate], point: &Point, effects: &[NamedEffect]) -> Option<usize> {
    let surest = |(i, effect): (usize, &NamedEffect)| {
        let pairs = candidates[i].parameters.iter().zip(&effect.parameters);
        pairs
            .filter(|(own, _)| own.has_zero())
            .map(|(_, size)| size.value.abs() / size.standard_error)
            .max_by(f64::total_cmp)
    };
    let places = point.effects.iter().map(|(i, _)| *i).zip(effects);
    let all = places
        .map(surest)
        .enumerate()
        .filter_map(|(place, own)| Some((place, own?)));
    let worst = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (worst.1 < SURE).then_some(worst.0)
}

/// What is `found`, judged, without the effects that unseen records refute and without those that would be named
/// though they may not be there.
fn weighed<M: ExtensibleModel + Clone>(
    rounds: &Rounds<'_, M>,
    found: Settled<M>,
    rivals: &[Hypothesis],
    held_out: &[usize],
) -> Option<(Settled<M>, Judgement)> {
    let mut found = rounds.steady(found);
    loop {
        let judgement = weigh(&found, rivals, rounds.records, held_out, rounds.observer)?;
        let (point, effects) = (&judgement.all.point, &judgement.effects);
        let place = refuted(&judgement.unseen_gains).or_else(|| {
            let is_said = judgement.verdict != Verdict::Unexplained;
            is_said.then(|| unsure(rounds.assumed.candidates(), point, effects))?
        });
        let smaller = place.and_then(|place| {
            let smaller = ablation::without(&found.hypothesis.fit.point, place);
            rounds.settled(Some(&found), &smaller)
        });
        match smaller {
            Some(smaller) => found = smaller,
            None => return Some((found, judgement)),
        }
    }
}

/// The one effect of `point` that explains most under the noises of the quiet records, which have no part
/// of what is missing.
fn core<M: ExtensibleModel + Clone>(rounds: &Rounds<'_, M>, point: &Point) -> Option<WeighedModel> {
    let selection = PenalisedLikelihood::of(rounds.quiet, rounds.records, rounds.observer);
    let excess = |own: &Hypothesis| (own.mean_square() - 1.0).max(0.0);
    let fitted = |effects: &[(usize, Vec<f64>)]| {
        let start = Point {
            nuisance: vec![0.0; point.nuisance.len()],
            effects: effects.to_vec(),
        };
        selection.hypothesis(&evaluate(rounds.quiet, &start, rounds.records)?)
    };
    let nominal = excess(&fitted(&[])?);
    let alone = point.effects.iter().filter_map(|own| {
        let found = fitted(std::slice::from_ref(own))?;
        let explains = 1.0 - excess(&found) / nominal.max(f64::MIN_POSITIVE);
        Some(WeighedModel::of(rounds.quiet, &found, 0.0, explains, false))
    });
    alone.max_by(|a, b| a.explains.total_cmp(&b.explains))
}

/// The model with the noises that the `quiet` records show under the nominal one, where with them the residual
/// there is nearly noise. A missing effect is then visible only at a higher level, and is not part of the
/// noises.
fn learned_at_rest<M: ExtensibleModel + Clone>(model: &M, quiet: &[usize]) -> Option<M> {
    if quiet.is_empty() {
        return None;
    }
    let origin = Point {
        nuisance: vec![0.0; model.nuisance()],
        effects: Vec::new(),
    };
    let found = settled(model, &origin, quiet, Observer::none())?;
    let tests = left_over(&found.model, &found.hypothesis.fit, quiet, false);
    let is_nearly_noise = tests.iter().all(|test| test.deviate < NEARLY_NOISE);
    (is_nearly_noise && found.model.is_usual()).then_some(found.model)
}

/// Judges the `found` model against its rivals, whose scores are those under their own noises.
fn weigh<M: ExtensibleModel>(
    found: &Settled<M>,
    rivals: &[Hypothesis],
    fitted: &[usize],
    held_out: &[usize],
    observer: Observer<'_>,
) -> Option<Judgement> {
    let model = &found.model;
    let selection = PenalisedLikelihood::of(model, fitted, observer);
    let nominal = selection.nominal()?;
    let best = found.hypothesis.clone();
    let named = !best.fit.point.effects.is_empty();
    // Fits from two starts may end at one model, which is not its own rival.
    let mut known = vec![best.effects()];
    let others = rivals.iter().take(CANDIDATES).filter(|rival| {
        let set = rival.effects();
        let is_new = !known.contains(&set);
        known.push(set);
        is_new
    });
    let others = others.filter_map(|rival| {
        let start = evaluate(model, &rival.fit.point, fitted)?;
        Some(Hypothesis {
            score: rival.score,
            ..selection.hypothesis(&start)?
        })
    });
    let others: Vec<Hypothesis> = others.collect();
    let nominal_square = nominal.mean_square();
    let nominal_point = nominal.fit.point.clone();
    let first = named.then(|| best.clone());
    let everything: Vec<usize> = fitted.iter().chain(held_out).copied().collect();
    // The held-out record is predicted with the fitted parameters for the gain; whether noise is
    // all that is left is asked of a fit to everything, free of the parameters' own errors.
    let joint = evaluate(model, &best.fit.point, &everything)
        .and_then(|start| polish(model, &start, &everything, None, ROUNDS, SETTLED))
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
    let excess = |square: f64| (square - 1.0).max(0.0);
    let share_explained = if excess(nominal_square) > 0.0 {
        1.0 - excess(best.mean_square()) / excess(nominal_square)
    } else {
        1.0
    };
    let is_explained = named && share_explained > NEARLY_ALL;
    let mut tests = left_over(model, &joint_fit, &everything, is_explained);
    tests.sort_by(|a, b| b.deviate.total_cmp(&a.deviate));
    let effects = best.fit.point.effects.iter();
    let tolerance = effects.fold(1.0f64, |most, (i, _)| {
        most.max(model.candidates()[*i].tolerance)
    });
    let tolerance_of = |test: &Test| match is_explained && test.place.is_some() {
        true => tolerance.max(LEFT_BY_FORM),
        false => tolerance,
    };
    let adequate = !tests.iter().any(|test| test.fails(tolerance_of(test)));

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
        if named && !nested(&set) && !extends(&set, &best_names) {
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
    let explains = |own: &Hypothesis| {
        let nominal = excess(nominal_square);
        if nominal > 0.0 {
            1.0 - excess(own.mean_square()) / nominal
        } else {
            0.0
        }
    };
    // What a model has beside the best one did not pay.
    let weighed = first.iter().chain(&others);
    let weighed = weighed.filter(|own| !named || !extends(&names(model, own), &best_names));
    let weighed: Vec<&Hypothesis> = weighed.take(CANDIDATES).collect();
    let odds = |own: &Hypothesis| {
        let behind = if named {
            own.score - best.score
        } else {
            lacks(model.candidates(), own, &best)
        };
        (-0.5 * behind.max(0.0)).exp()
    };
    let of_nominal = if named { 0.0 } else { 1.0 };
    let all_odds = of_nominal + weighed.iter().map(|own| odds(own)).sum::<f64>();
    let candidates: Vec<WeighedModel> = weighed
        .into_iter()
        .map(|own| {
            let weight = odds(own) / all_odds;
            WeighedModel::of(model, own, weight, explains(own), adequate)
        })
        .collect();
    // What is told of the effects rests on all records, as long as the model holds on them.
    let (all, jacobian) = match joint_jacobian.filter(|_| adequate) {
        Some(jacobian) => (joint_fit, jacobian),
        None => (best.fit.clone(), best.jacobian),
    };
    let refitted = |smaller: Point| -> Option<Point> {
        let start = evaluate(model, &smaller, fitted)?;
        let (fit, _) = polish(model, &start, fitted, None, ROUNDS, SETTLED)?;
        Some(fit.point)
    };
    let own = &best.fit.point;
    let smaller = (0..own.effects.len()).map(|place| refitted(ablation::without(own, place)));
    let without: Vec<Option<Point>> = smaller.collect();
    let unseen_gains = without.iter().map(|without| {
        let without = without.as_ref()?;
        ablation::unseen_gain(model, own, without, held_out)
    });
    let unseen_gains = unseen_gains.collect();
    let deviations = jacobian.deviations(model, &all).unwrap_or_default();
    let mut effects = estimates(model.candidates(), &all.point, &deviations);
    let mut nuisance_errors = deviations;
    nuisance_errors.truncate(all.point.nuisance.len());
    for effect in &mut effects {
        effect.confidence = SUREST / weight;
    }
    Some(Judgement {
        verdict,
        effects,
        alternatives,
        rival_points,
        nuisance_errors,
        best: best.fit,
        all,
        tests,
        share_explained,
        candidates,
        without,
        unseen_gains,
        nominal: nominal_point,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{EffectParameter, Scale};

    #[test]
    fn a_size_is_known_no_better_than_its_model_explains() {
        let estimate = |value, standard_error, is_shape| ParameterEstimate {
            name: "size".into(),
            value,
            unit: "N",
            standard_error,
            is_shape,
        };
        let mut effects = [NamedEffect {
            effect: "friction",
            parameters: vec![estimate(-4.0, 0.3, false), estimate(0.1, 0.01, true)],
            confidence: 1.0,
        }];
        widen(&mut effects, 0.01);
        let errors = effects[0].parameters.iter().map(|own| own.standard_error);
        // A tenth of 4, beside 0.3.
        assert_eq!(errors.collect::<Vec<_>>(), [0.5, 0.01]);
        widen(&mut effects, -0.1);
        assert_eq!(effects[0].parameters[0].standard_error, 0.5);
    }

    #[test]
    fn estimates_are_in_si_with_the_errors_behind_those_of_the_nuisance() {
        let parameter = |name, scale, role| EffectParameter {
            name,
            unit: "N",
            scale,
            role,
            bounds: (0.0, 10.0),
        };
        let size = parameter("size", Scale::Linear(0.5), Role::Size { weak: 0.1 });
        let shape = Role::Shape {
            typical: 1.0,
            spread: 0.5,
        };
        let shape = parameter("shape", Scale::Linear(-2.0), shape);
        let candidates = [
            Candidate::new("first", vec![size.clone()], Vec::new()),
            Candidate::new("second", vec![size, shape], Vec::new()),
        ];
        let point = Point {
            nuisance: vec![0.1, 0.2],
            effects: vec![(1, vec![3.0, 4.0]), (0, vec![5.0])],
        };
        let found = estimates(&candidates, &point, &[9.0, 9.0, 0.25, 0.125]);
        let figures: Vec<(&str, &str, f64, f64, bool)> = found
            .iter()
            .flat_map(|own| own.parameters.iter().map(move |one| (own.effect, one)))
            .map(|(effect, one)| {
                let name = one.name.as_str();
                (effect, name, one.value, one.standard_error, one.is_shape)
            })
            .collect();
        assert_eq!(
            figures[..2],
            [
                ("second", "size", 1.5, 0.125, false),
                ("second", "shape", -8.0, 0.25, true),
            ]
        );
        // Nobody knows the error of the last.
        let (effect, _, value, error, _) = figures[2];
        assert_eq!((effect, value), ("first", 2.5));
        assert!(error.is_nan());
    }

    #[test]
    fn verdicts_are_words_that_fill_a_column() {
        let words = [
            Verdict::Adequate,
            Verdict::Named,
            Verdict::Ambiguous,
            Verdict::TooSmall,
            Verdict::Unexplained,
        ]
        .map(|own| format!("{own:>11}|"));
        let expected = [
            "   adequate|",
            "      named|",
            "  ambiguous|",
            "  too small|",
            "unexplained|",
        ];
        assert_eq!(words, expected);
    }

    #[test]
    fn an_effect_that_predicts_unseen_records_worse_is_refuted() {
        assert_eq!(
            refuted(&[Some(13.6), Some(-6.7), None, Some(-3.1)]),
            Some(1)
        );
        assert_eq!(refuted(&[Some(-1.9), Some(5.3)]), None);
        assert_eq!(refuted(&[]), None);
    }

    #[test]
    fn an_effect_that_may_be_nothing_is_unsure() {
        let linear = |role| EffectParameter::example(Scale::Linear(1.0), role);
        let candidates = [
            vec![linear(Role::SIZE), linear(Role::SHAPE)],
            vec![linear(Role::SIZE), linear(Role::SIZE)],
            vec![EffectParameter::example(Scale::Logarithmic, Role::SIZE)],
        ]
        .map(|own| Candidate::new("effect", own, Vec::new()));
        let estimate = |(value, standard_error): (f64, f64)| ParameterEstimate {
            name: "size".into(),
            value,
            unit: "N",
            standard_error,
            is_shape: false,
        };
        let found = |all: &[(usize, &[(f64, f64)])]| {
            let point = Point {
                nuisance: Vec::new(),
                effects: all
                    .iter()
                    .map(|(i, own)| (*i, vec![0.0; own.len()]))
                    .collect(),
            };
            let effects = all.iter().map(|(_, own)| NamedEffect {
                effect: "effect",
                parameters: own.iter().copied().map(estimate).collect(),
                confidence: 1.0,
            });
            unsure(&candidates, &point, &effects.collect::<Vec<_>>())
        };
        // Its form is known well and its size is not.
        assert_eq!(found(&[(0, &[(-4.9, 1.0), (9.0, 1.0)])]), Some(0));
        assert_eq!(found(&[(0, &[(-5.1, 1.0), (1.0, 1.0)])]), None);
        // One size is enough; of two effects the worse goes.
        assert_eq!(found(&[(1, &[(0.1, 1.0), (6.0, 1.0)])]), None);
        let two: &[(f64, f64)] = &[(0.1, 1.0), (2.0, 1.0)];
        assert_eq!(found(&[(0, &[(4.0, 1.0), (0.0, 1.0)]), (1, two)]), Some(1));
        // A logarithm has no zero, and of an unknown error nothing follows.
        assert_eq!(found(&[(2, &[(0.1, 1.0)])]), None);
        assert_eq!(found(&[(0, &[(1.0, f64::NAN), (1.0, 1.0)])]), None);
        assert_eq!(found(&[]), None);
    }

    #[test]
    fn a_further_effect_that_does_not_pay_is_not_a_rival_and_another_one_is() {
        let best = ["displacement_lag"];
        assert!(extends(&["load_cell_scale", "displacement_lag"], &best));
        assert!(!extends(&["displacement_lag"], &best));
        assert!(!extends(&["command_delay"], &best));
        assert!(!extends(&["command_delay", "load_cell_scale"], &best));
    }
}

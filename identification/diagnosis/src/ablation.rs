//! What an effect is worth: against the model without it, refitted, under the noises that then fit best.

use super::fit::{Fit, evaluate, residuals};
use super::likelihood::{Hypothesis, PenalisedLikelihood, named, pays, special_case};
use super::model::{ExtensibleModel, Point};
use super::progress::{Observer, Progress};

/// Times that noises are learned and the model refitted under them.
const ROUNDS: usize = 3;
/// Rounds of a fit in between.
const ROUNDS_OF_A_FIT: usize = 4;
/// Twice the log likelihood below which noises that are learned once more change nothing.
const NOTHING_NEW: f64 = 20.0;
/// Share of the residuals' power beyond which a difference between two models is not doubted.
const BEYOND_DOUBT: f64 = 0.02;
/// Samples in a block over which unseen likelihoods are summed, as a share of a record.
const BLOCKS: usize = 40;

/// Share of what an effect gains that another one of the same law must gain: the form of a law is not known better.
/// Lifting off gained 0.35 % of what yielding did where a specimen of many sliders yields one after the other.
const FORM_IS_KNOWN_TO: f64 = 0.01;

/// A fitted model with the noises that fit it. Scores of models under different noises compare.
#[derive(Clone)]
pub(super) struct Settled<M> {
    pub model: M,
    pub hypothesis: Hypothesis,
    /// False where they are those that the fit began with.
    pub has_learned: bool,
}

impl<M> Settled<M> {
    /// Difference of scores from it that no other form of a noise makes up for.
    pub fn beyond_doubt(&self) -> f64 {
        BEYOND_DOUBT * self.hypothesis.fit.residuals.len() as f64
    }
}

/// The model at `start` fitted to `records` under `model`'s noises, then under those that its own
/// residuals show, in turn, as long as the score falls.
pub(super) fn settled<M: ExtensibleModel + Clone>(
    model: &M,
    start: &Point,
    records: &[usize],
    observer: Observer<'_>,
) -> Option<Settled<M>> {
    let fitted = |model: &M, start: &Point| {
        let selection = PenalisedLikelihood::of(model, records, observer);
        let start = evaluate(model, start, records)?;
        selection.hypothesis_in(&start, ROUNDS_OF_A_FIT)
    };
    let mut best = Settled {
        hypothesis: fitted(model, start)?,
        model: model.clone(),
        has_learned: false,
    };
    for _ in 0..ROUNDS {
        if observer.is_over() {
            break;
        }
        let Fit {
            point, residuals, ..
        } = &best.hypothesis.fit;
        let lesson = best.model.with_learned_noise(point, residuals, records);
        if let Some(own) = &lesson {
            observer.tell(|| Progress::Noise {
                gain: own.gain,
                figures: own.figures.clone(),
            });
        }
        let Some(lesson) = lesson.filter(|own| own.is_believable && own.gain > NOTHING_NEW) else {
            break;
        };
        let Some(next) = fitted(&lesson.model, point) else {
            break;
        };
        if next.score >= best.hypothesis.score {
            break;
        }
        best = Settled {
            model: lesson.model,
            hypothesis: next,
            has_learned: true,
        };
    }
    Some(best)
}

/// As [`settled`] under the noises of `near`, and under the `assumed` ones where those may hide what the model
/// lacks: of both the better. A model that is far worse than `near` needs no second look.
pub(super) fn settled_from<M: ExtensibleModel + Clone>(
    assumed: &M,
    near: &Settled<M>,
    start: &Point,
    records: &[usize],
    observer: Observer<'_>,
) -> Option<Settled<M>> {
    let first = settled(&near.model, start, records, observer);
    let is_known = |own: &Settled<M>| {
        own.model.is_usual() || own.hypothesis.score - near.hypothesis.score > near.beyond_doubt()
    };
    if near.model.has_noises_of(assumed) || first.as_ref().is_some_and(is_known) {
        return first;
    }
    let second = settled(assumed, start, records, observer);
    first
        .into_iter()
        .chain(second)
        .min_by(|a, b| a.hypothesis.score.total_cmp(&b.hypothesis.score))
}

/// `point` without its effect at `place`.
pub(super) fn without(point: &Point, place: usize) -> Point {
    let mut smaller = point.clone();
    smaller.effects.remove(place);
    smaller
}

/// `found` without the effects, or what they have beyond their special cases, that do not earn their price
/// once the noises may take their place; and the models without each of those that stay. Those of the set `kept` have
/// earned it already.
pub(super) fn ablated<M: ExtensibleModel + Clone>(
    assumed: &M,
    found: Settled<M>,
    kept: &[usize],
    records: &[usize],
    observer: Observer<'_>,
) -> (Settled<M>, Vec<Option<Settled<M>>>) {
    let mut current = found;
    loop {
        if current.hypothesis.effects() == kept {
            return (current, Vec::new());
        }
        let candidates = current.model.candidates();
        let point = &current.hypothesis.fit.point;
        let places = 0..point.effects.len();
        let refitted = |smaller: Point| {
            if observer.is_over() {
                return None;
            }
            observer.tell(|| Progress::Trying(format!("only {}", named(candidates, &smaller))));
            settled_from(assumed, &current, &smaller, records, observer)
        };
        let special = places
            .clone()
            .filter_map(|place| refitted(special_case(candidates, point, place)?))
            .collect::<Vec<_>>();
        let mut simpler: Vec<_> = places
            .map(|place| refitted(without(point, place)))
            .collect();
        let gain = |own: &Settled<M>| own.hypothesis.score - current.hypothesis.score;
        let gains: Vec<(&str, f64)> = point
            .effects
            .iter()
            .zip(&simpler)
            .map(|((i, _), own)| (candidates[*i].law, own.as_ref().map_or(0.0, gain)))
            .collect();
        let is_worth = |own: &Settled<M>| pays(candidates, &current.hypothesis, &own.hypothesis);
        let score = |own: &Settled<M>| own.hypothesis.score;
        let of_place = |place: &usize| simpler[*place].as_ref().map_or(f64::INFINITY, score);
        let goes = |place: &usize| {
            let own = simpler[*place].as_ref();
            own.is_some_and(|own| !is_worth(own) || is_form(&gains, *place))
        };
        let place = (0..simpler.len())
            .filter(goes)
            .min_by(|a, b| of_place(a).total_cmp(&of_place(b)));
        let smaller = place.and_then(|place| simpler[place].take());
        let smaller = smaller
            .into_iter()
            .chain(special.into_iter().filter(|own| !is_worth(own)))
            .min_by(|a, b| score(a).total_cmp(&score(b)));
        match smaller {
            Some(smaller) => current = smaller,
            None => return (current, simpler),
        }
    }
}

/// Whether the effect at `place`, of laws and what each gains, gains so little beside another one of its law that it
/// makes up for that one's form.
fn is_form(gains: &[(&str, f64)], place: usize) -> bool {
    let (law, own) = gains[place];
    let mut same = gains.iter().filter(|(other, _)| *other == law);
    !law.is_empty() && same.any(|(_, gain)| own < FORM_IS_KNOWN_TO * gain)
}

/// Normal deviate of what `with` predicts better than `without` on `records` that neither was fitted to:
/// twice the log likelihood, summed by blocks whose scatter is its error.
pub(super) fn unseen_gain<M: ExtensibleModel>(
    model: &M,
    with: &Point,
    without: &Point,
    records: &[usize],
) -> Option<f64> {
    let mut gains = Vec::new();
    for &record in records {
        let cost = |point: &Point| {
            let predictor = model.predictor(point)?;
            let residuals = residuals(model, &predictor, point, &[record])?;
            Some((residuals, model.log_determinant(&predictor)))
        };
        let ((better, own), (worse, other)) = (cost(with)?, cost(without)?);
        let samples = model.sample_count(record).max(1);
        let width = better.len() / samples;
        let block = samples.div_ceil(BLOCKS).max(1) * width.max(1);
        let pairs = better.chunks(block).zip(worse.chunks(block));
        gains.extend(pairs.map(|(a, b)| {
            let squares = |values: &[f64]| values.iter().map(|r| r * r).sum::<f64>();
            let count = (a.len() / width.max(1)) as f64;
            squares(b) - squares(a) + count * (other - own)
        }));
    }
    let count = gains.len() as f64;
    let sum: f64 = gains.iter().sum();
    let mean = sum / count;
    let scatter: f64 = gains.iter().map(|gain| (gain - mean).powi(2)).sum();
    (count > 1.0 && scatter > 0.0).then(|| sum / (scatter * count / (count - 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Candidate, Lesson};

    /// Two channels that are noise about a level; the effect doubles the noise that is assumed.
    struct Levels {
        candidates: Vec<Candidate>,
        measured: Vec<Vec<[f64; 2]>>,
    }

    impl ExtensibleModel for Levels {
        /// The assumed noise.
        type Predictor = f64;

        fn nuisance(&self) -> usize {
            1
        }
        fn candidates(&self) -> &[Candidate] {
            &self.candidates
        }
        fn records(&self) -> usize {
            self.measured.len()
        }
        fn record_name(&self, _: usize) -> &str {
            "record"
        }
        fn channels(&self) -> &[&'static str] {
            &["one", "other"]
        }
        fn regressors(&self, _: usize) -> Vec<(String, Vec<f64>)> {
            Vec::new()
        }
        fn with_learned_noise(&self, _: &Point, _: &[f64], _: &[usize]) -> Option<Lesson<Self>> {
            None
        }
        fn quiet_records(&self, _: &[usize]) -> Vec<usize> {
            Vec::new()
        }
        fn residual_count(&self, record: usize) -> usize {
            2 * self.measured[record].len()
        }
        fn sample_count(&self, record: usize) -> usize {
            self.measured[record].len()
        }
        fn predictor(&self, point: &Point) -> Option<f64> {
            Some(if point.effects.is_empty() { 1.0 } else { 2.0 })
        }
        fn log_determinant(&self, noise: &f64) -> f64 {
            2.0 * (noise * noise).ln()
        }
        fn residuals(&self, noise: &f64, point: &Point, record: usize, out: &mut [f64]) -> bool {
            let values = self.measured[record].as_flattened();
            for (out, value) in out.iter_mut().zip(values) {
                *out = (value - point.nuisance[0]) / noise;
            }
            true
        }
    }

    fn levels(lengths: &[usize], size: f64) -> Levels {
        let value = |k: usize| size * ((k * k) as f64).sin();
        Levels {
            candidates: vec![Candidate::new("louder", Vec::new(), Vec::new())],
            measured: lengths
                .iter()
                .map(|&length| {
                    (0..length)
                        .map(|k| [value(k), 1.0 + value(k + 7)])
                        .collect()
                })
                .collect(),
        }
    }

    /// By the densities of the normal distribution, sample by sample.
    #[test]
    fn an_unseen_gain_is_a_sum_of_log_likelihoods_over_the_scatter_of_its_blocks() {
        let bare = Point {
            nuisance: vec![0.25],
            effects: Vec::new(),
        };
        let louder = Point {
            nuisance: vec![0.5],
            effects: vec![(0, Vec::new())],
        };
        let model = levels(&[203, 100, 57], 3.0);
        let found = unseen_gain(&model, &louder, &bare, &[0, 2]).unwrap();
        let density = |value: f64, level: f64, noise: f64| {
            let off = (value - level) / noise;
            -2.0 * noise.ln() - off * off
        };
        // A fortieth of a record, rounded up: 6 samples of 203, 2 of 57.
        let mut blocks = Vec::new();
        for (record, length) in [(0, 6), (2, 2)] {
            for block in model.measured[record].chunks(length) {
                let gain = |value: &f64| density(*value, 0.5, 2.0) - density(*value, 0.25, 1.0);
                blocks.push(block.as_flattened().iter().map(gain).sum::<f64>());
            }
        }
        assert_eq!(blocks.len(), 34 + 29);
        let count = blocks.len() as f64;
        let mean = blocks.iter().sum::<f64>() / count;
        let variance = blocks.iter().map(|own| (own - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let expected = mean / (variance / count).sqrt();
        assert!(
            (found - expected).abs() < 1e-9 * expected.abs(),
            "{found} {expected}"
        );
        assert!(found > 0.0);
        // The other way round it is as much worse.
        let back = unseen_gain(&model, &bare, &louder, &[0, 2]).unwrap();
        assert!((back + found).abs() < 1e-9);
        // One block has no scatter, and neither have equal ones.
        assert_eq!(unseen_gain(&levels(&[1], 3.0), &louder, &bare, &[0]), None);
        assert_eq!(unseen_gain(&levels(&[80], 0.0), &bare, &bare, &[0]), None);
        assert_eq!(unseen_gain(&model, &louder, &bare, &[]), None);
    }

    #[test]
    fn a_small_gain_beside_a_large_one_of_its_law_is_form() {
        let gains = [
            ("slip", 0.5),
            ("slip", 100.0),
            ("lag", 0.5),
            ("", 0.1),
            ("", 90.0),
        ];
        let form: Vec<bool> = (0..gains.len())
            .map(|place| is_form(&gains, place))
            .collect();
        assert_eq!(form, [true, false, false, false, false]);
        // One per cent is not less than one per cent.
        assert!(!is_form(&[("slip", 1.0), ("slip", 100.0)], 0));
        let point = Point {
            nuisance: vec![1.0],
            effects: vec![(3, vec![0.5]), (7, vec![2.0])],
        };
        let smaller = without(&point, 0);
        assert_eq!(smaller.effects, [(7, vec![2.0])]);
        assert_eq!(smaller.nuisance, point.nuisance);
    }
}

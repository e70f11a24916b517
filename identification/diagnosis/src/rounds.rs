//! The search in rounds: which effects are tried beside or in the place of others, every model under noises of its own.

use super::ablation::{self, Settled, ablated, settled, settled_from};
use super::fit::{evaluate, polish};
use super::likelihood::{
    Hypothesis, MOST_EFFECTS, NEAR_NOISE, PenalisedLikelihood, SETTLED, matters, named, pays,
};
use super::model::{Candidate, ExtensibleModel, Point};
use super::progress::{Observer, Progress, Step};
use std::cell::RefCell;

/// Extensions that are fitted under noises of their own, in the first round; one less in each further.
const PROPOSED: usize = 3;
/// Share of what the best of them gains that they gain at least.
const NEAR: f64 = 0.5;
/// Share of its size that an effect keeps where the predictor follows the records less closely.
const STEADY: f64 = 0.5;
/// Rounds of the fit that asks for it.
const ROUNDS_OF_DOUBT: usize = 4;
/// Times that an effect of the best model gives its place to another one.
const EXCHANGES: usize = 2;

/// A search in rounds.
pub(super) struct Rounds<'a, M> {
    /// The model with the noises that were stated.
    pub assumed: &'a M,
    /// With those of the quiet records.
    pub quiet: &'a M,
    pub records: &'a [usize],
    pub observer: Observer<'a>,
    /// Sets of effects that were extended by further ones.
    extended: RefCell<Vec<Vec<usize>>>,
}

impl<'a, M: ExtensibleModel + Clone> Rounds<'a, M> {
    /// On some `records`, from noises that were stated and from those of the quiet records.
    pub fn of(assumed: &'a M, quiet: &'a M, records: &'a [usize], observer: Observer<'a>) -> Self {
        Self {
            assumed,
            quiet,
            records,
            observer,
            extended: RefCell::default(),
        }
    }

    /// The model at `start` under its own noises; in the beginning no model is `near`.
    pub fn settled(&self, near: Option<&Settled<M>>, start: &Point) -> Option<Settled<M>> {
        let (records, observer) = (self.records, self.observer);
        let found = match near {
            Some(near) => settled_from(self.assumed, near, start, records, observer),
            None => settled(self.quiet, start, records, observer),
        }?;
        let selection = PenalisedLikelihood::of(&found.model, self.records, self.observer);
        selection.tell(Step::Refitted, &found.hypothesis);
        Some(found)
    }

    /// From `start` as long as an effect pays, then without what does not; and the rivals of the last round.
    pub fn search(&self, start: Settled<M>, floor: f64) -> (Settled<M>, Vec<Hypothesis>) {
        let kept = start.hypothesis.effects();
        let mut current = start;
        let mut others: Vec<Settled<M>> = Vec::new();
        while current.hypothesis.effects().len() < MOST_EFFECTS && !self.observer.is_over() {
            let mut tried: Vec<Settled<M>> = Vec::new();
            for proposal in self.proposals(&current, floor, &[]) {
                if proposal.is_reached(tried.iter().map(|own| &own.hypothesis).map(scored)) {
                    continue;
                }
                let point = &proposal.point;
                self.observer.tell(|| {
                    let what = named(self.assumed.candidates(), point);
                    Progress::Trying(format!("{what} under its own noises"))
                });
                tried.extend(self.settled(Some(&current), point));
            }
            tried.retain(|own| {
                let point = &own.hypothesis.fit.point;
                matters(self.assumed.candidates(), point, floor)
            });
            tried.sort_by(|a, b| a.hypothesis.score.total_cmp(&b.hypothesis.score));
            let candidates = self.assumed.candidates();
            let taken = tried
                .iter()
                .position(|own| pays(candidates, &own.hypothesis, &current.hypothesis));
            let Some(taken) = taken else {
                if others.is_empty() {
                    others = tried;
                }
                break;
            };
            current = tried.remove(taken);
            others = tried;
        }
        let mut others: Vec<Hypothesis> = others.into_iter().map(|own| own.hypothesis).collect();
        let mut exchanges = 0..EXCHANGES;
        loop {
            let (best, simpler) =
                ablated(self.assumed, current, &kept, self.records, self.observer);
            let better = exchanges
                .next()
                .and_then(|_| self.exchanged(&best, &simpler, floor, &mut others));
            match better {
                Some(better) => current = better,
                None => return (best, others),
            }
        }
    }

    /// A better model than `best` with another effect in the place of one of its own: what was taken first may have been
    /// right only by itself. `simpler` are the models without each of these; what was tried in vain goes to `others`.
    fn exchanged(
        &self,
        best: &Settled<M>,
        simpler: &[Option<Settled<M>>],
        floor: f64,
        others: &mut Vec<Hypothesis>,
    ) -> Option<Settled<M>> {
        let mut known = vec![best.hypothesis.effects()];
        known.extend(others.iter().map(Hypothesis::effects));
        if known[0].len() < 2 {
            return None;
        }
        for simpler in simpler.iter().flatten() {
            if self
                .extended
                .borrow()
                .contains(&simpler.hypothesis.effects())
            {
                continue;
            }
            for proposal in self.proposals(simpler, floor, &known) {
                if self.observer.is_over() {
                    break;
                }
                if proposal.is_reached(others.iter().map(scored)) {
                    continue;
                }
                let point = &proposal.point;
                self.observer.tell(|| {
                    let what = named(self.assumed.candidates(), point);
                    Progress::Trying(format!("{what} in its place"))
                });
                let Some(own) = self.settled(Some(simpler), point) else {
                    continue;
                };
                if own.hypothesis.score < best.hypothesis.score {
                    others.push(best.hypothesis.clone());
                    return Some(own);
                }
                known.push(own.hypothesis.effects());
                others.push(own.hypothesis);
            }
        }
        None
    }

    /// `found` without the effects of the linear part that hardly pay and depend on how closely the predictor
    /// follows the records: the rig does not, a noise of another form does.
    pub fn steady(&self, mut found: Settled<M>) -> Settled<M> {
        while let Some(place) = self.wavering(&found) {
            let smaller = ablation::without(&found.hypothesis.fit.point, place);
            self.observer.tell(|| {
                let what = named(self.assumed.candidates(), &smaller);
                Progress::Trying(format!("only {what}"))
            });
            let (records, observer) = (self.records, self.observer);
            let Some(smaller) = settled_from(self.assumed, &found, &smaller, records, observer)
            else {
                break;
            };
            if smaller.hypothesis.score - found.hypothesis.score > found.beyond_doubt() {
                break;
            }
            found = smaller;
        }
        found
    }

    /// The place of an effect of the linear part in `found` that loses most of its size where the predictor
    /// follows less closely.
    fn wavering(&self, found: &Settled<M>) -> Option<usize> {
        let candidates = found.model.candidates();
        let effects = &found.hypothesis.fit.point.effects;
        let mut linear = effects.iter().filter(|(i, _)| candidates[*i].is_linear);
        if self.observer.is_over() || linear.next().is_none() {
            return None;
        }
        let other = found.model.following_less()?;
        let start = evaluate(&other, &found.hypothesis.fit.point, self.records)?;
        let (again, _) = polish(&other, &start, self.records, None, ROUNDS_OF_DOUBT, SETTLED)?;
        let mut pairs = effects.iter().zip(&again.point.effects);
        pairs.position(|((i, own), (_, again))| {
            let candidate = &candidates[*i];
            candidate.is_linear && has_shrunk(candidate, own, again)
        })
    }

    /// Models with one more effect than `current` that are not `known`, the most promising first.
    /// Those under the noises of the quiet records come before those under its own, which may be of the same effects.
    fn proposals(&self, current: &Settled<M>, floor: f64, known: &[Vec<usize>]) -> Vec<Proposal> {
        let effects = current.hypothesis.effects();
        self.extended.borrow_mut().push(effects);
        let under = |model: &M, current: &Hypothesis| -> Vec<Proposal> {
            let mut selection = PenalisedLikelihood::of(model, self.records, self.observer);
            selection.floor = floor;
            let mut level = selection.extensions(current);
            let gains: Vec<f64> = level.iter().map(|own| current.score - own.score).collect();
            let best = gains.first().copied().unwrap_or_default();
            level.truncate(gains.iter().filter(|gain| **gain > NEAR * best).count());
            let most = PROPOSED.saturating_sub(current.effects().len()).max(1);
            let level = level.into_iter().map(|own| Proposal {
                score: own.score,
                point: own.fit.point,
            });
            let new = level.filter(|own| !known.contains(&own.point.set()));
            new.take(most).collect()
        };
        let mut all = Vec::new();
        if !current.model.is_usual() || current.hypothesis.mean_square() > NEAR_NOISE {
            let selection = PenalisedLikelihood::of(self.quiet, self.records, self.observer);
            let start = evaluate(self.quiet, &current.hypothesis.fit.point, self.records);
            if let Some(own) = start.and_then(|start| selection.hypothesis(&start)) {
                all = under(self.quiet, &own);
            }
        }
        // Scores under the noises of the quiet records say nothing here.
        for own in &mut all {
            own.score = f64::NEG_INFINITY;
        }
        if !all.is_empty() && !current.has_learned {
            return all;
        }
        all.extend(under(&current.model, &current.hypothesis));
        all
    }
}

/// Effects that a model may have under noises of its own.
struct Proposal {
    point: Point,
    /// The score that it has, under the noises of the model that it extends.
    score: f64,
}

impl Proposal {
    /// Whether one of the models that were `fitted` has the same effects with no worse score: of two proposals of the same
    /// effects the second one is needed only where the first led astray.
    fn is_reached(&self, mut fitted: impl Iterator<Item = (Vec<usize>, f64)>) -> bool {
        let set = self.point.set();
        fitted.any(|(effects, score)| effects == set && score <= self.score)
    }
}

/// The effects of a model and its score.
fn scored(model: &Hypothesis) -> (Vec<usize>, f64) {
    (model.effects(), model.score)
}

/// Whether an effect's sizes, at coordinates `own`, are less than half of that at `again`, or of another sign.
fn has_shrunk(candidate: &Candidate, own: &[f64], again: &[f64]) -> bool {
    let parameters = candidate.parameters.iter().zip(own).zip(again);
    let mut sizes = parameters
        .filter(|((parameter, _), _)| parameter.has_zero())
        .map(|((_, own), again)| again * own.signum() < STEADY * own.abs())
        .peekable();
    sizes.peek().is_some() && sizes.all(|shrunk| shrunk)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{EffectParameter, Role, Scale};

    #[test]
    fn a_proposal_is_reached_by_a_model_of_its_effects_that_is_no_worse() {
        let proposal = |score| Proposal {
            point: Point {
                nuisance: vec![0.0; 2],
                effects: vec![(3, vec![1.0]), (1, vec![2.0])],
            },
            score,
        };
        let is_reached = |own: f64, effects: &[usize], score: f64| {
            proposal(own).is_reached([(effects.to_vec(), score)].into_iter())
        };
        assert!(is_reached(40.0, &[1, 3], 37.0));
        assert!(is_reached(40.0, &[1, 3], 40.0));
        // It led astray.
        assert!(!is_reached(40.0, &[1, 3], 46.0));
        assert!(!is_reached(40.0, &[1], 3.0));
        assert!(!is_reached(f64::NEG_INFINITY, &[1, 3], 3.0));
        assert!(!proposal(40.0).is_reached(std::iter::empty()));
    }

    #[test]
    fn an_effect_has_shrunk_where_all_its_sizes_have() {
        let linear = |role| EffectParameter::example(Scale::Linear(1.0), role);
        let two = [Role::SIZE, Role::SIZE, Role::SHAPE].map(linear);
        let two = Candidate::new("two", two.to_vec(), Vec::new());
        for (own, again, expected) in [
            ([2.0, -4.0, 3.0], [0.9, -1.9, 3.0], true),
            ([2.0, -4.0, 3.0], [1.1, -1.9, 0.0], false),
            ([2.0, -4.0, 3.0], [0.9, -2.1, 3.0], false),
            // Of another sign.
            ([2.0, -4.0, 3.0], [-5.0, 5.0, 3.0], true),
        ] {
            assert_eq!(has_shrunk(&two, &own, &again), expected, "{again:?}");
        }
        // A logarithm says nothing of that, and a shape is no size.
        let none = [
            EffectParameter::example(Scale::Logarithmic, Role::SIZE),
            linear(Role::SHAPE),
        ];
        let none = Candidate::new("none", none.to_vec(), Vec::new());
        assert!(!has_shrunk(&none, &[2.0, 2.0], &[0.1, 0.1]));
    }
}

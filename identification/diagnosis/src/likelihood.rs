//! Selection where a right model leaves white innovations: by penalised likelihood, with a beam.

use super::adequacy::{LARGEST_DEVIATE, left_over};
use super::fit::{Fit, Jacobian, evaluate, fit, polish, residuals};
use super::model::{Candidate, ExtensibleModel, Point, Role, Scale};
use super::progress::{Observer, Progress, Step};
use std::cell::OnceCell;

/// What an effect must earn, in units of `2 log` likelihood, before it is named. An effect that is
/// not there earns χ² with one degree of freedom (Wilks, Ann. Math. Stat. 9, 1938), more than 18
/// once in 45,000; with three dozen candidates, one false name in 1,200 searches (Bonferroni).
pub const PRICE_OF_AN_EFFECT: f64 = 18.0;
/// And for each further parameter that it brings. Equal significance would ask for 3.4 (χ² with two
/// degrees of freedom), Schwarz's criterion for the logarithm of the samples, about 10; chosen
/// between them.
pub const PRICE_OF_A_PARAMETER: f64 = 6.0;
/// Share of the catalogue's weakest value below which an effect is not worth a name; an engineer's
/// choice, below 1 since an estimate of the weakest may come out smaller.
pub const FLOOR: f64 = 0.6;
/// Share of the fitted residuals' power that an effect of the linear part must take away beyond its price. The
/// form of a noise, of a coarse converter's for one, is not known better: where nothing was hidden, oil that is
/// not there took away 0.35 %.
pub(super) const NOISE_IS_KNOWN_TO: f64 = 0.004;
/// Least share of an effect's gain that the records must contribute; the rest comes from the stated parameters.
/// Without the error of a scale, for one, the parameters would be far off and the records would look the same.
const BY_THE_RECORDS: f64 = 0.3;
/// A model within this of the best is a rival that the data do not rule out: odds of `e^6`, 400 to
/// one, against it; above 10 is "very strong" (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995).
pub const RIVAL_WITHIN: f64 = 12.0;
/// Mean square of whitened residuals up to which a model may be right. That of `N` values of unit
/// variance scatters by `(2/N)^{1/2}`: 0.005 with two records of 20 s, four channels at 500 Hz, so
/// that this is six deviations.
pub(crate) const NEAR_NOISE: f64 = 1.03;
/// Effects in one model.
pub(super) const MOST_EFFECTS: usize = 3;

/// Excess over noise, in that of the best, beyond which a set of effects leaves the race. Saves time
/// only: the short fits of a race are rarely a factor of two from their ends.
const BEHIND: f64 = 6.0;
/// And what a short fit may still gain, `2 log` likelihood.
const NOISE_OF_A_RACE: f64 = 1e4;

/// Largest deviate up to which learned noises are treated as most of a model's residual; the rest
/// is due to further effects. Saves time only.
pub(crate) const NEARLY_NOISE: f64 = 4.0 * LARGEST_DEVIATE;

/// Share of the catalogue's weakest size at which an effect without a threshold is looked at.
const NEARLY_NOTHING: f64 = 0.02;

/// Rounds of a fit at most; curved valleys take many.
pub(crate) const ROUNDS: usize = 12;
/// And of one that only ranks.
const FEW: usize = 2;
/// Share of the excess over noise that one more round must gain.
pub(crate) const SETTLED: f64 = 0.003;

/// A fitted model with its derivatives.
#[derive(Clone)]
pub struct Hypothesis {
    /// The fit.
    pub fit: Fit,
    /// Its derivatives by all coordinates.
    pub jacobian: Jacobian,
    /// Its cost and the price of its effects and of the noises.
    pub score: f64,
}

impl Hypothesis {
    /// Indices of its effects, ascending.
    pub fn effects(&self) -> Vec<usize> {
        self.fit.point.set()
    }

    /// Mean square of its residuals.
    pub fn mean_square(&self) -> f64 {
        let sum: f64 = self.fit.residuals.iter().map(|r| r * r).sum();
        sum / self.fit.residuals.len().max(1) as f64
    }
}

/// Price of the effects of `point`.
fn price(candidates: &[Candidate], point: &Point) -> f64 {
    let extra = |candidate: &Candidate| candidate.parameters.len().saturating_sub(1) as f64;
    point
        .effects
        .iter()
        .map(|(i, _)| PRICE_OF_AN_EFFECT + PRICE_OF_A_PARAMETER * extra(&candidates[*i]))
        .sum()
}

/// What a noise of another form may have gained: of what an effect `gained` by the records alone and with the
/// stated parameters, on so many residuals.
fn unsure([by_records, all]: [f64; 2], residuals: usize) -> f64 {
    if by_records > BY_THE_RECORDS * all {
        NOISE_IS_KNOWN_TO * residuals as f64
    } else {
        0.0
    }
}

/// Whether what `with` has more than `without` earns its price.
pub(super) fn pays(candidates: &[Candidate], with: &Hypothesis, without: &Hypothesis) -> bool {
    lacks(candidates, with, without) < 0.0
}

/// What it lacks to earn that, in units of `2 log` likelihood.
pub(super) fn lacks(candidates: &[Candidate], with: &Hypothesis, without: &Hypothesis) -> f64 {
    let known = without.effects();
    let added = with.effects().into_iter().filter(|i| !known.contains(i));
    let linear = added.filter(|i| candidates[*i].is_linear).count();
    let of_records = |own: &Hypothesis| own.fit.cost - own.fit.point.prior_cost(candidates);
    let gained = [
        of_records(without) - of_records(with),
        without.fit.cost - with.fit.cost,
    ];
    let unsure = unsure(gained, linear * with.fit.residuals.len());
    unsure - (without.score - with.score)
}

/// True when every effect of `point` has `floor` times the strength of the catalogue's weakest.
pub fn matters(candidates: &[Candidate], point: &Point, floor: f64) -> bool {
    point.effects.iter().all(|(i, internal)| {
        let candidate = &candidates[*i];
        let mut sizes = candidate
            .parameters
            .iter()
            .zip(internal)
            .filter_map(|(p, &q)| {
                let Role::Size { weak } = p.role else {
                    return None;
                };
                let value = p.scale.to_value(q);
                Some(match p.scale {
                    Scale::Linear(_) | Scale::Factor(_) => value.abs() / weak,
                    Scale::Logarithmic | Scale::Inverse(_) => weak / value,
                })
            });
        let mut none = true;
        let strong = sizes.any(|size| {
            none = false;
            size >= floor
        });
        strong || none
    })
}

/// One start of a race.
struct Runner {
    point: Point,
    cost: f64,
    effect: usize,
    parent: usize,
}

/// Selection by what an effect earns in likelihood, less its price.
pub struct PenalisedLikelihood<'a, M: ExtensibleModel> {
    /// The rig.
    pub model: &'a M,
    /// The records that are fitted: places among the model's.
    pub records: Vec<usize>,
    /// Receiver of every fit.
    pub observer: Observer<'a>,
    /// Share of the catalogue's weakest strength below which an effect is not looked at.
    pub floor: f64,
}

impl<'a, M: ExtensibleModel> PenalisedLikelihood<'a, M> {
    /// Of `model` on some records.
    pub fn of(model: &'a M, records: &[usize], observer: Observer<'a>) -> Self {
        Self {
            model,
            records: records.to_vec(),
            observer,
            floor: FLOOR,
        }
    }
}

impl<M: ExtensibleModel> PenalisedLikelihood<'_, M> {
    pub(super) fn hypothesis(&self, start: &Fit) -> Option<Hypothesis> {
        self.hypothesis_in(start, ROUNDS)
    }

    /// As [`Self::hypothesis`] in so many `rounds` at most.
    pub(super) fn hypothesis_in(&self, start: &Fit, rounds: usize) -> Option<Hypothesis> {
        let (fit, jacobian) = polish(self.model, start, &self.records, None, rounds, SETTLED)?;
        Some(self.scored(fit, jacobian))
    }

    /// As [`Self::hypothesis`] in few rounds, from derivatives near `start`.
    fn sketch(&self, start: &Fit, known: Jacobian) -> Option<Hypothesis> {
        let known = Some(known);
        let (fit, jacobian) = polish(self.model, start, &self.records, known, FEW, SETTLED)?;
        Some(self.scored(fit, jacobian))
    }

    fn scored(&self, fit: Fit, jacobian: Jacobian) -> Hypothesis {
        let price = price(self.model.candidates(), &fit.point) + self.model.noise_price();
        let score = fit.cost + price;
        Hypothesis {
            fit,
            jacobian,
            score,
        }
    }

    pub(super) fn tell(&self, step: Step, hypothesis: &Hypothesis) {
        let candidates = self.model.candidates();
        let effects = hypothesis.fit.point.effects.iter();
        self.observer.tell(|| Progress::Model {
            step,
            effects: effects
                .map(|(i, q)| (candidates[*i].effect, candidates[*i].values(q)))
                .collect(),
            figures: vec![
                ("score", hypothesis.score),
                ("cost", hypothesis.fit.cost),
                ("mean square", hypothesis.mean_square()),
                ("priors", hypothesis.fit.point.prior_cost(candidates)),
            ],
        });
    }

    fn origin(&self) -> Point {
        Point {
            nuisance: vec![0.0; self.model.nuisance()],
            effects: Vec::new(),
        }
    }

    /// Best extensions of `parents` by one more effect: short fits to the first record from every
    /// start, of which the better part runs on, then the `keep` best sets fitted to all records.
    fn extend(&self, parents: &[&Point], keep: usize) -> Vec<Hypothesis> {
        let candidates = self.model.candidates();
        let track = &self.records[..1];
        let samples: usize = track.iter().map(|&r| self.model.residual_count(r)).sum();
        let mut jacobians = Vec::new();
        let mut runners = Vec::new();
        for parent in parents {
            // What a missing effect bent the nuisance by would mislead: begin at the nominal
            // values.
            let base = &Point {
                nuisance: vec![0.0; self.model.nuisance()],
                effects: parent.effects.clone(),
            };
            let everywhere = evaluate(self.model, base, &self.records)
                .and_then(|fit| Jacobian::at(self.model, &fit, &self.records));
            let Some(everywhere) = everywhere else {
                continue;
            };
            let jacobian = everywhere.begin(samples);
            let parent = jacobians.len();
            for (effect, candidate) in candidates.iter().enumerate() {
                if is_held(candidates, base, effect) || self.observer.is_over() {
                    continue;
                }
                self.observer.tell(|| {
                    let known = named(candidates, base);
                    Progress::Trying(format!("{known} with {}", candidate.effect))
                });
                for start in &candidate.starts {
                    let mut point = base.clone();
                    point.effects.push((effect, candidate.internal(start)));
                    if let Some(fit) = fit(self.model, &point, track, &jacobian, 1) {
                        runners.push(Runner {
                            point: fit.point,
                            cost: fit.cost,
                            effect,
                            parent,
                        });
                    }
                }
            }
            jacobians.push((jacobian, everywhere));
        }
        for (iterations, share) in [(1, 2), (4, 4)] {
            runners.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            // Two starts of each set of effects run on.
            let mut starts: Vec<(usize, usize)> = Vec::new();
            runners.retain(|runner| {
                let key = (runner.parent, runner.effect);
                starts.push(key);
                starts.iter().filter(|seen| **seen == key).count() <= 2
            });
            runners.truncate(8 + 40 * parents.len() / share);
            for runner in &mut runners {
                let (jacobian, _) = &jacobians[runner.parent];
                if let Some(fit) = fit(self.model, &runner.point, track, jacobian, iterations) {
                    runner.point = fit.point;
                    runner.cost = fit.cost;
                }
            }
        }
        runners.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        // Sets that are far behind after the race are neither rivals nor worth extending.
        let excess = |runner: &Runner| (runner.cost - samples as f64).max(0.0);
        let farthest =
            runners.first().map_or(0.0, |first| BEHIND * excess(first)) + NOISE_OF_A_RACE;
        let mut seen: Vec<Vec<usize>> = Vec::new();
        let mut best: Vec<Hypothesis> = Vec::new();
        for runner in runners {
            let strong = |found: &Hypothesis| matters(candidates, &found.fit.point, self.floor);
            if excess(&runner) > farthest && best.iter().any(strong) {
                break;
            }
            let set = runner.point.set();
            if seen.contains(&set) {
                continue;
            }
            seen.push(set);
            let (_, everywhere) = &jacobians[runner.parent];
            let fitted = evaluate(self.model, &runner.point, &self.records).and_then(|start| {
                let known = everywhere.extended(self.model, &start, &self.records)?;
                self.sketch(&start, known)
            });
            best.extend(fitted);
            if best.len() == keep || self.observer.is_over() {
                break;
            }
        }
        best.sort_by(|a, b| a.score.total_cmp(&b.score));
        best
    }

    /// Extensions of an already good `parent`: only effects whose linear score promises to pay.
    fn refine(&self, parent: &Hypothesis, exact: &Jacobian) -> Vec<Hypothesis> {
        let candidates = self.model.candidates();
        let Some(predictor) = self.model.predictor(&parent.fit.point) else {
            return Vec::new();
        };
        let Some(scorer) = exact.scorer(self.model, &parent.fit) else {
            return Vec::new();
        };
        let mut promising = Vec::new();
        let mut tried = Vec::new();
        for (effect, candidate) in candidates.iter().enumerate() {
            if is_held(candidates, &parent.fit.point, effect) {
                continue;
            }
            for start in &candidate.starts {
                let off = candidate.nearly_off(start);
                let off_at = |share| -> Vec<f64> { off.iter().map(|at| at(share)).collect() };
                // A difference to a weak effect: thresholds have no derivative at nothing. What has one may be nearly
                // the same as a nominal parameter, but for its curvature.
                let mut point = parent.fit.point.clone();
                point.effects.push((effect, off_at(0.5)));
                if tried.contains(&point.effects) || self.observer.is_over() {
                    continue;
                }
                tried.push(point.effects.clone());
                let mut near = point.clone();
                if candidate.is_linear {
                    near.effects.pop();
                    near.effects.push((effect, off_at(NEARLY_NOTHING)));
                }
                let with = residuals(self.model, &predictor, &near, &self.records);
                let Some(with) = with else { continue };
                let pairs = with.iter().zip(&parent.fit.residuals);
                let column: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
                let (gain, amplitude) = scorer.score(&column);
                if gain <= 0.5 * PRICE_OF_AN_EFFECT {
                    continue;
                }
                self.observer.tell(|| Progress::Model {
                    step: Step::Screened,
                    effects: vec![(candidate.effect, candidate.values(&off_at(0.5)))],
                    figures: vec![("gain", gain), ("amplitude", amplitude)],
                });
                let either = candidate.parameters.iter().any(|p| p.bounds.0 < 0.0);
                if amplitude > 0.0 || either {
                    promising.push((gain, effect, point));
                }
            }
        }
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best: Vec<Hypothesis> = Vec::new();
        let mut seen = Vec::new();
        for (_, effect, point) in promising {
            if seen.contains(&effect) || seen.len() == 5 || self.observer.is_over() {
                continue;
            }
            seen.push(effect);
            // A size far from nothing, a delay of some samples, may be beyond a ridge.
            let mut points = vec![point];
            if candidates[effect].starts.len() > 1 {
                let starts = candidates[effect].starts.iter();
                points.extend(starts.map(|start| {
                    let mut far = parent.fit.point.clone();
                    far.effects
                        .push((effect, candidates[effect].internal(start)));
                    far
                }));
            }
            best.extend(self.best_of(&points, exact));
        }
        best.sort_by(|a, b| a.score.total_cmp(&b.score));
        best
    }

    /// The best of short fits to the first record from `points`, fitted to all: models whose last effect is new beside
    /// what has the derivatives `known`.
    fn best_of(&self, points: &[Point], known: &Jacobian) -> Option<Hypothesis> {
        let track = &self.records[..1];
        let begin = known.begin(self.model.residual_count(track[0]));
        let short = |point: &Point, steps| fit(self.model, point, track, &begin, steps);
        let starts = points.iter().filter_map(|point| short(point, 2));
        let near = starts.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        let near = short(&near.point, 4)?;
        let start = evaluate(self.model, &near.point, &self.records)?;
        let known = known.extended(self.model, &start, &self.records)?;
        self.sketch(&start, known)
    }
}

impl<M: ExtensibleModel> PenalisedLikelihood<'_, M> {
    /// The nominal model, its uncertain parameters estimated; none where it cannot be simulated.
    pub fn nominal(&self) -> Option<Hypothesis> {
        let start = evaluate(self.model, &self.origin(), &self.records)?;
        let nominal = self.hypothesis(&start)?;
        self.tell(Step::Nominal, &nominal);
        Some(nominal)
    }

    fn leaves_traces(&self, current: &Hypothesis) -> bool {
        let tests = left_over(self.model, &current.fit, &self.records, false);
        tests.iter().any(|test| test.deviate > LARGEST_DEVIATE)
    }

    /// Models with one more effect than `current` that pay under the noises of this model, best first.
    pub fn extensions(&self, current: &Hypothesis) -> Vec<Hypothesis> {
        // Derivatives that were carried along are too rough to tell an effect from the nominal parameter that it is
        // nearly equal to.
        let derivatives = OnceCell::new();
        let exact = || {
            derivatives.get_or_init(|| {
                let exact = Jacobian::at(self.model, &current.fit, &self.records);
                exact.unwrap_or_else(|| current.jacobian.clone())
            })
        };
        let mut level = if current.mean_square() < NEAR_NOISE {
            self.refine(current, exact())
        } else if current.fit.point.effects.is_empty() {
            // A strong effect bends the nominal fit: begin at the nominal values themselves.
            self.extend(&[&self.origin()], 4)
        } else {
            self.extend(&[&current.fit.point], 3)
        };
        let candidates = self.model.candidates();
        // What an effect has beyond its special case is asked for where that leaves traces.
        let general = general_cases(candidates, &current.fit.point);
        if !general.is_empty() && self.leaves_traces(current) {
            level.extend(general.iter().filter_map(|(place, points)| {
                let rest = exact().without(current.fit.point.coordinates(*place));
                self.best_of(points, &rest)
            }));
            level.sort_by(|a, b| a.score.total_cmp(&b.score));
        }
        level.retain(|own| {
            own.score < current.score && matters(candidates, &own.fit.point, self.floor)
        });
        for hypothesis in &level {
            self.tell(Step::Extended, hypothesis);
        }
        level
    }
}

/// The effects of `point` in words.
pub(super) fn named(candidates: &[Candidate], point: &Point) -> String {
    if point.effects.is_empty() {
        return "the nominal model".into();
    }
    let names = point.effects.iter().map(|(i, _)| candidates[*i].effect);
    names.collect::<Vec<_>>().join(" + ")
}

/// Whether `effect` is not for an extension of `base`: it is there, in whole or as a special case, or it has a
/// special case itself, which comes first.
fn is_held(candidates: &[Candidate], base: &Point, effect: usize) -> bool {
    let own = &candidates[effect];
    let mut known = base.effects.iter().map(|(i, _)| &candidates[*i]);
    own.contains.is_some()
        || known.any(|known| known.effect == own.effect || known.contains == Some(own.effect))
}

/// `point` with one of its effects become a more general one that contains it, which comes last: the place of each
/// effect that has some, and all starts of one.
pub(super) fn general_cases(candidates: &[Candidate], point: &Point) -> Vec<(usize, Vec<Point>)> {
    let mut all = Vec::new();
    for (place, (index, internal)) in point.effects.iter().enumerate() {
        let special = &candidates[*index];
        let known = special.values(internal);
        let numbered = candidates.iter().enumerate();
        for (general, candidate) in numbered.filter(|own| own.1.contains == Some(special.effect)) {
            let mut points: Vec<Point> = Vec::new();
            for start in &candidate.starts {
                let mut values = start.clone();
                for (value, parameter) in values.iter_mut().zip(&candidate.parameters) {
                    let mut same = special.parameters.iter().zip(&known);
                    if let Some((_, shared)) = same.find(|(own, _)| own.name == parameter.name) {
                        *value = *shared;
                    }
                }
                let mut next = point.clone();
                next.effects.remove(place);
                next.effects.push((general, candidate.internal(&values)));
                if !points.contains(&next) {
                    points.push(next);
                }
            }
            all.push((place, points));
        }
    }
    all
}

/// `point` with its effect at `place` become the special case that it contains, if it does: what was
/// taken first for a trace of another effect need not hold once that one is there.
pub(super) fn special_case(candidates: &[Candidate], point: &Point, place: usize) -> Option<Point> {
    let (index, internal) = &point.effects[place];
    let general = &candidates[*index];
    let contained = general.contains?;
    let special = candidates.iter().position(|c| c.effect == contained)?;
    if point.effects.iter().any(|(i, _)| *i == special) {
        return None;
    }
    let mut values = candidates[special].starts.first()?.clone();
    for (value, parameter) in values.iter_mut().zip(&candidates[special].parameters) {
        let pairs = general.parameters.iter().zip(general.values(internal));
        let mut same = pairs.filter(|(own, _)| own.name == parameter.name);
        if let Some((_, shared)) = same.next_back() {
            *value = shared;
        }
    }
    let mut simpler = point.clone();
    simpler.effects[place] = (special, candidates[special].internal(&values));
    Some(simpler)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EffectParameter;

    fn candidate(sizes: usize) -> Candidate {
        let size = EffectParameter {
            name: "size",
            unit: "1",
            scale: Scale::Linear(0.5),
            role: Role::Size { weak: 2.0 },
            bounds: (-10.0, 10.0),
        };
        Candidate::new("effect", vec![size; sizes], Vec::new())
    }

    fn with(effects: &[(usize, &[f64])]) -> Point {
        Point {
            nuisance: Vec::new(),
            effects: effects.iter().map(|(i, q)| (*i, q.to_vec())).collect(),
        }
    }

    #[test]
    fn an_effect_costs_18_and_each_further_parameter_6() {
        let candidates = [candidate(1), candidate(3)];
        assert_eq!(price(&candidates, &with(&[])), 0.0);
        assert_eq!(price(&candidates, &with(&[(0, &[1.0])])), 18.0);
        let three: &[f64] = &[1.0, 1.0, 1.0];
        assert_eq!(price(&candidates, &with(&[(1, three)])), 30.0);
        assert_eq!(price(&candidates, &with(&[(0, &[1.0]), (1, three)])), 48.0);
    }

    /// Oil that was not there, in the records of a coarse converter, and a load cell's scale that was.
    #[test]
    fn a_noise_of_another_form_does_not_pay_and_a_scale_does() {
        for (gained, residuals, is_enough) in [
            ([94.0, 126.0], 94_208, false),
            ([94.0, 179.0], 54_400, false),
            ([900.0, 950.0], 94_208, true),
            ([3.0, 90.0], 94_208, true),
        ] {
            let left = gained[1] - PRICE_OF_AN_EFFECT - unsure(gained, residuals);
            assert_eq!(left > 0.0, is_enough, "{gained:?}");
        }
    }

    #[test]
    fn an_effect_matters_from_six_tenths_of_its_weakest_size_on() {
        let candidates = [candidate(1)];
        // Half a unit to a coordinate, 2 is the weakest: 1.2 are 2.4 coordinates, on both sides.
        for (coordinate, is_enough) in [(2.3, false), (2.5, true), (-2.3, false), (-2.5, true)] {
            let point = with(&[(0, &[coordinate])]);
            assert_eq!(
                matters(&candidates, &point, FLOOR),
                is_enough,
                "{coordinate}"
            );
        }
    }
}

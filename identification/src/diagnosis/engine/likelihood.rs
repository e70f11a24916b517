//! Selection where a right model leaves white innovations: by penalised likelihood, with a beam.

use super::fit::{Fit, Jacobian, evaluate, fit, polish_to, residuals};
use super::model::{Candidate, ExtensibleModel, Point, Role, Scale};
use super::progress::{Observer, Progress, Step};
use super::search::{Found, Selection};
use super::verdict::{NEARLY_NOISE, NEWS, left_over};

/// What an effect must earn, in units of `2 log` likelihood, before it is named. An effect that is
/// not there earns χ² with one degree of freedom (Wilks, Ann. Math. Stat. 9, 1938), more than 18
/// once in 45,000; with three dozen candidates, one false name in 1,200 searches (Bonferroni).
pub const PRICE_OF_AN_EFFECT: f64 = 18.0;
/// And for each further parameter that it brings. Equal significance would ask for 3.4 (χ² with two
/// degrees of freedom), Schwarz's criterion for the logarithm of the samples, about 10; chosen
/// between them.
const PRICE_OF_A_PARAMETER: f64 = 6.0;
/// Share of the catalogue's weakest value below which an effect is not worth a name; an engineer's
/// choice, below 1 since an estimate of the weakest may come out smaller.
const FLOOR: f64 = 0.6;
/// A model within this of the best is a rival that the data do not rule out: odds of `e^6`, 400 to
/// one, against it; above 10 is "very strong" (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995).
pub const RIVAL_WITHIN: f64 = 12.0;
/// Mean square of whitened residuals up to which a model may be right. That of `N` values of unit
/// variance scatters by `(2/N)^{1/2}`: 0.005 with two records of 20 s, four channels at 500 Hz, so
/// that this is six deviations.
pub(super) const NEAR_NOISE: f64 = 1.03;
/// Mean square beyond which a third effect is no longer looked for: two that leave as much as the
/// noise itself were not the causes. Chosen; saves time only.
const HOPEFUL: f64 = 2.0;
/// Effects in one model.
const MOST_EFFECTS: usize = 3;

/// Excess over noise, in that of the best, beyond which a set of effects leaves the race. Saves time
/// only: the short fits of a race are rarely a factor of two from their ends.
const BEHIND: f64 = 6.0;
/// And what a short fit may still gain, `2 log` likelihood.
const NOISE_OF_A_RACE: f64 = 1e4;

/// Rivals that are fitted anew when other noises were learned.
const REFITTED: usize = 3;

/// Rounds of a fit at most; curved valleys take many.
pub(super) const ROUNDS: usize = 12;
/// Share of the excess over noise that one more round must gain.
pub(super) const SETTLED: f64 = 0.003;

/// A fitted model with its derivatives.
#[derive(Clone)]
pub struct Hypothesis {
    /// The fit.
    pub fit: Fit,
    /// Its derivatives by all coordinates.
    pub jacobian: Jacobian,
    /// Its cost and the price of its effects.
    pub score: f64,
}

impl Hypothesis {
    /// Indices of its effects, ascending.
    pub fn effects(&self) -> Vec<usize> {
        let mut effects: Vec<_> = self.fit.point.effects.iter().map(|(i, _)| *i).collect();
        effects.sort_unstable();
        effects
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

/// True when every effect of `point` is strong enough to matter.
pub fn matters(candidates: &[Candidate], point: &Point) -> bool {
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
            size >= FLOOR
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
    /// Who is told of every fit.
    pub observer: Observer<'a>,
}

impl<'a, M: ExtensibleModel> PenalisedLikelihood<'a, M> {
    /// Of `model` on some records.
    pub fn of(model: &'a M, records: &[usize], observer: Observer<'a>) -> Self {
        Self {
            model,
            records: records.to_vec(),
            observer,
        }
    }
}

impl<M: ExtensibleModel> PenalisedLikelihood<'_, M> {
    fn hypothesis(&self, start: &Fit) -> Option<Hypothesis> {
        let (fit, jacobian) = polish_to(self.model, start, &self.records, ROUNDS, SETTLED)?;
        let score = fit.cost + price(self.model.candidates(), &fit.point);
        Some(Hypothesis {
            fit,
            jacobian,
            score,
        })
    }

    /// The hypotheses of an earlier search under other noises, fitted anew; none where the nominal model
    /// cannot be simulated. The best is the best of all.
    pub fn refitted(&self, found: &Found<Hypothesis>) -> Option<Found<Hypothesis>> {
        let again = |earlier: &Hypothesis| {
            let fitted = evaluate(self.model, &earlier.fit.point, &self.records)
                .and_then(|start| self.hypothesis(&start));
            if let Some(fitted) = &fitted {
                self.tell(Step::Refitted, fitted);
            }
            fitted
        };
        let nominal = again(&found.nominal)?;
        let others = found.others.iter().take(REFITTED);
        let mut all: Vec<Hypothesis> = found
            .best
            .iter()
            .chain(others)
            .filter_map(again)
            .filter(|own| matters(self.model.candidates(), &own.fit.point))
            .collect();
        all.sort_by(|a, b| a.score.total_cmp(&b.score));
        all.retain(|own| own.score < nominal.score);
        let mut all = all.into_iter();
        Some(Found {
            nominal,
            best: all.next(),
            others: all.collect(),
        })
    }

    /// Whether other noises than the assumed ones explain what `current` leaves over: then no further
    /// effect is looked for under the assumed ones. Saves time only, since the search goes on with the noises
    /// that are learned after it.
    fn is_other_noise(&self, current: &Hypothesis) -> bool {
        let Fit {
            point, residuals, ..
        } = &current.fit;
        let lesson = self
            .model
            .with_learned_noise(point, residuals, &self.records);
        let Some(lesson) = lesson.filter(|own| own.is_believable && own.gain > NEWS) else {
            return false;
        };
        let explained = evaluate(&lesson.model, point, &self.records)
            .and_then(|start| polish_to(&lesson.model, &start, &self.records, ROUNDS, SETTLED));
        explained.is_some_and(|(fit, _)| {
            let tests = left_over(&lesson.model, &fit, &self.records);
            tests.iter().all(|test| test.deviate < NEARLY_NOISE)
        })
    }

    fn tell(&self, step: Step, hypothesis: &Hypothesis) {
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
        let mut jacobians = Vec::new();
        let mut runners = Vec::new();
        for parent in parents {
            // What a missing effect bent the nuisance by would mislead: begin at the nominal
            // values.
            let base = &Point {
                nuisance: vec![0.0; self.model.nuisance()],
                effects: parent.effects.clone(),
            };
            let jacobian = evaluate(self.model, base, track)
                .and_then(|fit| Jacobian::at(self.model, &fit, track));
            let Some(jacobian) = jacobian else { continue };
            let parent = jacobians.len();
            for (effect, candidate) in candidates.iter().enumerate() {
                let held = |(i, _): &(usize, Vec<f64>)| {
                    *i == effect
                        || candidate.contains == Some(candidates[*i].effect)
                        || candidates[*i].contains == Some(candidate.effect)
                };
                if base.effects.iter().any(held) {
                    continue;
                }
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
            jacobians.push(jacobian);
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
                let jacobian = &jacobians[runner.parent];
                if let Some(fit) = fit(self.model, &runner.point, track, jacobian, iterations) {
                    runner.point = fit.point;
                    runner.cost = fit.cost;
                }
            }
        }
        runners.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        // Sets that are far behind after the race are neither rivals nor worth extending.
        let samples: usize = track.iter().map(|&r| self.model.residual_count(r)).sum();
        let excess = |runner: &Runner| (runner.cost - samples as f64).max(0.0);
        let farthest =
            runners.first().map_or(0.0, |first| BEHIND * excess(first)) + NOISE_OF_A_RACE;
        let mut seen: Vec<Vec<usize>> = Vec::new();
        let mut best: Vec<Hypothesis> = Vec::new();
        for runner in runners {
            let strong = |found: &Hypothesis| matters(candidates, &found.fit.point);
            if excess(&runner) > farthest && best.iter().any(strong) {
                break;
            }
            let mut set: Vec<usize> = runner.point.effects.iter().map(|(i, _)| *i).collect();
            set.sort_unstable();
            if seen.contains(&set) {
                continue;
            }
            seen.push(set);
            let start = evaluate(self.model, &runner.point, &self.records);
            best.extend(start.and_then(|start| self.hypothesis(&start)));
            if best.len() == keep {
                break;
            }
        }
        best.sort_by(|a, b| a.score.total_cmp(&b.score));
        best
    }

    /// Extensions of an already good `parent`: only effects whose linear score promises to pay.
    fn refine(&self, parent: &Hypothesis) -> Vec<Hypothesis> {
        let candidates = self.model.candidates();
        let Some(predictor) = self.model.predictor(&parent.fit.point) else {
            return Vec::new();
        };
        let mut promising = Vec::new();
        let mut tried = Vec::new();
        for (effect, candidate) in candidates.iter().enumerate() {
            if parent.fit.point.effects.iter().any(|(i, _)| *i == effect) {
                continue;
            }
            for start in &candidate.starts {
                let off = candidate.nearly_off(start);
                let off_at = |share| -> Vec<f64> { off.iter().map(|at| at(share)).collect() };
                // A derivative at nothing, and a difference to a weak effect for thresholds.
                for share in [1e-3, 0.5] {
                    let mut point = parent.fit.point.clone();
                    point.effects.push((effect, off_at(share)));
                    if tried.contains(&point.effects) {
                        continue;
                    }
                    tried.push(point.effects.clone());
                    let with = residuals(self.model, &predictor, &point, &self.records);
                    let Some(with) = with else { continue };
                    let pairs = with.iter().zip(&parent.fit.residuals);
                    let column: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
                    let (gain, amplitude) = parent.jacobian.score(self.model, &parent.fit, &column);
                    if gain <= 0.5 * PRICE_OF_AN_EFFECT {
                        continue;
                    }
                    self.observer.tell(|| Progress::Model {
                        step: Step::Screened,
                        effects: vec![(candidate.effect, candidate.values(&off_at(share)))],
                        figures: vec![("gain", gain), ("amplitude", amplitude)],
                    });
                    let either = candidate.parameters.iter().any(|p| p.bounds.0 < 0.0);
                    if amplitude > 0.0 || either {
                        promising.push((gain, effect, point));
                    }
                }
            }
        }
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best: Vec<Hypothesis> = Vec::new();
        let mut seen = Vec::new();
        for (_, effect, point) in promising {
            if seen.contains(&effect) || seen.len() == 5 {
                continue;
            }
            seen.push(effect);
            let short = fit(self.model, &point, &self.records, &parent.jacobian, 6);
            best.extend(short.and_then(|short| self.hypothesis(&short)));
        }
        best.sort_by(|a, b| a.score.total_cmp(&b.score));
        best
    }
}

impl<M: ExtensibleModel> Selection for PenalisedLikelihood<'_, M> {
    type Hypothesis = Hypothesis;

    fn nominal(&self) -> Option<Hypothesis> {
        let start = evaluate(self.model, &self.origin(), &self.records)?;
        let nominal = self.hypothesis(&start)?;
        self.tell(Step::Nominal, &nominal);
        Some(nominal)
    }

    fn effects(&self, hypothesis: &Hypothesis) -> usize {
        hypothesis.fit.point.effects.len()
    }

    fn most_effects(&self) -> usize {
        MOST_EFFECTS
    }

    fn extensions(&mut self, current: &Hypothesis, lost: &[Hypothesis]) -> Option<Vec<Hypothesis>> {
        let mut level = if current.mean_square() < NEAR_NOISE {
            self.refine(current)
        } else if current.fit.point.effects.is_empty() {
            // A strong effect bends the nominal fit: begin at the nominal values themselves.
            self.extend(&[&self.origin()], 6)
        } else if self.effects(current) > 1 && current.mean_square() > HOPEFUL
            || self.is_other_noise(current)
        {
            Vec::new()
        } else {
            let excess = |hypothesis: &Hypothesis| hypothesis.mean_square() - 1.0;
            let mut parents = vec![&current.fit.point];
            parents.extend(
                lost.iter()
                    .filter(|other| excess(other) < 5.0 * excess(current))
                    .take(2)
                    .map(|other| &other.fit.point),
            );
            self.extend(&parents, 5)
        };
        level.retain(|hypothesis| matters(self.model.candidates(), &hypothesis.fit.point));
        for hypothesis in &level {
            self.tell(Step::Extended, hypothesis);
        }
        if level
            .first()
            .is_none_or(|first| first.score >= current.score)
        {
            level.clear();
        }
        Some(level)
    }

    fn reduced(&mut self, current: &Hypothesis) -> Option<Option<Hypothesis>> {
        let candidates = self.model.candidates();
        let point = &current.fit.point;
        let mut simpler: Vec<Point> = (0..point.effects.len())
            .filter_map(|i| special_case(candidates, point, i))
            .collect();
        if point.effects.len() > 1 {
            simpler.extend((0..point.effects.len()).map(|i| {
                let mut without = point.clone();
                without.effects.remove(i);
                without
            }));
        }
        let simpler = simpler.iter().filter_map(|point| {
            let start = evaluate(self.model, point, &self.records)?;
            self.hypothesis(&start)
        });
        let smaller = simpler
            .min_by(|a, b| a.score.total_cmp(&b.score))
            .filter(|smaller| smaller.score <= current.score);
        if let Some(smaller) = &smaller {
            self.tell(Step::Reduced, smaller);
        }
        Some(smaller)
    }
}

/// `point` with its effect at `place` become the special case that it contains, if it does: what was
/// taken first for a trace of another effect need not hold once that one is there.
fn special_case(candidates: &[Candidate], point: &Point, place: usize) -> Option<Point> {
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

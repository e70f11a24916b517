//! Selection where even a right model leaves correlated errors: by what an effect gains on data that
//! it was not fitted to.
//!
//! Forward selection adds one effect per round: the one with which a model fitted to one half of
//! the part best predicts the other half, in both directions. It stops when the gain may be due to
//! chance, with correlated samples counted once. Backward at the end by the same test. Every model
//! in every comparison is the least-squares one ([`super::least_squares`]).

use std::collections::{BTreeSet, VecDeque};
use std::sync::{Mutex, PoisonError};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::least_squares::{
    Columns, Free, SimulatedModel, Solution, all_errors, deviations, least_squares, polished,
    solution, squares,
};
use super::model::Point;
use super::opening::opened;
use super::progress::{Observer, Progress, Step};
use super::resampling::correlation_time;
use super::search::{Found, Selection, resumed, search};

/// Standard deviations by which the likelihood of unseen data must rise. A dozen candidates are
/// tried, so that one in a thousand times would be chance.
const LEAST_DEVIATE: f64 = 3.0;
/// Share of the squared error below which an effect is not worth a name.
const LEAST_GAIN: f64 = 0.05;
/// Factor by which the squared error of the fit grows without an effect that the data cannot do without.
pub const VITAL: f64 = 4.0;
/// A candidate that gains this share of what the one taken gains is its rival.
const RIVAL: f64 = 0.9;
/// A candidate whose fit gains less than this share of the best one's is not tested on unseen data.
const WORTH_TESTING: f64 = 0.7;
/// Effects in one model.
const MOST_EFFECTS: usize = 8;
/// Effects, the weakest first, in whose place others are searched.
const EXCHANGED: usize = 2;
/// Squared error of a look over that of another one which is far ahead of it.
const AHEAD: f64 = 4.0;
/// Candidates that are fitted to the end in a round.
const FINALISTS: usize = 6;
/// Starts of the nominal model beside the stated values, and how far they lie from these, in stated
/// standard deviations.
const OTHER_STARTS: usize = 6;
const APART: f64 = 2.0;
/// Share of the squared error that a fit from an equation's answer must leave at most of what others leave: that
/// answer bends towards what the equation lacks.
const CLEARLY: f64 = 0.9;
/// Of them, those that are fitted to the end.
const ENDED: usize = 3;
/// Seed of those starts.
pub const STARTS_SEED: u64 = 15;
/// Steps of a first look and of a fit to the end.
const LOOK: usize = 6;
const TO_THE_END: usize = 40;
/// Models of which errors on the folds are kept.
const KEPT: usize = 16;
/// Steps of a fit that begins near its end.
pub const AGAIN: usize = 12;
/// Squared error of a model after those, over its least from another start, beyond which it does not become the best.
const NEAR: f64 = 4.0;

/// A model fitted to a part.
#[derive(Debug, Clone)]
pub struct Simulated {
    /// Where.
    pub point: Point,
    /// Sum of squared errors on the part.
    pub squares: f64,
    /// Share of the squared error on unseen data that its last effect takes away.
    gain: f64,
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
    pub nominal: Simulated,
    /// With all effects.
    pub extended: Simulated,
    /// What each effect gains on unseen data, in standard deviations of that gain.
    pub deviates: Vec<f64>,
    /// The extended model without each effect.
    pub without: Vec<Simulated>,
    /// Rivals that are not in the extended model.
    pub rivals: Vec<Rival>,
    /// One standard deviation of each coordinate: nuisance first, then the effects'.
    pub deviations: Vec<f64>,
}

impl From<Solution> for Simulated {
    fn from(found: Solution) -> Self {
        Self {
            squares: squares(&found.errors),
            point: found.point,
            gain: 0.0,
        }
    }
}

/// Fits everything from `start`.
fn settle<M: SimulatedModel>(
    model: &M,
    start: &Point,
    record: usize,
    steps: usize,
) -> Option<Simulated> {
    least_squares(model, start, record, &Free::All, steps).map(Simulated::from)
}

/// The model with the effects of `start`, fitted to `record` to the end.
pub fn settled<M: SimulatedModel>(model: &M, start: &Point, record: usize) -> Option<Point> {
    least_squares(model, start, record, &Free::All, TO_THE_END).map(|found| found.point)
}

/// As [`settled`], also along a valley.
pub fn settled_along<M: SimulatedModel>(model: &M, start: &Point, record: usize) -> Option<Point> {
    polished(model, start, record, TO_THE_END).map(|found| found.point)
}

/// `point` with the nuisance as stated but for what differs from block to block.
pub fn as_stated<M: SimulatedModel>(model: &M, point: &Point) -> Point {
    let mut stated = point.clone();
    for (i, p) in stated.nuisance.iter_mut().enumerate() {
        *p = if model.block_of(i).is_some() { *p } else { 0.0 };
    }
    stated
}

/// As [`settled`], in a few steps: what is far from the end then is of no use.
pub fn looked<M: SimulatedModel>(model: &M, start: &Point, record: usize) -> Option<Point> {
    least_squares(model, start, record, &Free::All, AGAIN).map(|found| found.point)
}

/// As [`settled`], with the standard deviations of all coordinates.
pub fn refit<M: SimulatedModel>(
    model: &M,
    start: &Point,
    record: usize,
) -> Option<(Simulated, Vec<f64>)> {
    let found = least_squares(model, start, record, &Free::All, TO_THE_END)?;
    let deviations = deviations(model, &found, record).unwrap_or_default();
    Some((found.into(), deviations))
}

/// The nominal model, from the stated values and from others around them.
pub fn nominal<M: SimulatedModel>(model: &M, record: usize) -> Option<Simulated> {
    let stated = Point {
        nuisance: vec![0.0; model.nuisance()],
        effects: Vec::new(),
    };
    let mut random = ChaCha8Rng::seed_from_u64(STARTS_SEED);
    let screen = model.screen(record);
    let mut starts = vec![stated.clone()];
    for _ in 0..OTHER_STARTS {
        let mut start = stated.clone();
        for (i, p) in start.nuisance.iter_mut().enumerate() {
            let off = random.random_range(-APART..APART);
            // What differs from file to file begins as it is.
            *p = if model.block_of(i).is_some() {
                0.0
            } else {
                off
            };
        }
        starts.push(start);
    }
    let mut looked: Vec<Solution> = starts
        .par_iter()
        .filter_map(|start| least_squares(model, start, screen, &Free::All, LOOK))
        .collect();
    let first = looked.first()?.clone();
    let best_of = |looked: &[Solution]| {
        let all = looked.iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        all.cloned()
    };
    // Read from the records only where no start finds the motion.
    let begun = model.begun(&best_of(&looked)?.point, screen);
    let begun: Vec<&Point> = begun
        .iter()
        .filter(|point| point.effects.is_empty())
        .collect();
    looked.extend(opened(model, &begun, screen, LOOK));
    // The look may have been at a part of the record only, and how near it came tells little of where a fit ends.
    looked.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    looked.truncate(ENDED);
    looked.push(first);
    let ends: Vec<Simulated> = looked
        .par_iter()
        .filter_map(|one| settle(model, &one.point, record, TO_THE_END))
        .collect();
    let best = ends
        .into_iter()
        .min_by(|a, b| a.squares.total_cmp(&b.squares))?;
    let estimated = model
        .estimated(record)
        .and_then(|start| settle(model, &start, record, TO_THE_END));
    let is_better = |own: &Simulated| own.squares < CLEARLY * best.squares;
    Some(estimated.filter(is_better).unwrap_or(best))
}

/// `point`, of which the nuisance of a block that `fitted` does not tell is fitted to `tested`: a
/// transducer's zero and the like belong to a file and not to the rig.
pub fn completed<M: SimulatedModel>(
    model: &M,
    point: &Point,
    fitted: Option<usize>,
    tested: usize,
) -> Point {
    let open = |i: usize| {
        let is_held = |block| {
            model.samples(tested, block) == 0
                || fitted.is_some_and(|fitted| model.tells(fitted, i, tested))
        };
        i < model.nuisance() && model.block_of(i).is_some_and(|block| !is_held(block))
    };
    if !(0..model.nuisance()).any(open) {
        return point.clone();
    }
    // Where a fit did not see how a file begins, it may have left it anywhere.
    let mut stated = point.clone();
    for (i, p) in stated.nuisance.iter_mut().enumerate() {
        *p = if open(i) { 0.0 } else { *p };
    }
    let error = |start: &Point| squares(&all_errors(model, start, tested));
    let is_lost = error(&stated) < error(point);
    let start = if is_lost { &stated } else { point };
    least_squares(model, start, tested, &Free::Chosen(&open), AGAIN)
        .map_or_else(|| start.clone(), |found| found.point)
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

/// Whether an effect with this `gain` rivals the one `taken`: it takes away nearly as much, and
/// `leaves` at most so many times what that leaves.
fn rivals(gain: f64, taken: f64, leaves: f64) -> bool {
    gain > RIVAL * taken && 1.0 - gain < leaves * (1.0 - taken)
}

/// Compares two models by their errors from [`CrossValidation::crossed`].
fn compare(before: &[Vec<f64>; 2], after: &[Vec<f64>; 2]) -> Inside {
    let both = before
        .iter()
        .zip(after)
        .all(|(b, a)| squares(b) > squares(a));
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

/// Selection by what an effect gains on the half of a record that was not fitted.
struct CrossValidation<'a, M: SimulatedModel> {
    model: &'a M,
    record: usize,
    observer: Observer<'a>,
    /// Effects that came near the one taken in any round.
    rivals: Vec<Rival>,
    /// Deviates and reduced models of the last look backward.
    deviates: Vec<f64>,
    without: Vec<Simulated>,
    /// The effect that is not tried.
    barred: Option<usize>,
    /// Errors of the latest models on the folds: what a round takes is what the next one compares with.
    known: Mutex<VecDeque<(Point, [Vec<f64>; 2])>>,
}

impl<'a, M: SimulatedModel> CrossValidation<'a, M> {
    fn new(model: &'a M, record: usize, observer: Observer<'a>) -> Self {
        Self {
            model,
            record,
            observer,
            rivals: Vec::new(),
            deviates: Vec::new(),
            without: Vec::new(),
            barred: None,
            known: Mutex::default(),
        }
    }

    /// The effects that another search ends with, fitted here and without those that do not pay here.
    fn end_of(&mut self, mut other: CrossValidation<'_, M>) -> Option<Simulated> {
        let found = search(&mut other)?.best?;
        self.rivals.append(&mut other.rivals);
        let mut current = settle(self.model, &found.point, self.record, TO_THE_END)?;
        while !current.point.effects.is_empty() {
            match self.reduced(&current)? {
                Some(smaller) => current = smaller,
                None => break,
            }
        }
        let named = !current.point.effects.is_empty() && !self.is_at_bound(&current.point);
        named.then_some(current)
    }

    /// The end of a search that begins from `found`, if it pays as an effect must: what was taken while others were
    /// missing may replace them. It also begins without one of the effects, and with another one in the place of one that
    /// it looks like. The last look backward is that at `found`.
    fn exchanged(&mut self, found: &Simulated) -> Option<Simulated> {
        let mut best = found.clone();
        let mut is_other = false;
        let mut tried = BTreeSet::new();
        'better: while best.point.effects.len() > 1 && !self.observer.is_over() {
            let without = std::mem::take(&mut self.without).into_iter();
            let own = best.point.effects.iter().map(|(i, _)| Some(*i));
            let mut starts: Vec<(Option<usize>, Simulated)> = own.zip(without).collect();
            let better = self.with_look_alikes(&best, &starts);
            starts.sort_by(|a, b| a.1.squares.total_cmp(&b.1.squares));
            starts.truncate(EXCHANGED);
            let whole = [best.clone()].into_iter().chain(better);
            starts.splice(0..0, whole.map(|start| (None, start)));
            for (gone, start) in starts {
                if gone.is_some_and(|gone| !tried.insert(gone)) {
                    continue;
                }
                self.barred = gone;
                let other = self.ended_from(start);
                self.barred = None;
                if let Some(other) = other
                    && compare(&self.crossed(&best)?, &self.crossed(&other)?).holds()
                {
                    (best, is_other) = (other, true);
                    continue 'better;
                }
            }
            break;
        }
        is_other.then_some(best)
    }

    /// The models that fit better than `best` by an effect in the place of one that it looks like; `without` are those
    /// that lack an effect.
    fn with_look_alikes(
        &self,
        best: &Simulated,
        without: &[(Option<usize>, Simulated)],
    ) -> Vec<Simulated> {
        let candidates = self.model.candidates();
        let swapped = without.iter().filter_map(|(gone, start)| {
            let alike = candidates[(*gone)?].look_alikes;
            let others = 0..candidates.len();
            let others = others.filter(|&i| alike.contains(&candidates[i].effect));
            self.fitted(start, &others.collect::<Vec<_>>())
        });
        let models = swapped.flatten().map(|(_, model)| model);
        models
            .filter(|model| model.squares < best.squares)
            .collect()
    }

    /// What a search from `start` ends with.
    fn ended_from(&mut self, start: Simulated) -> Option<Simulated> {
        let begun = Found {
            nominal: start.clone(),
            best: Some(start),
            others: Vec::new(),
        };
        resumed(self, begun)?.best
    }

    /// Whether `one` predicts each fold from the other better than `two` does.
    fn predicts_better(&self, one: &Simulated, two: &Simulated) -> bool {
        let sum = |fitted: &Simulated| {
            let errors = self.crossed(fitted)?;
            Some(errors.iter().map(|fold| squares(fold)).sum::<f64>())
        };
        matches!((sum(one), sum(two)), (Some(one), Some(two)) if one < two)
    }

    /// Errors of `fitted` on each fold when its parameters are refitted to the other.
    fn crossed(&self, fitted: &Simulated) -> Option<[Vec<f64>; 2]> {
        let model = self.model;
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, errors)) = known().iter().find(|own| own.0 == fitted.point) {
            return Some(errors.clone());
        }
        let [one, two] = model.folds(self.record);
        let on_other = |own: usize, tested: usize| {
            let refitted = settle(model, &fitted.point, own, AGAIN)?;
            let point = completed(model, &refitted.point, Some(own), tested);
            Some(all_errors(model, &point, tested))
        };
        let (first, second) = rayon::join(|| on_other(two, one), || on_other(one, two));
        let errors = [first?, second?];
        let mut known = known();
        if known.len() == KEPT {
            known.pop_front();
        }
        known.push_back((fitted.point.clone(), errors.clone()));
        Some(errors)
    }

    /// The extensions of `base` by one of `among` that fit best.
    fn fitted(&self, base: &Simulated, among: &[usize]) -> Option<Vec<(usize, Simulated)>> {
        let (model, record) = (self.model, self.record);
        let screen = model.screen(record);
        let candidates = model.candidates();
        // A model without an effect bends its parameters towards it: from the stated ones the way to
        // the right effect may be straighter.
        let stated = as_stated(model, &base.point);
        let bases: Vec<(Point, Columns)> = [base.point.clone(), stated.clone()]
            .into_par_iter()
            .filter_map(|point| {
                let start = solution(model, &point, screen)?;
                Some((point, Columns::at(model, &start, screen)?))
            })
            .collect();
        let in_base = |effect: usize| {
            let alike = candidates[effect].look_alikes;
            let held = |i: usize| i == effect || alike.contains(&candidates[i].effect);
            base.point.effects.iter().any(|(i, _)| held(*i))
        };
        let suggested = model.starts(&base.point, screen);
        let is_bare = base.point.effects.is_empty();
        let begun = if is_bare {
            model.begun(&base.point, screen)
        } else {
            Vec::new()
        };
        let mut quick: Vec<(usize, Solution)> = among
            .par_iter()
            .filter(|effect| !in_base(**effect))
            .filter_map(|&effect| {
                let candidate = &candidates[effect];
                let own = suggested.iter().filter(|(i, _)| *i == effect);
                let own = own.map(|(_, values)| values);
                let values: Vec<&Vec<f64>> = candidate.starts.iter().chain(own).collect();
                let beside = |base: &Point| -> Vec<Point> {
                    let with = |values: &&Vec<f64>| {
                        let mut point = base.clone();
                        point.effects.push((effect, candidate.internal(values)));
                        point
                    };
                    values.iter().map(with).collect()
                };
                let starts = bases.iter().flat_map(|(base, frozen)| {
                    let look = |point: Point| {
                        least_squares(model, &point, screen, &Free::Frozen(frozen), LOOK)
                    };
                    beside(base).into_iter().filter_map(look)
                });
                let with_it = |point: &Point| point.effects.iter().any(|(i, _)| *i == effect);
                let begun: Vec<&Point> = begun.iter().filter(|point| with_it(point)).collect();
                let own = is_bare.then(|| looked_from_best(model, &beside(&stated), screen));
                let all = starts.chain(opened(model, &begun, screen, LOOK));
                let best = all.min_by(|a, b| a.cost.total_cmp(&b.cost));
                // Which look is ahead tells little of where a fit ends, unless it is far ahead.
                let best = match (best, own.flatten()) {
                    (Some(best), Some(own))
                        if AHEAD * squares(&own.errors) < squares(&best.errors) =>
                    {
                        own
                    }
                    (best, own) => best.or(own)?,
                };
                Some((effect, best))
            })
            .collect();
        quick.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
        quick.truncate(FINALISTS);
        let settled = quick.par_iter().filter_map(|(effect, quick)| {
            let settled = settle(model, &quick.point, record, TO_THE_END)?;
            Some((*effect, settled))
        });
        Some(settled.collect())
    }

    /// Whether an effect of `point` is at a bound other than zero.
    fn is_at_bound(&self, point: &Point) -> bool {
        let candidates = self.model.candidates();
        point
            .effects
            .iter()
            .any(|(i, q)| candidates[*i].bound(q).is_some())
    }

    /// Whether `rival` in the place of the effect that `without` lacks gains nearly what that gains.
    fn replaces(&self, rival: usize, without: &Simulated, current: &Simulated) -> Option<bool> {
        let (_, replaced) = self.fitted(without, &[rival])?.pop()?;
        let before = self.crossed(without)?;
        let gain = |fitted: &Simulated| Some(compare(&before, &self.crossed(fitted)?).gain);
        let leaves = self.model.rivals_leave();
        Some(rivals(gain(&replaced)?, gain(current)?, leaves))
    }

    fn tell(&self, fitted: &Simulated, inside: &Inside) {
        let candidates = self.model.candidates();
        let effects = fitted.point.effects.iter();
        self.observer.tell(|| Progress::Model {
            step: Step::Extended,
            effects: effects
                .map(|(i, q)| (candidates[*i].effect, candidates[*i].values(q)))
                .collect(),
            figures: vec![
                ("squared error", fitted.squares),
                ("share gained on the other fold", inside.gain),
                ("standard deviations", inside.deviate),
                ("holds", f64::from(u8::from(inside.holds()))),
            ],
        });
    }
}

impl<M: SimulatedModel> Selection for CrossValidation<'_, M> {
    type Hypothesis = Simulated;

    fn nominal(&self) -> Option<Simulated> {
        nominal(self.model, self.record)
    }

    fn is_over(&self) -> bool {
        self.observer.is_over()
    }

    fn effects(&self, fitted: &Simulated) -> usize {
        fitted.point.effects.len()
    }

    fn most_effects(&self) -> usize {
        MOST_EFFECTS
    }

    fn extensions(&mut self, current: &Simulated, _: &[Simulated]) -> Option<Vec<Simulated>> {
        let all = 0..self.model.candidates().len();
        let all: Vec<usize> = all.filter(|i| self.barred != Some(*i)).collect();
        let mut fitted = self.fitted(current, &all)?;
        // What stands at its bound is never named, and stands in for something else.
        fitted.retain(|(_, one)| !self.is_at_bound(&one.point));
        let gained = |one: &Simulated| current.squares - one.squares;
        let best = fitted.iter().map(|(_, one)| gained(one));
        let best = best.fold(0.0, f64::max);
        if best < LEAST_GAIN * current.squares {
            return Some(Vec::new());
        }
        fitted.retain(|(_, one)| gained(one) > WORTH_TESTING * best);
        let before = self.crossed(current)?;
        let mut tried: Vec<(Inside, Simulated)> = fitted
            .into_iter()
            .filter_map(|(_, mut fitted)| {
                let inside = compare(&before, &self.crossed(&fitted)?);
                fitted.gain = inside.gain;
                Some((inside, fitted))
            })
            .collect();
        tried.sort_by(|a, b| b.0.gain.total_cmp(&a.0.gain));
        for (inside, fitted) in &tried {
            self.tell(fitted, inside);
        }
        let pays = |fitted: &Simulated| fitted.squares < (1.0 - LEAST_GAIN) * current.squares;
        tried.retain(|(inside, fitted)| inside.holds() && pays(fitted));
        Some(tried.into_iter().map(|(_, fitted)| fitted).collect())
    }

    fn round(&mut self, taken: &Simulated, lost: &[Simulated]) {
        let newest = |fitted: &Simulated| fitted.point.effects.last().map(|(i, _)| *i);
        let leaves = self.model.rivals_leave();
        let near = lost
            .iter()
            .filter(|one| rivals(one.gain, taken.gain, leaves));
        self.rivals.extend(near.filter_map(|rival| {
            Some(Rival {
                effect: newest(rival)?,
                against: newest(taken)?,
            })
        }));
    }

    fn reduced(&mut self, current: &Simulated) -> Option<Option<Simulated>> {
        let after = self.crossed(current)?;
        let places = 0..current.point.effects.len();
        let all: Option<Vec<(Inside, Simulated)>> = places
            .map(|i| {
                let mut point = current.point.clone();
                point.effects.remove(i);
                // What runs away without an effect is compared with the model that has none.
                let smaller = settle(self.model, &point, self.record, TO_THE_END)
                    .or_else(|| nominal(self.model, self.record))?;
                Some((compare(&self.crossed(&smaller)?, &after), smaller))
            })
            .collect();
        let (compared, without): (Vec<Inside>, Vec<Simulated>) = all?.into_iter().unzip();
        self.without = without;
        self.deviates = compared.iter().map(|inside| inside.deviate).collect();
        // Where one half does not determine the model, its prediction is no judge of what all data need.
        let may_go = |&i: &usize| self.without[i].squares < VITAL * current.squares;
        let least = (0..compared.len())
            .filter(may_go)
            .min_by(|&a, &b| compared[a].gain.total_cmp(&compared[b].gain))
            .filter(|&i| !compared[i].holds());
        Some(least.map(|i| self.without[i].clone()))
    }
}

/// A look from the best of `starts` with an effect. The derivatives are its own: where the effect changes the whole motion,
/// as an overlap does with small commands, those of a model without it mislead.
fn looked_from_best<M: SimulatedModel>(
    model: &M,
    starts: &[Point],
    record: usize,
) -> Option<Solution> {
    let all = starts.iter();
    let all = all.filter_map(|start| solution(model, start, record));
    let best = all.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    least_squares(model, &best.point, record, &Free::All, LOOK)
}

/// Finds the effects that `record` asks for; none where nothing can be simulated.
pub fn select<M: SimulatedModel>(
    model: &M,
    record: usize,
    observer: Observer<'_>,
) -> Option<Selected> {
    let mut selection = CrossValidation::new(model, record, observer);
    let mut found = search(&mut selection)?;
    if model.is_cheap() {
        // Free parameters may bend to stand in for an effect, and the first effects that are taken to
        // straighten them again. With parameters held near what was stated the way is another; the
        // end is fitted and judged as ever.
        let held = model.held();
        let begun = CrossValidation::new(&held, record, observer);
        if let Some(other) = selection.end_of(begun)
            && selection.predicts_better(&other, found.best.as_ref().unwrap_or(&found.nominal))
        {
            found.best = Some(other);
        }
    }
    // What the last look backward left behind belongs to the one that was chosen.
    if let Some(best) = &found.best
        && (model.is_cheap() || selection.without.len() != best.point.effects.len())
    {
        selection.reduced(best)?;
    }
    let nominal = found.nominal;
    let extended = found.best.unwrap_or_else(|| nominal.clone());
    // What came near while other effects were still missing may be far behind at the end.
    let place = |effect: usize| {
        extended
            .point
            .effects
            .iter()
            .position(|(i, _)| *i == effect)
    };
    let mut rivals = std::mem::take(&mut selection.rivals);
    rivals.retain(|rival| match (place(rival.against), place(rival.effect)) {
        (Some(i), None) => selection
            .replaces(rival.effect, &selection.without[i], &extended)
            .unwrap_or(false),
        _ => false,
    });
    let last = solution(model, &extended.point, record)?;
    let deviations = deviations(model, &last, record).unwrap_or_default();
    Some(Selected {
        nominal,
        extended,
        deviates: selection.deviates,
        without: selection.without,
        rivals,
        deviations,
    })
}

/// The best of `proposals`, each a set of effects and a point to begin from. Each is fitted to all of `record`;
/// the best is the one whose halves predict each other best, without the effects that do not pay there. If none
/// can be fitted to the halves, it is the nominal model; none if that one cannot be fitted either. Beside it a better one
/// with others of its effects, if a search finds one from there.
pub fn select_jointly<M: SimulatedModel>(
    model: &M,
    proposals: &[Point],
    record: usize,
    observer: Observer<'_>,
) -> Option<(Simulated, Option<Simulated>)> {
    let mut selection = CrossValidation::new(model, record, observer);
    let effects = |point: &Point| -> BTreeSet<usize> {
        let all = point.effects.iter();
        all.map(|(i, _)| *i).collect()
    };
    // Of a model from several starts the best fit.
    let mut models: Vec<Simulated> = Vec::new();
    for start in proposals {
        observer.tell(|| Progress::Fitting(model.record_name(record).to_owned()));
        let to_the_end = |start: &Point| settle(model, start, record, TO_THE_END);
        let mut models_so_far = models.iter_mut();
        let Some(known) = models_so_far.find(|own| effects(&own.point) == effects(start)) else {
            models.extend(to_the_end(start));
            continue;
        };
        let near = settle(model, start, record, AGAIN);
        let near = near.filter(|near| near.squares < NEAR * known.squares);
        let other = near.and_then(|near| to_the_end(&near.point));
        if let Some(other) = other.filter(|other| other.squares < known.squares) {
            *known = other;
        }
    }
    let fitted = models.into_iter().filter_map(|fitted| {
        let crossed = selection.crossed(&fitted)?;
        // Either half counts alike, whatever its size; a model of data without noise may leave nothing.
        let left: f64 = crossed.iter().map(|half| squares(half).ln()).sum();
        (!left.is_nan()).then_some((left, fitted))
    });
    let Some((_, mut best)) = fitted.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        return nominal(model, record).map(|found| (found, None));
    };
    while !best.point.effects.is_empty() {
        match selection.reduced(&best) {
            Some(Some(smaller)) => best = smaller,
            Some(None) => break,
            None => return Some((best, None)),
        }
    }
    let other = model.is_cheap().then(|| selection.exchanged(&best));
    Some((best, other.flatten()))
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::time::Duration;

    use super::*;
    use crate::progress::Deadline;
    use crate::{Candidate, EffectParameter, Role, Scale};

    /// A swing whose frequency grows with its amplitude `p[0]`, by which a record begins; the later half of the
    /// record is of a motion that has forgotten it.
    struct Swing(Vec<f64>);

    const SAMPLES: usize = 400;

    fn swing(begin: f64, k: usize) -> f64 {
        let t = k as f64 / 40.0;
        begin * (-0.5 * t).exp() * ((6.0 + 3.0 * begin * begin) * t).cos()
    }

    impl SimulatedModel for Swing {
        fn nuisance(&self) -> usize {
            1
        }
        fn candidates(&self) -> &[Candidate] {
            &[]
        }
        fn blocks(&self) -> usize {
            1
        }
        fn block_of(&self, i: usize) -> Option<usize> {
            Some(i)
        }
        fn tells(&self, fitted: usize, _: usize, tested: usize) -> bool {
            fitted <= tested
        }
        fn samples(&self, _: usize, _: usize) -> usize {
            SAMPLES / 2
        }
        fn errors(&self, point: &Point, record: usize, _: usize) -> Vec<f64> {
            let from = record * SAMPLES / 2;
            let own = from..from + SAMPLES / 2;
            own.map(|k| self.0[k] - swing(point.nuisance[0], k))
                .collect()
        }
        fn folds(&self, _: usize) -> [usize; 2] {
            [0, 1]
        }
        fn screen(&self, record: usize) -> usize {
            record
        }
        fn held(&self) -> Self {
            Self(self.0.clone())
        }
        fn record_name(&self, _: usize) -> &str {
            "swing"
        }
    }

    #[test]
    fn a_rival_gains_nine_tenths_and_leaves_little_more() {
        // What was taken leaves a fifth.
        assert!(rivals(0.73, 0.8, 1.5) && !rivals(0.71, 0.8, 1.5));
        // And at most one and a half times that.
        assert!(!rivals(0.73, 0.8, 1.3) && rivals(0.75, 0.8, 1.3));
        assert!(!rivals(0.95, 0.99, 1.5));
    }

    #[test]
    fn what_holds_gains_enough_on_both_halves_beyond_doubt() {
        let own = |gain, deviate, both| Inside {
            gain,
            deviate,
            both,
        };
        assert!(own(0.06, 3.1, true).holds());
        assert!(!own(0.04, 3.1, true).holds() && !own(0.06, 2.9, true).holds());
        assert!(!own(0.06, 3.1, false).holds());
    }

    /// A drift of power 1/2 with and without steps of 0.3 to either side at random: the differences of the squared
    /// errors have the mean 0.09 and the standard deviation `2 0.3 / √2`, which hardly shows beside the drift.
    #[test]
    fn a_small_effect_is_told_by_its_own_differences_beside_a_drift() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let half = 20_000;
        let drift = |k: usize| (k as f64 / 300.0).sin();
        let after: Vec<f64> = (0..half).map(drift).collect();
        let mut rough = || -> Vec<f64> {
            let all = after.iter();
            all.map(|own| own + if random.random::<bool>() { 0.3 } else { -0.3 })
                .collect()
        };
        let before = [rough(), rough()];
        let after = [after.clone(), after];
        let found = compare(&before, &after);
        let samples = 2.0 * half as f64;
        let expected = 0.09 / (0.6 / 2.0_f64.sqrt()) * samples.sqrt();
        assert!(
            (found.deviate / expected - 1.0).abs() < 0.1,
            "{} {expected}",
            found.deviate
        );
        assert!(
            (found.gain - 0.09 / 0.59).abs() < 0.01 && found.both,
            "{}",
            found.gain
        );
        let back = compare(&after, &before);
        assert!(back.deviate < 0.0 && back.gain < 0.0 && !back.both);
        // White errors that are halved: of each sample, twice the logarithm of two.
        let white = |size: f64| {
            before.each_ref().map(|own| -> Vec<f64> {
                own.iter()
                    .zip(&after[0])
                    .map(|(a, b)| size * (a - b))
                    .collect()
            })
        };
        let found = compare(&white(2.0), &white(1.0));
        assert!(found.gain == 0.75 && found.deviate > 0.9 * (samples * 4.0_f64.ln()).sqrt());
    }

    #[test]
    fn how_a_record_begins_is_found_where_a_fit_to_its_end_left_it_far_away() {
        let model = Swing((0..SAMPLES).map(|k| swing(0.3, k)).collect());
        let begun = |begin: f64| Point {
            nuisance: vec![begin],
            effects: Vec::new(),
        };
        let from_there = least_squares(&model, &begun(5.4), 0, &Free::All, AGAIN).unwrap();
        assert!(
            (from_there.point.nuisance[0].abs() - 0.3).abs() > 0.05,
            "the start is no trap"
        );
        let found = completed(&model, &begun(5.4), Some(1), 0);
        assert!((found.nuisance[0].abs() - 0.3).abs() < 1e-3, "{found:?}");
        // What the fit did see stays.
        assert_eq!(completed(&model, &begun(5.4), Some(0), 1), begun(5.4));
    }

    #[test]
    fn a_model_begins_from_the_best_of_its_starts_whichever_comes_first() {
        let model = Swing((0..SAMPLES).map(|k| swing(0.3, k)).collect());
        let begun = |begin: f64| Point {
            nuisance: vec![begin],
            effects: Vec::new(),
        };
        for starts in [[5.4, 0.2], [0.2, 5.4]] {
            let (found, _) =
                select_jointly(&model, &starts.map(begun), 0, Observer::none()).unwrap();
            assert!(
                (found.point.nuisance[0].abs() - 0.3).abs() < 1e-3,
                "{found:?}"
            );
        }
    }

    /// Two halves of a record with a nominal parameter and effects of one size each.
    struct Halves {
        candidates: Vec<Candidate>,
        /// What a point leaves of a sample, counted in its half.
        left: fn(&Point, usize, usize) -> f64,
        is_cheap: bool,
    }

    impl Halves {
        fn new(effects: &[&'static str], left: fn(&Point, usize, usize) -> f64) -> Self {
            let candidate = |effect: &&'static str| {
                Candidate::new(
                    effect,
                    vec![EffectParameter {
                        name: "size",
                        unit: "1",
                        scale: Scale::Linear(1.0),
                        role: Role::Size { weak: 0.1 },
                        bounds: (-50.0, 50.0),
                    }],
                    vec![vec![0.5]],
                )
            };
            let candidates = effects.iter().map(candidate).collect();
            Self {
                candidates,
                left,
                is_cheap: true,
            }
        }
    }

    impl SimulatedModel for Halves {
        fn nuisance(&self) -> usize {
            1
        }
        fn candidates(&self) -> &[Candidate] {
            &self.candidates
        }
        fn blocks(&self) -> usize {
            1
        }
        fn block_of(&self, _: usize) -> Option<usize> {
            None
        }
        fn samples(&self, record: usize, _: usize) -> usize {
            if record == 2 { 2 * SAMPLES } else { SAMPLES }
        }
        fn errors(&self, point: &Point, record: usize, _: usize) -> Vec<f64> {
            let halves = if record == 2 {
                0..2
            } else {
                record..record + 1
            };
            let all = halves.flat_map(|half| (0..SAMPLES).map(move |k| (half, k)));
            all.map(|(half, k)| (self.left)(point, half, k)).collect()
        }
        fn folds(&self, _: usize) -> [usize; 2] {
            [0, 1]
        }
        fn screen(&self, record: usize) -> usize {
            record
        }
        fn held(&self) -> Self {
            Self {
                candidates: self.candidates.clone(),
                left: self.left,
                is_cheap: self.is_cheap,
            }
        }
        fn is_cheap(&self) -> bool {
            self.is_cheap
        }
        fn record_name(&self, _: usize) -> &str {
            "halves"
        }
    }

    /// `y = a x + c z`. In the second half x and z hardly differ, and what else is in it is as what they differ by.
    fn alike_in_one_half(point: &Point, half: usize, k: usize) -> f64 {
        let (a, effect) = (point.nuisance[0], point.effects.first());
        let c = effect.map_or(0.0, |(_, q)| q[0]);
        let t = k as f64 / 10.0;
        let (x, other) = (t.sin(), (2.3 * t).sin());
        let apart = 0.01 * other;
        let (z, more) = if half == 0 {
            (other, 0.0)
        } else {
            (x + apart, 2.0 * apart)
        };
        (1.0 - a) * x + (1.0 - c) * z + more
    }

    /// A sum of the waves 0, 1 and 3; the wave 2 is like the first two together.
    fn like_two_waves(point: &Point, half: usize, k: usize) -> f64 {
        let k = half * SAMPLES + k;
        let t = k as f64 / 10.0;
        let [first, second, other, apart] =
            [1.0, 1.9, 3.1, 4.3].map(|frequency| (frequency * t + frequency).sin());
        let waves = [first, second, first + second + 0.3 * apart, other];
        let found = point.effects.iter().map(|(i, q)| q[0] * waves[*i]);
        let noise = 1e-3 * (37.0 * k as f64).sin();
        first + second + other + noise - point.nuisance[0] - found.sum::<f64>()
    }

    /// `1.5 x` beyond an overlap of 0.9, of a wave whose size is 1: hardly anything passes.
    fn overlapped(point: &Point, half: usize, k: usize) -> f64 {
        let x = (0.1 * (half * SAMPLES + k) as f64).sin();
        let beyond = |overlap: f64| x - x.clamp(-overlap, overlap);
        let overlap = point.effects.first().map_or(0.0, |(_, q)| q[0].abs());
        1.5 * beyond(0.9) - (1.0 + 0.1 * point.nuisance[0]) * beyond(overlap)
    }

    #[test]
    fn an_effect_that_lets_hardly_anything_pass_is_found_from_what_was_stated() {
        let model = Halves::new(&["overlap"], overlapped);
        let starts = [0.1, 0.5].map(|overlap| Point {
            nuisance: vec![0.0],
            effects: vec![(0, vec![overlap])],
        });
        let found = looked_from_best(&model, &starts, 2).unwrap().point;
        assert!(
            (found.effects[0].1[0].abs() - 0.9).abs() < 0.01,
            "{found:?}"
        );
        assert!((found.nuisance[0] - 5.0).abs() < 0.5, "{found:?}");
    }

    #[test]
    fn an_effect_that_all_data_need_stays_where_one_half_does_not_determine_it() {
        let model = Halves::new(&["other"], alike_in_one_half);
        let start = Point {
            nuisance: vec![0.5],
            effects: vec![(0, vec![0.5])],
        };
        let selection = CrossValidation::new(&model, 2, Observer::none());
        let with = settle(&model, &start, 2, TO_THE_END).unwrap();
        let bare = settle(
            &model,
            &Point {
                effects: Vec::new(),
                ..start.clone()
            },
            2,
            TO_THE_END,
        );
        let [with, bare] = [with, bare.unwrap()].map(|own| selection.crossed(&own).unwrap());
        assert!(
            compare(&bare, &with).gain < -1.0,
            "the halves tell the effect"
        );
        let (found, _) = select_jointly(&model, &[start], 2, Observer::none()).unwrap();
        let size = found.point.effects.first().map(|(_, q)| q[0]);
        assert!((size.unwrap() - 1.0).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn a_search_that_time_ends_before_it_looks_back_knows_the_models_without_its_effects() {
        let model = Halves {
            is_cheap: false,
            ..Halves::new(&["first", "second", "like_both", "other"], like_two_waves)
        };
        let deadline = Deadline::after(Duration::from_secs(1));
        let has_waited = Cell::new(false);
        let wait = |event: &Progress| {
            let is_extended =
                matches!(event, Progress::Model { effects, .. } if !effects.is_empty());
            if is_extended && !has_waited.replace(true) {
                std::thread::sleep(Duration::from_secs(1));
            }
        };
        let observer = Observer::new(&wait).until(&deadline);
        let found = select(&model, 2, observer).unwrap();
        assert!(observer.has_cut());
        assert_eq!(found.extended.point.effects.len(), 1);
        assert_eq!(found.without.len(), 1);
        assert!((found.without[0].squares / found.nominal.squares - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_replaced_two_effects_goes_where_both_of_them_do_better() {
        let model = Halves::new(&["first", "second", "like_both", "other"], like_two_waves);
        let start = Point {
            nuisance: vec![0.0],
            effects: vec![(2, vec![0.9]), (3, vec![0.9])],
        };
        let (_, found) = select_jointly(&model, &[start], 2, Observer::none()).unwrap();
        let found = found.unwrap();
        let mut effects: Vec<usize> = found.point.effects.iter().map(|(i, _)| *i).collect();
        effects.sort_unstable();
        assert_eq!(effects, [0, 1, 3], "{found:?}");
        let mut sizes = found.point.effects.iter().map(|(_, q)| q[0]);
        assert!(sizes.all(|size| (size - 1.0).abs() < 0.01), "{found:?}");
    }

    /// A strong wave 0 and the weak ones 1 and 2; the wave 3 is nearly the strong one.
    fn like_a_strong_wave(point: &Point, half: usize, k: usize) -> f64 {
        let k = half * SAMPLES + k;
        let t = k as f64 / 10.0;
        let [strong, second, third, apart] =
            [1.0, 1.9, 3.1, 4.3].map(|frequency| (frequency * t + frequency).sin());
        let waves = [strong, second, third, strong + 0.1 * apart];
        let found = point.effects.iter().map(|(i, q)| q[0] * waves[*i]);
        let noise = 1e-3 * (37.0 * k as f64).sin();
        5.0 * strong + second + third + noise - point.nuisance[0] - found.sum::<f64>()
    }

    #[test]
    fn the_strongest_effect_is_exchanged_for_one_that_it_looks_like() {
        let mut model = Halves::new(&["strong", "second", "third", "like"], like_a_strong_wave);
        let start = Point {
            nuisance: vec![0.0],
            effects: vec![(3, vec![4.9]), (1, vec![0.9]), (2, vec![0.9])],
        };
        let effects = |model: &Halves| {
            let start = [start.clone()];
            let (_, found) = select_jointly(model, &start, 2, Observer::none()).unwrap();
            let all = found.map(|found| found.point.effects.into_iter().map(|(i, _)| i));
            all.map(Iterator::collect::<BTreeSet<usize>>)
        };
        model.candidates[0].look_alikes = &["like"];
        model.candidates[3].look_alikes = &["strong"];
        assert_eq!(effects(&model), Some(BTreeSet::from([0, 1, 2])));
    }
}

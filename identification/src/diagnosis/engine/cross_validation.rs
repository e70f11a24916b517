//! Selection where even a right model leaves correlated errors: by what an effect gains on data that
//! it was not fitted to.
//!
//! Forward, one effect a round: the one with which a model fitted to one half of the part predicts
//! the other half best, both ways, as long as the gain is no chance when correlated samples are
//! counted once. Backward at the end by the same test.

use super::fit::{Fit, Jacobian, evaluate, fit, polish};
use super::model::{ExtensibleModel, Point};
use super::progress::{Observer, Progress, Step};
use super::resampling::correlation_time;
use super::search::{Selection, search};

/// A model whose residuals are the errors of a simulation over a scale that the fit itself chooses.
pub trait SimulatedModel: ExtensibleModel {
    /// Errors (output's unit) at `point` on the samples of `record`.
    fn errors(&self, point: &Point, record: usize) -> Vec<f64>;

    /// The two records that are the halves of `record`.
    fn folds(&self, record: usize) -> [usize; 2];

    /// Error that counts as one.
    fn scale(&self) -> f64;

    /// The same model with another such error.
    #[must_use]
    fn with_scale(&self, scale: f64) -> Self
    where
        Self: Sized;
}

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
pub struct Simulated {
    /// Where.
    pub point: Point,
    /// Sum of squared errors on the part.
    pub squares: f64,
    /// Independent samples among them.
    pub samples: f64,
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

fn simulated<M: SimulatedModel>(model: &M, fit: &Fit, record: usize) -> Simulated {
    let errors = model.errors(&fit.point, record);
    Simulated {
        point: fit.point.clone(),
        squares: squares(&errors),
        samples: errors.len() as f64 / correlation_time(&errors),
        gain: 0.0,
    }
}

fn squares(errors: &[f64]) -> f64 {
    errors.iter().map(|e| e * e).sum()
}

/// Error that counts as one, such that the cost has as many units as there are independent samples.
fn scale_of(fitted: &Simulated) -> f64 {
    (fitted.squares / fitted.samples)
        .sqrt()
        .max(f64::MIN_POSITIVE)
}

/// Fits everything from `start`, the error's scale once taken anew.
fn settle<M: SimulatedModel>(
    model: &M,
    start: &Point,
    scale: f64,
    record: usize,
    rounds: usize,
) -> Option<Simulated> {
    let mut point = start.clone();
    let mut scale = scale;
    let mut settled = None;
    for _ in 0..2 {
        let scaled = model.with_scale(scale);
        let begin = evaluate(&scaled, &point, &[record])?;
        let fit = polish(&scaled, &begin, &[record], rounds).map_or(begin, |(fit, _)| fit);
        let fitted = simulated(model, &fit, record);
        point = fitted.point.clone();
        let next = scale_of(&fitted);
        settled = Some(fitted);
        if (next / scale - 1.0).abs() < 0.2 {
            break;
        }
        scale = next;
    }
    settled
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

/// Compares two models by their errors from [`crossed`].
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
}

impl<M: SimulatedModel> CrossValidation<'_, M> {
    /// Errors of `fitted` on each fold when its parameters are refitted to the other.
    fn crossed(&self, fitted: &Simulated) -> Option<[Vec<f64>; 2]> {
        let [one, two] = self.model.folds(self.record);
        let scale = scale_of(fitted);
        let on_other = |own: usize, tested: usize| {
            let refitted = settle(self.model, &fitted.point, scale, own, 2)?;
            Some(self.model.errors(&refitted.point, tested))
        };
        Some([on_other(two, one)?, on_other(one, two)?])
    }

    /// The extensions of `base` by one of `among` that fit best.
    fn fitted(&self, base: &Simulated, among: &[usize]) -> Option<Vec<(usize, Simulated)>> {
        let record = self.record;
        let scaled = self.model.with_scale(scale_of(base));
        let candidates = scaled.candidates();
        let start = evaluate(&scaled, &base.point, &[record])?;
        let jacobian = Jacobian::at(&scaled, &start, &[record])?;
        let mut quick: Vec<(usize, Fit)> = Vec::new();
        for &effect in among {
            let candidate = &candidates[effect];
            let held =
                |i: usize| i == effect || candidate.look_alikes.contains(&candidates[i].effect);
            if base.point.effects.iter().any(|(i, _)| held(*i)) {
                continue;
            }
            let best = candidate
                .starts
                .iter()
                .filter_map(|values| {
                    let mut point = base.point.clone();
                    point.effects.push((effect, candidate.internal(values)));
                    fit(&scaled, &point, &[record], &jacobian, 4)
                })
                .min_by(|a, b| a.cost.total_cmp(&b.cost));
            quick.extend(best.map(|best| (effect, best)));
        }
        quick.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
        let finished = quick.into_iter().take(FINALISTS);
        Some(
            finished
                .filter_map(|(effect, quick)| {
                    let settled = settle(self.model, &quick.point, scaled.scale(), record, 4)?;
                    Some((effect, settled))
                })
                .collect(),
        )
    }

    /// Whether `rival` in the place of the effect that `without` lacks gains nearly what that gains.
    fn replaces(&self, rival: usize, without: &Simulated, current: &Simulated) -> Option<bool> {
        let (_, replaced) = self.fitted(without, &[rival])?.pop()?;
        let before = self.crossed(without)?;
        let gain = |fitted: &Simulated| Some(compare(&before, &self.crossed(fitted)?).gain);
        Some(gain(&replaced)? > RIVAL * gain(current)?)
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
        let origin = Point {
            nuisance: vec![0.0; self.model.nuisance()],
            effects: Vec::new(),
        };
        let errors = self.model.errors(&origin, self.record);
        let power = squares(&errors) / errors.len() as f64;
        let scale = (power * correlation_time(&errors)).sqrt();
        settle(self.model, &origin, scale, self.record, 6)
    }

    fn effects(&self, fitted: &Simulated) -> usize {
        fitted.point.effects.len()
    }

    fn most_effects(&self) -> usize {
        MOST_EFFECTS
    }

    fn extensions(&mut self, current: &Simulated, _: &[Simulated]) -> Option<Vec<Simulated>> {
        let all: Vec<usize> = (0..self.model.candidates().len()).collect();
        let before = self.crossed(current)?;
        let mut tried: Vec<(Inside, Simulated)> = self
            .fitted(current, &all)?
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
        let near = lost.iter().filter(|one| one.gain > RIVAL * taken.gain);
        self.rivals.extend(near.filter_map(|rival| {
            Some(Rival {
                effect: newest(rival)?,
                against: newest(taken)?,
            })
        }));
    }

    fn reduced(&mut self, current: &Simulated) -> Option<Option<Simulated>> {
        let after = self.crossed(current)?;
        let mut compared = Vec::new();
        self.without.clear();
        for i in 0..current.point.effects.len() {
            let mut point = current.point.clone();
            point.effects.remove(i);
            let smaller = settle(self.model, &point, scale_of(current), self.record, 3)?;
            compared.push(compare(&self.crossed(&smaller)?, &after));
            self.without.push(smaller);
        }
        self.deviates = compared.iter().map(|inside| inside.deviate).collect();
        let least = (0..compared.len())
            .min_by(|&a, &b| compared[a].gain.total_cmp(&compared[b].gain))
            .filter(|&i| !compared[i].holds());
        Some(least.map(|i| self.without.swap_remove(i)))
    }
}

/// Finds the effects that `record` asks for; none where nothing can be simulated.
pub fn select<M: SimulatedModel>(
    model: &M,
    record: usize,
    observer: Observer<'_>,
) -> Option<Selected> {
    let mut selection = CrossValidation {
        model,
        record,
        observer,
        rivals: Vec::new(),
        deviates: Vec::new(),
        without: Vec::new(),
    };
    let found = search(&mut selection)?;
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
    let scaled = model.with_scale(scale_of(&extended));
    let last = evaluate(&scaled, &extended.point, &[record])?;
    let deviations = Jacobian::at(&scaled, &last, &[record])
        .and_then(|jacobian| jacobian.deviations(&scaled, &last))
        .unwrap_or_default();
    Some(Selected {
        nominal,
        extended,
        deviates: selection.deviates,
        without: selection.without,
        rivals,
        deviations,
    })
}

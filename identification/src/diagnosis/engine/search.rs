//! The search for the set of effects: forward with a beam, then backward.

use super::fit::{Fit, Jacobian, evaluate, fit, polish_to, residuals};
use super::model::{Candidate, Point, RigModel, Role, Scale};

/// What an effect must earn, in units of `2 log` likelihood, before it is named.
pub const PRICE_OF_AN_EFFECT: f64 = 18.0;
/// And for each further parameter that it brings.
const PRICE_OF_A_PARAMETER: f64 = 6.0;
/// Share of the catalogue's weakest value below which an effect is not worth a name.
const FLOOR: f64 = 0.6;
/// A model within this of the best is a rival that the data do not rule out.
pub const RIVAL_WITHIN: f64 = 12.0;
/// Mean square of whitened residuals up to which a model may be right.
const NEAR_NOISE: f64 = 1.03;
/// Mean square beyond which a third effect is no longer looked for: the catalogue lacks something.
const HOPEFUL: f64 = 2.0;
/// Effects in one model.
const MOST_EFFECTS: usize = 3;

/// Excess over noise, in that of the best, beyond which a set of effects leaves the race.
const BEHIND: f64 = 6.0;
/// And what a short fit may still gain.
const NOISE_OF_A_RACE: f64 = 1e4;

/// Rounds of a fit at most; curved valleys take many.
pub(super) const ROUNDS: usize = 12;
/// Share of the excess over noise that one more round must gain.
pub(super) const SETTLED: f64 = 0.003;

/// A fitted model with its derivatives.
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

/// What the search found.
pub struct Found {
    /// The nominal model with its nuisance.
    pub nominal: Hypothesis,
    /// The best model, which may be the nominal one.
    pub best: Option<Hypothesis>,
    /// Other models of as many effects, best first.
    pub others: Vec<Hypothesis>,
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

/// Search on `records` (indices of the model's records).
pub struct Search<'a, M: RigModel> {
    /// The rig.
    pub model: &'a M,
    /// The records that are fitted.
    pub records: Vec<usize>,
    /// Prints what it finds to standard error.
    pub verbose: bool,
}

impl<M: RigModel> Search<'_, M> {
    fn hypothesis(&self, start: &Fit) -> Option<Hypothesis> {
        let (fit, jacobian) = polish_to(self.model, start, &self.records, ROUNDS, SETTLED)?;
        let score = fit.cost + price(self.model.candidates(), &fit.point);
        Some(Hypothesis {
            fit,
            jacobian,
            score,
        })
    }

    fn tell(&self, what: &str, hypothesis: &Hypothesis) {
        if !self.verbose {
            return;
        }
        let candidates = self.model.candidates();
        let effects: Vec<String> = hypothesis
            .fit
            .point
            .effects
            .iter()
            .map(|(i, q)| format!("{} {:.4?}", candidates[*i].effect, candidates[*i].values(q)))
            .collect();
        eprintln!(
            "  {what}: score {:.1} cost {:.1} mean square {:.4} {}",
            hypothesis.score,
            hypothesis.fit.cost,
            hypothesis.mean_square(),
            effects.join(" + ")
        );
    }

    /// The nominal model, nuisance estimated.
    pub fn nominal(&self) -> Option<Hypothesis> {
        let origin = Point {
            nuisance: vec![0.0; self.model.nuisance()],
            effects: Vec::new(),
        };
        let start = evaluate(self.model, &origin, &self.records)?;
        self.hypothesis(&start)
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
                // A derivative at nothing, and a difference to a weak effect for thresholds.
                for share in [1e-3, 0.5] {
                    let internal: Vec<f64> = off.iter().map(|at| at(share)).collect();
                    let mut point = parent.fit.point.clone();
                    point.effects.push((effect, internal));
                    if tried.contains(&point.effects) {
                        continue;
                    }
                    tried.push(point.effects.clone());
                    let with = residuals(self.model, &predictor, &point, &self.records);
                    let Some(with) = with else { continue };
                    let pairs = with.iter().zip(&parent.fit.residuals);
                    let column: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
                    let (gain, amplitude) = parent.jacobian.score(self.model, &parent.fit, &column);
                    if self.verbose && gain > 9.0 {
                        eprintln!(
                            "    {} share {share}: gain {gain:.1} amplitude {amplitude:.3e}",
                            candidate.effect
                        );
                    }
                    let either = candidate.parameters.iter().any(|p| p.bounds.0 < 0.0);
                    if gain > 0.5 * PRICE_OF_AN_EFFECT && (amplitude > 0.0 || either) {
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

    /// The whole search.
    pub fn run(&self) -> Option<Found> {
        let candidates = self.model.candidates();
        let nominal = self.nominal()?;
        self.tell("nominal", &nominal);
        let origin = Point {
            nuisance: vec![0.0; self.model.nuisance()],
            effects: Vec::new(),
        };
        let worth = |hypothesis: &Hypothesis| matters(candidates, &hypothesis.fit.point);

        let mut level = if nominal.mean_square() < NEAR_NOISE {
            self.refine(&nominal)
        } else {
            // A strong effect bends the nominal fit: begin at the nominal values themselves.
            self.extend(&[&origin], 6)
        };
        level.retain(worth);
        for hypothesis in &level {
            self.tell("one", hypothesis);
        }
        let mut best: Option<Hypothesis> = None;
        let mut others = Vec::new();
        for _ in 1..=MOST_EFFECTS {
            let score_before = best.as_ref().map_or(nominal.score, |best| best.score);
            if level
                .first()
                .is_none_or(|first| first.score >= score_before)
            {
                break;
            }
            others = level.split_off(1);
            best = level.pop();
            let Some(current) = &best else { break };
            if current.fit.point.effects.len() == MOST_EFFECTS {
                break;
            }
            level = if current.mean_square() < NEAR_NOISE {
                self.refine(current)
            } else {
                if current.fit.point.effects.len() > 1 && current.mean_square() > HOPEFUL {
                    break;
                }
                let excess = |hypothesis: &Hypothesis| hypothesis.mean_square() - 1.0;
                let mut parents = vec![&current.fit.point];
                parents.extend(
                    others
                        .iter()
                        .filter(|other| excess(other) < 5.0 * excess(current))
                        .take(2)
                        .map(|other| &other.fit.point),
                );
                self.extend(&parents, 5)
            };
            level.retain(worth);
            for hypothesis in &level {
                self.tell("more", hypothesis);
            }
        }
        if let Some(current) = best.take() {
            best = Some(self.eliminate(current));
        }
        Some(Found {
            nominal,
            best,
            others,
        })
    }

    /// Drops effects that no longer earn their price.
    fn eliminate(&self, mut current: Hypothesis) -> Hypothesis {
        while current.fit.point.effects.len() > 1 {
            let without = (0..current.fit.point.effects.len()).filter_map(|i| {
                let mut point = current.fit.point.clone();
                point.effects.remove(i);
                let start = evaluate(self.model, &point, &self.records)?;
                self.hypothesis(&start)
            });
            match without.min_by(|a, b| a.score.total_cmp(&b.score)) {
                Some(smaller) if smaller.score <= current.score => {
                    self.tell("dropped to", &smaller);
                    current = smaller;
                }
                _ => break,
            }
        }
        current
    }
}

//! The search for the faults that explain what the model of the healthy rig does not.

use crate::Fault;
use crate::diagnose::{Diagnosis, EXPLAINED, Found, Verdict, sentence};
use crate::fit::repeats;
use crate::residuals::{Case, Faults};

/// Share that a fault must explain of the present excess, and of the excess of the model without faults.
const SHARE: f64 = 0.3;
const SHARE_AT_FIRST: f64 = 0.02;
/// Most faults.
const MOST: usize = 3;
/// Excess, over the best fault's, below which another fault explains as much.
const RIVAL: f64 = 1.5;
/// Standard errors beyond which a fault's parameter is not zero.
const CLEAR: f64 = 4.0;

impl Case<'_> {
    fn candidates(&self) -> Vec<Fault> {
        let n = self.model.actuators();
        let mut all = Vec::new();
        for i in 0..n {
            all.extend([
                Fault::Gain(i),
                Fault::Delay(i),
                Fault::SensorGain(i),
                Fault::Play(i),
            ]);
            if self.has_joint() {
                all.extend([Fault::PinPlay(i), Fault::Lever(i)]);
            }
            for j in 0..i {
                all.extend([Fault::SensorsSwapped(j, i), Fault::CommandsSwapped(j, i)]);
            }
        }
        all
    }

    /// Range of a fault's parameter and what is too small to be one; none for a swap.
    fn range(&self, fault: Fault) -> Option<([f64; 2], f64)> {
        let reach = |i: usize| {
            let of = self.recordings.iter().map(|own| {
                let (low, high) = own.strokes[i]
                    .iter()
                    .fold((f64::MAX, f64::MIN), |(low, high), y| {
                        (low.min(*y), high.max(*y))
                    });
                high - low
            });
            of.fold(0.0, f64::max)
        };
        match fault {
            Fault::Gain(_) | Fault::SensorGain(_) => Some(([-0.6, 0.6], 3e-3)),
            Fault::Delay(i) => Some(([-self.model.delay_s[i], 0.05], 0.1 * self.model.period_s)),
            Fault::Play(i) | Fault::PinPlay(i) => Some(([0.0, 0.3 * reach(i)], self.noise[i])),
            Fault::Lever(i) => {
                let arm = self.pins[i][0].hypot(self.pins[i][1]);
                Some(([-0.4 * arm, 0.4 * arm], 3e-3 * arm))
            }
            Fault::SensorsSwapped(..) | Fault::CommandsSwapped(..) => None,
        }
    }

    /// The best value of a fault beside `others`, and the total there.
    fn best(&self, fault: Fault, others: &Faults) -> (f64, f64) {
        let total = |value: f64| {
            let mut all = others.clone();
            all.push((fault, value));
            self.total(&all)
        };
        let Some(([low, high], _)) = self.range(fault) else {
            return (0.0, total(0.0));
        };
        // More places near zero, where most faults are.
        let places: Vec<f64> = (-6i32..=6)
            .map(|i| {
                let part = f64::from(i) / 6.0;
                let end = if part < 0.0 { -low } else { high };
                end * part * part.abs()
            })
            .collect();
        let values: Vec<f64> = places.iter().map(|place| total(*place)).collect();
        let least = (0..places.len())
            .min_by(|a, b| values[*a].total_cmp(&values[*b]))
            .unwrap_or(0);
        let (mut a, mut b) = (
            places[least.saturating_sub(1)],
            places[(least + 1).min(places.len() - 1)],
        );
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let (mut c, mut d) = (b - golden * (b - a), a + golden * (b - a));
        let (mut at_c, mut at_d) = (total(c), total(d));
        for _ in 0..26 {
            if at_c < at_d {
                (b, d, at_d) = (d, c, at_c);
                c = b - golden * (b - a);
                at_c = total(c);
            } else {
                (a, c, at_c) = (c, d, at_d);
                d = a + golden * (b - a);
                at_d = total(d);
            }
        }
        let (value, best) = if at_c < at_d { (c, at_c) } else { (d, at_d) };
        if values[least] < best {
            (places[least], values[least])
        } else {
            (value, best)
        }
    }

    /// One standard error of the last fault's parameter, from the curvature; residuals that are correlated count as fewer.
    fn standard_error(&self, faults: &Faults, at: usize) -> f64 {
        let (fault, value) = faults[at];
        let Some(([low, high], small)) = self.range(fault) else {
            return 0.0;
        };
        let step = (1e-3 * (high - low)).min(0.5 * small).max(1e-12);
        let moved = |by: f64| {
            let mut all = faults.clone();
            all[at].1 = value + by;
            self.recordings
                .iter()
                .map(|own| self.residuals(own, &all))
                .collect::<Vec<_>>()
        };
        let (above, below) = (moved(step), moved(-step));
        let mut information = 0.0;
        for (above, below) in above.iter().zip(&below) {
            for ((above, below), noise) in above.iter().zip(below).zip(&self.noise) {
                let slope = above
                    .iter()
                    .zip(below)
                    .map(|(a, b)| ((a - b) / (2.0 * step)).powi(2))
                    .sum::<f64>();
                let left: Vec<f64> = above
                    .iter()
                    .zip(below)
                    .map(|(a, b)| 0.5 * (a + b))
                    .collect();
                let square = left.iter().map(|e| e * e).sum::<f64>() / left.len().max(1) as f64;
                information += slope / (square.max(noise * noise) * repeats(&left));
            }
        }
        if information > 0.0 {
            information.sqrt().recip()
        } else {
            f64::INFINITY
        }
    }

    fn found(&self, faults: &Faults, at: usize) -> Found {
        let (fault, value) = faults[at];
        let error = self.standard_error(faults, at);
        let has_value = self.range(fault).is_some();
        Found {
            effect: fault.name().into(),
            actuators: fault.actuators().iter().map(|i| i + 1).collect(),
            value: has_value.then_some(value),
            unit: fault.unit().into(),
            standard_error: has_value.then_some(error),
            words: fault.words(value, error),
        }
    }

    pub(crate) fn search(&self) -> Diagnosis {
        let at_first = self.squares(&Faults::new());
        let count = at_first.len() as f64;
        let is_explained = |squares: &[f64]| squares.iter().all(|square| *square <= EXPLAINED);
        let excess_at_first = at_first.iter().sum::<f64>() - count;
        let mut faults = Faults::new();
        let mut alternatives = Vec::new();
        while faults.len() < MOST && !is_explained(&self.squares(&faults)) {
            let before = self.total(&faults) - count;
            let mut tried: Vec<(f64, Fault, f64)> = self
                .candidates()
                .into_iter()
                .filter(|fault| faults.iter().all(|(known, _)| known != fault))
                .map(|fault| {
                    let (value, total) = self.best(fault, &faults);
                    (total - count, fault, value)
                })
                .collect();
            tried.sort_by(|a, b| a.0.total_cmp(&b.0));
            let Some(&(left, fault, value)) = tried.first() else {
                break;
            };
            let explains = before - left;
            if explains < SHARE * before || explains < SHARE_AT_FIRST * excess_at_first {
                break;
            }
            faults.push((fault, value));
            if let Some((_, small)) = self.range(fault) {
                let error = self.standard_error(&faults, faults.len() - 1);
                if value.abs() < small || value.abs() < CLEAR * error {
                    faults.pop();
                    break;
                }
            }
            if faults.len() == 1 {
                let rivals = tried[1..]
                    .iter()
                    .filter(|own| own.0 < RIVAL * left.max(0.1));
                alternatives = rivals
                    .map(|(_, fault, value)| self.found(&vec![(*fault, *value)], 0))
                    .collect();
            }
            self.settle(&mut faults);
        }
        let after = self.squares(&faults);
        let effects: Vec<Found> = (0..faults.len()).map(|i| self.found(&faults, i)).collect();
        let verdict = match (effects.is_empty(), is_explained(&at_first)) {
            (true, true) => Verdict::Adequate,
            (true, false) => Verdict::Unexplained,
            (false, _) if effects.len() == 1 && !alternatives.is_empty() => Verdict::Ambiguous,
            (false, _) => Verdict::Named,
        };
        let roots = |squares: &[f64]| {
            squares
                .iter()
                .map(|square| square.sqrt())
                .collect::<Vec<f64>>()
        };
        Diagnosis {
            sentence: sentence(verdict, &effects, &alternatives, &roots(&after)),
            verdict,
            effects,
            alternatives,
            channels: self.channels(),
            before: roots(&at_first),
            after: roots(&after),
        }
    }

    /// Finds each fault's value again beside the others.
    fn settle(&self, faults: &mut Faults) {
        for _ in 0..if faults.len() > 1 { 2 } else { 0 } {
            for i in 0..faults.len() {
                let (fault, _) = faults[i];
                let mut others = faults.clone();
                others.remove(i);
                faults[i].1 = self.best(fault, &others).0;
            }
        }
    }
}
